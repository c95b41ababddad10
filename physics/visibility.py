# SPDX-License-Identifier: GPL-3.0-or-later
"""How much of each pixel sees the sky: the shadow's edge, anti-aliased from its closed form.

`trapped.edge_function` is a smooth signed function of the ray that vanishes on the edge. Pixels whose corners all
have one sign are wholly sky or wholly shadow; those at the edge, and those around the hole's centre (a distant hole
is smaller than a pixel), are divided into cells, and the edge is followed from cell to cell as a chain of chords.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .rays import Array

# Cells along each side of a pixel at the edge. A chord across a cell cuts off 1/(8 n^2 R) of the pixel for an edge of
# radius R pixels: 8e-4 for a shadow 20 pixels wide.
CELLS = 4

# A shadow of less than a pixel gets cells of about this share of its radius, down to the smallest shadow that can
# be told from none in a picture of 8 bits.
CELLS_PER_RADIUS = 4
SMALLEST_SHADOW = 1.0 / 64.0

# Pixels refined on each side of the one that looks at the hole's centre.
CENTRE_REACH = 3

# A pixel whose visible part is less than this, or lacks less, counts as shadow or sky: it holds no part that a
# ray could be traced through.
SMALLEST_SHARE = 1e-6

# Rounds of the root finder that places the ends of the chords; the function is flat on the shadow's side and steep
# on the other, where linear interpolation alone would shrink the shadow.
ROOT_ROUNDS = 5

EdgeFunction = Callable[[Array, Array], Array]
"""From pixel coordinates x, y to the signed edge function, positive in the sky; all of shape (n,)."""


def near_edge(corners: Array) -> NDArray[np.bool_]:
    """Return the pixels that the edge may touch, shape (..., h, w), from corner values, shape (..., h + 1, w + 1).

    Those whose corners differ in sign, and their neighbours: the edge may bulge into a pixel through one side.
    """
    sky = corners > 0.0
    touched = sky[..., :-1, :-1] ^ sky[..., 1:, 1:]
    touched |= sky[..., :-1, :-1] ^ sky[..., :-1, 1:]
    touched |= sky[..., :-1, :-1] ^ sky[..., 1:, :-1]
    grown = touched.copy()
    grown[..., 1:, :] |= touched[..., :-1, :]
    grown[..., :-1, :] |= touched[..., 1:, :]
    wide = grown.copy()
    wide[..., 1:] |= grown[..., :-1]
    wide[..., :-1] |= grown[..., 1:]
    return wide


def centre_block(
    centre: tuple[float, float] | None, width: int, height: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the columns and rows of the pixels around the one that sees the hole's centre, those in the picture."""
    if centre is None or not (abs(centre[0]) < 1e9 and abs(centre[1]) < 1e9):
        return np.empty(0, np.intp), np.empty(0, np.intp)
    column, row = int(np.floor(centre[0])), int(np.floor(centre[1]))
    columns = np.arange(max(column - CENTRE_REACH, 0), min(column + CENTRE_REACH + 1, width))
    rows = np.arange(max(row - CENTRE_REACH, 0), min(row + CENTRE_REACH + 1, height))
    grid_column, grid_row = np.meshgrid(columns, rows)
    return grid_column.ravel(), grid_row.ravel()


def cells_for_shadow(centre: tuple[float, float], edge: EdgeFunction) -> int:
    """Return how many cells along its side a pixel at the hole's centre needs for a shadow of this size."""
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    radius = 1.0
    while radius > SMALLEST_SHADOW:
        if (edge(centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)) < 0.0).any():
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
        The centroid of the visible part in pixel coordinates; the centre of a pixel that is wholly one thing.
    """
    count = len(column)
    if not count:
        return np.empty(0), np.empty(0), np.empty(0)
    steps = np.arange(cells + 1) / cells
    x = np.broadcast_to(column[:, None, None] + steps, (count, cells + 1, cells + 1))
    y = np.broadcast_to(row[:, None, None] + steps[:, None], (count, cells + 1, cells + 1))
    values = edge(x.ravel(), y.ravel()).reshape(x.shape)

    sky = (values > 0.0).reshape(count, -1)
    in_cells = np.broadcast_to(sky[:, 0].astype(np.float64)[:, None, None], (count, cells, cells)).copy()
    mixed = np.flatnonzero(sky.any(axis=1) & ~sky.all(axis=1))
    if len(mixed):
        in_cells[mixed] = _cell_shares(x[mixed], y[mixed], values[mixed], edge)
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


def _cell_shares(x: Array, y: Array, values: Array, edge: EdgeFunction) -> Array:
    """Return the visible share of each cell, shape (n, cells, cells), from its nodes, (n, cells + 1, cells + 1)."""

    def side(start: tuple[slice, ...], end: tuple[slice, ...]) -> Array:
        return _crossing(x[start], y[start], values[start], x[end], y[end], values[end], edge)

    every, low, high = slice(None), slice(None, -1), slice(1, None)
    across = side((every, every, low), (every, every, high))  # along rows of nodes
    down = side((every, low, every), (every, high, every))
    diagonal = side((every, low, low), (every, high, high))
    sky = values > 0.0
    a, b, c, d = sky[:, :-1, :-1], sky[:, :-1, 1:], sky[:, 1:, :-1], sky[:, 1:, 1:]
    upper = _triangle_share((a, b, d), (across[:, :-1], down[:, :, 1:], 1.0 - diagonal))
    lower = _triangle_share((a, c, d), (down[:, :, :-1], across[:, 1:], 1.0 - diagonal))
    return 0.5 * (upper + lower)


def _crossing(x0: Array, y0: Array, f0: Array, x1: Array, y1: Array, f1: Array, edge: EdgeFunction) -> Array:
    """Return where between two nodes the function vanishes, 0 to 1 from the first; NaN where it has one sign.

    The Illinois form of false position (Dowell & Jarratt 1971, BIT 11, 168).
    """
    where = np.full(f0.shape, np.nan)
    chosen = (f0 > 0.0) != (f1 > 0.0)
    x, y, width, height = x0[chosen], y0[chosen], (x1 - x0)[chosen], (y1 - y0)[chosen]
    low, high = np.zeros(x.shape), np.ones(x.shape)
    f_low, f_high = f0[chosen], f1[chosen]
    middle = f_low / (f_low - f_high)
    for _ in range(ROOT_ROUNDS):
        f_middle = edge(x + middle * width, y + middle * height)
        same = (f_middle > 0.0) == (f_low > 0.0)
        # The end that stays has its value halved, so that it cannot stay for ever.
        f_low, f_high = np.where(same, f_middle, 0.5 * f_low), np.where(same, 0.5 * f_high, f_middle)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
        gap = f_low - f_high
        middle = np.where(gap == 0.0, middle, low + (high - low) * f_low / np.where(gap == 0.0, 1.0, gap))
    where[chosen] = middle
    return where


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
