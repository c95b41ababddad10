# SPDX-License-Identifier: GPL-3.0-or-later
"""A sky at ever coarser resolution, by which it is filtered where many of its texels fall into one pixel.

Level 0 is the sky itself, each further level has half the rows and columns of the one before. A texel of a level is the
mean light of the part of the celestial sphere that it covers: rows are weighted by their solid angles, and from level
1 on each row is averaged in azimuth over 1 / sin(theta) texels, so that texels beside the poles are as wide as high
(Heckbert 1989, "Fundamentals of Texture Mapping and Image Warping", on prefiltered look-ups; the weights are those of
the sphere).

All levels but level 0, which is the sky's own picture, fit into one picture, the atlas: level 1 at the bottom, the
others side by side above it, each with a margin of `MARGIN` texels that continues it, columns around the sky and rows
beyond the poles. Its layout follows from its height alone; see `LevelLayout`. With level 0 in it, it would take four
times the memory.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..numerics.errors import BlackHoleError

Texels = NDArray[np.float32]

MARGIN = 4
"""Texels around each level of the atlas: enough for a bilinear look-up by coordinates of single precision."""

FEWEST_ROWS = 8
"""The coarsest level has 8 to 15 rows: eight looks of that width see the whole sky."""

MOST_ROWS = 8192
"""Rows of level 0 at most; a sky with more is averaged down to as many."""

LARGEST_HALF = 65504.0


@dataclass(frozen=True)
class LevelLayout:
    """Where levels lie in a picture, the first one at the bottom.

    Attributes
    ----------
    rows : int
        Rows of the first level, m 2^(count - 1) with m from 8 to 15; it has twice as many columns.
    """

    rows: int

    @property
    def count(self) -> int:
        """Number of levels."""
        return math.floor(math.log2(self.rows / FEWEST_ROWS)) + 1

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the atlas: 3/2 rows + 4 margins high."""
        further = sum(2 * self.rows // 2**level + 2 * MARGIN for level in range(1, self.count))
        return max(2 * self.rows + 2 * MARGIN, further), self.rows * 3 // 2 + 4 * MARGIN

    def corner(self, level: int) -> tuple[int, int]:
        """Columns and rows from the lower left corner to that of a level, without its margin; 0 is the first one."""
        if level == 0:
            return MARGIN, MARGIN
        before = sum(2 * self.rows // 2**each + 2 * MARGIN for each in range(1, level))
        return before + MARGIN, self.rows + 3 * MARGIN


def layout_for(rows: int, columns: int) -> LevelLayout:
    """Return the layout for a sky of a size: the next one that has as many texels both ways, up to `MOST_ROWS` rows.

    Parameters
    ----------
    rows, columns : int
        Of the sky's picture, at least 1.
    """
    least = min(max(rows, -(-columns // 2), 2 * FEWEST_ROWS), MOST_ROWS)
    step = 2 ** math.floor(math.log2(least / FEWEST_ROWS))
    return LevelLayout(-(-least // step) * step)


@dataclass(frozen=True)
class SkyLevels:
    """The levels of a sky.

    Attributes
    ----------
    levels : tuple of ndarray of float32, shape (rows / 2^l, 2 rows / 2^l, channels)
        Row 0 at the top, the zenith.
    """

    levels: tuple[Texels, ...]

    @property
    def layout(self) -> LevelLayout:
        """How many there are, of how many rows."""
        return LevelLayout(self.levels[0].shape[0])

    @property
    def atlas_layout(self) -> LevelLayout:
        """Where levels 1 and further lie in the atlas."""
        return LevelLayout(self.levels[1].shape[0])

    def atlas(self) -> Texels:
        """Return all levels but level 0 in one picture, row 0 at the top.

        Returns
        -------
        ndarray of float32, shape (height, width, channels)
            The size of `atlas_layout`; black where no level lies.
        """
        layout = self.atlas_layout
        width, height = layout.size
        picture = np.zeros((height, width, self.levels[0].shape[2]), np.float32)
        for number, level in enumerate(self.levels[1:]):
            column, row = layout.corner(number)
            around = np.pad(level, ((0, 0), (MARGIN, MARGIN), (0, 0)), mode="wrap")
            around = np.pad(around, ((MARGIN, MARGIN), (0, 0), (0, 0)), mode="edge")
            top, left = height - row - level.shape[0] - MARGIN, column - MARGIN
            picture[top : top + around.shape[0], left : left + around.shape[1]] = around
        return picture


def sky_levels(picture: ArrayLike) -> SkyLevels:
    """Return the levels of an equirectangular sky.

    Parameters
    ----------
    picture : array_like, shape (rows, columns, channels)
        Scene-linear, row 0 at the top (the zenith). Values that are no numbers count as 0, infinite ones as the largest
        number of half precision.

    Returns
    -------
    SkyLevels
        Level 0 is the picture, resampled if its size is not one of `layout_for`: averaged along an axis that has more
        texels, interpolated along one that has fewer.

    Raises
    ------
    BlackHoleError
        If it is no picture.

    Notes
    -----
    The mean light of the whole sphere, by solid angle, is the same at each level, to single precision.
    """
    texels = np.array(picture, dtype=np.float32)
    if texels.ndim != 3 or 0 in texels.shape:
        raise BlackHoleError(
            f"The environment has shape {texels.shape}, expected (rows, columns, channels).", code="settings.array"
        )
    np.nan_to_num(texels, copy=False, nan=0.0, posinf=LARGEST_HALF, neginf=0.0)
    layout = layout_for(*texels.shape[:2])
    texels = _resampled(texels, layout.rows, axis=0, around=False)
    texels = _resampled(texels, 2 * layout.rows, axis=1, around=True)
    plain = [texels]
    while len(plain) < layout.count:
        plain.append(_halved(plain[-1]))
    return SkyLevels((texels, *(_even_in_azimuth(level) for level in plain[1:])))


def _halved(level: Texels) -> Texels:
    """Mean of 2 x 2 texels by solid angle: a row's is cos(theta_1) - cos(theta_2)."""
    rows = level.shape[0]
    weights = -np.diff(np.cos(np.linspace(0.0, np.pi, rows + 1)))
    share = weights[::2] / (weights[::2] + weights[1::2])
    upper = share.astype(np.float32)[:, np.newaxis, np.newaxis]
    by_rows = level[::2] * upper + level[1::2] * (1.0 - upper)
    halved: Texels = np.float32(0.5) * (by_rows[:, ::2] + by_rows[:, 1::2])
    return halved


def _even_in_azimuth(level: Texels) -> Texels:
    """Each row averaged around each texel over 1 / sin(theta) texels, at most once around."""
    rows, columns = level.shape[:2]
    even = level.copy()
    widths = np.minimum(1.0 / np.sin((np.arange(rows) + 0.5) * np.pi / rows), columns)
    for row in np.flatnonzero(widths > 1.0):
        even[row] = _box_around(level[row], float(widths[row]))
    return even


def _box_around(row: Texels, width: float) -> NDArray[np.float64]:
    """Mean over `width` texels around each texel's center, where the row goes on around the sky."""
    columns = row.shape[0]
    total = np.concatenate([np.zeros((1, row.shape[1])), np.cumsum(np.tile(row.astype(np.float64), (3, 1)), axis=0)])
    centers = columns + np.arange(columns) + 0.5
    mean: NDArray[np.float64] = (_at(total, centers + 0.5 * width) - _at(total, centers - 0.5 * width)) / width
    return mean


def _at(total: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """A running total, along axis 0, at places between its steps."""
    before = np.minimum(places.astype(np.int64), total.shape[0] - 2)
    share = (places - before).reshape((-1,) + (1,) * (total.ndim - 1))
    between: NDArray[np.float64] = total[before] * (1.0 - share) + total[before + 1] * share
    return between


def _resampled(texels: Texels, count: int, *, axis: int, around: bool) -> Texels:
    """A picture with `count` texels along an axis: averaged if it had more, interpolated if it had fewer."""
    present = texels.shape[axis]
    if present == count:
        return texels
    lines = np.moveaxis(texels, axis, 0)
    if present > count:
        total = np.concatenate([np.zeros((1, *lines.shape[1:])), np.cumsum(lines, axis=0, dtype=np.float64)])
        edges = _at(total, np.linspace(0.0, present, count + 1))
        result = np.diff(edges, axis=0) * (count / present)
    else:
        places = (np.arange(count) + 0.5) * present / count - 0.5
        before = np.floor(places).astype(np.int64)
        share = (places - before).reshape((-1,) + (1,) * (lines.ndim - 1))
        first, second = ((each % present if around else np.clip(each, 0, present - 1)) for each in (before, before + 1))
        result = lines[first] * (1.0 - share) + lines[second] * share
    return np.ascontiguousarray(np.moveaxis(result, 0, axis), dtype=np.float32)
