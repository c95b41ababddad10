# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pixel covers of the disk: an ellipse in the plane of a texture, from differences to covered neighbors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Image

Pixels = NDArray[np.int32]

_TURN = np.float32(2.0 * math.pi)
NEARLY_COVERED = np.float32(0.99)


@dataclass(frozen=True)
class Footprints:
    """Ellipses of pixels; arrays of shape (n,)."""

    log_radius: Image
    """Change of ln r along the major axis, over the pixel."""
    phi: Image
    """Change of the azimuth along it."""
    log_g: Image
    """Change of ln g along it."""
    wide_log_radius: Image
    """Extent in ln r along the minor axis."""
    wide_phi: Image
    """Extent in azimuth along it."""
    length: Image
    """Major axis, texels."""


def footprints(
    planes: tuple[Image, Image, Image],
    coverage: Image,
    pixels: Pixels,
    size: tuple[int, int],
    texels: tuple[float, float],
    whole: float,
) -> Footprints:
    """Return what pixels cover.

    Parameters
    ----------
    planes : tuple of ndarray
        ln r, azimuth and ln g of the whole picture, flat.
    coverage : ndarray
        Of the whole picture, flat. Pixels of 0 are no neighbors.
    pixels : ndarray of int32, shape (n,)
    size : (int, int)
        Columns and rows of the picture.
    texels : (float, float)
        Texels per ln r and per radian.
    whole : float
        Extent of the disk in ln r: what a pixel covers of a ring too thin for neighbors.
    """
    (right, missing_right), (down, missing_down) = (
        _differences(planes, coverage, pixels, size, step) for step in (1, size[0])
    )
    lone = (missing_right | missing_down) & (coverage.take(pixels) < NEARLY_COVERED)
    if lone.any():
        right[0][lone & missing_right] = whole
        down[0][lone & missing_down & ~missing_right] = whole
    across, along = (np.float32(each) for each in texels)
    ax, ay, bx, by = right[0] * across, down[0] * across, right[1] * along, down[1] * along
    xx, yy, xy = ax * ax + bx * bx, ay * ay + by * by, ax * ay + bx * by
    half = np.float32(0.5)
    difference = half * (xx - yy)
    length = np.sqrt(half * (xx + yy) + np.sqrt(difference * difference + xy * xy))
    angle = half * np.arctan2(xy, difference)
    cos, sin = np.cos(angle), np.sin(angle)
    major = [one * cos + other * sin for one, other in zip(right, down, strict=True)]
    minor = [np.abs(other * cos - one * sin) for one, other in zip(right[:2], down[:2], strict=True)]
    return Footprints(major[0], major[1], major[2], minor[0], minor[1], length)


def _differences(
    planes: tuple[Image, Image, Image], coverage: Image, pixels: Pixels, size: tuple[int, int], step: int
) -> tuple[list[Image], NDArray[np.bool_]]:
    """Return the planes' changes over a step to the right or down, and which pixels have no neighbor that way."""
    columns, rows = size
    place = pixels % columns if step == 1 else pixels
    more = place < columns - 1 if step == 1 else place < columns * (rows - 1)
    less = place > 0 if step == 1 else place >= columns
    after, before = np.where(more, pixels + step, pixels), np.where(less, pixels - step, pixels)
    for neighbor, known in ((after, more), (before, less)):
        known &= coverage.take(neighbor) > 0.0
        np.copyto(neighbor, pixels, where=~known)
    count = more.astype(np.float32) + less
    share = np.float32(1.0) / np.maximum(count, np.float32(1.0))
    changes = []
    for number, plane in enumerate(planes):
        change = plane.take(after) - plane.take(before)
        if number == 1:
            change -= _TURN * np.rint(change / _TURN)
        change *= share
        changes.append(change)
    return changes, count == 0.0
