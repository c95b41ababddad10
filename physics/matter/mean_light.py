# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of a disk as far away objects see it: at rest, and averaged over its turbulence."""

from __future__ import annotations

import numpy as np

from ..light.matter_settings import MatterLook
from ..numerics.arrays import Array
from ..shot.disk import Disk
from .picture import Picture
from .surface import Surface

_WHOLE = 1e3
"""A footprint larger than any pattern."""


def disk_radiance(look: MatterLook, disk: Disk, spin: float, radius: Array, picture: Picture | None = None) -> Array:
    """Return the light of a disk seen face-on by an observer who moves with it, times its opacity.

    Parameters
    ----------
    look : MatterLook
    disk : Disk
    spin : float
        Kerr parameter, -1 < a < 1.
    radius : ndarray, shape (n,)
        Units of M, within the disk.
    picture : Picture, optional
        That the disk shows.

    Returns
    -------
    ndarray, shape (n, 3)
        Linear Rec. 709, the mean over the azimuth.
    """
    surface = Surface(look, disk, spin, picture)
    log_radius = np.log(radius).astype(np.float32)
    nothing = np.zeros(len(radius), dtype=np.float32)
    whole = np.full(len(radius), _WHOLE, dtype=np.float32)
    # slant = r makes the cosine of emission 1.
    slant = radius.astype(np.float32)
    light, opacity = surface.shade(log_radius, nothing, nothing, slant, 0.0, None, surface.levels(nothing, whole))
    shown: Array = (light[:, :3] * opacity[:, None]).astype(np.float64)
    return shown
