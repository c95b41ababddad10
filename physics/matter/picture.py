# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's picture on the disk: azimuth across, the logarithm of the radius down, the inner edge at the top."""

from __future__ import annotations

import hashlib
import math

import numpy as np

from ..numerics.arrays import Array, Image, Index
from ..numerics.errors import BlackHoleError

LARGEST = 2048, 1024
"""Columns and rows; a larger picture is averaged down."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
SMALLEST_ALPHA = np.float32(1e-4)


class Picture:
    """A picture at all pairs of a level across and a level down, as in `rip_map`."""

    def __init__(self, pixels: Array | Image, is_color: bool, is_ramp: bool = False) -> None:
        """Prepare a picture.

        Parameters
        ----------
        pixels : ndarray, shape (rows, columns, 4)
            Linear Rec. 709, premultiplied by the alpha, row 0 at the top.
        is_color : bool
            Whether its colors are those of the disk and its alpha says how dense it is; else its brightness does.
        is_ramp : bool
            Whether only the means of its rows count: colors by radius, for a disk that keeps its turbulence.

        Raises
        ------
        BlackHoleError
            If it has no pixels, or values that are not finite.
        """
        pixels = np.asarray(pixels, dtype=np.float32)
        if pixels.ndim != 3 or pixels.shape[2] != 4 or not pixels.size or not np.isfinite(pixels).all():
            raise BlackHoleError(
                "The picture on the disk has no pixels, or values that are not numbers.", code="disk.picture"
            )
        self.is_color, self.is_ramp = bool(is_color), bool(is_ramp)
        if self.is_ramp:
            pixels = pixels.mean(axis=1, keepdims=True)
        self.digest = hashlib.sha256(
            b"%d %d %d %d " % (*pixels.shape[:2], self.is_color, self.is_ramp)
            + np.ascontiguousarray(pixels, dtype="<f4").tobytes()
        ).hexdigest()
        row: Image = np.maximum(pixels, np.float32(0.0))
        for axis, most in ((1, LARGEST[0]), (0, LARGEST[1])):
            row = _resized(row, axis, most)
        self._rows, self._columns = row.shape[:2]
        self._levels_down, self._levels_across = (int(math.log2(each)) + 1 for each in row.shape[:2])
        parts, bases, total = [], [], 0
        for _down in range(self._levels_down):
            here = row
            for _across in range(self._levels_across):
                parts.append(here.reshape(-1, 4))
                bases.append(total)
                total += len(parts[-1])
                if here.shape[1] > 1:
                    here = np.float32(0.5) * (here[:, ::2] + here[:, 1::2])
            if row.shape[0] > 1:
                row = np.float32(0.5) * (row[::2] + row[1::2])
        self._atlas, self._bases = np.concatenate(parts), np.array(bases)

    def at(self, place: Image, phi: Image, radial: Image, azimuthal: Image) -> Image:
        """Return the picture at places, averaged over footprints, shape (n, 4).

        Parameters
        ----------
        place : ndarray of float32, shape (n,)
            0 at the inner edge to 1 at the outer one.
        phi : ndarray of float32, shape (n,)
            Azimuth, radians.
        radial, azimuthal : ndarray of float32, shape (n,)
            Sides of the footprints, in the unit of `place` and radians.
        """
        down = self._level(radial * np.float32(self._rows), self._levels_down)
        across = self._level(azimuthal * np.float32(self._columns / (2.0 * math.pi)), self._levels_across)
        rows, columns = np.right_shift(self._rows, down), np.right_shift(self._columns, across)
        base = self._bases.take(down * self._levels_across + across)
        y = np.clip(place * rows - 0.5, 0.0, rows - 1.0)
        x = phi * (columns / (2.0 * math.pi)) - 0.5
        top, left = np.floor(y).astype(np.int64), np.floor(x).astype(np.int64)
        down_share, right_share = (y - top).astype(np.float32)[:, None], (x - left).astype(np.float32)[:, None]
        below = np.minimum(top + 1, rows - 1)
        left, right = left % columns, (left + 1) % columns

        def row(number: Index) -> Image:
            start = base + number * columns
            one, other = self._atlas.take(start + left, axis=0), self._atlas.take(start + right, axis=0)
            mixed: Image = one + right_share * (other - one)
            return mixed

        upper = row(top)
        found: Image = upper + down_share * (row(below) - upper)
        return found

    def _level(self, texels: Image, count: int) -> Index:
        level = np.log2(np.maximum(texels, np.float32(1.0))) + np.float32(0.5)
        found: Index = np.minimum(level, count - 1).astype(np.int64)
        return found

    def density(self, seen: Image) -> Image:
        """Return by how much the optical depth is multiplied, shape (n,), from `at`."""
        found: Image = seen[:, 3] if self.is_color else seen[:, :3] @ _LUMINANCE
        return found

    def colors(self, seen: Image) -> Image:
        """Return the picture's own colors, shape (n, 3), from `at`: no longer premultiplied."""
        alpha: Image = np.maximum(seen[:, 3:], SMALLEST_ALPHA)
        found: Image = seen[:, :3] * (np.float32(1.0) / alpha)
        return found


def _resized(pixels: Image, axis: int, most: int) -> Image:
    """Return pixels with a power of two of them along an axis, at most so many: averaged, or interpolated."""
    count = pixels.shape[axis]
    wanted = min(1 << max(0, math.ceil(math.log2(count))), most)
    if count == wanted:
        return pixels
    # The mean over each new pixel of the piecewise constant picture.
    edges = np.linspace(0.0, count, wanted + 1)
    sums = np.concatenate([np.zeros_like(pixels.take([0], axis)), np.cumsum(pixels, axis=axis, dtype=np.float64)], axis)
    whole = np.minimum(edges.astype(int), count - 1)
    shape = [1] * pixels.ndim
    shape[axis] = len(edges)
    share = (edges - whole).reshape(shape)
    at_edges = sums.take(whole, axis) + share * pixels.take(whole, axis)
    means: Array = np.diff(at_edges, axis=axis) * (wanted / count)
    return means.astype(np.float32)
