# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracing the passes of a disk pixel by pixel, where its image is not smooth enough for anything else."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array, Index, Mask
from ..numerics.blocks import BLOCK_SIZE
from ..sampling.tiles import TILE_SIDES, Tiles, tiles_of
from .annulus import coverage, misses_with_neighbors, nearest_covered
from .disk_planes import DiskPlanes, mean_matter, slopes
from .disk_samples import DiskSamples, U

# So far off the disk, in units of 1 / r at its outer and inner rim, it does not matter for differences between pixels;
# and in 1 / M for large disks, whose outer rim is next to infinity.
LOWEST_STEP, HIGHEST_STEP = -2.0, 4.0
FARTHEST_STEP = -0.1

# Places along each side of a pixel that is divided.
FINER = 3

# Pixels on each side of one that are traced with it: what is bent shows in second differences.
BESIDE = 2

# A rim bent by more than this share of a pixel within the pixel is not taken for straight.
LARGEST_BEND = 0.05


class DiskTracing:
    """Rays for single pixels."""

    def __init__(
        self, samples: DiskSamples, planes: DiskPlanes, radii: tuple[float, float], size: tuple[int, int]
    ) -> None:
        """`radii`: of the disk's inner and outer rim; `size`: the map's width and height."""
        inner, outer = radii
        self._low, self._high = 1.0 / outer, 1.0 / inner
        self._samples, self._planes = samples, planes
        self._bounds = min(LOWEST_STEP / outer, FARTHEST_STEP), HIGHEST_STEP / inner
        self._crossings = len(planes.planes)
        self._width, self._height = size
        self.asked = np.zeros((self._crossings, self._height, self._width), dtype=bool)
        """Pixels that are to be traced, by crossing: of the others it is known that they are off the disk."""
        self._filled: dict[int, Mask] = {}
        self.unresolved = np.zeros((self._height, self._width), dtype=bool)
        """Pixels whose ray was given up."""

    def trace_only(self, order: int, columns: Index, rows: Index) -> Tiles:
        """Ask for the chosen pixels of a crossing, shape (n,), and none else; neighbors are traced along. Return the
        smallest tiles that hold any of these."""
        if not len(columns):
            return Tiles(TILE_SIDES[-1], columns, rows)
        beside = np.arange(-BESIDE, BESIDE + 1)
        column = np.clip(columns[:, None, None] + beside, 0, self._width - 1)
        row = np.clip(rows[:, None, None] + beside[:, None], 0, self._height - 1)
        self.asked[order, row, column] = True
        self._filled[order] = np.zeros((self._height, self._width), dtype=bool)
        self._filled[order][rows, columns] = True
        side = TILE_SIDES[-1]
        held = np.zeros((-(-self._height // side), -(-self._width // side)), dtype=bool)
        held[row // side, column // side] = True
        return tiles_of(self._width, self._height, side).select(held.ravel())

    def steps(self, tiles: Tiles, wanted: Mask, done: float) -> Generator[float, None, None]:
        """Fill tiles, for the crossings that are wanted of each, by a ray for each pixel or more; yield fractions from
        `done` to 1."""
        group = max(1, BLOCK_SIZE // tiles.side**2)
        for start in range(0, len(tiles), group):
            part = np.arange(start, min(start + group, len(tiles)))
            self._group(tiles.select(part), wanted[part])
            yield done + (1.0 - done) * (start + len(part)) / len(tiles)

    def _group(self, tiles: Tiles, wanted: Mask) -> None:
        columns, rows = tiles.pixels()
        shape = (len(tiles), tiles.side, tiles.side)
        columns, rows = np.broadcast_to(columns, shape), np.broadcast_to(rows, shape)
        inside = (columns < self._width) & (rows < self._height)
        looked = (np.minimum(rows, self._height - 1), np.minimum(columns, self._width - 1))
        every = wanted.T[:, :, None, None] & self.asked[:, *looked]
        traced: Mask = every.any(axis=0)
        values = np.full((self._crossings, self._samples.channels, *shape), np.nan)
        x, y = columns[traced].astype(np.float64) + 0.5, rows[traced].astype(np.float64) + 0.5
        values[:, :, traced], lost = self._samples.at(x, y, every[:, traced])
        given_up = np.zeros(shape, dtype=bool)
        given_up[traced] = lost
        given_up &= inside
        self.unresolved[rows[given_up], columns[given_up]] = True
        for order, channels in enumerate(values):
            chosen = np.flatnonzero(wanted[:, order])
            if not len(chosen):
                continue
            here = channels[:, chosen]
            here[U] = np.clip(here[U], *self._bounds)
            down, across = np.gradient(here[U], axis=1), np.gradient(here[U], axis=2)
            finer = self._needs_finer(here[U], across, down)
            open_here = inside[chosen]
            if order in self._filled:
                open_here &= self._filled[order][looked][chosen]
            finer &= open_here
            with np.errstate(invalid="ignore"):
                share = coverage(here[U], across, down, self._low, self._high)
                share[misses_with_neighbors(here[U], self._low, self._high)] = 0.0
                seen = np.flatnonzero((share > 0.0) & ~finer & open_here)
            moved = here.reshape(len(here), -1).take(seen, axis=1)
            u, x, y = nearest_covered(moved[U], across.take(seen), down.take(seen), self._low, self._high)
            right, below = slopes(here, seen)
            moved += right * x + below * y
            moved[U] = u
            place = (columns[chosen].take(seen), rows[chosen].take(seen))
            self._planes.write(order, place, self._samples.matter(moved), share.take(seen))
            self._divide(order, columns[chosen][finer], rows[chosen][finer], here[:, finer])

    def _needs_finer(self, u: Array, across: Array, down: Array) -> Mask:
        """Return which pixels have a rim in or beside them that is not nearly straight, shape (n, side, side)."""
        bend = np.abs(np.gradient(across, axis=2)) + np.abs(np.gradient(down, axis=1))
        bend += np.abs(np.gradient(across, axis=1))
        unknown = np.isnan(bend)  # beside pixels that are not traced
        reach = 0.5 * (np.abs(across) + np.abs(down)) + np.where(unknown, 0.0, bend)
        # A neighbor may reach further than the mean slope says.
        step_x, step_y = np.abs(np.diff(u, axis=2)), np.abs(np.diff(u, axis=1))
        reach[:, :, 1:], reach[:, :, :-1] = np.fmax(reach[:, :, 1:], step_x), np.fmax(reach[:, :, :-1], step_x)
        reach[:, 1:], reach[:, :-1] = np.fmax(reach[:, 1:], step_y), np.fmax(reach[:, :-1], step_y)
        touched = (u + reach > self._low) & (u - reach < self._high)
        whole = (u - reach > self._low) & (u + reach < self._high)
        steep = np.hypot(across, down)
        # At a tile's edge slopes are of one side, and do not tell whether a pixel reaches a rim that its center is off.
        edge = np.ones(u.shape[1:], dtype=bool)
        edge[1:-1, 1:-1] = False
        off = (edge | unknown) & ((u < self._low) | (u > self._high))
        needs: Mask = touched & ~whole & (off | (bend > 8.0 * LARGEST_BEND * steep))
        return needs

    def _divide(self, order: int, columns: NDArray[np.intp], rows: NDArray[np.intp], centers: Array) -> None:
        """Fill pixels from places on a finer grid inside them, and from their centers, shape (channels, n).

        A place more on each side gives the others slopes of both sides.
        """
        group = max(1, BLOCK_SIZE // (FINER + 2) ** 2)
        steps = (np.arange(-1, FINER + 1) + 0.5) / FINER
        for start in range(0, len(columns), group):
            column, row = columns[start : start + group], rows[start : start + group]
            x, y = column[:, None, None] + steps, row[:, None, None] + steps[:, None]
            x, y = np.broadcast_arrays(x, y)
            alone = np.zeros((self._crossings, x.size), dtype=bool)
            alone[order] = True
            values, _ = self._samples.at(x.ravel(), y.ravel(), alone)
            here = values[order].reshape(-1, *x.shape)
            here[U] = np.clip(here[U], *self._bounds)
            down, across = np.gradient(here[U], axis=(1, 2))
            shares = coverage(here[U], across, down, self._low, self._high)
            shares[misses_with_neighbors(here[U], self._low, self._high)] = 0.0
            shares = shares[:, 1:-1, 1:-1].reshape(len(column), -1)
            share = shares.mean(axis=1)
            seen = share > 0.0
            here = here[:, :, 1:-1, 1:-1].reshape(self._samples.channels, len(column), -1)[:, seen]
            here[U] = np.clip(here[U], self._low, self._high)
            radius, phi, g = self._samples.matter(here)
            matter = mean_matter(radius.T, phi.T, g.T, shares[seen].T)
            whole = share[seen] == 1.0
            center = centers[:, start : start + group][:, seen][:, whole]
            center[U] = np.clip(center[U], self._low, self._high)
            for each, central in zip(matter, self._samples.matter(center), strict=True):
                each[whole] = central
            self._planes.write(order, (column[seen], row[seen]), matter, share[seen])
