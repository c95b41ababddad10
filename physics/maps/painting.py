# SPDX-License-Identifier: GPL-3.0-or-later
"""Filling a warp map's pixels: interpolated where the sky is smooth, traced one by one where it is not."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..geodesics.tracer import trace_block
from ..numerics.angles import wrap_once
from ..numerics.arrays import Array, Image, Mask
from ..numerics.blocks import BLOCK_SIZE
from ..numerics.sphere import celestial_coordinates
from ..sampling.tiles import POINTS, TILE_SIDES, Tiles, interpolate, pool, sample, sides_for, tiles_of
from ..sampling.view import View
from ..sampling.visibility import CENTER_REACH, cells_for_shadow, center_block, near_edge, refine
from ..shot.cameras import PanoramaCamera
from ..shot.map_parameters import WarpMapParameters

# What pixels without any sky carry for 1 + z: no redshift. 0 is kept for "no valid map".
SHADOW_ONE_PLUS_Z = 1.0
# 1 + z of a pixel whose ray was given up, which no sky has: the compositor shows it as it shows a broken map.
UNRESOLVED_ONE_PLUS_Z = -1.0

# Tiles are worked through in groups of about this many pixels, which bounds the memory and the time between two steps.
GROUP_PIXELS = 4 * BLOCK_SIZE

# Tiles whose pixels are all traced are this large when that is asked for everywhere: small ones would work out the
# corners that they share more than once.
TRACED_SIDE = 128

# Points that one chord of the shadow's outline is divided into, at the most.
MOST_PIECES = 100_000


class Painting:
    """A warp map in the making."""

    def __init__(self, parameters: WarpMapParameters, view: View | None = None) -> None:
        """`view`: of these parameters, if there is one already."""
        self._parameters = parameters
        self._view = View(parameters) if view is None else view
        self._width, self._height = parameters.map_size
        shape = (self._height, self._width)
        self._theta, self._phi, self._visibility = (np.zeros(shape, np.float32) for _ in range(3))
        self._one_plus_z = np.full(shape, SHADOW_ONE_PLUS_Z, np.float32)
        self._unresolved = 0
        self._rays = 0

    @property
    def planes(self) -> tuple[Image, Image, Image, Image]:
        """theta, phi, 1 + z and visibility, each of shape (height, width)."""
        return self._theta, self._phi, self._one_plus_z, self._visibility

    def counts(self) -> dict[str, int]:
        """Number of pixels by what they see, and of the rays traced for them."""
        found = self._one_plus_z != UNRESOLVED_ONE_PLUS_Z
        whole = int(np.count_nonzero(found & (self._visibility == 1.0)))
        dark = int(np.count_nonzero(found & (self._visibility == 0.0)))
        return {
            "sky": whole,
            "edge": int(np.count_nonzero(found)) - whole - dark,
            "shadow": dark,
            "unresolved": self._unresolved,
            "rays": self._rays,
            "shared": 0,
        }

    def steps(self) -> Generator[float, None, None]:
        """Fill the map, yielding the fraction done after each step."""
        if self._parameters.interpolation > 0.0:
            yield from self._adaptive()
        else:
            yield from self._trace(tiles_of(self._width, self._height, TRACED_SIDE), 0.0, 1.0)

    # --- adaptive ----------------------------------------------------------------------------------

    def _adaptive(self) -> Generator[float, None, None]:
        touched, sky = self._survey()
        sides = sides_for(self._width, self._height)
        waiting = tiles_of(self._width, self._height, sides[0])
        # Interpolated tiles are quick; most of the time goes into the pixels that are traced at the end.
        done, share = 0.0, 0.5 / len(sides)
        for side in sides:
            cells = side // TILE_SIDES[-1]
            clear = ~pool(touched, cells)[waiting.row // side, waiting.column // side]
            seen = pool(sky, cells)[waiting.row // side, waiting.column // side]
            good = clear & ~seen  # all shadow, as the map is from the start
            smooth = np.flatnonzero(clear & seen)
            group = max(1, BLOCK_SIZE // POINTS**2)
            for start in range(0, len(smooth), group):
                members = smooth[start : start + group]
                tiles = waiting.select(members)
                coefficients, determined = sample(tiles, self._directions, self._parameters.interpolation)
                good[members] = determined
                yield done + share * (start + 0.5 * len(members)) / len(smooth)
                for _ in self._interpolate(tiles.select(determined), coefficients[determined]):
                    yield done + share * (start + len(members)) / len(smooth)
            done += share
            waiting = waiting.select(~good)
            if side != TILE_SIDES[-1]:
                waiting = waiting.divided().within(self._width, self._height)
        yield from self._trace(waiting, done, 1.0)

    def _survey(self) -> tuple[Mask, Mask]:
        """Return which of the smallest tiles the shadow's edge may touch, and which others see sky, (rows, columns)."""
        side = TILE_SIDES[-1]
        rows, columns = -(-self._height // side), -(-self._width // side)
        y, x = np.mgrid[0 : rows + 1, 0 : columns + 1] * float(side)
        corner_sky = self._view.edge(x, y) > 0.0
        touched = np.zeros((rows, columns), dtype=bool)
        for corner in (corner_sky[:-1, 1:], corner_sky[1:, :-1], corner_sky[1:, 1:]):
            touched |= corner != corner_sky[:-1, :-1]
        for x, y in (self._outline_points(), self._center_points()):
            # One pixel to each side: a pixel counts as touched when a neighbor is.
            for shift_x in (-2.0, 2.0):
                for shift_y in (-2.0, 2.0):
                    column, row = (x + shift_x) // side, (y + shift_y) // side
                    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
                    touched[row[inside].astype(np.intp), column[inside].astype(np.intp)] = True
        return touched, corner_sky[:-1, :-1]

    def _outline_points(self) -> tuple[Array, Array]:
        """Return points along the shadow's edge no farther apart than half of the smallest tile."""
        x, y = self._view.outline()
        next_x, next_y = np.roll(x, -1), np.roll(y, -1)
        step_x, step_y = next_x - x, next_y - y
        length = np.hypot(step_x, step_y)
        # Parts beside the picture do not matter, and a jump from one side of a panorama to the other is its seam.
        side = TILE_SIDES[-1]
        joined = (np.maximum(x, next_x) > -side) & (np.minimum(x, next_x) < self._width + side)
        joined &= (np.maximum(y, next_y) > -side) & (np.minimum(y, next_y) < self._height + side)
        if isinstance(self._parameters.camera, PanoramaCamera):
            joined &= length < 0.5 * self._width
        pieces = np.ones(len(x), dtype=np.intp)
        pieces[joined] = np.minimum(1 + length[joined] // (0.5 * side), MOST_PIECES).astype(np.intp)
        owner = np.repeat(np.arange(len(x)), pieces)
        first = np.repeat(np.cumsum(pieces) - pieces, pieces)
        part = (np.arange(len(owner)) - first) / pieces[owner]
        part_x, part_y = np.where(joined, step_x, 0.0), np.where(joined, step_y, 0.0)
        points_x, points_y = x[owner] + part * part_x[owner], y[owner] + part * part_y[owner]
        seen = np.isfinite(points_x)
        return points_x[seen], points_y[seen]

    def _center_points(self) -> tuple[Array, Array]:
        """Return points that mark the pixels around the hole's center, which `refine` looks at in any case."""
        center = self._view.center()
        if center is None:
            return np.empty(0), np.empty(0)
        reach = np.arange(-CENTER_REACH, CENTER_REACH + 1.0)
        x, y = np.meshgrid(center[0] + reach, center[1] + reach)
        return x.ravel(), y.ravel()

    def _directions(self, x: Array, y: Array) -> Array:
        """Return the sky's unit vectors, hole's frame, at map pixel coordinates; NaN in the shadow; shape (n, 3)."""
        direction = np.empty((3, len(x)))
        for start in range(0, len(x), BLOCK_SIZE):
            block = slice(start, start + BLOCK_SIZE)
            direction[:, block] = self._block_directions(x[block], y[block]).T
        return direction.T

    def _block_directions(self, x: Array, y: Array) -> Array:
        """Return the same as `_directions`, for one block."""
        _, direction = trace_block(self._view.rays(x, y), self._parameters.tolerance, self._parameters.method)
        self._rays += len(x)
        return direction

    def _interpolate(self, tiles: Tiles, coefficients: Array) -> Generator[None, None, None]:
        """Fill whole tiles of sky from Chebyshev coefficients, a group at a time."""
        group = max(1, GROUP_PIXELS // (tiles.side * tiles.side))
        for start in range(0, len(tiles), group):
            part = np.arange(start, min(start + group, len(tiles)))
            self._interpolate_group(tiles.select(part), coefficients[part])
            yield

    def _interpolate_group(self, tiles: Tiles, coefficients: Array) -> None:
        x, y, z = interpolate(coefficients, tiles.side, self._view.hole_to_world)
        theta = np.arctan2(np.sqrt(x * x + y * y), z)
        phi = wrap_once(np.arctan2(y, x))
        columns, rows = tiles.pixels()
        one_plus_z = self._view.one_plus_z(columns.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5)
        for plane, values in zip(self.planes, (theta, phi, one_plus_z, np.ones_like(theta)), strict=True):
            tiles.put(plane, values)

    # --- pixel by pixel ------------------------------------------------------------------------------

    def _trace(self, tiles: Tiles, done: float, end: float) -> Generator[float, None, None]:
        """Fill tiles by a ray for each pixel, yielding fractions from `done` to `end`."""
        group = max(1, GROUP_PIXELS // (tiles.side * tiles.side))
        for start in range(0, len(tiles), group):
            part = tiles.select(np.arange(start, min(start + group, len(tiles))))
            last = min(start + group, len(tiles))
            for fraction in self._trace_group(part):
                yield done + (end - done) * (start + fraction * (last - start)) / len(tiles)

    def _trace_group(self, tiles: Tiles) -> Generator[float, None, None]:
        visibility, x, y = self._visible_parts(tiles)
        columns, rows = (np.broadcast_to(each, visibility.shape) for each in tiles.pixels())
        inside = (columns < self._width) & (rows < self._height)
        columns, rows = columns[inside], rows[inside]
        visibility, x, y = visibility[inside], x[inside], y[inside]
        self._visibility[rows, columns] = visibility
        yield 0.2
        traced = np.flatnonzero(visibility > 0.0)
        for start in range(0, len(traced), BLOCK_SIZE):
            pixel = traced[start : start + BLOCK_SIZE]
            direction = self._block_directions(x[pixel], y[pixel])
            theta, phi = celestial_coordinates(direction @ self._view.hole_to_world.T)
            lost = np.isnan(theta)  # a point that sees sky, and whose ray was given up all the same
            one_plus_z = self._view.one_plus_z(x[pixel], y[pixel])
            place = (rows[pixel], columns[pixel])
            self._theta[place] = np.where(lost, 0.0, theta)
            self._phi[place] = wrap_once(np.where(lost, 0.0, phi))
            self._one_plus_z[place] = np.where(lost, UNRESOLVED_ONE_PLUS_Z, one_plus_z)
            self._unresolved += int(np.count_nonzero(lost))
            yield 0.2 + 0.8 * (start + len(pixel)) / len(traced)

    def _visible_parts(self, tiles: Tiles) -> tuple[Array, Array, Array]:
        """Return the visible share of each pixel and a point in the visible part, shape (n, side, side) each."""
        columns, rows = tiles.pixels()
        # A pixel more on each side: whether a pixel is near the edge depends on its neighbors.
        steps = np.arange(-1, tiles.side + 2)
        corner_x = tiles.column[:, None, None] + steps + 0.0 * steps[:, None]
        corner_y = tiles.row[:, None, None] + steps[:, None] + 0.0 * steps
        corners = self._view.edge(corner_x, corner_y)
        marked = near_edge(corners)
        visibility = (corners[:, 1:-2, 1:-2] > 0.0).astype(np.float64)
        x, y = (np.broadcast_to(each + 0.5, visibility.shape).copy() for each in (columns, rows))
        tile, row, column = np.nonzero(marked)
        where = (tile, row, column)
        visibility[where], x[where], y[where] = refine(
            tiles.column[tile] + column, tiles.row[tile] + row, self._view.edge
        )
        center = self._view.center()
        block_column, block_row = center_block(center, self._width, self._height)
        for i in range(len(tiles)):
            column, row = block_column - tiles.column[i], block_row - tiles.row[i]
            held = (column >= 0) & (column < tiles.side) & (row >= 0) & (row < tiles.side)
            if center is not None and held.any():
                place = (i, row[held], column[held])
                visibility[place], x[place], y[place] = refine(
                    block_column[held], block_row[held], self._view.edge, cells_for_shadow(center, self._view.edge)
                )
        return visibility, x, y
