# SPDX-License-Identifier: GPL-3.0-or-later
"""Arithmetic of 3 x 3 matrices that rounds the same on every processor.

numpy's linear algebra does not: its kernels, chosen by processor, round differently. Sums, products and square roots of
single numbers are rounded as IEEE 754 says everywhere. What a map is known by is worked out here.
"""

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

# Newton's iteration doubles the digits; from a matrix that is orthogonal to 1e-4, three times give double precision.
_ITERATIONS = 5


def times(matrix: Matrix, other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the product of a matrix, shape (3, 3), with another one or with a vector, shape (3, 3) or (3,)."""
    columns = matrix.T.reshape(3, 3, *[1] * (other.ndim - 1))
    product: NDArray[np.float64] = columns[0] * other[0] + columns[1] * other[1] + columns[2] * other[2]
    return product


def length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lengths of vectors along the first axis, shape (3, ...)."""
    lengths: NDArray[np.float64] = np.sqrt(vectors[0] ** 2 + vectors[1] ** 2 + vectors[2] ** 2)
    return lengths


def determinant(matrix: Matrix) -> float:
    """Return the determinant of a matrix, shape (3, 3)."""
    x, y, z = matrix[0] * np.cross(matrix[1], matrix[2])
    return float(x + y + z)


def nearest_rotation(matrix: Matrix) -> Matrix:
    """Return the rotation next to a matrix that is one but for rounding, shape (3, 3).

    The orthogonal factor of the polar decomposition, by Newton's iteration X -> (X + X^-T) / 2 (N. J. Higham, SIAM J.
    Sci. Stat. Comput. 7, 1160 (1986), Eq. 3.3), where X^-T is the matrix of cofactors over the determinant.
    """
    rotation = matrix
    for _ in range(_ITERATIONS):
        rotation = 0.5 * (rotation + _cofactors(rotation) / determinant(rotation))
    return rotation


def _cofactors(matrix: Matrix) -> Matrix:
    one, two, three = matrix
    return np.stack([np.cross(two, three), np.cross(three, one), np.cross(one, two)])
