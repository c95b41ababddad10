# SPDX-License-Identifier: GPL-3.0-or-later
"""Lagrange interpolation between points at whole numbers."""

from __future__ import annotations

import math

from .arrays import Array

# The points of cubic interpolation, counted from the one before the place, and the share of the fourth difference that
# it leaves out half way between two points.
CUBIC_POINTS = (-1, 0, 1, 2)
CUBIC_ERROR = 3.0 / 128.0


def lagrange_weights(part: Array, points: tuple[int, ...]) -> list[Array]:
    """Return the weights of Lagrange interpolation among points at whole numbers.

    Parameters
    ----------
    part : ndarray
        Places, between 0 and 1.
    points : tuple of int
        At least two.

    Returns
    -------
    list of ndarray
        One weight per point, each of the shape of `part`.
    """
    away = {point: part - point for point in points}
    weights = []
    for point in points:
        others = [other for other in points if other != point]
        weight = away[others[0]] * (1.0 / math.prod(point - other for other in others))
        for other in others[1:]:
            weight *= away[other]
        weights.append(weight)
    return weights
