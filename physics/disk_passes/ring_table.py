# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk's second and later images as tables around the shadow's edge.

These images crowd next to the critical curve: seen from there, the k-th crossing of the plane depends on the distance
delta from the edge at a scale w_k that shrinks with every half turn by the same factor (Luminet 1979, Astron.
Astrophys. 75, 228; Gralla & Lupsasca 2020, Phys. Rev. D 101, 044031, call it the demagnification exponent), nearly in
proportion to delta inside of that scale and to its logarithm outside. Where a ray crosses is smooth across the edge
itself, so s = asinh(delta / w_k), brought to the same range at all position angles psi about the hole's direction, and
psi are coordinates in which one regular grid resolves all of the image at once, sky side and shadow side alike.

Lagrange's interpolation among 4 x 4 of its points answers where the differences that it leaves out are small against
what a pixel spans; elsewhere the table has no answer, which `ring_tracing` makes a finer grid for if it is too much of
the disk, and then rays are traced. Of an image that is a band around the shadow the table also knows the rims, as
curves over psi.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..numerics.angles import circle_steps
from ..numerics.arrays import Array, Index, Mask
from ..numerics.interpolation import CUBIC_ERROR, CUBIC_POINTS, lagrange_weights
from .ring_grid import Grid, Needs, continuous

Pairs = NDArray[np.complex128]
"""Two numbers as one, to be looked up together."""

# The column that begins the first cell: its neighbors serve it, and the first of all tells the errors alone.
FIRST_CELL = 2

# Where a band's rims are not well known at this share of the position angles, it is no band.
ENOUGH_ROWS = 0.75

# Rounds of Newton's method that find a rim between two columns, where it is nearly straight.
RIM_ROUNDS = 4

# A node so far off the disk, in units of how uncertain it is, need not be known if its neighbors are off as well.
OFF_MARGIN = 4.0


class RingTable:
    """Where rays around the shadow's edge cross the plane for the k-th time, for one camera's place."""

    def __init__(self, coordinates: Grid, values: Array, needs: Needs) -> None:
        """`values`: u, unwound azimuth and du / dlambda, shape (3, angles, columns)."""
        self._angles = len(coordinates.edge)
        azimuth, self._beyond, once_round = continuous(values[1])
        channels, good, placed = _served((values[0], azimuth, values[2]), once_round, coordinates, needs)
        self._columns = int(good.shape[1])
        around = np.arange(CUBIC_POINTS[0], self._angles + CUBIC_POINTS[-1]) % self._angles
        # The outermost columns served to tell the errors alone.
        grid = (coordinates.edge, coordinates.scale, coordinates.low + coordinates.step, coordinates.step)
        self._grid = _pairs([each[around] for each in grid])
        self._channels = _pairs(channels)
        self._rims = 1.0 / needs.outer, 1.0 / needs.inner
        u = values[0][around, 1:-1]
        on_disk = (u > self._rims[0]) & (u < self._rims[1])
        self.answered = float(good[on_disk].mean()) if on_disk.any() else 1.0
        """The share of the table's places on the disk that it answers for."""
        self._open = ~_cells(~on_disk | good)
        self._good = _cells(good).ravel()
        placed = placed[-CUBIC_POINTS[0] :][: self._angles]
        rims = [_Rim.of(values[0][:, 1:-1], placed, level, grid, needs) for level in self._rims]
        known = rims[0].known & rims[1].known
        self._band = _pairs([rim.away[around] for rim in reversed(rims)])
        self._band_known = _cells(known[around])
        # Rays at the ends that are not known are of no disk.
        ends_inside = not (u[:, :2] < self._rims[1]).any()
        ends_outside = not (u[:, -2:] >= self._rims[0]).any()
        within = ends_inside and ends_outside
        self.confined = bool(within and np.isfinite(self._band).all() and known.mean() > ENOUGH_ROWS)
        """Whether all of the image is in the table: it is a band around the shadow."""

    def left(self) -> Mask:
        """Return which places of a grid twice as fine, shape (2 angles, 2 columns - 1), have to be known for all of the
        disk to be, and are not yet."""
        wanted = np.zeros((2 * self._angles, 2 * self._columns + 3), dtype=bool)
        row, column = np.nonzero(self._open)
        for down in range(3):
            for right in range(3):
                wanted[(2 * row + down) % len(wanted), 2 * (column + FIRST_CELL) + right] = True
        wanted[::2, ::2] = False
        return wanted

    def places(self, away: Array, angle: Array, channels: int) -> Array:
        """Return the first few channels at `position_angles`, shape (channels, n).

        u is NaN where there is no answer, and infinite beyond the ends of an image that is `confined`.
        """
        row, across, (edge, scale, low, step) = self._around(angle, self._grid)
        place: Array = (np.arcsinh((away - edge) / scale) - low) / step + CUBIC_POINTS[0]
        before = place < 0.0
        inside = ~before & (place < self._columns - len(CUBIC_POINTS) + 1.0)
        place = np.where(inside, place, 0.0)
        column = place.astype(np.intp)
        part = place - column
        along = lagrange_weights(part, CUBIC_POINTS)
        pairs = self._channels[: (channels + 1) // 2]
        sums: list[Pairs] = [np.zeros(len(away), complex) for _ in pairs]
        for i, weight in enumerate(across):
            first = (row + i) * self._columns + column
            for total, values in zip(sums, pairs, strict=True):
                partial = along[0] * values.take(first)
                for j in range(1, len(along)):
                    partial += along[j] * values.take(first + j)
                partial *= weight
                total += partial
        result = np.stack(_unpaired(sums)[:channels])
        unknown = ~self._good.take(row * (self._columns - len(CUBIC_POINTS) + 1) + column)
        unknown &= (result[0] >= self._rims[0]) & (result[0] <= self._rims[1])
        result[0, unknown] = np.nan
        if self._beyond:
            result[1] -= self._beyond * (angle > math.pi)
        result[0, ~inside] = np.where(before[~inside], np.inf, -np.inf) if self.confined else np.nan
        return result

    @property
    def extent(self) -> tuple[float, float]:
        """How near to the hole's direction and how far from it the rims of a `confined` image are, radians."""
        inner, outer = _unpaired(self._band)
        return float(inner.min()), float(outer.max())

    def band(self, angle: Array) -> tuple[list[Array], Mask]:
        """Return at position angles how far the disk's inner rim and its outer rim are from the hole's direction,
        radians, and whether they are well known; for an image that is `confined`."""
        row, _, found = self._around(angle, self._band)
        return found, self._band_known.take(row)

    def _around(self, angle: Array, rows: list[Pairs]) -> tuple[Index, list[Array], list[Array]]:
        """Return the first rows and the weights that interpolate between them, and interpolated values of rows."""
        row, part = circle_steps(angle, self._angles)
        across = lagrange_weights(part, CUBIC_POINTS)
        sums: list[Pairs] = [np.zeros(len(angle), complex) for _ in rows]
        for i, weight in enumerate(across):
            index = row + i
            for total, each in zip(sums, rows, strict=True):
                total += weight * each.take(index)
        return row, across, _unpaired(sums)


def _cells(good: Mask) -> Mask:
    """Return which cells have all of the nodes good that they are interpolated among, along every axis."""
    for axis, size in enumerate(good.shape):
        last = size - len(CUBIC_POINTS) + 1
        good = np.logical_and.reduce(
            [good[(slice(None),) * axis + (slice(i, last + i),)] for i in range(len(CUBIC_POINTS))]
        )
    return good


def _pairs(values: Sequence[Array]) -> list[Pairs]:
    """Return any arrays of one shape two by two, raveled: looking up both at once is quicker."""
    even, odd = values[::2], [*values[1::2], *([np.zeros_like(values[0])] * (len(values) % 2))]
    return [(one + 1j * other).ravel() for one, other in zip(even, odd, strict=True)]


def _unpaired(pairs: Sequence[Pairs]) -> list[Array]:
    return [part for each in pairs for part in (each.real, each.imag)]


@dataclass(frozen=True)
class _Rim:
    """One rim of a band at each of a table's position angles, shape (angles,)."""

    away: Array
    """Angle from the hole's direction, radians; NaN where there is no such rim."""
    known: Mask
    """Whether it is known to a small part of a pixel between the position angles, too."""

    @classmethod
    def of(cls, u: Array, placed: Mask, level: float, grid: Sequence[Array], needs: Needs) -> _Rim:
        """Return where u, shape (angles, columns), falls to a level; `placed`: where it is well known; `grid`: edge,
        scale, and asinh(delta / scale) in the first column and its step."""
        edge, scale, low, step = grid
        column, first = _falls_to(u, level)
        away = edge + scale * np.sinh(low + step * column)
        wide = np.arange(-2, len(away) + 2) % len(away)
        with np.errstate(invalid="ignore"):
            known = CUBIC_ERROR * np.abs(np.diff(away[wide], 4)) < needs.pixel_error * needs.pixel  # NaN: False
        nodes = first[:, None] + np.array(CUBIC_POINTS)
        return cls(away, known & np.take_along_axis(placed, nodes, axis=1).all(axis=1))


def _falls_to(u: Array, level: float) -> tuple[Array, Index]:
    """Return in which column u, shape (angles, columns), falls to a level for good, NaN where that is not known; and
    the last whole one before, at which cubics through `CUBIC_POINTS` are possible."""
    columns = u.shape[1]
    with np.errstate(invalid="ignore"):
        above = u >= level
    last = columns - 1 - np.argmax(above[:, ::-1], axis=1)
    first = np.clip(last, -CUBIC_POINTS[0], columns - 1 - CUBIC_POINTS[-1])
    nodes = np.take_along_axis(u, first[:, None] + np.array(CUBIC_POINTS), axis=1)
    # Newton's method on the cubic, from the straight line between the middle two
    before, here, after, last_one = nodes.T
    slope = after - before / 3.0 - 0.5 * here - last_one / 6.0
    square = 0.5 * (before + after) - here
    cube = 0.5 * (here - after) + (last_one - before) / 6.0
    with np.errstate(all="ignore"):  # unknown nodes
        part = (level - here) / (after - here)
        for _ in range(RIM_ROUNDS):
            off = here + part * (slope + part * (square + part * cube)) - level
            part = np.clip(part - off / (slope + part * (2.0 * square + 3.0 * part * cube)), 0.0, 1.0)
    found = above.any(axis=1) & (first == last) & np.isfinite(nodes).all(axis=1)
    return np.where(found, first + part, np.nan), first


def _continue_inwards(values: Array, inside: Mask) -> None:
    """Replace values of shape (angles, columns) beyond the inner rim, where rays end at the horizon and are not smooth
    for long, by cubics through those next to it on the disk."""
    columns = values.shape[1]
    last = columns - 1 - np.argmax(inside[:, ::-1], axis=1)
    rows = np.flatnonzero(inside.any(axis=1) & (last < columns - 4))
    for depth in range(4):
        column = last[rows] - depth
        here = column >= 0
        row, column = rows[here], column[here]
        values[row, column] = sum(
            weight * values[row, column + i] for i, weight in enumerate((4.0, -6.0, 4.0, -1.0), start=1)
        )


def _left_out(values: Array, axis: int) -> Array:
    """Return what cubics through neighbors along an axis leave out at the most, from the nearest fourth difference."""
    differences = np.abs(np.diff(values, 4, axis=axis))
    nearest = np.clip(np.arange(values.shape[axis]) - 2, 0, differences.shape[axis] - 1)
    left_out: Array = CUBIC_ERROR * differences.take(nearest, axis=axis)
    return left_out


def _served(
    values: tuple[Array, Array, Array], once_round: float, grid: Grid, needs: Needs
) -> tuple[list[Array], Mask, Mask]:
    """Return the channels for `RingTable`, NaN where nothing is known well enough, where all of them are, and where u
    is; for `once_round` see `_continuous`."""
    u, azimuth, slope = values
    angles = len(u)
    azimuth = np.nan_to_num(azimuth)  # rays that never cross: their u is not known either
    around = np.arange(-2, angles + 3)
    u, slope = u[around % angles], slope[around % angles]
    azimuth = azimuth[around % angles] + (around // angles)[:, None] * once_round
    for each in (azimuth, slope):
        _continue_inwards(each, u >= 1.0 / needs.inner)
    off = np.maximum(1.0 / needs.outer - u, u - 1.0 / needs.inner)
    wide = around % angles
    away = grid.edge[wide, None] + grid.delta[wide]
    # How far a pixel reaches in units of the grid's steps, either way.
    along = needs.pixel / (grid.step[wide, None] * np.hypot(grid.scale[wide, None], grid.delta[wide]))
    across = needs.pixel * angles / (2.0 * math.pi * np.maximum(np.sin(away), needs.pixel))
    # What the coordinates lose between angles, in columns.
    lost_edge, lost_scale, lost_low, lost_step = (
        CUBIC_ERROR * np.abs(np.diff(each[np.arange(-4, angles + 5) % angles], 4))[:, None]
        for each in (grid.edge, grid.scale, grid.low, grid.step)
    )
    stray = along / needs.pixel * (lost_edge + lost_scale * np.abs(np.sinh(grid.stretched[wide])))
    stray += (lost_low + lost_step * np.arange(grid.columns)) / grid.step[wide, None]
    good = np.ones(u.shape, dtype=bool)
    for each, small in ((u, needs.place_error / needs.outer), (azimuth, needs.place_error)):
        error = np.maximum(*(_left_out(each, axis) for axis in (0, 1)))
        change = np.gradient(each, axis=1), np.gradient(each, axis=0)
        error += stray * np.abs(change[0])
        good = good & (error < np.maximum(needs.pixel_error * np.hypot(change[0] * along, change[1] * across), small))
        if each is u:
            placed = good
            # Off the disk, and so are all places around.
            far = off > OFF_MARGIN * error + 2.0 * (np.abs(change[0]) + np.abs(change[1]))
    # Next to rays that never cross there is nothing to count turns from.
    for view, torn in ((good, np.diff(azimuth, axis=0)), (good.T, np.diff(azimuth, axis=1).T)):
        whole = np.abs(torn) <= math.pi
        view[1:] &= whole
        view[:-1] &= whole
    known = good | far
    channels = [np.where(known, each, np.nan)[1:-1, 1:-1] for each in (u, azimuth, slope)]
    return channels, good[1:-1, 1:-1], placed[1:-1, 1:-1]
