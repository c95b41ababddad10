# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pixels of a map are traced again: some that stand for all, and those where errors would be."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array, Image, Mask

Pixels = NDArray[np.intp]

# Of all samples, so many are spread evenly; the others lie at the shadow's edge, where neighbors differ most, and
# where pixels do not fit their neighbors, in equal parts.
EVEN_SHARE = 0.5

# Pixels from the shadow's edge that count as next to it.
EDGE_REACH = 2
# Half of the samples where neighbors differ most are the very first, the others are drawn from this share of the map.
STEEP_SHARE = 0.02
# Pixels on each side that a pixel is compared with. Of each square of so many the one that fits worst is looked at.
REACH, SQUARE = 2, 16
# Less than this, radians, is rounding and says nothing.
SMALLEST_STEP = 1e-6


@dataclass(frozen=True)
class Samples:
    """Pixels of a map, in order, each once."""

    column: Pixels
    row: Pixels
    even: Mask
    """Whether a pixel is one of those spread evenly, which stand for the whole picture."""

    def __len__(self) -> int:
        return len(self.column)

    def centers(self, block: slice) -> tuple[Array, Array]:
        """Return the map pixel coordinates of some pixels' centers, shape (n,) each."""
        return self.column[block].astype(np.float64) + 0.5, self.row[block].astype(np.float64) + 0.5


def choose(
    kind: NDArray[np.uint8], whole: Mask, direction: NDArray[Any], count: int, seed: int
) -> Generator[float, None, Samples]:
    """Choose pixels of a map; yields the fraction done as it looks through the map, and returns them.

    Parameters
    ----------
    kind : ndarray of uint8, shape (height, width)
        What each pixel sees; where neighbors differ is the shadow's edge.
    whole : ndarray of bool, shape (height, width)
        Pixels whose direction may be compared with their neighbors'.
    direction : ndarray, shape (height, width, 3)
        Unit vectors, of any kind of float.
    count : int
        About so many are chosen; all of a map that has no more.
    seed : int
        The same seed chooses the same pixels of the same map.
    """
    height, width = kind.shape
    if kind.size <= count:
        row, column = np.divmod(np.arange(kind.size), width)
        return Samples(column, row, np.ones(kind.size, dtype=bool))
    random = np.random.default_rng(seed)
    even = _spread(width, height, round(EVEN_SHARE * count), random)
    each = max(1, (count - len(even)) // 3)
    near = np.flatnonzero(_near_edge(kind))
    steps, odd = yield from _unevenness(whole, direction)
    steep = _largest(steps.ravel(), max(each, int(STEEP_SHARE * kind.size)))
    chosen = [
        even,
        random.permutation(near)[:each],
        steep[_largest(steps.ravel()[steep], each - each // 2)],
        random.permutation(steep)[: each // 2],
        _largest(odd.ravel(), each),
    ]
    pixels = np.unique(np.concatenate(chosen))
    row, column = np.divmod(pixels, width)
    return Samples(column, row, np.isin(pixels, even))


def _spread(width: int, height: int, count: int, random: np.random.Generator) -> Pixels:
    """Return one pixel at random out of each of some `count` equal cells that cover the picture, as indices."""
    columns = min(width, max(1, round(math.sqrt(count * width / height))))
    rows = min(height, max(1, round(count / columns)))
    row, column = np.mgrid[0:rows, 0:columns]
    x = ((column + random.random(column.shape)) * (width / columns)).astype(np.intp)
    y = ((row + random.random(row.shape)) * (height / rows)).astype(np.intp)
    pixels: Pixels = np.unique(np.minimum(y, height - 1) * width + np.minimum(x, width - 1))
    return pixels


def _near_edge(kind: NDArray[np.uint8]) -> Mask:
    """Return the pixels that have a pixel of another kind within `EDGE_REACH` along the row or the column."""
    near = np.zeros(kind.shape, dtype=bool)
    for reach in range(1, EDGE_REACH + 1):
        aside, down = kind[:, reach:] != kind[:, :-reach], kind[reach:] != kind[:-reach]
        near[:, reach:] |= aside
        near[:, :-reach] |= aside
        near[reach:] |= down
        near[:-reach] |= down
    return near


def _unevenness(whole: Mask, direction: NDArray[Any]) -> Generator[float, None, tuple[Image, Image]]:
    """Return how far pixels are from the next, radians, and how badly they fit their neighbors, a ratio.

    Both of shape (height, width), 0 where there is nothing to compare. Only the pixel of each square that fits worst
    has a ratio, to what is usual in the square: next to the photon ring, few fit.
    """
    height, width = whole.shape
    steps, odd = np.zeros((2, height, width), np.float32)
    for top in range(0, height, SQUARE):
        first, last = max(top - REACH, 0), min(top + SQUARE + REACH, height)
        values = np.where(whole[first:last, :, None], direction[first:last].astype(np.float64), np.nan)
        rows = slice(top, min(top + SQUARE, height))
        inner = slice(top - first, top - first + rows.stop - top)
        steps[rows] = _steps(values)[inner]
        misfit = _misfit(values)[inner]
        for left in range(0, width, SQUARE):
            block = misfit[:, left : left + SQUARE]
            known = np.isfinite(block)
            if known.any():
                row, column = np.unravel_index(np.where(known, block, 0.0).argmax(), block.shape)
                odd[top + row, left + column] = block[row, column] / (np.median(block[known]) + SMALLEST_STEP)
        yield rows.stop / height
    return steps, odd


def _steps(values: Array) -> Array:
    """Return the larger of the steps along the row and the column to the next pixel, shape (height, width)."""
    step = np.zeros(values.shape[:2])
    for axis in (0, 1):
        ahead = np.moveaxis(np.nan_to_num(np.linalg.norm(np.diff(values, axis=axis), axis=-1)), axis, 0)
        where = np.moveaxis(step, axis, 0)
        where[:-1] = np.maximum(where[:-1], ahead)
    return step


def _misfit(values: Array) -> Array:
    """Return how far pixels are from the cubic through two neighbors on each side, shape (height, width).

    The smaller of what row and column say: a wrong pixel does not fit in either, its neighbors do in one. NaN where
    neither can be told.
    """
    misfit = np.full(values.shape[:2], np.nan)
    for axis in (0, 1):
        lines = np.moveaxis(values, axis, 0)
        if len(lines) < 2 * REACH + 1:
            continue
        far, near = lines[:-4] + lines[4:], lines[1:-3] + lines[3:-1]
        apart = np.linalg.norm(lines[2:-2] - (4.0 * near - far) / 6.0, axis=-1)
        along = np.moveaxis(misfit, axis, 0)
        along[REACH:-REACH] = np.fmin(along[REACH:-REACH], apart)
    return misfit


def _largest(values: Image, count: int) -> Pixels:
    """Return the indices of the `count` largest values that are above 0."""
    found: Pixels = np.flatnonzero(values > 0.0)
    if len(found) > count:
        found = found[np.argpartition(values[found], len(found) - count)[len(found) - count :]]
    return found
