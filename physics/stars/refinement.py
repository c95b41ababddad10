# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact places and magnifications of images: Newton's method on the local sky, interpolated cubically.

Magnification is the solid angle of an image over that of its star. With D(x, y) the direction at columns and rows and
A(x, y) the solid angle of a cell in the FIDO's sky (`LocalSky.angles`),

    1 / mu = D . (dD/dx x dD/dy) / A,

the determinant of the lens map by differences of neighboring rays (Schneider, Ehlers & Falco 1992, "Gravitational
Lenses", section 5.1); its sign is the image's parity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..numerics.arrays import Array, Index, Mask
from .local_sky import LocalSky
from .search import Found

ROUNDS = 8
SETTLED = 1e-3
"""Steps shorter than this, in cells, end the search: what is left is the square of that. Next to a caustic, where the
determinant is the difference of large terms, they must be shorter by its share in them."""
LEAST_SHARE = 1e-3
LONGEST_STEP = 1.0
BLOCK = 8192

MOST_MAGNIFIED = 1e4
"""On caustics a point is magnified without end; stars are not points, and count as magnified by this at most."""


@dataclass(frozen=True)
class Images:
    """Images of stars in a FIDO's sky; arrays of shape (images,)."""

    star: Index
    x: Array
    """Column in the table, and row."""
    y: Array
    magnification: Array
    """Solid angle of the image over that of the star, > 0."""
    parity: Array
    """1.0, or -1.0 for mirrored images."""


def refine(
    sky: LocalSky, found: Found, stars: Array, counts: Callable[[Array, Array], Mask] | None = None
) -> tuple[Images, int]:
    """Return images with exact places.

    Parameters
    ----------
    sky : LocalSky
    found : Found
        Their places in the mesh.
    stars : ndarray, shape (n, 3)
        Unit vectors toward the stars, in the frame of the table.
    counts : callable, optional
        Returns, for exact columns and rows of all that was found, which are wanted.

    Returns
    -------
    images : Images
    vanished : int
        Number of images that the mesh had and that are not there: pairs of stars just outside of a caustic.
    """
    x, y = found.x.copy(), found.y.copy()
    determinant = np.empty(len(x))
    there = np.zeros(len(x), bool)
    for start in range(0, len(x), BLOCK):
        block = slice(start, start + BLOCK)
        toward = stars[found.star[block]].T
        x[block], y[block], determinant[block], there[block] = _newton(sky, x[block], y[block], toward)
    if counts is not None:
        there &= counts(x, y)
    kept = np.flatnonzero(there)
    x, y, determinant = x[kept] % len(sky.edge), y[kept], determinant[kept]
    _psi, _away, area = sky.angles(x, y)
    magnification = area / np.maximum(np.abs(determinant), area / MOST_MAGNIFIED)
    return Images(found.star[kept], x, y, magnification, np.sign(determinant)), len(there) - len(kept)


def _newton(sky: LocalSky, x: Array, y: Array, toward: Array) -> tuple[Array, Array, Array, Mask]:
    """Return places of images, the triple product of the derivatives there, and which were found."""
    x, y = x.copy(), y.copy()
    determinant, settled = np.zeros(len(x)), np.zeros(len(x), bool)
    aside, up = _tangents(toward)
    left = np.arange(len(x))
    largest = np.full(len(x), LONGEST_STEP)
    for _ in range(ROUNDS):
        here, along_x, along_y = interpolate(sky, x[left], y[left])
        e, f = aside[:, left], up[:, left]
        off_e, off_f = _dot(e, here), _dot(f, here)
        ex, ey, fx, fy = _dot(e, along_x), _dot(e, along_y), _dot(f, along_x), _dot(f, along_y)
        det = ex * fy - ey * fx
        with np.errstate(divide="ignore", invalid="ignore"):
            step_x, step_y = (ey * off_f - fy * off_e) / det, (fx * off_e - ex * off_f) / det
            length = np.maximum(np.abs(step_x), np.abs(step_y))
            share = np.minimum(1.0, largest[left] / length)
        share = np.where(np.isfinite(length), share, 0.0)
        x[left] += np.nan_to_num(step_x) * share
        y[left] = np.clip(y[left] + np.nan_to_num(step_y) * share, 0.0, sky.rows - 1.0)
        determinant[left] = det
        largest[left] = 0.5 * np.minimum(largest[left], np.where(share > 0.0, length, 1.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            distinct = np.abs(det) / (np.abs(ex * fy) + np.abs(ey * fx))
        settled[left] = length < SETTLED * np.clip(distinct, LEAST_SHARE, 1.0)
        left = left[~settled[left]]
        if not len(left):
            break
    return x, y, determinant, settled


def interpolate(sky: LocalSky, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return the table's vectors by cubic interpolation, and their derivatives by column and row.

    Parameters
    ----------
    sky : LocalSky
    x, y : ndarray, shape (n,)

    Returns
    -------
    here, along_x, along_y : ndarray, shape (3, n)
        `here` is of length 1 only nearly.
    """
    column = np.floor(x)
    row = np.clip(np.floor(y), 0.0, sky.rows - 2.0)
    weights_x, slopes_x = _cubic(x - column)
    weights_y, slopes_y = _cubic(y - row)
    width = sky.directions.shape[1]
    first = row.astype(np.intp) * width + column.astype(np.intp) % len(sky.edge)
    here, along_x, along_y = np.zeros((3, 3, len(x)))
    for i in range(4):
        values = np.zeros((3, len(x)))
        slopes = np.zeros((3, len(x)))
        for j in range(4):
            node = sky.planes.take(first + (i * width + j), axis=1)
            values += weights_x[j] * node
            slopes += slopes_x[j] * node
        here += weights_y[i] * values
        along_x += weights_y[i] * slopes
        along_y += slopes_y[i] * values
    return here, along_x, along_y


def _cubic(t: Array) -> tuple[list[Array], list[Array]]:
    """Weights of Lagrange's cubic through points at -1, 0, 1, 2, and their derivatives, for 0 <= t <= 1."""
    square = t * t
    cube = square * t
    weights = [
        (3.0 * square - cube - 2.0 * t) / 6.0,
        0.5 * (cube - 2.0 * square - t) + 1.0,
        0.5 * (square - cube) + t,
        (cube - t) / 6.0,
    ]
    slopes = [
        (6.0 * t - 3.0 * square - 2.0) / 6.0,
        0.5 * (3.0 * square - 4.0 * t - 1.0),
        0.5 * (2.0 * t - 3.0 * square) + 1.0,
        (3.0 * square - 1.0) / 6.0,
    ]
    return weights, slopes


def _tangents(toward: Array) -> tuple[Array, Array]:
    """Two unit vectors square to each of `toward`, shape (3, n), right-handed with it."""
    x, y, z = toward
    # Duff et al. 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1).
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.stack([1.0 + sign * x * x * a, sign * b, -sign * x]),
        np.stack([b, sign + y * y * a, -y]),
    )


def _dot(a: Array, b: Array) -> Array:
    product: Array = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product
