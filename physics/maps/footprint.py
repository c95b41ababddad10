# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of the sky that each pixel of a warp map sees, as an ellipse: what the light of the sky is averaged over.

With D the unit vector of a pixel's direction on the sky, and e_x = dD/dx, e_y = dD/dy in radians per pixel, a pixel
of unit width covers the parallelogram of e_x and e_y. The matrix

    M = [[e_x.e_x, e_x.e_y], [e_x.e_y, e_y.e_y]]

has the squared lengths of the ellipse's axes as eigenvalues; its first eigenvector (cos t, sin t) gives the major axis
as a vector on the sky, cos t e_x + sin t e_y (Heckbert 1989, "Fundamentals of Texture Mapping and Image Warping",
section 3.5; ray bundles: James et al. 2015, arXiv:1502.03808, appendix A).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array
from ..numerics.sphere import unit_vectors

NOTHING_SEEN = (0.0, 0.0, 0.0, -12.0)
"""Footprint of a pixel that sees no sky."""

SMALLEST_AXIS = 2.0**-14
"""Minor axes count as this at least (radians): less than half a texel of the finest sky."""

LONGEST_AXIS = 3.0
"""Above 2 sqrt(2), the longest major axis: unit vectors differ by 2 at most along rows and along columns."""

_STRIP = 32


class Directions(Protocol):
    """The channels of a warp map that a footprint is made from, each of shape (height, width)."""

    @property
    def theta(self) -> NDArray[np.float32]:
        """Polar angle (radians) the light comes from."""

    @property
    def phi(self) -> NDArray[np.float32]:
        """Azimuth (radians) the light comes from."""

    @property
    def visibility(self) -> NDArray[np.float32]:
        """Share of the pixel that sees the sky, 0..1."""


def footprint(warp_map: Directions) -> NDArray[np.float16]:
    """Return the footprints of a warp map's pixels on the sky.

    Parameters
    ----------
    warp_map : Directions
        A warp map, row 0 at the top.

    Returns
    -------
    ndarray of float16, shape (height, width, 4)
        The first three are the major axis as a vector in the map's frame, radians, of full length; its sign is of no
        meaning. The last is log2 of the minor axis in radians. `NOTHING_SEEN` where the visibility is 0.

    Notes
    -----
    By central differences between neighboring pixels, and by one-sided ones beside pixels that see no sky and at the
    picture's border. Their error is of the second order in the pixel's width: beside the critical curve, where the
    sky is compressed exponentially, they state the light's spread over about one pixel and not its exact derivative.
    """
    theta, phi = np.asarray(warp_map.theta), np.asarray(warp_map.phi)
    seen = np.asarray(warp_map.visibility) > 0.0
    height, width = theta.shape
    result = np.empty((height, width, 4), np.float16)
    for top in range(0, height, _STRIP):
        bottom = min(top + _STRIP, height)
        above, below = max(top - 1, 0), min(bottom + 1, height)
        rows = slice(above, below)
        strip = _of_strip(unit_vectors(theta[rows], phi[rows]), seen[rows])
        result[top:bottom] = strip[top - above : bottom - above]
    result[~seen] = NOTHING_SEEN
    return result


def _of_strip(directions: Array, seen: NDArray[np.bool_]) -> NDArray[np.float32]:
    # The differences are taken in double precision; from there single precision is more than the file holds.
    components = np.moveaxis(directions, -1, 0)
    per_column = _difference(components, seen)
    per_row = _difference(np.swapaxes(components, 1, 2), seen.T).swapaxes(1, 2)
    xx, xy, yy = _dot(per_column, per_column), _dot(per_column, per_row), _dot(per_row, per_row)
    least = np.float32(SMALLEST_AXIS**2)
    mean, half = np.float32(0.5) * (xx + yy), np.float32(0.5) * (xx - yy)
    root = np.sqrt(half * half + xy * xy)
    # The product of the eigenvalues is the squared area: the smaller one keeps its digits by division.
    (ax, ay, az), (bx, by, bz) = per_column, per_row
    area = (ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2
    smaller = area / np.maximum(mean + root, least)
    # cos t and sin t by half of the angle 2 t, whose cosine is half / root.
    cosine_of_twice = half / np.maximum(root, np.float32(1e-30))
    cosine = np.sqrt(np.float32(0.5) * np.maximum(1.0 + cosine_of_twice, 0.0))
    sine = np.copysign(np.sqrt(np.float32(0.5) * np.maximum(1.0 - cosine_of_twice, 0.0)), xy)
    result = np.empty((*seen.shape, 4), np.float32)
    for axis in range(3):
        result[..., axis] = cosine * per_column[axis] + sine * per_row[axis]
    result[..., 3] = np.float32(0.5) * np.log2(np.maximum(smaller, least))
    return result


def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    product: NDArray[np.float32] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


def _difference(vectors: Array, seen: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Change of vectors (3, lines, places) per place: the mean of those to both neighbors, as far as they are seen."""
    both = (seen[:, 1:] & seen[:, :-1]).astype(np.float32)
    steps = (vectors[:, :, 1:] - vectors[:, :, :-1]).astype(np.float32)
    steps *= both
    total = np.zeros(vectors.shape, np.float32)
    total[:, :, :-1] += steps
    total[:, :, 1:] += steps
    count = np.zeros(seen.shape, np.float32)
    count[:, :-1] += both
    count[:, 1:] += both
    total /= np.maximum(count, np.float32(1.0))
    return total
