# SPDX-License-Identifier: GPL-3.0-or-later
"""Bilinear look-up of an equirectangular picture by direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def sample_environment(environment: ArrayLike, directions: ArrayLike) -> FloatArray:
    """Bilinear look-up of an equirectangular picture, in the convention of Blender's World.

    Parameters
    ----------
    environment : array_like, shape (rows, columns, channels)
        Row 0 at the top (the zenith, +z), the middle column towards +x. Texel centers at (i + 0.5) / N.
    directions : array_like, shape (..., 3)
        Directions to look along; they need not be of unit length.

    Returns
    -------
    ndarray, shape (..., channels)
        u = 0.5 - atan2(y, x) / (2 pi) wraps round; v = 0.5 + asin(z) / pi ends at the poles, where the first
        and last row are extended.
    """
    picture: FloatArray = np.asarray(environment, dtype=np.float64)
    looking: FloatArray = np.asarray(directions, dtype=np.float64)
    rows, columns = picture.shape[:2]
    x, y, z = looking[..., 0], looking[..., 1], looking[..., 2]
    u = 0.5 - np.arctan2(y, x) / (2.0 * np.pi)
    # By atan2: equal to pi/2 - asin(z), but it keeps its digits at the poles, where asin loses half of them.
    polar = np.arctan2(np.hypot(x, y), z)
    column = u * columns - 0.5
    row = polar / np.pi * rows - 0.5
    left, top = np.floor(column), np.floor(row)
    share_x, share_y = (column - left)[..., np.newaxis], (row - top)[..., np.newaxis]
    left_index = left.astype(np.int64) % columns
    right_index = (left_index + 1) % columns
    top_index = np.clip(top.astype(np.int64), 0, rows - 1)
    bottom_index = np.clip(top.astype(np.int64) + 1, 0, rows - 1)
    upper = picture[top_index, left_index] * (1.0 - share_x) + picture[top_index, right_index] * share_x
    lower = picture[bottom_index, left_index] * (1.0 - share_x) + picture[bottom_index, right_index] * share_x
    colors: FloatArray = upper * (1.0 - share_y) + lower * share_y
    return colors
