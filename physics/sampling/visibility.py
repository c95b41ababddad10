# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of each pixel sees the sky: the shadow's edge, anti-aliased from its closed form.

`critical_curve.edge_function` is a smooth signed function of the ray that vanishes on the edge. Pixels whose corners
all have one sign are wholly sky or wholly shadow; those at the edge, and those around the hole's center (a distant hole
is smaller than a pixel), are divided into cells, and the edge is followed from cell to cell as a chain of chords.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array

# Cells along each side of a pixel at the edge. A chord across a cell cuts off 1/(8 n^2 R) of the pixel for an edge of
# radius R pixels: 8e-4 for a shadow 20 pixels wide.
CELLS = 4

# A shadow of less than a pixel gets cells of about this share of its radius, down to the smallest shadow that can
# be told from none in a picture of 8 bits.
CELLS_PER_RADIUS = 4
SMALLEST_SHADOW = 1.0 / 64.0

# Pixels refined on each side of the one that looks at the hole's center.
CENTER_REACH = 3

# A pixel whose visible part is less than this, or lacks less, counts as shadow or sky: it holds no part that a
# ray could be traced through.
SMALLEST_SHARE = 1e-6

# How far the edge may bulge through a pixel's side, in second differences: an eighth, and as much again to be safe.
BULGE = 0.25

# The ends of the chords: the change, as a share of a cell's side, that ends the root finder, which is left with about
# the square of it, and its rounds at the most. The function is flat on the shadow's side and steep on the other, where
# linear interpolation alone would shrink the shadow.
ROOT_CHANGE = 1e-2
ROOT_ROUNDS = 8

# The corners a, b, c, d of a cell, (row, column), and its sides and diagonal from corner to corner.
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
SIDES = ((0, 1), (0, 2), (1, 3), (2, 3), (0, 3))

EdgeFunction = Callable[[Array, Array], Array]
"""From pixel coordinates x, y to the signed edge function, positive in the sky; all of shape (n,)."""


def near_edge(corners: Array) -> NDArray[np.bool_]:
    """Return the pixels that the edge may touch.

    Those whose corners differ in sign, and those into which the edge may bulge through one side: between the ends of
    a side the function departs from a straight line by an eighth of its second difference.

    Parameters
    ----------
    corners : ndarray, shape (..., h + 3, w + 3)
        The edge function at the corners of h x w pixels and of one more pixel on each side.

    Returns
    -------
    ndarray of bool, shape (..., h, w)
    """
    sky = corners[..., 1:-1, 1:-1] > 0.0
    touched = sky[..., :-1, :-1] ^ sky[..., 1:, 1:]
    touched |= sky[..., :-1, :-1] ^ sky[..., :-1, 1:]
    touched |= sky[..., :-1, :-1] ^ sky[..., 1:, :-1]
    across = _may_bulge(corners[..., 1:-1, :])
    touched |= across[..., :-1, :] | across[..., 1:, :]
    down = _may_bulge(corners[..., :, 1:-1].swapaxes(-1, -2)).swapaxes(-1, -2)
    touched |= down[..., :-1] | down[..., 1:]
    return touched


def _may_bulge(values: Array) -> NDArray[np.bool_]:
    """Return the sides, shape (..., n), that the edge may cross twice, from a line of corners, shape (..., n + 3)."""
    bend = np.abs(np.diff(values, 2, axis=-1))
    size = np.abs(values[..., 1:-1])
    bulges: NDArray[np.bool_] = np.minimum(size[..., :-1], size[..., 1:]) < BULGE * np.maximum(
        bend[..., :-1], bend[..., 1:]
    )
    return bulges


def center_block(
    center: tuple[float, float] | None, width: int, height: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the columns and rows of the pixels around the one that sees the hole's center, those in the picture."""
    if center is None or not (abs(center[0]) < 1e9 and abs(center[1]) < 1e9):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    column, row = int(np.floor(center[0])), int(np.floor(center[1]))
    columns = np.arange(max(column - CENTER_REACH, 0), min(column + CENTER_REACH + 1, width))
    rows = np.arange(max(row - CENTER_REACH, 0), min(row + CENTER_REACH + 1, height))
    grid_column, grid_row = np.meshgrid(columns, rows)
    return grid_column.ravel(), grid_row.ravel()


def cells_for_shadow(center: tuple[float, float], edge: EdgeFunction) -> int:
    """Return how many cells along its side a pixel at the hole's center needs for a shadow of this size."""
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    radius = 1.0
    while radius > SMALLEST_SHADOW:
        if (edge(center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle)) < 0.0).any():
            break
        radius *= 0.5
    return max(CELLS, int(CELLS_PER_RADIUS / radius))


def refine(
    column: NDArray[np.intp], row: NDArray[np.intp], edge: EdgeFunction, cells: int = CELLS
) -> tuple[Array, Array, Array]:
    """Return the visible share of pixels and a point in the visible part.

    Parameters
    ----------
    column, row : ndarray of int, shape (n,)
    edge : callable
        The edge function in pixel coordinates.
    cells : int
        Cells along each side of a pixel.

    Returns
    -------
    share : ndarray, shape (n,)
        0 to 1; exactly 0 or 1 for less than `SMALLEST_SHARE` of the other.
    x, y : ndarray, shape (n,)
        The centroid of the visible part in pixel coordinates; the center of a pixel that is wholly one thing.
    """
    count = len(column)
    if not count:
        return np.empty(0), np.empty(0), np.empty(0)
    steps = np.arange(cells + 1) / cells
    x = np.broadcast_to(column[:, None, None] + steps, (count, cells + 1, cells + 1))
    y = np.broadcast_to(row[:, None, None] + steps[:, None], (count, cells + 1, cells + 1))
    values = edge(x.ravel(), y.ravel()).reshape(x.shape)

    sky = values > 0.0
    corners = [(slice(None), slice(i, cells + i), slice(j, cells + j)) for i, j in CORNERS]
    in_cells = sky[corners[0]].astype(np.float64)
    mixed = np.any([sky[corner] != sky[corners[0]] for corner in corners[1:]], axis=0)
    in_cells[mixed] = _cell_shares(
        x[corners[0]][mixed], y[corners[0]][mixed], 1.0 / cells, np.stack([values[c][mixed] for c in corners]), edge
    )
    share = in_cells.mean(axis=(1, 2))
    partial = (share > SMALLEST_SHARE) & (share < 1.0 - SMALLEST_SHARE)
    share = np.where(partial, share, np.round(share))

    middle = (np.arange(cells) + 0.5) / cells
    weight = np.where(share > 0.0, share, 1.0) * cells * cells
    inside_x = column + (in_cells.sum(axis=1) * middle).sum(axis=1) / weight
    inside_y = row + (in_cells.sum(axis=2) * middle).sum(axis=1) / weight
    # The centroid of a bent or divided part may itself lie in the shadow: then the most visible node stands for it.
    best = values.reshape(count, -1).argmax(axis=1)
    every = np.arange(count)
    hidden = partial & ~(edge(inside_x, inside_y) > 0.0)
    best_x, best_y = x.reshape(count, -1)[every, best], y.reshape(count, -1)[every, best]
    inside_x = np.where(hidden, best_x, np.where(partial, inside_x, column + 0.5))
    inside_y = np.where(hidden, best_y, np.where(partial, inside_y, row + 0.5))
    # Nothing visible but a sliver between nodes: no ray stands for it, and it is a thousandth of a pixel at most.
    lost = hidden & ~(values.reshape(count, -1)[every, best] > 0.0)
    return np.where(lost, 0.0, share), inside_x, inside_y


def _cell_shares(x: Array, y: Array, size: float, values: Array, edge: EdgeFunction) -> Array:
    """Return the visible share of cells, shape (n,), from their top left corners and the values at all `CORNERS`.

    Each is halved along its diagonal; where the edge enters and leaves a triangle a chord joins the two places.
    """
    start, end = np.array(SIDES).T
    down, right = np.array(CORNERS).T[:, :, None] * size
    f0, f1 = values[start], values[end]
    meets = (f0 > 0.0) != (f1 > 0.0)
    x0, y0 = (x + right[start])[meets], (y + down[start])[meets]
    width, height = (np.broadcast_to(step[end] - step[start], f0.shape)[meets] for step in (right, down))
    crossing = np.full(f0.shape, np.nan)
    crossing[meets] = _roots(
        lambda place, part: edge(x0[part] + place * width[part], y0[part] + place * height[part]),
        f0[meets],
        f1[meets],
    )
    ab, ac, bd, cd, ad = crossing
    a, b, c, d = values > 0.0
    return 0.5 * (_triangle_share((a, b, d), (ab, bd, 1.0 - ad)) + _triangle_share((a, c, d), (ac, cd, 1.0 - ad)))


def _roots(function: Callable[[Array, NDArray[np.intp]], Array], f_low: Array, f_high: Array) -> Array:
    """Return where functions, almost straight ones, vanish between 0 and 1, shape (n,).

    The Illinois form of false position (Dowell & Jarratt 1971, BIT 11, 168). `function` takes places and the numbers of
    the functions that they belong to; `f_low` and `f_high` are its values at 0 and 1, of different signs.
    """
    low, high = np.zeros(len(f_low)), np.ones(len(f_low))
    place = f_low / (f_low - f_high)
    found, left = place.copy(), np.arange(len(place))
    for _ in range(ROOT_ROUNDS):
        if not len(left):
            break
        value = function(place, left)
        same = (value > 0.0) == (f_low > 0.0)
        # The end that stays has its value halved, so that it cannot stay for ever.
        f_low, f_high = np.where(same, value, 0.5 * f_low), np.where(same, 0.5 * f_high, value)
        low, high = np.where(same, place, low), np.where(same, high, place)
        gap = f_low - f_high
        better = np.where(gap == 0.0, place, low + (high - low) * (f_low / np.where(gap == 0.0, 1.0, gap)))
        found[left] = better
        # Each goes on until it has settled, whatever the others do: it must not depend on its company.
        going = np.abs(better - place) > ROOT_CHANGE
        left, place = left[going], better[going]
        low, high, f_low, f_high = low[going], high[going], f_low[going], f_high[going]
    return found


def _triangle_share(sky: tuple[NDArray[np.bool_], ...], crossing: tuple[Array, ...]) -> Array:
    """Return the visible share of triangles.

    `sky` says whether corners 0, 1, 2 see it; `crossing` where the edge meets the sides 0-1, 1-2, 2-0, as a fraction
    from the side's first corner.
    """
    share = np.where(sky[0] & sky[1] & sky[2], 1.0, 0.0)
    for i, (first, second, third) in enumerate(((0, 1, 2), (1, 2, 0), (2, 0, 1))):
        alone = (sky[first] != sky[second]) & (sky[first] != sky[third])
        # The corner cut off: a triangle similar to the whole but for its two sides.
        corner = crossing[i] * (1.0 - crossing[third])
        share = np.where(alone, np.where(sky[first], corner, 1.0 - corner), share)
    return share
