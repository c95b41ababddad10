# SPDX-License-Identifier: GPL-3.0-or-later
"""Two random fields at once, averaged over rectangles of any power of two of texels: a rip map.

A rip map (Larson & Shah 1990, "Rip maps", Silicon Graphics; Akenine-Moeller et al. 2018, Real-Time Rendering, 6.2.2)
holds a picture at all pairs of a level across and a level down, so that a footprint that is long one way is not
blurred the other way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array, Image

Complex = NDArray[np.complex64]
Whole = NDArray[np.int32]

_HALVES = (2.0 ** -np.arange(32)).astype(np.float32)
_TURN = 2.0 * math.pi


class Levels(NamedTuple):
    """Where in a rip map to look for footprints; arrays of shape (n,)."""

    across: Image
    """Texels of the level per radian."""
    down: Image
    """Texels of the level per ln r."""
    columns: Whole
    last_row: Whole
    base: Whole
    """Where the level begins."""
    lost_heat: Image
    """Variance of the heat that the level has averaged away, 0 to 1."""
    lost_density: Image


class RipMap:
    """Heat (the real part) and density (the imaginary part), Gaussian fields of mean 0 and variance 1.

    Azimuth runs across, 0 to 2 pi; the logarithm of the radius down, `span` per repetition.
    """

    def __init__(self, heat: Array, density: Array, span: float) -> None:
        """`heat`, `density`: shape (rows, columns), both powers of two."""
        row = (heat + 1j * density).astype(np.complex64)
        self.rows, self.columns = row.shape
        self.span = span
        self.levels_down, self.levels_across = int(math.log2(self.rows)), int(math.log2(self.columns))
        parts, bases, total = [], [], 0
        lost = np.zeros((self.levels_down, self.levels_across, 2))
        for down in range(self.levels_down):
            here = row
            for across in range(self.levels_across):
                parts.append(here.ravel())
                bases.append(total)
                total += here.size
                lost[down, across] = 1.0 - here.real.var(), 1.0 - here.imag.var()
                here = np.complex64(0.5) * (here[:, ::2] + here[:, 1::2])
            row = np.complex64(0.5) * (row[::2] + row[1::2])
        # numpy takes whole numbers more than twice as fast as complex ones of the same size.
        self._atlas = np.concatenate(parts).view(np.uint64)
        self._bases = np.array(bases, dtype=np.int32)
        self._lost = np.clip(lost, 0.0, 1.0).reshape(-1, 2).astype(np.float32)

    def levels(self, radial: Image, azimuthal: Image) -> Levels:
        """Return where to look for footprints of these sides, in ln r and radians, shape (n,)."""
        down = np.log2(np.maximum(radial * np.float32(self.rows / self.span), np.float32(1.0)))
        across = np.log2(np.maximum(azimuthal * np.float32(self.columns / _TURN), np.float32(1.0)))
        half = np.float32(0.5)
        down, across = (
            np.minimum(each + half, most).astype(np.int32)
            for each, most in ((down, self.levels_down - 1), (across, self.levels_across - 1))
        )
        level = down * np.int32(self.levels_across) + across
        lost = self._lost.take(level, axis=0)
        return Levels(
            _HALVES.take(across) * np.float32(self.columns / _TURN),
            _HALVES.take(down) * np.float32(self.rows / self.span),
            np.right_shift(np.int32(self.columns), across),
            np.right_shift(np.int32(self.rows - 1), down),
            self._bases.take(level),
            lost[:, 0],
            lost[:, 1],
        )

    def at(self, log_radius: Image, phi: Image, levels: Levels) -> Complex:
        """Return both fields at places of shape (n,), bilinear in texels of their levels."""
        x = phi * levels.across
        x -= np.float32(0.5)
        y = log_radius * levels.down
        y -= np.float32(0.5)
        left, top = np.floor(x), np.floor(y)
        x -= left
        y -= top
        width, last_row = levels.columns, levels.last_row
        last_column = width - 1
        first, upper = left.astype(np.int32), top.astype(np.int32)
        second, lower = first + 1, upper + 1
        first &= last_column
        second &= last_column
        upper &= last_row
        lower &= last_row
        upper *= width
        upper += levels.base
        lower *= width
        lower += levels.base
        found: Complex = self._atlas.take(upper + first).view(np.complex64)
        step = self._atlas.take(upper + second).view(np.complex64)
        step -= found
        step *= x
        found += step
        below = self._atlas.take(lower + first).view(np.complex64)
        step = self._atlas.take(lower + second).view(np.complex64)
        step -= below
        step *= x
        below += step
        below -= found
        below *= y
        found += below
        return found
