# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid of a table around the shadow's edge: where its nodes are, and what is between them.

See `ring_table` for the coordinates. Their scale and range are found from a few scouts, and change smoothly around the
hole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..numerics.arrays import Array

# The step of asinh(delta / w).
STEP = 0.25

# Position angles at which the scale is looked for, and distances from the edge there: shares of its own distance from
# the hole's direction, from the largest to the smallest.
SCALE_ANGLES = 16
SHARES = np.geomspace(1.0, 1e-9, 28)

# Of what is found there, waves up to this are kept: steps between the distances make the others.
MOST_WAVES = 5

# A table holds the image and so much of asinh(delta / w) on both sides.
BAND_MARGIN = 1.5

# u changes by this share of 1 / r at the inner rim over the scale.
SCALE_CHANGE = 0.3


@dataclass(frozen=True)
class Needs:
    """What a picture of a disk asks of its tables."""

    inner: float
    outer: float
    tolerance: float
    """Of tracing, radians."""
    pixel: float
    """The angle between neighboring pixels in the middle of the picture, radians."""
    pixel_error: float
    """Share of the change from pixel to pixel that interpolation may be wrong by."""
    place_error: float
    """Error of place, relative to the radius, and of azimuth, radians, that is small in any case."""


@dataclass(frozen=True)
class Grid:
    """A grid around the shadow's edge, at equal steps of position angle: delta = scale sinh(low + step j)."""

    edge: Array
    """Shape (angles,), as are the next three."""
    scale: Array
    low: Array
    step: Array
    columns: int

    @property
    def stretched(self) -> Array:
        """asinh(delta / scale), shape (angles, columns)."""
        return self.low[:, None] + self.step[:, None] * np.arange(self.columns)

    @property
    def away(self) -> Array:
        """Angles from the hole's direction, shape (angles, columns)."""
        return self.edge[:, None] + self.delta

    @property
    def delta(self) -> Array:
        """Distances from the edge, shape (angles, columns)."""
        delta: Array = self.scale[:, None] * np.sinh(self.stretched)
        return delta


@dataclass(frozen=True)
class Draft:
    """What coordinates are made of, at `SCALE_ANGLES` position angles, shape (angles,)."""

    scale: Array
    low: Array
    """Of asinh(delta / w)."""
    high: Array

    @classmethod
    def of(cls, u: Array, distances: Array, edge: Array, needs: Needs) -> Draft:
        """Return what is found from u at distances from the edge, shape (angles, distances)."""
        scale = _scale(u, edge, needs)
        stretched = np.arcsinh(distances / scale[:, None])
        band = _band(u, stretched, needs)
        if band is None:
            return cls(scale, stretched[:, 0], stretched[:, -1])
        return cls(scale, band[0] - BAND_MARGIN, band[1] + BAND_MARGIN)

    def grid(self, edge: Array, columns: int | None = None) -> Grid:
        """Return the grid at more position angles, where the edge is given, in steps of `STEP` unless told else."""
        columns = columns or math.ceil((self.high - self.low).max() / STEP) + 1
        low, high, scale = (_waves(each, len(edge)) for each in (self.low, self.high, np.log(self.scale)))
        return Grid(edge, np.exp(scale), low, (high - low) / (columns - 1), columns)


def _band(u: Array, stretched: Array, needs: Needs) -> tuple[Array, Array] | None:
    """Return where the disk's inner and outer rim are in asinh(delta / w), shape (angles,), from u at such places,
    shape (angles, distances); None where the image does not end."""
    # A ray that is not known deep inside the shadow is of no disk.
    u = np.where(np.isnan(u) & (stretched < 0.0), np.inf, u)
    found = []
    for level in (1.0 / needs.inner, 1.0 / needs.outer):
        with np.errstate(invalid="ignore"):
            above = u >= level
        last = above.sum(axis=1) - 1
        once = (above == (np.arange(u.shape[1]) <= last[:, None])).all()
        if not once or last.min() < 0 or last.max() > u.shape[1] - 2:
            return None
        here, there, high, low = (
            np.take_along_axis(each, (last + i)[:, None], axis=1)[:, 0] for each in (stretched, u) for i in (0, 1)
        )
        found.append(here + (there - here) * (high - level) / (high - low))
    if not np.isfinite(found).all():
        return None
    return found[0], found[1]


def _scale(u: Array, edge: Array, needs: Needs) -> Array:
    """Return w for a few position angles from u at distances from the edge, the farthest first and last."""
    half = len(SHARES)
    inside, outside = u[:, :half][:, ::-1], u[:, half:]  # from the edge away
    change = np.fmax(np.abs(inside - inside[:, :1]), np.abs(outside - outside[:, :1]))
    changed = np.fmax.accumulate(change, axis=1) > SCALE_CHANGE / needs.inner
    changed[:, -1] = True  # where nothing crowds, the largest will do
    scale: Array = SHARES[::-1][changed.argmax(axis=1)] * edge
    return scale


def _waves(values: Array, angles: int) -> Array:
    """Return a coordinate's parameter at more position angles, by few waves: smooth, as it has to be."""
    waves = np.fft.rfft(values)
    waves[MOST_WAVES:] = 0.0
    smooth: Array = np.fft.irfft(waves, angles) * (angles / len(values))
    return smooth


def continuous(azimuth: Array) -> tuple[Array, float, float]:
    """Return azimuths, shape (angles, columns), continuous round the hole; what was added beyond position angle pi; and
    what they grow by once round.

    At position angles 0 and pi b changes sign, and the turns are counted the other way: rows there may be of either.
    """
    half = len(azimuth) // 2

    def turns(jumps: Array) -> float:
        known = np.sort(jumps[np.isfinite(jumps)])
        return 2.0 * math.pi * round(known[len(known) // 2] / (2.0 * math.pi)) if len(known) else 0.0

    def jump(before: int, after: int) -> float:
        """Return the turns from one row to the one after the next."""
        smooth = azimuth[before] - azimuth[before - 1] + azimuth[after + 1] - azimuth[after]
        return turns(azimuth[after] - azimuth[before] - smooth)

    beyond = -jump(half - 1, half + 1)
    once_round = beyond - jump(-1, 1)
    azimuth = azimuth.copy()
    azimuth[half + 1 :] += beyond
    azimuth[half] += turns(0.5 * (azimuth[half - 1] + azimuth[half + 1]) - azimuth[half])
    azimuth[0] += turns(0.5 * (azimuth[1] + azimuth[-1] - once_round) - azimuth[0])
    return azimuth, beyond, once_round


def between(values: Array) -> Array:
    """Return u, azimuth and du / dlambda, shape (3, angles, columns), with those half way to the next position angle
    and half way between columns, by cubics, shape (3, 2 angles, 2 columns - 1)."""
    _, angles, columns = values.shape
    azimuth, beyond, once_round = continuous(values[1])
    finer = np.empty((3, 2 * angles, 2 * columns - 1))
    finer[:, ::2, ::2] = values[0], azimuth, values[2]
    around = finer[:, 2 * (np.arange(-1, angles + 2) % angles), ::2]
    around[1, :1] -= once_round
    around[1, -2:] += once_round
    finer[:, 1::2, ::2] = _halfway(around, 1)[:, 1:-1]
    finer[:, :, 1::2] = _halfway(finer[:, :, ::2], 2)
    finer[1, angles + 1 :] -= beyond
    return finer


def _halfway(values: Array, axis: int) -> Array:
    """Return what is half way between neighbors along an axis, by cubics through four of them."""
    values = np.moveaxis(values, axis, 0)
    middle = 9.0 * (values[1:-2] + values[2:-1]) - (values[:-3] + values[3:])
    ends = [5.0 * one + 15.0 * two - 5.0 * three + four for one, two, three, four in (values[:4], values[:-5:-1])]
    halfway: Array = np.moveaxis(np.concatenate([ends[0][None], middle, ends[1][None]]), 0, axis) / 16.0
    return halfway
