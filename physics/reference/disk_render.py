# SPDX-License-Identifier: GPL-3.0-or-later
"""Numpy's own picture of a disk in front of the lensed sky, in float64: what node groups are compared with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..disk_passes.disk_pass import DiskPass
from ..light.disk_look import shade
from ..light.disk_settings import DiskLook
from ..numerics.arrays import Array
from ..numerics.checks import finite
from ..numerics.errors import BlackHoleError
from ..shot.disk import Disk
from .reference_render import resize

# Beyond this time, units of M, float64 does not tell the phases of orbits.
LATEST = 1e12


def disk_layers(
    passes: Sequence[DiskPass], look: DiskLook, texture: Array, time: float = 0.0, period: float | None = None
) -> tuple[Array, Array]:
    """Return the light of the disk's images, front to back, and what passes through all of them.

    Parameters
    ----------
    passes : sequence of DiskPass
        All of one map, the first crossing first.
    look : DiskLook
    texture : ndarray, shape (rows, columns, 2 or 4)
        Streaks and clumps, or a picture: see `disk_look.shade`.
    time : float
        Coordinate time, units of M.
    period : float, optional
        How long a pattern of the texture is shown, see `disk_texture.moving_texture`.

    Returns
    -------
    light : ndarray, shape (height, width, 3)
        Premultiplied: to be added to what is behind times `through`.
    through : ndarray, shape (height, width)
        Share of the light from behind the disk that is left, 0 to 1.

    Raises
    ------
    BlackHoleError
        For no passes, passes of different maps, or a look that cannot be.

    Notes
    -----
    For each crossing in turn, with t = 1 at first and alpha = opacity x coverage: ``light += t alpha emission``, then
    ``t *= 1 - alpha``.
    """
    look.validate()
    if not abs(finite(time, "the time of the disk")) <= LATEST:
        raise BlackHoleError(
            f"The time of the disk is {time:g} M; give -{LATEST:g} to {LATEST:g} M.", code="disk.setting"
        )
    if not passes or len({one.metadata["hash"] for one in passes}) != 1:
        raise BlackHoleError(
            "The disk's passes are not of one map; give all crossings of one bake.", code="map.passes-mixed"
        )
    crossings = [one.metadata["crossing"] for one in passes]
    if crossings != list(range(1, len(passes) + 1)):
        raise BlackHoleError(
            f"The disk's passes are crossings {crossings}; give them from 1 on, none left out.", code="map.passes-mixed"
        )
    parameters = passes[0].metadata["parameters"]
    disk, spin = Disk(**parameters["disk"]), float(parameters["spin"])
    shape = passes[0].coverage.shape
    light, through = np.zeros((*shape, 3)), np.ones(shape)
    for one in passes:
        seen = one.coverage > 0.0
        radius, phi, g, coverage = (
            plane[seen].astype(np.float64) for plane in (one.radius, one.phi, one.g, one.coverage)
        )
        color, opacity = shade(look, disk, spin, (radius, phi, g, coverage), texture, time, period)
        alpha = opacity * coverage
        light[seen] += (through[seen] * alpha)[:, None] * color
        through[seen] *= 1.0 - alpha
    return light, through


def over_sky(sky: Array, light: Array, through: Array) -> Array:
    """Return the disk in front of a picture, shape (height, width, 4), brought to its size.

    Parameters
    ----------
    sky : ndarray, shape (height, width, 3 or 4)
        The lensed sky, the shadow in it; or, premultiplied with an alpha, what a camera of bent rays sees.
    light, through : ndarray, shape (map height, map width, 3) and (map height, map width)
        From `disk_layers`, of the map's size.
    """
    height, width = sky.shape[:2]
    layers = resize(np.concatenate([light, through[..., None]], axis=-1), (width, height))
    if sky.shape[2] == 3:
        sky = np.concatenate([sky, np.ones_like(sky[..., :1])], axis=-1)
    front = np.concatenate([layers[..., :3], 1.0 - layers[..., 3:]], axis=-1)
    picture: Array = front + layers[..., 3:] * sky
    return picture
