# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of each pixel an annulus of the disk covers, from u = 1 / r and its slope across the picture."""

from __future__ import annotations

import numpy as np

from .rays import Array

# A slope along one axis of less than this share of the other's counts as that.
LEAST_SLOPE = 1e-4

# A slope of less than this is none.
FLAT = 1e-15

# Coverage of less than this, or lacking less than this, is none or all.
LEAST_COVERAGE = 1e-4


def share_above(height: Array, slope_x: Array, slope_y: Array) -> Array:
    """Return the share of a unit square where height + slope_x x + slope_y y > 0, x and y from -1/2 to 1/2.

    The integral of max(z, 0) twice over: exact for a plane.
    """
    one, other = np.abs(slope_x), np.abs(slope_y)
    long = np.maximum(np.maximum(one, other), FLAT)
    short = np.maximum(np.minimum(one, other), LEAST_SLOPE * long)
    short = short / long
    height = np.clip(height / long, -1.0, 1.0)  # beyond half of 1 + short nothing changes

    def twice(z: Array) -> Array:
        positive = np.maximum(z, 0.0)
        return 0.5 * positive * positive

    far, near = 0.5 * (1.0 + short), 0.5 * (1.0 - short)
    share = (twice(height + far) - twice(height + near) - twice(height - near) + twice(height - far)) / short
    # Far above, differences of large squares cancel.
    share = np.where(height >= far, 1.0, np.where(height <= -far, 0.0, share))
    clipped: Array = np.clip(share, 0.0, 1.0)
    return clipped


def coverage(u: Array, slope_x: Array, slope_y: Array, inner: float, outer: float) -> Array:
    """Return the share of each pixel between two radii; `u` at its centre and its change from pixel to pixel."""
    share = share_above(u - 1.0 / outer, slope_x, slope_y) - share_above(u - 1.0 / inner, slope_x, slope_y)
    share = np.where(share < LEAST_COVERAGE, 0.0, share)
    return np.where(share > 1.0 - LEAST_COVERAGE, 1.0, share)


def nearest_covered(u: Array, slope_x: Array, slope_y: Array, inner: float, outer: float) -> tuple[Array, Array, Array]:
    """Return u within the annulus, and how many pixels right and down of the centre it is met, at most half of one."""
    inside = np.clip(u, 1.0 / outer, 1.0 / inner)
    away = (inside - u) / np.maximum(slope_x * slope_x + slope_y * slope_y, FLAT * FLAT)
    return inside, np.clip(away * slope_x, -0.5, 0.5), np.clip(away * slope_y, -0.5, 0.5)
