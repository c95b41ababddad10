# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of each pixel sees the sky: the shadow's edge, anti-aliased from its closed form.

`trapped.edge_function` is a smooth signed function of the ray that vanishes on the edge. Pixels whose corners all
have one sign are wholly sky or wholly shadow; those at the edge, and those around the hole's centre (a
distant hole is smaller than a pixel), are divided into cells, in each of which the function is taken as linear.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .rays import Array

# Cells along each side of a pixel at the edge. Within a cell the edge is taken as straight: for a shadow two
# pixels across that leaves a share of about 1e-3 of the pixel wrong, for one of 100 pixels 1e-5.
CELLS = 8

# Pixels refined on each side of the one that looks at the hole's centre.
CENTRE_REACH = 3

# A pixel whose visible part is less than this, or lacks less, counts as shadow or sky: it holds no part that a
# ray could be traced through.
SMALLEST_SHARE = 1e-6

EdgeFunction = Callable[[Array, Array], Array]
"""From pixel coordinates x, y to the signed edge function, positive in the sky; all of shape (n,)."""


def near_edge(corners: Array) -> NDArray[np.bool_]:
    """Return the pixels that the edge may touch, shape (height, width), from corner values (height + 1, width + 1).

    Those whose corners differ in sign, and their neighbours: the edge may bulge into a pixel through one side.
    """
    sky = corners > 0.0
    touched = sky[:-1, :-1] ^ sky[1:, 1:]
    touched |= sky[:-1, :-1] ^ sky[:-1, 1:]
    touched |= sky[:-1, :-1] ^ sky[1:, :-1]
    grown = touched.copy()
    grown[1:] |= touched[:-1]
    grown[:-1] |= touched[1:]
    wide = grown.copy()
    wide[:, 1:] |= grown[:, :-1]
    wide[:, :-1] |= grown[:, 1:]
    return wide


def mark_centre(marked: NDArray[np.bool_], centre: tuple[float, float] | None, first_row: int) -> None:
    """Mark, in a strip of rows that starts at `first_row`, the pixels around the one that sees the hole's centre."""
    if centre is None or not np.isfinite(centre).all():
        return
    column, row = int(np.floor(centre[0])), int(np.floor(centre[1])) - first_row
    rows = slice(max(row - CENTRE_REACH, 0), max(row + CENTRE_REACH + 1, 0))
    columns = slice(max(column - CENTRE_REACH, 0), max(column + CENTRE_REACH + 1, 0))
    marked[rows, columns] = True


def refine(column: NDArray[np.intp], row: NDArray[np.intp], edge: EdgeFunction) -> tuple[Array, Array, Array]:
    """Return the visible share of pixels and a point in the visible part.

    Parameters
    ----------
    column, row : ndarray of int, shape (n,)
    edge : callable
        The edge function in pixel coordinates.

    Returns
    -------
    share : ndarray, shape (n,)
        0 to 1; exactly 0 or 1 for less than `SMALLEST_SHARE` of the other.
    x, y : ndarray, shape (n,)
        The centroid of the visible part in pixel coordinates; the centre of a pixel that is wholly one thing.
    """
    count = len(column)
    if not count:
        return np.empty(0), np.empty(0), np.empty(0)
    steps = np.arange(CELLS + 1) / CELLS
    grid_y, grid_x = (axis.ravel() for axis in np.meshgrid(steps, steps, indexing="ij"))
    x = column[:, None] + grid_x
    y = row[:, None] + grid_y
    values = edge(x.ravel(), y.ravel()).reshape(count, CELLS + 1, CELLS + 1)

    a, b, c, d = values[:, :-1, :-1], values[:, :-1, 1:], values[:, 1:, :-1], values[:, 1:, 1:]
    cells = 0.5 * (_positive_share(a, b, d) + _positive_share(a, c, d))
    share = cells.mean(axis=(1, 2))

    middle = (np.arange(CELLS) + 0.5) / CELLS
    weight = np.where(share > 0.0, share, 1.0) * CELLS * CELLS
    inside_x = (cells.sum(axis=1) * middle).sum(axis=1) / weight
    inside_y = (cells.sum(axis=2) * middle).sum(axis=1) / weight

    partial = (share > SMALLEST_SHARE) & (share < 1.0 - SMALLEST_SHARE)
    share = np.where(partial, share, np.round(share))
    # The centroid of a bent or divided part may itself lie in the shadow: then the most visible node stands for it.
    best = np.argmax(values.reshape(count, -1), axis=1)
    hidden = partial & ~(edge(column + inside_x, row + inside_y) > 0.0)
    inside_x = np.where(hidden, grid_x[best], np.where(partial, inside_x, 0.5))
    inside_y = np.where(hidden, grid_y[best], np.where(partial, inside_y, 0.5))
    # Nothing visible but the part between nodes: no ray stands for it, and it is a thousandth of a pixel at most.
    lost = hidden & ~(values.reshape(count, -1).max(axis=1) > 0.0)
    return np.where(lost, 0.0, share), column + inside_x, row + inside_y


def _positive_share(a: Array, b: Array, c: Array) -> Array:
    """Return the share of a triangle in which the linear function with these corner values is positive."""
    low, middle, high = np.sort(np.stack([a, b, c]), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        one_positive = high * high / ((high - low) * (high - middle))
        one_negative = 1.0 - low * low / ((low - middle) * (low - high))
    share = np.where(middle > 0.0, one_negative, one_positive)
    return np.where(low > 0.0, 1.0, np.where(high > 0.0, share, 0.0))
