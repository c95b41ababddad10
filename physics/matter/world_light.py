# SPDX-License-Identifier: GPL-3.0-or-later
"""A layer of light for all directions: what a World shader looks up, whichever way the camera is turned."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..numerics.sphere import spherical_triad
from ..shot.cameras import HolePanorama
from ..shot.map_parameters import WarpMapParameters
from .light_layer import LightParameters

FINAL, PREVIEW = (3072, 1024), (768, 256)
"""Columns and rows."""


def world_light_parameters(light: LightParameters, grid: tuple[int, int] = FINAL) -> LightParameters:
    """Return what the layer of light is made from that surrounds a camera.

    Parameters
    ----------
    light : LightParameters
        A frame's. Camera and orientation do not matter.
    grid : (int, int)
        Columns and rows.

    Returns
    -------
    LightParameters
        Of a `HolePanorama` that looks at the hole; its x is along theta-hat and its y along phi-hat at the camera.
    """
    x, y, z = light.view.camera_position
    toward_r, toward_theta, toward_phi = spherical_triad(math.atan2(math.hypot(x, y), z), math.atan2(y, x))
    first, second, third = np.stack([toward_theta, toward_phi, toward_r], axis=-1).tolist()
    view: WarpMapParameters = replace(
        light.view,
        camera=HolePanorama(*grid),
        camera_to_hole=(tuple(first), tuple(second), tuple(third)),
        supersampling=1,
    )
    return replace(light, view=view)
