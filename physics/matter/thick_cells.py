# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of pixels whose rays are interpolated between the cells' corners.

The places along a pass are bilinear in the pixel within a cell. What that leaves out is an eighth of their second
differences from corner to corner; cells where that is too much, or of which some corners miss a pass that others see,
are left to be traced pixel by pixel.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import Any

import numpy as np

from ..numerics.arrays import Image, Index, Mask
from ..sampling.view import View
from ..shot.disk import Disk
from .surface import Surface
from .thick_nodes import Nodes, extents, passes_of, profile, shares_seen, wrapped

CORNERS_AT_ONCE = 1 << 12
"""Rays traced at a time."""
PIXELS_AT_ONCE = 1 << 14

EVEN_SHARE = 0.3
"""Least ratio of optical depths between which they are interpolated."""
WIDENED = 2.0
"""Of the smooth layer, for where clouds may be seen."""
VISIBLE_PASS = 0.03
"""Passes that take less than this of the light behind do not matter."""

PIXEL_SHARE, LEAST_ERROR = 0.25, (0.003, 0.008, 0.02, 0.02)
"""What interpolation may leave out of ln r, azimuth, ln g and z / H: this share of the change from pixel to pixel, and
so much in any case."""


class _Field:
    """One pass at all corners; arrays of shape (rows, columns) or (nodes, rows, columns)."""

    def __init__(self, nodes: int, shape: tuple[int, int], timed: bool) -> None:
        self.known: Mask = np.zeros(shape, dtype=bool)
        self.values = np.zeros((8 if timed else 7, nodes, *shape), dtype=np.float32)
        """ln r, azimuth, ln g, z / H, optical depth, extents in ln r and azimuth and, if asked for, the delay."""

    def nodes(self, chosen: Index) -> Nodes:
        """Return the nodes of corners."""
        one, two, three, four, five = self.values[:5].reshape(5, len(self.values[0]), -1)[..., chosen]
        return Nodes(one, two, three, four, five, five[:0])

    def set_extents(self, side: int) -> None:
        """Work out the extents."""
        corner = np.flatnonzero(self.known)
        for plane, extent in zip(
            self.values[5:7], extents(self.nodes(corner), corner, self.known.shape[1], side), strict=True
        ):
            plane.reshape(len(plane), -1)[:, corner] = extent


class Cells:
    """All cells of a picture."""

    def __init__(self, side: int, size: tuple[int, int]) -> None:
        """`side`: pixels along the sides of cells; `size`: columns and rows of the picture."""
        self._side, (self._width, self._height) = side, size
        self._shape = -(-self._height // side) + 1, -(-self._width // side) + 1
        self._fields: dict[tuple[bool, int], _Field] = {}
        self._good: Mask = np.ones((self._shape[0] - 1, self._shape[1] - 1), dtype=bool)
        self.unresolved = 0
        """Pixels whose rays have no energy, of the cells that are interpolated."""

    def trace(self, view: View, surface: Surface, disk: Disk, spin: float, nodes: int) -> Generator[float, None, None]:
        """Trace the corners, yielding the fraction done, and find which cells are good."""
        rows, columns = self._shape
        timed = surface.look.light_travel > 0.0
        energy = np.ones(rows * columns, dtype=bool)
        for start in range(0, rows * columns, CORNERS_AT_ONCE):
            corner = np.arange(start, min(start + CORNERS_AT_ONCE, rows * columns))
            row, column = np.divmod(corner, columns)
            rays = view.rays(column * float(self._side), row * float(self._side))
            energy[corner] = rays.escapes
            for each in passes_of(surface, rays, disk, spin, nodes):
                key = each.is_slow, each.order
                if key not in self._fields:
                    self._fields[key] = _Field(nodes, self._shape, timed)
                field = self._fields[key]
                where = corner[each.ray]
                field.known.ravel()[where] = True
                one = each.nodes
                flat = field.values.reshape(len(field.values), nodes, -1)
                for plane, values in enumerate((one.log_radius, one.phi, one.log_g, one.zeta, one.depth)):
                    flat[plane][:, where] = values
                if timed:
                    flat[7][:, where] = one.delay
            yield (start + len(corner)) / (rows * columns)
        self._good &= _all_corners(energy.reshape(self._shape))
        for field in self._fields.values():
            field.set_extents(self._side)
            self._judge(field)

    def _judge(self, field: _Field) -> None:
        """Strike out cells in which a field is not bilinear."""
        values = field.values
        seen = shares_seen(values[4] * profile(values[3] * np.float32(1.0 / WIDENED)))
        total = seen.sum(axis=0)
        visible = field.known & (total > VISIBLE_PASS)
        self._good &= ~(_any_corner(visible) & _any_corner(~field.known))
        # What is opaque at one corner and empty at another has an edge between them.
        depth = _corners(np.where(field.known, values[4].sum(axis=0), np.float32(0.0)))
        uneven = depth.min(axis=0) < EVEN_SHARE * depth.max(axis=0)
        self._good &= ~(_any_corner(visible) & uneven)
        seen /= np.maximum(total, np.float32(1e-6))
        bad = np.zeros(self._shape, dtype=bool)
        for number, least in enumerate(LEAST_ERROR):
            plane = values[number]
            for axis in (1, 2):
                first = np.diff(plane, axis=axis)
                if number == 1:
                    first = wrapped(first)
                second = np.diff(first, axis=axis)
                middle = [slice(None)] * 3
                middle[axis] = slice(1, -1)
                before, after = middle.copy(), middle.copy()
                before[axis], after[axis] = slice(None, -2), slice(2, None)
                weight = seen[tuple(middle)]
                error = (np.abs(second) * weight).sum(axis=0) * np.float32(0.125)
                steps = first[(slice(None), slice(None, -1))] if axis == 1 else first[..., :-1]
                allowed = (np.abs(steps) * weight).sum(axis=0) * np.float32(PIXEL_SHARE / self._side)
                all_known = field.known[tuple(before[1:])] & field.known[tuple(after[1:])]
                bad[tuple(middle[1:])] |= all_known & (error > np.maximum(allowed, np.float32(least)))
        self._good &= ~_any_corner(bad & visible)

    def left(self) -> Index:
        """Return the pixels of cells that are not interpolated, in order."""
        whole = np.repeat(np.repeat(self._good, self._side, axis=0), self._side, axis=1)
        return np.flatnonzero(~whole[: self._height, : self._width])

    def parts(self) -> Iterator[tuple[Index, list[tuple[Nodes, Image, Image]]]]:
        """Yield pixels, and their passes front to back with the extents of nodes in ln r and azimuth."""
        side = self._side
        y, x = (each.ravel() for each in np.mgrid[0:side, 0:side])
        t, s = ((each + 0.5) / side for each in (y, x))
        weights = np.stack([(1 - t) * (1 - s), (1 - t) * s, t * (1 - s), t * s]).astype(np.float32)
        for key in sorted(self._fields):
            field = self._fields[key]
            cells = np.flatnonzero(self._good & _any_corner(field.known))
            for start in range(0, len(cells), PIXELS_AT_ONCE // side**2):
                cell = cells[start : start + PIXELS_AT_ONCE // side**2]
                row, column = np.divmod(cell, self._shape[1] - 1)
                pixel_row, pixel_column = row[:, None] * side + y, column[:, None] * side + x
                inside = (pixel_row < self._height) & (pixel_column < self._width)
                pixels = (pixel_row * self._width + pixel_column)[inside]
                yield pixels, [self._interpolated(field, row, column, weights, inside.ravel())]

    def _interpolated(
        self, field: _Field, row: Index, column: Index, weights: Image, inside: Mask
    ) -> tuple[Nodes, Image, Image]:
        corner_row, corner_column = np.stack([row, row, row + 1, row + 1]), np.stack([column, column + 1] * 2)
        values = field.values[:, :, corner_row, corner_column]  # (planes, nodes, 4, n)
        known = field.known[corner_row, corner_column].astype(np.float32)
        # Corners without the pass have the mean of the others, and no matter.
        share = known / known.sum(axis=0)
        first = known.argmax(axis=0)
        base = values[1][:, first, np.arange(len(row))][:, None]
        values[1] = base + wrapped(values[1] - base)
        lacking = known == 0.0
        if lacking.any():
            mean = (values * share).sum(axis=2, keepdims=True)
            mean[4] = 0.0
            values = np.where(lacking, mean, values)
        pixels = [
            np.matmul(np.ascontiguousarray(plane.swapaxes(1, 2)), weights).reshape(len(plane), -1)[:, inside]
            for plane in values
        ]
        delay = pixels[7] if len(pixels) > 7 else np.zeros(0, dtype=np.float32)
        log_radius, phi, log_g, zeta, depth, radial, azimuthal = pixels[:7]
        return Nodes(log_radius, phi, log_g, zeta, depth, delay), radial, azimuthal


def _corners(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the values at the four corners of each cell, shape (4, rows, columns)."""
    return np.stack([values[:-1, :-1], values[:-1, 1:], values[1:, :-1], values[1:, 1:]])


def _any_corner(corners: Mask) -> Mask:
    found: Mask = _corners(corners).any(axis=0)
    return found


def _all_corners(corners: Mask) -> Mask:
    found: Mask = _corners(corners).all(axis=0)
    return found
