# SPDX-License-Identifier: GPL-3.0-or-later
"""Filling the passes of a disk: interpolated where its image is smooth, traced where it is not.

For each crossing, u = 1 / r and the azimuth, unwound as in `radial_path`, are smooth functions of the pixel: across the
disk's rims, across the shadow's edge, and on beyond infinity and the horizon. So are the light's energy and angular
momentum for a camera energy of 1, from which a formula gives the redshift at the disk. So tiles are sampled as for the
sky (`tiles`), rims and all, and how much of a pixel the annulus covers follows from u and its slope there. Tiles where
that is not enough are divided, and at last traced pixel by pixel, and those pixels at a rim where even a neighbour is
too far away are traced at finer places inside them.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .annulus import coverage, near_annulus, nearest_covered
from .disk_pass import DiskPass
from .disk_samples import PHI, PIXEL_ERROR, PLACE_ERROR, SLOPE, DiskSamples, U, nearest_turn
from .painting import GROUP_PIXELS, wrapped
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
from .tracer import BLOCK_SIZE
from .view import View

Mask = NDArray[np.bool_]
Image = NDArray[np.float32]

# Chebyshev points along each side of a tile: the sky, which has to be better known, has more.
DISK_POINTS = 8

# A tile is empty if its samples stay off the disk by this many times what they may be wrong by.
EMPTY_MARGIN = 4.0

# Chebyshev coefficients looked up at a time for single pixels at a rim.
GROUP_VALUES = 1 << 20

# The side of the tiles from which on tables serve the later images, and the rounds that their tiles ask for samples in.
TABLE_SIDE, TABLE_ROUNDS = 64, 6

# So far off the disk, in units of 1 / r at its outer and inner rim, it does not matter for differences between pixels;
# and in 1 / M for large disks, whose outer rim is next to infinity.
LOWEST_STEP, HIGHEST_STEP = -2.0, 4.0
FARTHEST_STEP = -0.1

# Places along each side of a pixel that is divided.
FINER = 3

# A rim bent by more than this share of a pixel within the pixel is not taken for straight.
LARGEST_BEND = 0.05

# Circles and places on each that mark where the disk is, for tiles whose samples may miss it.
MARKED_CIRCLES, MARKED_PLACES = 8, 256

# Pixels below which the spread of these places, across where it is least, makes a slim disk.
SLIM = 8.0


class DiskPainting:
    """The passes of a disk in the making."""

    def __init__(self, parameters: WarpMapParameters) -> None:
        assert parameters.disk is not None
        self._parameters = parameters
        self._disk = parameters.disk
        self._inner, self._outer = self._disk.radii(parameters.spin)
        self._view = View(parameters)
        self._samples = DiskSamples(parameters, self._view)
        self._channels = self._samples.channels
        self._bounds = min(LOWEST_STEP / self._outer, FARTHEST_STEP), HIGHEST_STEP / self._inner
        self._width, self._height = parameters.map_size
        self._planes = np.zeros((self._disk.crossings, 4, self._height, self._width), np.float32)
        # Pixels that samples of their tile say are far from the disk, by crossing.
        self._far = np.zeros((self._disk.crossings, self._height, self._width), dtype=bool)
        self._unresolved = np.zeros((self._height, self._width), dtype=bool)

    def counts(self) -> dict[str, int]:
        """Number of rays that were traced for the passes, and of pixels whose ray was given up."""
        return {"disk_rays": self._samples.rays, "disk_unresolved": int(np.count_nonzero(self._unresolved))}

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

    # --- adaptive ----------------------------------------------------------------------------------

    def _adaptive(self) -> Generator[float, None, None]:
        marked_x, marked_y = self._marked_places()
        sides = sides_for(self._width, self._height)
        waiting = tiles_of(self._width, self._height, sides[0])
        wanted = np.ones((len(waiting), self._disk.crossings), dtype=bool)
        done, share = 0.0, 0.6 / len(sides)
        for side in sides:
            marked = self._marked(waiting, marked_x, marked_y)
            if side == TABLE_SIDE:
                self._samples.make_tables(np.count_nonzero(wanted, axis=0) * (TABLE_ROUNDS * DISK_POINTS**2))
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
        values, lost = self._samples.at(x, y, np.repeat(wanted[part].T, DISK_POINTS**2, axis=1))
        values = values.reshape(*values.shape[:2], len(tiles), DISK_POINTS, DISK_POINTS)
        broken = lost.reshape(len(tiles), -1).any(axis=1)
        allowed = PLACE_ERROR * self._parameters.interpolation
        for order, sampled in enumerate(values):
            chosen = np.flatnonzero(wanted[part, order] & ~broken)
            if not len(chosen):
                continue
            azimuth = sampled[PHI, chosen]
            sampled[PHI, chosen] = azimuth[:, :1, :1] + nearest_turn(azimuth - azimuth[:, :1, :1])
            u = sampled[U, chosen].reshape(len(chosen), -1)
            low, high = u.min(axis=1), u.max(axis=1)
            off = np.maximum(1.0 / self._outer - high, low - 1.0 / self._inner)
            coefficients = coefficients_of(np.moveaxis(sampled[:, chosen], 0, 1))
            size = np.abs(coefficients)
            tail = size[:, :, -TAIL:, :].sum(axis=(2, 3)) + size[:, :, :-TAIL, -TAIL:].sum(axis=(2, 3))
            pixel = np.hypot(coefficients[:, :, 0, 1], coefficients[:, :, 1, 0]) * (2.0 * PIXEL_ERROR / tiles.side)
            along = np.maximum(pixel[:, U], allowed / self._outer)
            empty = (off > EMPTY_MARGIN * tail[:, U]) & (~marked[chosen] | (TAIL_SHARE * tail[:, U] < along))
            good = (TAIL_SHARE * tail[:, U] < along) & (TAIL_SHARE * tail[:, PHI] < np.maximum(pixel[:, PHI], allowed))
            if self._channels > SLOPE:
                good &= TAIL_SHARE * tail[:, SLOPE] < np.maximum(pixel[:, SLOPE], allowed)
            good &= ~empty
            settled = np.flatnonzero(good)
            few = max(1, GROUP_PIXELS // tiles.side**2)
            for start in range(0, len(settled), few):
                some = settled[start : start + few]
                self._fill(tiles.select(chosen[some]), coefficients[some], order)
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
        single = coefficients.astype(np.float32)
        values: NDArray[Any] = base @ single @ base.T
        u = values[:, U].reshape(len(tiles), -1)
        low, high = u.min(axis=1), u.max(axis=1)
        # Whole tiles inside need no coverage; half a pixel's way to a rim is a small part of a tile's.
        reach = (high - low) / tiles.side
        whole = (low - reach > 1.0 / self._outer) & (high + reach < 1.0 / self._inner)
        if whole.any():
            self._write_tiles(order, tiles.select(whole), values[whole], None)
        rim = np.flatnonzero(~whole)
        if len(rim):
            self._fill_rim(order, tiles.select(rim), single[rim], values[rim])

    def _fill_rim(
        self, order: int, tiles: Tiles, coefficients: NDArray[Any], values: NDArray[Any]
    ) -> None:
        """Write tiles with a rim in them from Chebyshev coefficients and the channels, (n, channels, side, side)."""
        u = values[:, U]
        off = np.maximum(1.0 / self._outer - u, u - 1.0 / self._inner)
        # Half of the steps to both neighbours reaches a pixel's corner; slopes hardly change from one to the next.
        steps = np.zeros_like(u)
        steps[:, :, 1:] += np.abs(np.diff(u, axis=2))
        steps[:, 1:] += np.abs(np.diff(u, axis=1))
        steps[:, :, 0], steps[:, 0] = steps[:, :, 1], steps[:, 1]
        near = np.abs(off) < steps
        covered = (off < 0.0) & ~near
        partial = self._partly_covered(tiles, coefficients[:, U], near, covered)
        values[:, U] = np.clip(u, 1.0 / self._outer, 1.0 / self._inner)
        self._write_tiles(order, tiles, values, covered)
        (tile, row, column), share, met, (x, y) = partial
        base, slope = (each.astype(np.float32) for each in at_pixels(tiles.side, DISK_POINTS))
        along, upright = base[column] + slope[column] * x[:, None], base[row] + slope[row] * y[:, None]
        here = np.einsum("ncj,nj->cn", np.einsum("ni,ncij->ncj", upright, coefficients[tile]), along)
        here[U] = met
        place = (tiles.column[tile] + column, tiles.row[tile] + row)
        self._write(order, place, self._samples.matter(here), share)

    def _partly_covered(
        self, tiles: Tiles, coefficients: NDArray[Any], near: Mask, covered: Mask
    ) -> tuple[tuple[NDArray[np.intp], ...], Array, Array, tuple[Array, Array]]:
        """Return tile, row and column of pixels at a rim, their coverage, u within the annulus, and where in the pixel
        that is met; mark those that are `covered` wholly. `coefficients`: of u, (n, DISK_POINTS, DISK_POINTS)."""
        tile, row, column = np.nonzero(near)
        inside = (tiles.column[tile] + column < self._width) & (tiles.row[tile] + row < self._height)
        tile, row, column = tile[inside], row[inside], column[inside]
        base, slope = (each.astype(np.float32) for each in at_pixels(tiles.side, DISK_POINTS))
        group = max(1, GROUP_VALUES // DISK_POINTS**2)
        found = np.empty((3, len(tile)))
        for start in range(0, len(tile), group):
            part = slice(start, start + group)
            own = coefficients[tile[part]]
            across = np.einsum("nij,nj->ni", own, base[column[part]])
            found[0, part] = np.einsum("ni,ni->n", base[row[part]], across)
            found[2, part] = np.einsum("ni,ni->n", slope[row[part]], across)
            across = np.einsum("nij,nj->ni", own, slope[column[part]])
            found[1, part] = np.einsum("ni,ni->n", base[row[part]], across)
        share = coverage(found[0], found[1], found[2], self._inner, self._outer)
        whole = share == 1.0
        covered[tile[whole], row[whole], column[whole]] = True
        left = np.flatnonzero((share > 0.0) & ~whole)
        met = found[:, left]
        u, x, y = nearest_covered(met[0], met[1], met[2], self._inner, self._outer)
        return (tile[left], row[left], column[left]), share[left], u, (x, y)

    def _write_tiles(self, order: int, tiles: Tiles, values: NDArray[Any], covered: Mask | None) -> None:
        """Write tiles from channels of shape (n, channels, side, side), where they are wholly covered: None for all."""
        radius, phi, g = self._samples.matter(np.moveaxis(values, 1, 0))
        share = np.ones_like(radius) if covered is None else covered.astype(radius.dtype)
        for plane, channel in zip(self._planes[order], (radius, phi, g, share), strict=True):
            tiles.put(plane, channel if covered is None else np.where(covered, channel, 0.0))

    def _write(
        self,
        order: int,
        place: tuple[NDArray[np.intp], NDArray[np.intp]],
        matter: tuple[NDArray[Any], NDArray[Any], NDArray[Any]],
        share: Array,
    ) -> None:
        """Write pixels given by column and row, from radius, azimuth and g of shape (n,).

        Light that cannot be, where a place was moved too far to a rim next to the horizon, leaves its pixel empty.
        """
        known = matter[2] > 0.0
        columns, rows = (each[known] for each in place)
        for plane, values in zip(self._planes[order], (*matter, share), strict=True):
            plane[rows, columns] = values[known]

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
        values = np.full((self._disk.crossings, self._channels, *shape), np.nan)
        x, y = columns[traced].astype(np.float64) + 0.5, rows[traced].astype(np.float64) + 0.5
        values[:, :, traced], lost = self._samples.at(x, y, every[:, traced])
        given_up = np.zeros(shape, dtype=bool)
        given_up[traced] = lost
        given_up &= inside
        self._unresolved[rows[given_up], columns[given_up]] = True
        for order, channels in enumerate(values):
            chosen = np.flatnonzero(wanted[:, order])
            if not len(chosen):
                continue
            here = channels[:, chosen]
            here[U] = np.clip(here[U], *self._bounds)
            down, across = np.gradient(here[U], axis=1), np.gradient(here[U], axis=2)
            finer = self._needs_finer(here[U], across, down)
            finer &= inside[chosen]
            with np.errstate(invalid="ignore"):
                share = coverage(here[U], across, down, self._inner, self._outer)
                seen = np.nonzero((share > 0.0) & ~finer & inside[chosen])
            u, x, y = nearest_covered(here[U][seen], across[seen], down[seen], self._inner, self._outer)
            right, below = _slopes(here, seen)
            moved = here[:, seen[0], seen[1], seen[2]] + right * x + below * y
            moved[U] = u
            place = (columns[chosen][seen], rows[chosen][seen])
            self._write(order, place, self._samples.matter(moved), share[seen])
            self._divide(order, columns[chosen][finer], rows[chosen][finer], here[:, finer])

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
            values, _ = self._samples.at(x.ravel(), y.ravel(), alone)
            here = values[order].reshape(-1, *x.shape)
            here[U] = np.clip(here[U], *self._bounds)
            down, across = np.gradient(here[U], axis=(1, 2))
            shares = coverage(here[U], across, down, self._inner, self._outer).reshape(len(column), -1)
            share = shares.mean(axis=1)
            seen = share > 0.0
            here = here.reshape(self._channels, len(column), -1)[:, seen]
            here[U] = np.clip(here[U], 1.0 / self._outer, 1.0 / self._inner)
            radius, phi, g = self._samples.matter(here)
            # A pixel that is partly covered, or by all of the disk at once, shows its mean: one place of it would
            # twinkle from pixel to pixel along a thin ring.
            g = np.where(g > 0.0, g, 0.0)
            weights = shares[seen] * (g > 0.0)
            weights /= np.maximum(weights.sum(axis=1, keepdims=True), np.finfo(float).tiny)
            mean = [(each * weights).sum(axis=1) for each in (1.0 / radius, np.cos(phi), np.sin(phi), g)]
            azimuth = np.arctan2(mean[2], mean[1])
            with np.errstate(divide="ignore"):
                mean[0] = 1.0 / mean[0]
            matter = [mean[0], azimuth + 2.0 * math.pi * (azimuth < 0.0), mean[3]]
            whole = share[seen] == 1.0
            centre = centres[:, start : start + group][:, seen][:, whole]
            centre[U] = np.clip(centre[U], 1.0 / self._outer, 1.0 / self._inner)
            for each, central in zip(matter, self._samples.matter(centre), strict=True):
                each[whole] = central
            matter[1] = wrapped(matter[1])
            self._write(order, (column[seen], row[seen]), (matter[0], matter[1], matter[2]), share[seen])


def _slopes(values: Array, place: tuple[NDArray[np.intp], ...]) -> tuple[Array, Array]:
    """Return the changes from pixel to pixel, along the rows and down, of channels of shape (channels, n, side, side)
    at some places; none where a neighbour is not known."""
    tile, row, column = place
    last = values.shape[-1] - 1
    found = []
    for down, right in ((0, 1), (1, 0)):
        before = values[:, tile, np.maximum(row - down, 0), np.maximum(column - right, 0)]
        after = values[:, tile, np.minimum(row + down, last), np.minimum(column + right, last)]
        steps = 1.0 + ((row if down else column) % last != 0)  # one only at the tile's own edge
        change = after - before
        change[PHI] = nearest_turn(change[PHI])
        found.append(np.nan_to_num(change / steps))
    return found[0], found[1]
