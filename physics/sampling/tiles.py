# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive sampling: where the lensed sky is smooth, a few rays stand for a tile of pixels.

The direction that a pixel's light comes from is a smooth function of the pixel except at the shadow's edge, where it
oscillates without end. A tile away from the edge is sampled at n x n Chebyshev points; its unit vectors are
interpolated by a polynomial of degree n - 1 in each coordinate (never the angles, which jump at the seam and at the
poles). The highest coefficients tell the error: for an analytic function they fall geometrically, and what is left out
is about as large as the last that is kept (Trefethen 2013, Approximation Theory and Approximation Practice, ch. 8).
Tiles that the edge touches, or that fail, are divided, down to tiles whose every pixel is traced.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array, Mask

# Sides of the tiles in pixels, each half of the one before; the pixels of the last are traced one by one.
TILE_SIDES = (256, 128, 64, 32, 16)
# The largest tiles are those that at least this many of cover the picture: fewer would all be divided.
FEWEST_TILES = 30

# Chebyshev points along each side of a tile, and how many of the highest coefficients tell the error. What is left out
# was found to be a twentieth of their sum or less next to the shadow's edge, up to a tenth beside a distant hole.
POINTS = 11
TAIL = 2
TAIL_SHARE = 0.15

Directions = Callable[[Array, Array], Array]
"""From pixel coordinates, shape (n,), to unit vectors in the sky, shape (n, 3); NaN where there is none.

Further vectors on the same axes may follow, in columns 3 to 5 and so on: they are interpolated along."""


@dataclass(frozen=True)
class Tiles:
    """Square tiles of one size, by their top left pixels; the last of a row or column may stick out of the picture."""

    side: int
    column: NDArray[np.intp]
    row: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.column)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Tiles:
        """Return the chosen tiles alone."""
        return Tiles(self.side, self.column[chosen], self.row[chosen])

    def divided(self) -> Tiles:
        """Return the four quarters of each tile."""
        half = self.side // 2
        steps = np.array([(0, 0), (0, half), (half, 0), (half, half)])
        column = (self.column[:, None] + steps[:, 1]).ravel()
        row = (self.row[:, None] + steps[:, 0]).ravel()
        return Tiles(half, column, row)

    def pixels(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the columns, shape (n, 1, side), and rows, shape (n, side, 1), of the tiles' pixels."""
        steps = np.arange(self.side)
        return self.column[:, None, None] + steps, self.row[:, None, None] + steps[:, None]

    def put(self, image: NDArray[Any], values: NDArray[Any], where: NDArray[np.bool_] | None = None) -> None:
        """Write values, shape (n, side, side, ...), to the tiles' places in an image, as far as they lie inside it; all
        of them, or some."""
        for i in range(len(self)):
            top, left = self.row[i], self.column[i]
            place = image[top : top + self.side, left : left + self.side]
            part = (i, slice(place.shape[0]), slice(place.shape[1]))
            if where is None:
                place[:] = values[part]
            else:
                np.copyto(place, values[part], where=where[part])

    def within(self, width: int, height: int) -> Tiles:
        """Return the tiles that hold any pixel of the picture."""
        return self.select((self.column < width) & (self.row < height))


def sides_for(width: int, height: int) -> tuple[int, ...]:
    """Return the sides of tiles that are used for a picture.

    Parameters
    ----------
    width, height : int
        Of the map, pixels.

    Returns
    -------
    tuple of int
        The used ones of `TILE_SIDES`, the largest first.
    """
    used = tuple(side for side in TILE_SIDES if width * height >= FEWEST_TILES * side * side)
    return used or TILE_SIDES[-1:]


def tiles_of(width: int, height: int, side: int) -> Tiles:
    """Return the tiles of one size that cover a picture.

    Parameters
    ----------
    width, height : int
        Of the map, pixels.
    side : int
        Of the tiles, pixels.

    Returns
    -------
    Tiles
        By rows from the top left.
    """
    row, column = np.mgrid[0:height:side, 0:width:side]
    return Tiles(side, column.ravel(), row.ravel())


def pool(mask: Mask, cells: int) -> Mask:
    """Return whether any member of each square of `cells` x `cells` members is set.

    Parameters
    ----------
    mask : ndarray of bool, shape (rows, columns)
    cells : int

    Returns
    -------
    ndarray of bool, shape (ceil(rows / cells), ceil(columns / cells))
    """
    rows, columns = (-(-size // cells) for size in mask.shape)
    padded = np.zeros((rows * cells, columns * cells), dtype=bool)
    padded[: mask.shape[0], : mask.shape[1]] = mask
    pooled: Mask = padded.reshape(rows, cells, columns, cells).any(axis=(1, 3))
    return pooled


@cache
def to_coefficients(count: int) -> Array:
    """Return the matrix from values at Chebyshev points to Chebyshev coefficients.

    Parameters
    ----------
    count : int
        Number of points, >= 1.

    Returns
    -------
    ndarray, shape (count, count)
    """
    order, point = np.mgrid[0:count, 0:count]
    matrix: Array = np.cos(np.pi * order * (count - 0.5 - point) / count) * (2.0 / count)
    matrix[0] *= 0.5
    return matrix


def _at_pixels(side: int, count: int) -> Array:
    """The Chebyshev polynomials at the pixel centers of a tile, shape (side, count)."""
    place = 2.0 * (np.arange(side) + 0.5) / side - 1.0
    polynomials: Array = np.cos(np.arange(count) * np.arccos(place)[:, None])
    return polynomials


def sample_places(tiles: Tiles, count: int = POINTS) -> tuple[Array, Array]:
    """Return the pixel coordinates of the tiles' Chebyshev points.

    Parameters
    ----------
    tiles : Tiles
    count : int
        Points along each side.

    Returns
    -------
    x, y : ndarray, shape (n * count^2,)
        By tile, row and column.
    """
    places = chebyshev_places(count)
    x = tiles.column[:, None, None] + tiles.side * places[None, None, :]
    y = tiles.row[:, None, None] + tiles.side * places[None, :, None]
    x, y = np.broadcast_arrays(x, y)
    return x.ravel(), y.ravel()


def chebyshev_places(count: int = POINTS) -> Array:
    """Return where the Chebyshev points of the first kind are along a tile's side.

    Parameters
    ----------
    count : int
        Number of points.

    Returns
    -------
    ndarray, shape (count,)
        Between 0 and 1, increasing.
    """
    places: Array = 0.5 - 0.5 * np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return places


def coefficients_of(values: Array) -> Array:
    """Return the Chebyshev coefficients of samples.

    Parameters
    ----------
    values : ndarray, shape (..., count, count)
        By row and column, at `sample_places`.

    Returns
    -------
    ndarray, shape (..., count, count)
        By the orders along the rows' and the columns' axes.
    """
    matrix = to_coefficients(values.shape[-1])
    coefficients: Array = matrix @ values @ matrix.T
    return coefficients


def at_pixels(side: int, count: int = POINTS) -> tuple[Array, Array]:
    """Return the Chebyshev polynomials and their slopes at a tile's pixel centers.

    Parameters
    ----------
    side : int
        Of the tile, pixels.
    count : int
        Number of polynomials.

    Returns
    -------
    polynomials, slopes : ndarray, shape (side, count)
        The slopes are per pixel.
    """
    angle = np.arccos(2.0 * (np.arange(side) + 0.5) / side - 1.0)[:, None]
    order = np.arange(count)
    # T_n' = n sin(n t) / sin(t), x = cos(t)
    return _at_pixels(side, count), order * np.sin(order * angle) / np.sin(angle) * (2.0 / side)


def sample(tiles: Tiles, directions: Directions, tolerance: float) -> tuple[Array, NDArray[np.bool_]]:
    """Sample tiles and judge whether the samples determine them.

    Parameters
    ----------
    tiles : Tiles
    directions : callable
        See `Directions`.
    tolerance : float
        Radians, > 0.

    Returns
    -------
    coefficients : ndarray, shape (n, 3, POINTS, POINTS)
        Chebyshev coefficients of x, y, z by row and column.
    good : ndarray of bool, shape (n,)
        Whether the interpolation's error is below `tolerance`; false where any sample sees no sky.
    """
    values = directions(*sample_places(tiles)).reshape(len(tiles), POINTS, POINTS, -1)
    coefficients = coefficients_of(np.moveaxis(values, -1, 1))
    rest = tails_of(coefficients).sum(axis=1)
    return coefficients, TAIL_SHARE * rest < tolerance  # NaN: False


def tails_of(coefficients: Array) -> Array:
    """Return the sum of the highest coefficients' sizes: `TAIL_SHARE` of it is about the error of interpolation.

    Parameters
    ----------
    coefficients : ndarray, shape (n, channels, count, count)

    Returns
    -------
    ndarray, shape (n, channels)
    """
    size = np.abs(coefficients)
    tails: Array = size[:, :, -TAIL:, :].sum(axis=(2, 3)) + size[:, :, :-TAIL, -TAIL:].sum(axis=(2, 3))
    return tails


def interpolate(coefficients: Array, side: int, rotation: Array) -> NDArray[np.float32]:
    """Return the unit vectors at the pixels of tiles, rotated.

    The sums along the rows, most of the work, are in single precision: what they lose is of the order of what the map's
    own single precision loses, 1e-7.

    Parameters
    ----------
    coefficients : ndarray, shape (n, 3, POINTS, POINTS)
        From `sample`.
    side : int
        Of the tiles, pixels.
    rotation : ndarray, shape (3, 3)

    Returns
    -------
    ndarray of float32, shape (3, n, side, side)
    """
    vectors = _at_pixels(side, POINTS)
    turned = np.tensordot(rotation, coefficients, axes=(1, 1))
    values: NDArray[np.float32] = (vectors @ turned).astype(np.float32) @ vectors.T.astype(np.float32)
    return values
