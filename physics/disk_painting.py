# SPDX-License-Identifier: GPL-3.0-or-later
"""Filling the passes of a disk: interpolated where its image is smooth, traced where it is not.

For each crossing, u = 1 / r and the azimuth, as (cos, sin), are smooth functions of the pixel, also across the disk's
rims and across the shadow's edge: which side a ray ends on changes only later crossings. So tiles are sampled as for
the sky (`tiles`), rims and all, and how much of a pixel the annulus covers follows from u and its slope there. Tiles
where that is not enough are divided, and at last traced pixel by pixel, and those pixels at a rim where even a
neighbour is too far away are traced at finer places inside them.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .annulus import coverage, near_annulus, nearest_covered
from .disk_pass import DiskPass
from .metric import horizon_radius
from .painting import wrapped
from .rays import Array
from .shot import WarpMapParameters
from .tiles import (
    TAIL,
    TAIL_SHARE,
    TILE_SIDES,
    Tiles,
    at_pixels,
    coefficients_of,
    sample_places,
    sides_for,
    tiles_of,
)
from .tracer import BLOCK_SIZE, Fate
from .view import View

Mask = NDArray[np.bool_]
Image = NDArray[np.float32]

# Error of place on the disk, relative, for each radian of error of direction that is allowed.
PLACE_ERROR = 40.0
# Chebyshev points along each side of a tile: the sky, which has to be better known, has more.
DISK_POINTS = 8
# Rays need be better than that by this only.
TRACING_SHARE = 0.1
# Where the image is crowded, this share of the way from pixel to pixel will do.
PIXEL_ERROR = 0.03

# A tile is empty if its samples stay off the disk by this many times what they may be wrong by.
EMPTY_MARGIN = 4.0

# So far off the disk, in units of 1 / r at its outer and inner rim, it does not matter any more how far: for samples
# that must stay smooth, and for differences between pixels.
LOWEST_U, HIGHEST_U = -30.0, 20.0
LOWEST_STEP, HIGHEST_STEP = -2.0, 4.0

# Places along each side of a pixel that is divided.
FINER = 3

# A rim bent by more than this share of a pixel within the pixel is not taken for straight.
LARGEST_BEND = 0.05

# Circles and places on each that mark where the disk is, for tiles whose samples may miss it.
MARKED_CIRCLES, MARKED_PLACES = 8, 256

# Pixels below which the spread of these places, across where it is least, makes a slim disk.
SLIM = 8.0

# Channels of what is interpolated.
CHANNELS = 4
U, COS, SIN, G = range(CHANNELS)

# g is smooth only where there is an orbit, or a fall: beyond so many outer and inner radii, and next to the horizon, it
# is held.
FARTHEST_G, INNERMOST_G, NEAREST_G = 3.0, 0.8, 1.0001
# At a rim g changes along with the place by no more than this factor.
LARGEST_CHANGE = 1.5


class DiskPainting:
    """The passes of a disk in the making."""

    def __init__(self, parameters: WarpMapParameters) -> None:
        assert parameters.disk is not None
        self._parameters = parameters
        self._disk = parameters.disk
        self._inner, self._outer = self._disk.radii(parameters.spin)
        nearest = max(NEAREST_G * horizon_radius(parameters.spin), INNERMOST_G * self._inner)
        self._bounds_of_g = 1.0 / (FARTHEST_G * self._outer), 1.0 / nearest
        self._tolerance = max(parameters.tolerance, TRACING_SHARE * PLACE_ERROR * parameters.interpolation)
        self._view = View(parameters)
        self._width, self._height = parameters.map_size
        self._planes = np.zeros((self._disk.crossings, 4, self._height, self._width), np.float32)
        # Pixels that samples of their tile say are far from the disk, by crossing.
        self._far = np.zeros((self._disk.crossings, self._height, self._width), dtype=bool)
        self._unresolved = np.zeros((self._height, self._width), dtype=bool)
        self._rays = 0

    def counts(self) -> dict[str, int]:
        """Number of rays that were traced for the passes, and of pixels whose ray was given up."""
        return {"disk_rays": self._rays, "disk_unresolved": int(np.count_nonzero(self._unresolved))}

    def passes(self, metadata: dict[str, object]) -> tuple[DiskPass, ...]:
        """Return the passes in order."""
        return tuple(
            DiskPass(planes[0], planes[1], planes[2], planes[3], {**metadata, "crossing": order})
            for order, planes in enumerate(self._planes, start=1)
        )

    def steps(self) -> Generator[float, None, None]:
        """Fill the passes, yielding the fraction done after each step."""
        if self._parameters.interpolation > 0.0:
            yield from self._adaptive()
        else:
            tiles = tiles_of(self._width, self._height, TILE_SIDES[-1])
            yield from self._trace(tiles, np.ones((len(tiles), self._disk.crossings), dtype=bool), 0.0)

    # --- samples -----------------------------------------------------------------------------------

    def _sample(self, x: Array, y: Array, wanted: Mask) -> tuple[Array, Mask]:
        """Return the channels, shape (crossings, channels, n), and which rays were given up, (n,).

        Only what is `wanted`, shape (crossings, n), means anything; the others' u is NaN.

        u is finite everywhere: rays that never cross count as far beyond their end.
        """
        values = np.empty((self._disk.crossings, CHANNELS, len(x)))
        lost = np.zeros(len(x), dtype=bool)
        for start in range(0, len(x), BLOCK_SIZE):
            block = slice(start, start + BLOCK_SIZE)
            found, light = self._view.crossings(
                x[block],
                y[block],
                self._disk.crossings,
                self._tolerance,
                self._parameters.method,
                wanted[:, block],
            )
            low, high = LOWEST_U / self._outer, HIGHEST_U / self._inner
            nowhere = np.where(found.fate == Fate.SHADOW, high, low)
            u = np.clip(np.where(np.isnan(found.u), nowhere, found.u), low, high)
            values[:, U, block] = np.where(wanted[:, block], u, np.nan)
            for order in np.flatnonzero(wanted[:, block].any(axis=1)):
                phi, u = np.nan_to_num(found.phi[order]), np.clip(found.u[order], *self._bounds_of_g)
                g = light.g(self._parameters.spin, u, found.u_slope[order], self._disk.retrograde)
                values[order, COS, block], values[order, SIN, block] = np.cos(phi), np.sin(phi)
                values[order, G, block] = np.nan_to_num(g)
            lost[block] = found.fate == Fate.UNRESOLVED
        self._rays += len(x)
        return values, lost

    # --- adaptive ----------------------------------------------------------------------------------

    def _adaptive(self) -> Generator[float, None, None]:
        marked_x, marked_y = self._marked_places()
        sides = sides_for(self._width, self._height)
        waiting = tiles_of(self._width, self._height, sides[0])
        wanted = np.ones((len(waiting), self._disk.crossings), dtype=bool)
        done, share = 0.0, 0.6 / len(sides)
        for side in sides:
            marked = self._marked(waiting, marked_x, marked_y)
            group = max(1, BLOCK_SIZE // DISK_POINTS**2)
            for start in range(0, len(waiting), group):
                part = np.arange(start, min(start + group, len(waiting)))
                self._settle(waiting.select(part), marked[part], wanted, part)
                yield done + share * (start + len(part)) / len(waiting)
            done += share
            left = wanted.any(axis=1)
            waiting, wanted = waiting.select(left), wanted[left]
            if side != TILE_SIDES[-1]:
                waiting = waiting.divided()
                wanted = np.repeat(wanted, 4, axis=0)
                inside = (waiting.column < self._width) & (waiting.row < self._height)
                waiting, wanted = waiting.select(inside), wanted[inside]
        yield from self._trace(waiting, wanted, done)

    def _marked_places(self) -> tuple[Array, Array]:
        """Return pixel coordinates of the hole's centre and, if it is slim, on the disk as flat space would show it.

        Samples may miss a disk that is seen from the edge, or from afar; a broad one they cannot.
        """
        radii = np.linspace(self._inner, self._outer, MARKED_CIRCLES)
        turn = np.arange(MARKED_PLACES) * (2.0 * math.pi / MARKED_PLACES)
        x, y = self._view.places_in_plane(np.repeat(radii, len(turn)), np.tile(turn, len(radii)))
        known = np.isfinite(x) & np.isfinite(y)
        x, y = x[known], y[known]
        if len(x) > 1 and math.sqrt(max(np.linalg.eigvalsh(np.cov(x, y))[0], 0.0)) > SLIM:
            x, y = x[:0], y[:0]
        centre = self._view.centre()
        if centre is not None:
            x, y = np.append(x, centre[0]), np.append(y, centre[1])
        seen = (x > -1.0) & (x < self._width + 1.0) & (y > -1.0) & (y < self._height + 1.0)
        return x[seen], y[seen]

    def _marked(self, tiles: Tiles, x: Array, y: Array) -> Mask:
        """Return which tiles hold a marked place, shape (n,)."""
        columns = self._width // tiles.side + 2
        places = np.unique((y // tiles.side).astype(np.intp) * columns + (x // tiles.side).astype(np.intp))
        marked: Mask = np.isin(tiles.row // tiles.side * columns + tiles.column // tiles.side, places)
        return marked

    def _settle(self, tiles: Tiles, marked: Mask, wanted: Mask, part: NDArray[np.intp]) -> None:
        """Sample tiles, fill what they determine and strike it from `wanted`, whose rows `part` they are."""
        x, y = sample_places(tiles, DISK_POINTS)
        values, lost = self._sample(x, y, np.repeat(wanted[part].T, DISK_POINTS**2, axis=1))
        values = values.reshape(*values.shape[:2], len(tiles), DISK_POINTS, DISK_POINTS)
        broken = lost.reshape(len(tiles), -1).any(axis=1)
        allowed = PLACE_ERROR * self._parameters.interpolation
        for order, sampled in enumerate(values):
            chosen = np.flatnonzero(wanted[part, order] & ~broken)
            if not len(chosen):
                continue
            u = sampled[U, chosen].reshape(len(chosen), -1)
            low, high = u.min(axis=1), u.max(axis=1)
            off = np.maximum(1.0 / self._outer - high, low - 1.0 / self._inner)
            coefficients = coefficients_of(np.moveaxis(sampled[:, chosen], 0, 1))
            size = np.abs(coefficients)
            tail = size[:, :, -TAIL:, :].sum(axis=(2, 3)) + size[:, :, :-TAIL, -TAIL:].sum(axis=(2, 3))
            pixel = np.hypot(coefficients[:, :, 0, 1], coefficients[:, :, 1, 0]) * (2.0 * PIXEL_ERROR / tiles.side)
            turned = np.maximum(np.hypot(pixel[:, COS], pixel[:, SIN]), allowed)[:, None]
            along = np.maximum(pixel[:, U], allowed / self._outer)
            empty = (off > EMPTY_MARGIN * tail[:, U]) & (~marked[chosen] | (TAIL_SHARE * tail[:, U] < along))
            good = (TAIL_SHARE * tail[:, U] < along) & (TAIL_SHARE * tail[:, COS:G] < turned).all(axis=1)
            good &= TAIL_SHARE * tail[:, G] < np.maximum(pixel[:, G], allowed)
            good &= ~empty
            if good.any():
                self._fill(tiles.select(chosen[good]), coefficients[good], order)
            wanted[part[chosen[good | empty]], order] = False
            if tiles.side == TILE_SIDES[-1]:
                left = chosen[~(good | empty)]
                near = near_annulus(sampled[U, left], 1.0 / self._outer, 1.0 / self._inner)
                near[marked[left]] = True
                for i, tile in enumerate(left):
                    place = self._far[order, tiles.row[tile] :, tiles.column[tile] :][: tiles.side, : tiles.side]
                    place[:] = ~near[i, : place.shape[0], : place.shape[1]]

    def _fill(self, tiles: Tiles, coefficients: Array, order: int) -> None:
        """Fill whole tiles from Chebyshev coefficients, shape (n, channels, DISK_POINTS, DISK_POINTS)."""
        # Single precision is what is written, and enough for sums of terms of order 1.
        base = at_pixels(tiles.side, DISK_POINTS)[0].astype(np.float32)
        coefficients = coefficients.astype(np.float32)
        values = base @ coefficients @ base.T
        u = values[:, U].reshape(len(tiles), -1)
        low, high = u.min(axis=1), u.max(axis=1)
        # Whole tiles inside need no coverage; half a pixel's way to a rim is a small part of a tile's.
        reach = (high - low) / tiles.side
        whole = (low - reach > 1.0 / self._outer) & (high + reach < 1.0 / self._inner)
        if whole.any():
            self._write_whole(tiles.select(whole), values[whole], order)
        rim = np.flatnonzero(~whole)
        if len(rim):
            self._put_rim(order, tiles.select(rim), coefficients[rim], values[rim])

    def _put_rim(self, order: int, tiles: Tiles, coefficients: Array, values: Array) -> None:
        """Write tiles with a rim in them from Chebyshev coefficients and the channels, (n, channels, side, side)."""
        base, slope = (each.astype(np.float32) for each in at_pixels(tiles.side, DISK_POINTS))
        u, across, down = values[:, U], base @ coefficients[:, U] @ slope.T, slope @ coefficients[:, U] @ base.T
        columns, rows = (np.broadcast_to(each, u.shape) for each in tiles.pixels())
        share = coverage(u, across, down, self._inner, self._outer)
        share[(columns >= self._width) | (rows >= self._height)] = 0.0
        whole, partly = share == 1.0, (share > 0.0) & (share < 1.0)
        self._write(order, (columns[whole], rows[whole]), np.moveaxis(values, 1, 0)[:, whole], share[whole])
        tile, row, column = np.nonzero(partly)
        if not len(tile):
            return
        inside, x, y = nearest_covered(u[partly], across[partly], down[partly], self._inner, self._outer)
        along = base[column] + slope[column] * x[:, None]
        upright = base[row] + slope[row] * y[:, None]
        met = np.einsum("ni,ncij,nj->cn", upright, coefficients[tile], along, optimize=True)
        met[U] = inside
        self._write(order, (columns[partly], rows[partly]), met, share[partly])

    def _write_whole(self, tiles: Tiles, values: Array, order: int) -> None:
        """Write tiles that the disk covers wholly, from channels of shape (n, channels, side, side)."""
        radius, phi = 1.0 / values[:, U], wrapped(np.arctan2(values[:, SIN], values[:, COS]))
        channels: tuple[NDArray[np.floating[Any]], ...] = (radius, phi, values[:, G], np.ones_like(radius))
        for plane, channel in zip(self._planes[order], channels, strict=True):
            tiles.put(plane, channel)

    def _put(
        self, order: int, columns: NDArray[np.intp], rows: NDArray[np.intp], values: Array, across: Array, down: Array
    ) -> None:
        """Write pixels, from channels and their slopes of shape (n, channels, side, side)."""
        share = coverage(values[:, U], across[:, U], down[:, U], self._inner, self._outer)
        seen = (share > 0.0) & (columns < self._width) & (rows < self._height)
        if not seen.any():
            return
        place = (columns[seen], rows[seen])
        here, right, below = (np.moveaxis(each, 1, 0)[:, seen] for each in (values, across, down))
        u, x, y = nearest_covered(here[U], right[U], below[U], self._inner, self._outer)
        moved = here + right * x + below * y
        moved[U] = u
        moved[G] = np.clip(moved[G], here[G] / LARGEST_CHANGE, here[G] * LARGEST_CHANGE)
        self._write(order, place, moved, share[seen])

    def _write(
        self, order: int, place: tuple[NDArray[np.intp], NDArray[np.intp]], values: Array, share: Array
    ) -> None:
        """Write pixels given by column and row, from channels of shape (channels, n)."""
        columns, rows = place
        planes = self._planes[order]
        planes[0, rows, columns] = 1.0 / values[U]
        planes[1, rows, columns] = wrapped(np.arctan2(values[SIN], values[COS]))
        planes[2, rows, columns] = values[G]
        planes[3, rows, columns] = share

    # --- pixel by pixel ------------------------------------------------------------------------------

    def _trace(self, tiles: Tiles, wanted: Mask, done: float) -> Generator[float, None, None]:
        """Fill tiles, for the crossings that are wanted of each, by a ray for each pixel or more."""
        group = max(1, BLOCK_SIZE // tiles.side**2)
        for start in range(0, len(tiles), group):
            part = np.arange(start, min(start + group, len(tiles)))
            self._trace_group(tiles.select(part), wanted[part])
            yield done + (1.0 - done) * (start + len(part)) / len(tiles)

    def _trace_group(self, tiles: Tiles, wanted: Mask) -> None:
        columns, rows = tiles.pixels()
        shape = (len(tiles), tiles.side, tiles.side)
        columns, rows = np.broadcast_to(columns, shape), np.broadcast_to(rows, shape)
        inside = (columns < self._width) & (rows < self._height)
        looked = (np.minimum(rows, self._height - 1), np.minimum(columns, self._width - 1))
        every = wanted.T[:, :, None, None] & ~self._far[:, *looked]
        traced: Mask = every.any(axis=0)
        values = np.full((self._disk.crossings, CHANNELS, *shape), np.nan)
        x, y = columns[traced].astype(np.float64) + 0.5, rows[traced].astype(np.float64) + 0.5
        values[:, :, traced], lost = self._sample(x, y, every[:, traced])
        given_up = np.zeros(shape, dtype=bool)
        given_up[traced] = lost
        given_up &= inside
        self._unresolved[rows[given_up], columns[given_up]] = True
        for order, channels in enumerate(values):
            chosen = np.flatnonzero(wanted[:, order])
            if not len(chosen):
                continue
            here: Array = np.moveaxis(channels[:, chosen], 0, 1)
            here[:, U] = np.clip(here[:, U], LOWEST_STEP / self._outer, HIGHEST_STEP / self._inner)
            down: Array = np.gradient(here, axis=2)
            across: Array = np.gradient(here, axis=3)
            finer = self._needs_finer(here[:, U], across[:, U], down[:, U])
            finer &= inside[chosen]
            smooth = np.where(finer[:, None], 0.0, here)  # u = 0 is off the disk
            with np.errstate(invalid="ignore"):
                self._put(order, columns[chosen], rows[chosen], smooth, *(
                    np.where(finer[:, None], 0.0, each) for each in (across, down)
                ))
            self._divide(order, columns[chosen][finer], rows[chosen][finer], np.moveaxis(here, 1, 0)[:, finer])

    def _needs_finer(self, u: Array, across: Array, down: Array) -> Mask:
        """Return which pixels have a rim in or beside them that is not nearly straight, shape (n, side, side)."""
        bend = np.abs(np.gradient(across, axis=2)) + np.abs(np.gradient(down, axis=1))
        bend += np.abs(np.gradient(across, axis=1))
        reach = 0.5 * (np.abs(across) + np.abs(down)) + bend
        # A neighbour may reach further than the mean slope says.
        step_x, step_y = np.abs(np.diff(u, axis=2)), np.abs(np.diff(u, axis=1))
        reach[:, :, 1:], reach[:, :, :-1] = np.maximum(reach[:, :, 1:], step_x), np.maximum(reach[:, :, :-1], step_x)
        reach[:, 1:], reach[:, :-1] = np.maximum(reach[:, 1:], step_y), np.maximum(reach[:, :-1], step_y)
        touched = (u + reach > 1.0 / self._outer) & (u - reach < 1.0 / self._inner)
        whole = (u - reach > 1.0 / self._outer) & (u + reach < 1.0 / self._inner)
        steep = np.hypot(across, down)
        needs: Mask = touched & ~whole & (bend > 8.0 * LARGEST_BEND * steep)
        return needs

    def _divide(self, order: int, columns: NDArray[np.intp], rows: NDArray[np.intp], centres: Array) -> None:
        """Fill pixels from places on a finer grid inside them, and from their centres, shape (channels, n)."""
        group = max(1, BLOCK_SIZE // FINER**2)
        steps = (np.arange(FINER) + 0.5) / FINER
        for start in range(0, len(columns), group):
            column, row = columns[start : start + group], rows[start : start + group]
            x, y = column[:, None, None] + steps, row[:, None, None] + steps[:, None]
            x, y = np.broadcast_arrays(x, y)
            alone = np.zeros((self._disk.crossings, x.size), dtype=bool)
            alone[order] = True
            values, _ = self._sample(x.ravel(), y.ravel(), alone)
            values = values[order].reshape(-1, *x.shape)
            values[U] = np.clip(values[U], LOWEST_STEP / self._outer, HIGHEST_STEP / self._inner)
            down, across = np.gradient(values[U], axis=(1, 2))
            shares = coverage(values[U], across, down, self._inner, self._outer).reshape(len(column), -1)
            share = shares.mean(axis=1)
            seen = share > 0.0
            # A pixel that is partly covered, or by all of the disk at once, shows its mean: one place of it would
            # twinkle from pixel to pixel along a thin ring.
            values[U] = np.clip(values[U], 1.0 / self._outer, 1.0 / self._inner)
            weights = shares[seen] / shares[seen].sum(axis=1, keepdims=True)
            mean = (values.reshape(CHANNELS, len(column), -1)[:, seen] * weights).sum(axis=-1)
            flat = np.where(share[seen] == 1.0, centres[:, start : start + group][:, seen], mean)
            flat[U] = np.clip(flat[U], 1.0 / self._outer, 1.0 / self._inner)
            self._write(order, (column[seen], row[seen]), flat, share[seen])
