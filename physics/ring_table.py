# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk's second and later images as tables around the shadow's edge.

These images crowd next to the critical curve: seen from there, the k-th crossing of the plane depends on the distance
delta from the edge at a scale w_k that shrinks with every half turn by the same factor (Luminet 1979, Astron.
Astrophys. 75, 228; Gralla & Lupsasca 2020, Phys. Rev. D 101, 044031, call it the demagnification exponent), nearly in
proportion to delta inside of that scale and to its logarithm outside. Where a ray crosses is smooth across the edge
itself, so s = asinh(delta / w_k), brought to the same range at all position angles psi about the hole's direction, and
psi are coordinates in which one regular grid resolves all of the image at once, sky side and shadow side alike.

Lagrange's interpolation among 4 x 4 of its points answers where the differences that it leaves out are small against
what a pixel spans; elsewhere the table has no answer, and rays are traced.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .crossings import cross_plane
from .observer import Observer
from .rays import Array, rays_from_triad
from .sky_table import AROUND, AROUND_ERROR, angle_steps, lagrange_weights
from .sphere import cos_sin
from .trapped import around_hole, edge_angles

Mask = NDArray[np.bool_]

# The step of asinh(delta / w), and the fewest and most position angles of the grid.
STEP = 0.25
ANGLES = (96, 512)
# How far from the edge the tables reach, inside and outside, as shares of its distance from the hole's direction.
REACH = (0.7, 1.5)
# Error of the edge, in pixels.
EDGE_ERROR = 1e-3

# Position angles at which the scale is looked for, and distances from the edge there: shares of its own distance from
# the hole's direction, from the largest to the smallest.
SCALE_ANGLES = 16
SHARES = REACH[0] * np.geomspace(1.0, 1e-9, 28)

# Of what is found there, waves up to this are kept: steps between the distances make the others.
MOST_WAVES = 5

# u changes by this share of 1 / r at the inner rim over the scale.
SCALE_CHANGE = 0.3

# A node so far off the disk, in units of how uncertain it is, need not be known if its neighbours are off as well.
OFF_MARGIN = 4.0


@dataclass(frozen=True)
class Needs:
    """What a picture of a disk asks of its tables."""

    inner: float
    outer: float
    tolerance: float
    """Of tracing, radians."""
    pixel: float
    """The angle between neighbouring pixels in the middle of the picture, radians."""
    pixel_error: float
    """Share of the change from pixel to pixel that interpolation may be wrong by."""
    place_error: float
    """Error of place, relative to the radius, and of azimuth, radians, that is small in any case."""


@dataclass(frozen=True)
class _Coordinates:
    """A grid around the shadow's edge, at equal steps of position angle: delta = scale sinh(range s)."""

    edge: Array
    """Shape (angles,), as are the next two."""
    scale: Array
    range: Array
    s: Array
    """Up to 1 in equal steps, shape (columns,)."""

    @property
    def delta(self) -> Array:
        """Distances from the edge, shape (angles, columns)."""
        delta: Array = self.scale[:, None] * np.sinh(self.range[:, None] * self.s)
        return delta


class RingTable:
    """Where rays around the shadow's edge cross the plane for the k-th time, for one camera's place."""

    def __init__(self, coordinates: _Coordinates, channels: list[Array], good: Mask, needs: Needs) -> None:
        """`channels`: u, unwound azimuth and du / dlambda, shape (angles + 3, columns), at all but the outermost s and
        at the angles from the one before the first to the second after the last; `good`: where all of them are known,
        elsewhere only that they are off the disk."""
        self._angles = len(coordinates.edge)
        around = np.arange(AROUND[0], self._angles + AROUND[-1]) % self._angles
        self._edge, self._scale = coordinates.edge[around], coordinates.scale[around]
        self._step = (coordinates.range * (coordinates.s[1] - coordinates.s[0]))[around]
        self._first = 2.0 + coordinates.s[0] / (coordinates.s[1] - coordinates.s[0])
        self._columns = int(channels[0].shape[1])
        self._channels = [np.ascontiguousarray(each).ravel() for each in channels]
        self._rims = 1.0 / needs.outer, 1.0 / needs.inner
        reach = len(AROUND)
        cells = np.lib.stride_tricks.sliding_window_view(good, (reach, reach))
        self._good = np.ascontiguousarray(cells.all(axis=(2, 3))).ravel()

    @property
    def rays(self) -> int:
        """How many rays it was made of, but for those that told the scale."""
        return self._angles * (self._columns + 2)

    def places(self, away: Array, angle: Array, channels: int) -> Array:
        """Return the first few channels at `position_angles`, shape (channels, n); NaN: no answer."""
        row, part = angle_steps(angle, self._angles)
        across = lagrange_weights(part, AROUND)
        edge, scale, step = (
            sum(weight * each.take(row + i) for i, weight in enumerate(across))
            for each in (self._edge, self._scale, self._step)
        )
        place: Array = np.arcsinh((away - edge) / scale) / step - self._first
        inside = (place >= 0.0) & (place < self._columns - len(AROUND) + 1.0)
        place = np.where(inside, place, 0.0)
        column = place.astype(np.intp)
        part = place - column
        along = lagrange_weights(part, AROUND)
        result = np.zeros((channels, len(away)))
        for i, weight in enumerate(across):
            first = (row + i) * self._columns + column
            for j, other in enumerate(along):
                both, index = weight * other, first + j
                for component, values in zip(result, self._channels[:channels], strict=True):
                    component += both * values.take(index)
        low, high = self._rims
        unknown = ~self._good.take(row * (self._columns - len(AROUND) + 1) + column)
        unknown &= (result[0] >= low) & (result[0] <= high)
        result[:, unknown | ~inside] = np.nan
        return result


def ring_tables(spin: float, observer: Observer, rays: dict[int, float], needs: Needs) -> dict[int, RingTable]:
    """Return tables of crossings by their order, counted from 0, each made of about as many rays as `rays` says.

    The observer's motion does not matter: the tables are of its FIDO's sky. It must be outside the ergosphere, where
    all rays have positive energy.
    """
    fido = Observer.fido(observer.r, observer.theta, observer.phi)

    def edge_at(angles: int) -> tuple[Array, Array, Array]:
        """Return the edge at so many position angles, and their cosines and sines."""
        aside, up = cos_sin(np.linspace(0.0, 2.0 * math.pi, angles, endpoint=False, dtype=np.float64))
        return edge_angles(spin, fido, aside, up, EDGE_ERROR * needs.pixel), aside, up

    def cross(away: Array, aside: Array, up: Array, wanted: list[int]) -> Array:
        """Return u, unwound azimuth and du / dlambda, shape (3, orders, angles, distances)."""
        looking = around_hole(away, aside[:, None], up[:, None]).reshape(-1, 3)
        light, count = rays_from_triad(spin, fido, looking), max(wanted) + 1
        asked = np.zeros((count, len(light)), dtype=bool)
        asked[wanted] = True
        found = cross_plane(light, count, needs.tolerance, beyond=True, wanted=asked)
        values = np.stack([found.u, found.unwound, found.u_slope])[:, wanted]
        return values.reshape(3, len(wanted), *away.shape)

    edge, aside, up = edge_at(SCALE_ANGLES)
    distances = np.concatenate([-SHARES, SHARES[::-1]]) * edge[:, None]
    scouted = cross(edge[:, None] + distances, aside, up, list(rays))[0]
    tables = {}
    for u, (order, wanted) in zip(scouted, rays.items(), strict=True):
        few = _scale(u, edge, needs)
        inside, outside = (np.arcsinh(each * edge / few) for each in REACH)
        columns = math.ceil((inside + outside).max() / STEP)
        angles = min(max(int(wanted / columns), ANGLES[0]), ANGLES[1]) // SCALE_ANGLES * SCALE_ANGLES
        here, aside, up = edge_at(angles)
        scale = _between(few, angles)
        s = 1.0 - np.arange(columns, dtype=np.float64)[::-1] * (STEP / outside.max())
        s = s[s > -(inside / outside).min()]
        grid = _Coordinates(here, scale, np.arcsinh(REACH[1] * here / scale), s)
        values = cross(here[:, None] + grid.delta, aside, up, [order])[:, 0]
        tables[order] = RingTable(grid, *_served(values, grid, needs), needs)
    return tables


def _scale(u: Array, edge: Array, needs: Needs) -> Array:
    """Return w for each of a few position angles from u at distances -SHARES and SHARES of the edge."""
    half = len(SHARES)
    inside, outside = u[:, :half][:, ::-1], u[:, half:]  # from the edge away
    change = np.fmax(np.abs(inside - inside[:, :1]), np.abs(outside - outside[:, :1]))
    changed = np.fmax.accumulate(change, axis=1) > SCALE_CHANGE / needs.inner
    changed[:, -1] = True  # where nothing crowds, the largest will do
    scale: Array = SHARES[::-1][changed.argmax(axis=1)] * edge
    return scale


def _between(scale: Array, angles: int) -> Array:
    """Return w at more position angles, by few waves: smooth, as a coordinate has to be."""
    waves = np.fft.rfft(np.log(scale))
    waves[MOST_WAVES:] = 0.0
    smooth: Array = np.exp(np.fft.irfft(waves, angles) * (angles / len(scale)))
    return smooth


def _served(values: Array, grid: _Coordinates, needs: Needs) -> tuple[list[Array], Mask]:
    """Return the channels for `RingTable`, NaN where nothing is known well enough, and where all of them are."""
    u, azimuth, slope = values
    angles = len(u)
    azimuth = np.nan_to_num(azimuth)  # rays that never cross: their u is not known either
    azimuth[0] = np.unwrap(azimuth[0])
    azimuth = np.unwrap(azimuth, axis=0)
    # Once round the hole the image may have turned as well.
    turn = 2.0 * math.pi * np.round((azimuth[-1] + (azimuth[-1] - azimuth[-2]) - azimuth[0]) / (2.0 * math.pi))
    around = np.arange(-2, angles + 3)
    u, slope = u[around % angles], slope[around % angles]
    azimuth = azimuth[around % angles] + (around // angles)[:, None] * turn
    off = np.maximum(1.0 / needs.outer - u, u - 1.0 / needs.inner)
    wide = around % angles
    away = grid.edge[wide, None] + grid.delta[wide]
    # How far a pixel reaches in units of the grid's steps, either way.
    step = grid.range * (grid.s[1] - grid.s[0])
    along = needs.pixel / (step[wide, None] * np.hypot(grid.scale[wide, None], grid.delta[wide]))
    across = needs.pixel * angles / (2.0 * math.pi * np.maximum(np.sin(away), needs.pixel))
    # What the coordinates lose between angles, in steps of s.
    lost_edge, lost_scale, lost_step = (
        AROUND_ERROR * np.abs(np.diff(each[np.arange(-4, angles + 5) % angles], 4))[:, None]
        for each in (grid.edge, grid.scale, step)
    )
    stray = along / needs.pixel * (lost_edge + lost_scale * np.abs(np.sinh(grid.range[wide, None] * grid.s)))
    stray += lost_step / step[wide, None] * np.abs(grid.s / (grid.s[1] - grid.s[0]))
    good = np.ones(u.shape, dtype=bool)
    for each, small in ((u, needs.place_error / needs.outer), (azimuth, needs.place_error)):
        error = np.zeros_like(each)
        for axis in (0, 1):
            left_out = AROUND_ERROR * np.abs(np.diff(each, 4, axis=axis))
            padded = np.pad(left_out, [(2, 2) if i == axis else (0, 0) for i in (0, 1)], mode="edge")
            error = np.maximum(error, padded)
        change = np.gradient(each, axis=1), np.gradient(each, axis=0)
        error += stray * np.abs(change[0])
        good &= error < np.maximum(needs.pixel_error * np.hypot(change[0] * along, change[1] * across), small)
        if each is u:
            # Off the disk, and so are all places around.
            far = off > OFF_MARGIN * error + 2.0 * (np.abs(change[0]) + np.abs(change[1]))
    # Next to rays that never cross, neighbours may have been unwrapped by different turns.
    for axis in (0, 1):
        torn = np.abs(np.diff(azimuth, axis=axis)) > math.pi
        edge = [(0, 1) if i == axis else (0, 0) for i in (0, 1)]
        good &= ~np.pad(torn, edge) & ~np.pad(torn, [each[::-1] for each in edge])
    known = good | far
    return [np.where(known, each, np.nan)[1:-1, 1:-1] for each in (u, azimuth, slope)], good[1:-1, 1:-1]
