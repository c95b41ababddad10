# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of each pixel an annulus of the disk covers, from u = 1 / r and its slope across the picture."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array
from ..sampling.tiles import TILE_SIDES, chebyshev_places

# A slope along one axis of less than this share of the other's counts as that.
LEAST_SLOPE = 1e-4

# A slope of less than this is none.
FLAT = 1e-15

# The part of the differences around a sample that it must be off the disk by to count as far from it.
FAR_SHARE = 0.3

# Coverage of less than this, or lacking less than this, is none or all.
LEAST_COVERAGE = 1e-4


def share_above(height: Array, slope_x: Array, slope_y: Array) -> Array:
    """Return the share of a unit square where height + slope_x x + slope_y y > 0, x and y from -1/2 to 1/2.

    The integral of max(z, 0) twice over: exact for a plane.
    """
    height, one, other = np.broadcast_arrays(height, np.abs(slope_x), np.abs(slope_y))
    long = np.maximum(np.maximum(one, other), FLAT)
    short = np.maximum(np.minimum(one, other), LEAST_SLOPE * long)
    share = np.where(height > 0.0, 1.0, 0.0)
    met = ~(np.abs(height) >= 0.5 * (long + short))  # elsewhere the line passes by the square
    height, short = height[met] / long[met], short[met] / long[met]

    def twice(z: Array) -> Array:
        positive = np.maximum(z, 0.0)
        half_square: Array = 0.5 * positive * positive
        return half_square

    far, near = 0.5 * (1.0 + short), 0.5 * (1.0 - short)
    part = (twice(height + far) - twice(height + near) - twice(height - near) + twice(height - far)) / short
    share[met] = np.clip(part, 0.0, 1.0)
    return share


def coverage(u: Array, slope_x: Array, slope_y: Array, low: float, high: float) -> Array:
    """Return the share of each pixel where u is between two values; `u` at its center, and its change from pixel to
    pixel."""
    share = share_above(u - low, slope_x, slope_y) - share_above(u - high, slope_x, slope_y)
    share = np.where(share < LEAST_COVERAGE, 0.0, share)
    return np.where(share > 1.0 - LEAST_COVERAGE, 1.0, share)


def misses(u: NDArray[Any], corners: NDArray[Any], low: float, high: float) -> NDArray[np.bool_]:
    """Return which pixels miss the annulus although a straight u might meet it, shape (n,).

    Where u bends, as where rays end beside a camera near the plane, its slope leads astray: center and corners say that
    all of the pixel is off to one side.

    Parameters
    ----------
    u : ndarray, shape (n,)
        At the pixels' centers.
    corners : ndarray, shape (4, n)
        u at their corners.
    low, high : float
        u at the annulus's rims.
    """
    inside: NDArray[np.bool_] = np.minimum(u, corners.min(axis=0)) > high
    outside: NDArray[np.bool_] = np.maximum(u, corners.max(axis=0)) < low
    return inside | outside


def misses_with_neighbors(u: Array, low: float, high: float) -> NDArray[np.bool_]:
    """Return which pixels miss the annulus as `misses` does, from u at the centers around: what a straight u reaches
    within a pixel, its neighbor on that side has beyond it.

    Parameters
    ----------
    u : ndarray, shape (n, rows, columns)
        At the pixels' centers. Where a neighbor is not known, NaN, a pixel does not miss; beyond the sides, they are
        taken as those within.
    low, high : float
        u at the annulus's rims.
    """
    missed = np.zeros(u.shape, dtype=bool)
    rows, columns = u.shape[1:]
    for off in (u > high, u < low):
        wide = np.pad(off, [(0, 0), (1, 1), (1, 1)], mode="edge")
        parts = [wide[:, row : row + rows, column : column + columns] for row in range(3) for column in range(3)]
        missed |= np.logical_and.reduce(parts)
    return missed


def nearest_covered(u: Array, slope_x: Array, slope_y: Array, low: float, high: float) -> tuple[Array, Array, Array]:
    """Return u brought between two values, and how many pixels right and down of the center it is met, at most half of
    one."""
    inside = np.clip(u, low, high)
    away = (inside - u) / np.maximum(slope_x * slope_x + slope_y * slope_y, FLAT * FLAT)
    return inside, np.clip(away * slope_x, -0.5, 0.5), np.clip(away * slope_y, -0.5, 0.5)


def near_annulus(u: Array, low: float, high: float) -> NDArray[np.bool_]:
    """Return which pixels of the smallest tiles may see u between `low` and `high`, shape (n, side, side).

    `u` is sampled at the tiles' Chebyshev points, shape (n, count, count). A point is far if it and all around it
    are off to the same side, and by a good part of what they differ by; a pixel, if the four points around it are.
    """
    off = np.maximum(low - u, u - high)
    side = np.where(u > high, 1.0, -1.0)
    highest = [_around(each, np.maximum) for each in (u, side)]
    lowest = [_around(each, np.minimum) for each in (u, side, off)]
    far = (lowest[2] > FAR_SHARE * (highest[0] - lowest[0])) & (highest[1] == lowest[1])
    tile_side, count = TILE_SIDES[-1], u.shape[-1]
    before = np.searchsorted(chebyshev_places(count), (np.arange(tile_side) + 0.5) / tile_side) - 1
    first, second = np.clip(before, 0, count - 1), np.clip(before + 1, 0, count - 1)
    by_row = far[:, first] & far[:, second]
    near: NDArray[np.bool_] = ~(by_row[:, :, first] & by_row[:, :, second])
    return near


def _around(values: Array, extreme: np.ufunc) -> Array:
    """Return the largest or smallest of each value and its eight neighbors, shape (n, rows, columns)."""
    found = values.copy()
    for axis in (1, 2):
        here = found.copy()
        ahead, behind = (slice(None),) * axis + (slice(1, None),), (slice(None),) * axis + (slice(None, -1),)
        extreme(found[behind], here[ahead], out=found[behind])
        extreme(found[ahead], here[behind], out=found[ahead])
    return found
