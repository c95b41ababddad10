# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing points of light into a picture, each as a small Gaussian of fixed width in pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array
from ..shot.cameras import Camera, PanoramaCamera

POINTS_AT_ONCE = 8192
# A panorama wider than this, radians, joins at its sides, give or take single precision.
FULL_CIRCLE = 6.2831

WIDTH = 0.55
"""Standard deviation of a star's Gaussian in pixels."""
REACH = 2
"""Pixels on each side that it is drawn in."""


def draw(camera: Camera, x: Array, y: Array, light: Array) -> tuple[NDArray[np.float32], int]:
    """Draw points of light into a picture.

    Parameters
    ----------
    camera : Camera
    x, y : ndarray, shape (n,)
        Pixels from the picture's left and top.
    light : ndarray, shape (n, 3)
        Radiance times steradian.

    Returns
    -------
    image : ndarray of float32, shape (height, width, 3)
        Radiance. Times the pixels' solid angles it adds up to the light of the points, but for what lies beyond the
        picture's border. A panorama of the full circle goes on at the other side, and beyond its poles.
    drawn : int
        How many points reach into the picture.

    Notes
    -----
    Each is a Gaussian of standard deviation `WIDTH`, taken at the pixels' centers, with weights that sum to 1.
    """
    width, height = camera.width, camera.height
    taps = np.arange(-REACH, REACH + 1)
    column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    weights = []
    for place, pixel in ((x, column), (y, row)):
        weight = np.exp(-0.5 * ((taps + 0.5) - (place - pixel)[:, None]) ** 2 / WIDTH**2)
        weights.append(weight / weight.sum(axis=1, keepdims=True))
    rows, columns = row[:, None] + taps, column[:, None] + taps
    is_round = isinstance(camera, PanoramaCamera) and camera.longitude_max - camera.longitude_min > FULL_CIRCLE
    whole = (rows[:, 0] >= 0) & (rows[:, -1] < height) & (columns[:, 0] >= 0) & (columns[:, -1] < width)
    partly = (rows[:, -1] >= 0) & (rows[:, 0] < height)
    if not is_round:
        partly &= (columns[:, -1] >= 0) & (columns[:, 0] < width)
    light = np.ascontiguousarray(light.T)
    flux = np.zeros((3, height * width), np.float32)
    for members, is_whole in ((np.flatnonzero(whole), True), (np.flatnonzero(partly & ~whole), False)):
        for start in range(0, len(members), POINTS_AT_ONCE):
            some = members[start : start + POINTS_AT_ONCE]
            share = weights[1][some][:, :, None] * weights[0][some][:, None, :]
            down, right = rows[some][:, :, None], columns[some][:, None, :]
            if not is_whole:
                down, right = np.broadcast_arrays(down, right)
                if is_round:
                    beyond = (down < 0) | (down >= height)
                    right = np.where(beyond, right + width // 2, right) % width
                    down = np.where(down < 0, -1 - down, np.where(down >= height, 2 * height - 1 - down, down))
                seen = (down >= 0) & (down < height) & (right >= 0) & (right < width)
                share, down, right = share * seen, np.where(seen, down, 0), np.where(seen, right, 0)
            pixel = (down * width + right).ravel()
            for channel in range(3):
                parts = (share * light[channel, some][:, None, None]).astype(np.float32)
                np.add.at(flux[channel], pixel, parts.ravel())
    planes = flux.reshape(3, height, width)
    planes /= camera.solid_angles().astype(np.float32)
    return np.moveaxis(planes, 0, -1), int(np.count_nonzero(partly))
