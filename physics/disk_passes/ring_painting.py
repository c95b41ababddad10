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
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from ..kerr.critical_curve import position_angles
from ..numerics.angles import wrap_symmetric
from ..numerics.arrays import Array, Index, Mask
from ..sampling.tiles import TILE_SIDES, Tiles, chebyshev_places, tiles_of, to_coefficients
from ..sampling.view import View
from .annulus import LEAST_COVERAGE, share_above
from .ring_table import RingTable

# Gauss's places and weights across the part of the band in a pixel, in units of its width.
_PLACES, _WEIGHTS = leggauss(3)
PLACES, WEIGHTS = 0.5 * (1.0 + _PLACES), 0.5 * _WEIGHTS

# Steps along a tile's side to the places that tell whether the band touches it; more in a panorama, where a tile may
# hold a pole. Between them a rim bulges by less than this share of what its distances from them differ by, if they are
# farther from the hole's direction than this many times what they are from each other.
LOOKS, LOOKS_IN_PANORAMA = 1, 4
BULGE, BESIDE_HOLE = 0.25, 2.0

# Tiles so many times the largest's size from the band do not touch it, whatever its position angle.
BEYOND = 2.0

# Points along each side of a tile that say where its pixels are, if the highest coefficients of a polynomial through
# them are below this share of the tile's size.
NODES, SMOOTH = 5, 3e-4

# Tiles worked through at a time: their pixels stay in the cache.
GROUP = 64

# Pixels that a table is asked for at a time, for the same reason.
BLOCK = 8192

# What of tiles with a pixel more on each side is the tiles.
OWN = (..., slice(1, -1), slice(1, -1))

TURN = 2.0 * math.pi


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
        self._survey, self._table = survey, table
        self._width, self._height = survey.width, survey.height
        nearest, farthest = table.extent
        reach = BEYOND * float(survey.size.max())
        beside = (survey.away > nearest - reach) & (survey.away < farthest + reach)
        close = np.flatnonzero(beside)
        inner, outer = np.zeros((2, len(survey.away)))
        (inner[close], outer[close]), _ = table.band(survey.angle[close])
        first, _ = survey.extremes(inner)
        _, last = survey.extremes(outer)
        least, most = survey.extremes(survey.away - inner)
        around = survey.nearest < BESIDE_HOLE * survey.size
        slack = np.where(around, survey.size, BULGE * (most - least))
        self._nearest = np.where(around, nearest, first) - slack
        self._farthest = np.where(around, farthest, last) + slack
        self.touched: Mask = survey.farthest + survey.between > self._nearest
        self.touched &= survey.nearest - survey.between < self._farthest
        self.touched &= survey.extremes(beside.astype(np.float64))[0] > 0.0
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
        values, known = self._at_pixels(tiles)
        steps = [_steps(each) for each in values[:2]]
        from_inner, from_outer, away, angle, energy, momentum = values[OWN]
        columns, rows = tiles.pixels()
        inner_reach, outer_reach = (0.5 * (np.abs(right) + np.abs(down)) for right, down in steps)
        near = (from_inner > -inner_reach) & (from_outer < outer_reach)
        if not known.all():  # there the rims may be anywhere in the tile's part of the band
            place = tiles.row // tiles.side, tiles.column // tiles.side
            nearest, farthest = (each[place][:, None, None] for each in (self._nearest, self._farthest))
            near = np.where(known, near, (away > nearest) & (away < farthest))
        near &= (columns < self._width) & (rows < self._height)
        here = np.nonzero(near)
        columns, rows = tiles.column[here[0]] + here[2], tiles.row[here[0]] + here[1]
        from_inner, from_outer, known = from_inner[here], from_outer[here], known[here]
        inner_steps, outer_steps = ([each[here] for each in both] for both in steps)
        share = share_above(from_inner, *inner_steps) - share_above(from_outer, *outer_steps)
        share[~known] = 0.0
        share[share > 1.0 - LEAST_COVERAGE] = 1.0
        whole = np.flatnonzero(share == 1.0)
        partly = np.flatnonzero((share > LEAST_COVERAGE) & (share < 1.0))
        half = 0.5 * np.hypot(*(each[partly] for each in outer_steps))
        low, high = (np.clip(each, -from_inner[partly], -from_outer[partly]) for each in (-half, half))

        def seen(pixels: Index, off: Array) -> RingPixels:
            place = tuple(each[pixels] for each in here)
            turned = angle[place] - TURN * np.floor(angle[place] / TURN)
            light = turned, energy[place], momentum[place]
            return RingPixels(columns[pixels], rows[pixels], share[pixels], away[place] + off, *light)

        found = seen(whole, np.zeros((1, len(whole)))), seen(partly, low + PLACES[:, None] * (high - low))
        return *found, columns[~known], rows[~known]

    def _at_pixels(self, tiles: Tiles) -> tuple[Array, Mask]:
        """Return what `_sampled` does at the pixels of tiles and at one more on each side, shape (6, n, side + 2,
        side + 2), and at which of their own the rims are well known, shape (n, side, side).

        Nearly everywhere a polynomial through a few places says that to a hundredth of a pixel, and sooner.
        """
        wide = tiles.side + 2
        sampled, known = self._sampled(tiles, chebyshev_places(NODES) * (wide - 1) - 0.5)
        sampled[3] = sampled[3, :, :1, :1] + wrap_symmetric(sampled[3] - sampled[3, :, :1, :1])
        highest = to_coefficients(NODES)[-1]
        tail = np.maximum(np.abs(sampled[:4] @ highest), np.abs(sampled[:4].swapaxes(2, 3) @ highest)).max(axis=2)
        tail[3] *= sampled[2].max(axis=(1, 2))
        size = self._survey.size[tiles.row // tiles.side, tiles.column // tiles.side]
        smooth = known.all(axis=(1, 2)) & (tail < SMOOTH * size).all(axis=0)
        values = _interpolated(sampled, wide)
        well_known = np.ones((len(tiles), tiles.side, tiles.side), dtype=bool)
        if not smooth.all():
            values[:, ~smooth], known = self._sampled(tiles.select(~smooth), np.arange(wide, dtype=np.float64) - 0.5)
            well_known[~smooth] = known[OWN]
        return values, well_known

    def _sampled(self, tiles: Tiles, steps: Array) -> tuple[Array, Mask]:
        """Return at places so many pixels from the left and top of tiles, shape (6, n, k, k): how much farther from the
        hole's direction they are than the disk's inner rim and than its outer rim, the angle from that direction and
        the position angle, and the light's energy and angular momentum; and whether the rims are well known there."""
        x, y = np.broadcast_arrays(tiles.column[:, None, None] + steps, tiles.row[:, None, None] + steps[:, None])
        light, *momenta = self._survey.view.light_and_momenta(x.ravel(), y.ravel())
        away, angle = position_angles(light)
        (inner, outer), known = self._table.band(angle)
        values = np.stack([away - inner, away - outer, away, angle, *momenta]).reshape(6, *x.shape)
        return values, known.reshape(x.shape)


def _interpolated(values: Array, wide: int) -> Array:
    """Return values at equal steps from end to end, shape (..., wide, wide), from those at `NODES` x `NODES` Chebyshev
    points: in two matrix products, as many small ones take longer."""
    to_pixels = _to_equal_steps(wide).T
    for _ in (0, 1):
        values = values.swapaxes(2, 3)
        values = (values.reshape(-1, NODES) @ to_pixels).reshape(*values.shape[:3], wide)
    return values


@functools.cache
def _to_equal_steps(count: int) -> Array:
    """Return the matrix from values at `NODES` Chebyshev points to such at equal steps from end to end."""
    place = np.linspace(-1.0, 1.0, count)
    polynomials: Array = np.cos(np.arange(NODES) * np.arccos(place)[:, None])
    return polynomials @ to_coefficients(NODES)


def _steps(values: Array) -> tuple[Array, Array]:
    """Return the changes from pixel to pixel, along the rows and down, of values with a pixel more on each side."""
    right = 0.5 * (values[:, 1:-1, 2:] - values[:, 1:-1, :-2])
    down = 0.5 * (values[:, 2:, 1:-1] - values[:, :-2, 1:-1])
    return right, down
