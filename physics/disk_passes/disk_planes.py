# SPDX-License-Identifier: GPL-3.0-or-later
"""The planes of a disk's passes, and whole tiles written to them from Chebyshev coefficients, rims and all."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numerics.angles import wrap, wrap_once, wrap_symmetric
from ..numerics.arrays import Array, Index, indices
from ..sampling.tiles import TILE_SIDES, Tiles, at_pixels
from .annulus import coverage, misses, nearest_covered
from .disk_samples import PHI, Matter, U

Channels = NDArray[Any]
"""Shape (channels, ...), in single precision for whole tiles."""
MatterOf = Callable[[Channels], Matter]

# u is bent from this many times its value at the inner rim on.
BENT_FROM = 2.0

# Tiles of which this share is wholly covered are written whole.
DENSE = 0.15

# How much steeper than at the places looked at a tile may be between them.
STEEPER = 1.2

# What follows u and the azimuth where the redshift itself is interpolated.
G = 2


class BentU:
    """u = 1 / r as tiles interpolate it: nearly as it is on the disk, bounded beyond its inner rim.

    u / (1 + (u / s)^2)^(1/2), s being `BENT_FROM` times u at the inner rim: deep in the hole, where u grows and rays
    end, this is nearly constant, and a tile there is smooth.
    """

    def __init__(self, inner: float, outer: float) -> None:
        self._bend = inner / BENT_FROM
        low, high = self.bent(np.array([1.0 / outer, 1.0 / inner]))
        self.low = float(low)
        """At the outer rim."""
        self.high = float(high)
        """At the inner rim."""

    def bent(self, u: Array) -> Array:
        """Return u bent."""
        bent: Array = u / np.sqrt(1.0 + (u * self._bend) ** 2)
        return bent

    def radius(self, bent: NDArray[Any]) -> NDArray[Any]:
        """Return 1 / u of bent u > 0."""
        radius: NDArray[Any] = np.sqrt(1.0 / (bent * bent) - self._bend * self._bend)
        return radius

    def matter(self, values: Channels) -> Matter:
        """Return the matter at places given by bent u, azimuth and g."""
        return self.radius(values[U]), wrap(values[PHI]), values[G]


class DiskPlanes:
    """Radius, azimuth, g and coverage of each crossing, in the making."""

    def __init__(self, crossings: int, width: int, height: int, bent: BentU) -> None:
        self._width, self._height = width, height
        self._bent = bent
        self.planes = np.zeros((crossings, 4, height, width), np.float32)
        self._rims: defaultdict[tuple[int, MatterOf], list[tuple[Index, Channels, Array, Array, Array]]]
        self._rims = defaultdict(list)

    def fill(self, order: int, tiles: Tiles, coefficients: Array, matter: MatterOf) -> None:
        """Fill tiles from Chebyshev coefficients, shape (n, channels, points, points), but for pixels next to a rim,
        which are left to `fill_rims`; the channels are bent u, azimuth, and what else `matter` needs to know."""
        if not len(tiles):
            return
        # Single precision is what is written, and enough for sums of terms of order 1.
        single = np.moveaxis(coefficients, 1, 0).astype(np.float32, order="C")
        reach = _steepest(single[U], tiles.side)
        few = (TILE_SIDES[0] // tiles.side) ** 2  # with as many pixels as the largest tile, which stay in the cache
        for start in range(0, len(tiles), few):
            part = slice(start, start + few)
            self._fill_some(order, tiles.select(part), single[:, part], reach[part], matter)

    def _fill_some(
        self, order: int, tiles: Tiles, coefficients: Channels, reach: NDArray[Any], matter: MatterOf
    ) -> None:
        """Do what `fill` does for some tiles, from coefficients of shape (channels, n, points, points); `reach`: how
        much u changes at the most from a pixel's center to its corners, (n,)."""
        base, _ = _polynomials(tiles.side, coefficients.shape[-1])
        # Of tiles that stick out of the picture no more than is in it.
        down, across = base[: (self._height - tiles.row).max()], base[: (self._width - tiles.column).max()]
        values: Channels = down @ coefficients @ across.T
        u = values[U].reshape(len(tiles), -1)
        low, high = u.min(axis=1), u.max(axis=1)
        # Whole tiles inside need no coverage; half a pixel's way to a rim is less than the steepest step.
        whole = (low - reach > self._bent.low) & (high + reach < self._bent.high)
        if whole.any():
            part = indices(whole)
            self._fill_whole(order, tiles.select(part), values[:, part], matter)
        if not whole.all():
            part = indices(~whole)
            corners = _corners(tiles.side, coefficients[U, part])
            self._fill_rim(order, tiles.select(part), values[:, part], corners, reach[part], matter)

    def _fill_whole(self, order: int, tiles: Tiles, values: Channels, matter: MatterOf) -> None:
        """Write tiles that are wholly covered, from channels of shape (channels, n, rows, columns)."""
        share = np.broadcast_to(np.float32(1.0), values[U].shape)
        for plane, channel in zip(self.planes[order], (*matter(values), share), strict=True):
            tiles.put(plane, channel)

    def _fill_rim(
        self,
        order: int,
        tiles: Tiles,
        values: Channels,
        corners: NDArray[Any],
        reach: NDArray[Any],
        matter: MatterOf,
    ) -> None:
        """Write tiles with a rim in them from channels of shape (channels, n, rows, columns); `corners`: u at corners
        of pixels, shape (n, side + 1, side + 1); `reach` as above."""
        u, reach = values[U], reach[:, None, None]
        off = np.maximum(self._bent.low - u, u - self._bent.high)
        wholly = off <= -reach
        rim, where = self._in_picture(tiles, np.flatnonzero((off < reach) != wholly), u.shape)
        tile, row, column = np.unravel_index(rim, u.shape)
        around = np.stack([corners[tile, row + below, column + right] for below in (0, 1) for right in (0, 1)])
        channels = values.reshape(len(values), -1)
        right, below = slopes(values, rim)
        self._rims[order, matter].append((where, channels.take(rim, axis=1), right, below, around))
        if np.count_nonzero(wholly) < DENSE * wholly.size:
            inside, where = self._in_picture(tiles, np.flatnonzero(wholly), u.shape)
            self._put(order, where, matter(channels.take(inside, axis=1)), 1.0)
            return
        np.clip(u, self._bent.low, self._bent.high, out=u)
        with np.errstate(all="ignore"):  # off the disk there is no matter
            found = matter(values)
        for plane, channel in zip(self.planes[order], (*found, wholly), strict=True):
            tiles.put(plane, channel, wholly)

    def _in_picture(self, tiles: Tiles, places: Index, shape: tuple[int, ...]) -> tuple[Index, Index]:
        """Return those of some places, given by their numbers in `shape`, (n, rows, columns), that are in the picture,
        and their numbers there."""
        tile, row, column = np.unravel_index(places, shape)
        row, column = row + tiles.row[tile], column + tiles.column[tile]
        where = row * self._width + column
        known = (row < self._height) & (column < self._width)
        return (places, where) if known.all() else (places[known], where[known])

    def fill_rims(self) -> None:
        """Write the pixels next to the rims in the tiles filled: all at once, as there are few in each."""
        for (order, matter), parts in self._rims.items():
            where, here, right, below, around = (np.concatenate(each, axis=-1) for each in zip(*parts, strict=True))
            share = coverage(here[U], right[U], below[U], self._bent.low, self._bent.high)
            share[misses(here[U], around, self._bent.low, self._bent.high)] = 0.0
            seen = np.flatnonzero(share > 0.0)
            right, below, here = (each.take(seen, axis=1) for each in (right, below, here))
            met, x, y = nearest_covered(here[U], right[U], below[U], self._bent.low, self._bent.high)
            moved = here + right * x + below * y
            moved[U] = met
            self._write(order, where[seen], matter(moved), share[seen])
        self._rims.clear()

    def write(
        self,
        order: int,
        place: tuple[Index, Index],
        matter: Matter,
        share: Array,
    ) -> None:
        """Write pixels given by column and row, from radius, azimuth and g of shape (n,).

        Light that cannot be, where a place was moved too far to a rim next to the horizon, leaves its pixel empty.
        """
        columns, rows = place
        self._write(order, rows * self._width + columns, matter, share)

    def _write(self, order: int, where: Index, matter: Matter, share: Array) -> None:
        """Do what `write` does for pixels given by their numbers in the picture."""
        known = matter[2] > 0.0
        radius, phi, g = (each[known] for each in matter)
        self._put(order, where[known], (radius, phi, g), share[known])

    def _put(self, order: int, where: Index, matter: Matter, share: Array | float) -> None:
        for plane, values in zip(self.planes[order], (*matter, share), strict=True):
            plane.reshape(-1)[where] = values  # by one number is quicker than by row and column


def slopes(values: Channels, place: Index) -> tuple[Array, Array]:
    """Return the changes from pixel to pixel, along the rows and down, of channels of shape (channels, n, rows,
    columns) at some places, given by their numbers in (n, rows, columns); none where a neighbor is not known."""
    rows, columns = values.shape[-2:]
    flat = values.reshape(len(values), -1)
    step, at = np.array([[1], [columns]]), np.stack([place % columns, place // columns % rows])
    before, after = at > 0, at < np.array([[columns - 1], [rows - 1]])  # one only at the tile's own edge
    change = flat.take(place + step * after, axis=1) - flat.take(place - step * before, axis=1)
    change[PHI] = wrap_symmetric(change[PHI])
    change = change / (1.0 + (before & after))
    change[np.isnan(change)] = 0.0
    return change[:, 0], change[:, 1]


def _corners(side: int, coefficients: NDArray[Any]) -> NDArray[Any]:
    """Return values at the corners of pixels, shape (n, side + 1, side + 1), from Chebyshev coefficients, shape (n,
    points, points)."""
    base = _at_corners(side, coefficients.shape[-1])
    corners: NDArray[Any] = base @ coefficients @ base.T
    return corners


@cache
def _at_corners(side: int, count: int) -> NDArray[np.float32]:
    """Return the Chebyshev polynomials at the corners of a tile's pixels, shape (side + 1, count)."""
    place = np.linspace(-1.0, 1.0, side + 1)[:, None]
    polynomials: NDArray[np.float32] = np.cos(np.arange(count) * np.arccos(place)).astype(np.float32)
    return polynomials


@cache
def _polynomials(side: int, count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return what `at_pixels` does, in single precision."""
    base, slope = at_pixels(side, count)
    return base.astype(np.float32), slope.astype(np.float32)


def _steepest(coefficients: NDArray[Any], side: int) -> NDArray[Any]:
    """Return how much tiles, given by Chebyshev coefficients of shape (n, points, points), change at the most from a
    pixel's center to its corners, shape (n,): from as many places as there are pixels in the smallest tiles."""
    base, slope = _polynomials(TILE_SIDES[-1], coefficients.shape[-1])
    per_pixel = TILE_SIDES[-1] / side
    change = np.abs(base @ coefficients @ slope.T) + np.abs(slope @ coefficients @ base.T)
    steepest: NDArray[Any] = (0.5 * STEEPER * per_pixel) * change.max(axis=(1, 2))
    return steepest


def mean_matter(radius: Array, phi: Array, g: Array, weights: Array) -> Matter:
    """Return the mean radius, azimuth and g over places of each pixel, shape (places, n), by weight.

    A pixel that is partly covered, or by all of the disk at once, shows its mean: one place of it would twinkle from
    pixel to pixel along a thin ring.
    """
    g = np.where(g > 0.0, g, 0.0)
    weights = weights * (g > 0.0)
    weights /= np.maximum(weights.sum(axis=0), np.finfo(float).tiny)
    mean = [(each * weights).sum(axis=0) for each in (1.0 / radius, np.cos(phi), np.sin(phi), g)]
    with np.errstate(divide="ignore"):
        return 1.0 / mean[0], wrap_once(np.arctan2(mean[2], mean[1])), mean[3]
