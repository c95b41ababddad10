# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of a disk that are bands around the shadow, pixel by pixel from their tables.

From the third on, a disk's images are mostly thinner than a pixel. Across them all changes so fast that neither tiles
nor a few places in a pixel tell what of it is covered. But a band's rims are smooth curves around the hole's direction
that its table knows nearly everywhere (`ring_table`), and across a pixel the distance from them is all but linear. So
the share of a pixel that is covered is right however thin the band is, and the pixel shows the mean across the part of
the band in it.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .annulus import LEAST_COVERAGE, share_above
from .quadrature import gauss_legendre
from .rays import Array
from .ring_table import RingTable
from .sky_table import nearest_turn, position_angles
from .tiles import TILE_SIDES, Tiles, tiles_of
from .view import View

Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

# Gauss's places and weights across the part of the band in a pixel, in units of its width.
_PLACES, _WEIGHTS = gauss_legendre(3)
PLACES, WEIGHTS = 0.5 * (1.0 + _PLACES), 0.5 * _WEIGHTS

# Steps along a tile's side to the places that tell whether the band touches it; more in a panorama, where a tile may
# hold a pole. Between them a rim bulges by less than this share of what its distances from them differ by, if they are
# farther from the hole's direction than this many times what they are from each other.
LOOKS, LOOKS_IN_PANORAMA = 1, 4
BULGE, BESIDE_HOLE = 0.25, 2.0

# Tiles worked through at a time: their pixels stay in the cache.
GROUP = 64

# Pixels that a table is asked for at a time, for the same reason.
BLOCK = 8192

# What of a tile with a pixel more on each side is the tile.
OWN = (slice(None), slice(1, -1), slice(1, -1))


class RingPixels(NamedTuple):
    """Pixels that see a band, shape (n,)."""

    column: Index
    row: Index
    share: Array
    """How much of the pixel is covered."""
    away: Array
    """Angles from the hole's direction of places on the disk in the pixel, shape (k, n): one where it is wholly
    covered, else those of `PLACES`."""
    angle: Array
    """Position angle."""
    energy: Array
    momentum: Array
    """Of the light, for a camera energy of 1."""

    def blocks(self) -> Iterator[RingPixels]:
        """Yield some of them at a time."""
        for start in range(0, len(self.column), BLOCK):
            part = slice(start, start + BLOCK)
            place = self.column[part], self.row[part], self.share[part]
            yield RingPixels(*place, self.away[:, part], self.angle[part], self.energy[part], self.momentum[part])


class TileSurvey:
    """Where the hole is seen from places in the smallest tiles of a picture."""

    def __init__(self, view: View, width: int, height: int) -> None:
        self.view, self.width, self.height = view, width, height
        self._looks = LOOKS_IN_PANORAMA if view.is_panorama else LOOKS
        side, step = TILE_SIDES[-1], TILE_SIDES[-1] / self._looks
        y, x = np.mgrid[0 : -(-height // side) * self._looks + 1, 0 : -(-width // side) * self._looks + 1] * step
        light = view.light(np.minimum(x, width).ravel(), np.minimum(y, height).ravel())
        self._shape = x.shape
        self.away, self.angle = position_angles(light)
        """Position angles of the places, shape (n,)."""
        spans = [high - low for low, high in map(self.extremes, light)]
        self.size: Array = np.sqrt(sum(span * span for span in spans))
        """How far apart a tile's places are, radians, shape (rows, columns)."""
        self.nearest, self.farthest = self.extremes(self.away)
        """How near to the hole's direction, and how far from it, the places come, radians."""
        self.between: Array | float = self.size / self._looks if view.is_panorama else 0.0
        """By how much what lies between the places may come nearer, or farther."""

    def extremes(self, values: Array) -> tuple[Array, Array]:
        """Return the smallest and largest value in each tile, shape (rows, columns), from values at the places."""
        grid, looks = values.reshape(self._shape), self._looks
        rows, columns = grid.shape[0] - looks, grid.shape[1] - looks
        shifts = [(down, right) for down in range(looks + 1) for right in range(looks + 1)]
        views = [grid[down : down + rows : looks, right : right + columns : looks] for down, right in shifts]
        return functools.reduce(np.minimum, views), functools.reduce(np.maximum, views)


class RingPainting:
    """Which pixels see the band that is in a table."""

    def __init__(self, survey: TileSurvey, table: RingTable) -> None:
        self._view, self._table = survey.view, table
        self._width, self._height = survey.width, survey.height
        (inner, _, outer, _), _ = table.band(survey.angle)
        first, _ = survey.extremes(inner)
        _, last = survey.extremes(outer)
        least, most = survey.extremes(survey.away - inner)
        around = survey.nearest < BESIDE_HOLE * survey.size
        slack = np.where(around, survey.size, BULGE * (most - least))
        self._nearest = np.where(around, inner.min(), first) - slack
        self._farthest = np.where(around, outer.max(), last) + slack
        self.touched: Mask = survey.farthest + survey.between > self._nearest
        self.touched &= survey.nearest - survey.between < self._farthest
        """Which of the smallest tiles the band may touch, shape (rows, columns)."""

    def tiles(self) -> Tiles:
        """Return the smallest tiles that the band may touch."""
        return tiles_of(self._width, self._height, TILE_SIDES[-1]).select(self.touched.ravel())

    def pixels(self, tiles: Tiles) -> tuple[list[RingPixels], Index, Index]:
        """Return the pixels of one or more of the smallest tiles that see the band, those that are wholly covered and
        others, and columns and rows of those that are not known."""
        groups = [
            self._pixels(tiles.select(np.arange(start, min(start + GROUP, len(tiles)))))
            for start in range(0, len(tiles), GROUP)
        ]
        whole, partly, columns, rows = zip(*groups, strict=True)
        found = [
            RingPixels(*(np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)))
            for parts in (whole, partly)
        ]
        return found, np.concatenate(columns), np.concatenate(rows)

    def _pixels(self, tiles: Tiles) -> tuple[RingPixels, RingPixels, Index, Index]:
        wide = tiles.side + 2  # a pixel more on each side, for slopes
        steps = np.arange(-1, tiles.side + 1) + 0.5
        x, y = np.broadcast_arrays(tiles.column[:, None, None] + steps, tiles.row[:, None, None] + steps[:, None])
        light, *momenta = self._view.light_and_momenta(x.ravel(), y.ravel())
        away, angle = position_angles(light)
        place = tiles.row // tiles.side, tiles.column // tiles.side
        nearest, farthest = (each[place][:, None, None] for each in (self._nearest, self._farthest))
        own = away.reshape(x.shape)[OWN]
        near = np.zeros(x.shape, dtype=bool)
        near[OWN] = (own > nearest) & (own < farthest) & (x[OWN] < self._width) & (y[OWN] < self._height)
        here = np.flatnonzero(near)
        tile, row, column = np.unravel_index(here, x.shape)
        columns, rows = tiles.column[tile] + column - 1, tiles.row[tile] + row - 1
        (inner, inner_slope, outer, outer_slope), known = self._table.band(angle.take(here))
        gone = [0.5 * (away.take(here + step) - away.take(here - step)) for step in (1, wide)]
        turned = [0.5 * nearest_turn(angle.take(here + step) - angle.take(here - step)) for step in (1, wide)]
        away, angle, energy, momentum = (each.take(here) for each in (away, angle, *momenta))
        # How the distance from each rim changes from pixel to pixel.
        inner_steps, outer_steps = (
            [slope * turn - step for turn, step in zip(turned, gone, strict=True)]
            for slope in (inner_slope, outer_slope)
        )
        share = share_above(outer - away, *outer_steps) - share_above(inner - away, *inner_steps)
        share[~known] = 0.0
        whole = np.flatnonzero(share > 1.0 - LEAST_COVERAGE)
        partly = np.flatnonzero((share > LEAST_COVERAGE) & (share <= 1.0 - LEAST_COVERAGE))
        half = 0.5 * np.hypot(*(each.take(partly) for each in outer_steps))
        middle, inner, outer = (each.take(partly) for each in (away, inner, outer))
        low, high = (np.clip(middle + each, inner, outer) for each in (-half, half))
        places = low + PLACES[:, None] * (high - low)
        share[whole] = 1.0

        def seen(pixels: Index, away: Array) -> RingPixels:
            place = columns[pixels], rows[pixels], share[pixels]
            return RingPixels(*place, away, *(each.take(pixels) for each in (angle, energy, momentum)))

        return seen(whole, away[None, whole]), seen(partly, places), columns[~known], rows[~known]
