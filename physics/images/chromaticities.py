# SPDX-License-Identifier: GPL-3.0-or-later
"""Colors of any primaries as linear Rec. 709, which is what pictures are made of here."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..numerics.arrays import Array

# x, y of red, green, blue and white (ITU-R BT.709, section 1).
REC709 = (0.640, 0.330, 0.300, 0.600, 0.150, 0.060, 0.3127, 0.3290)

# Chromaticities that differ by less are the same: they are published with three or four digits.
SAME = 1e-4

# Cone responses of Bradford's adaptation (Lam 1985; ICC.1:2022, annex E).
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def to_rec709(chromaticities: Sequence[float]) -> Array | None:
    """Return the matrix from linear colors of some primaries to linear Rec. 709, white to white.

    Parameters
    ----------
    chromaticities : sequence of 8 floats
        CIE x and y of red, green, blue and white, as an OpenEXR file has them.

    Returns
    -------
    ndarray, shape (3, 3), or None
        None if they are those of Rec. 709.

    Raises
    ------
    ValueError
        If they are not those of three colors and a white between them.
    """
    given = np.array(chromaticities, dtype=np.float64)
    if given.shape != (8,) or not np.isfinite(given).all():
        raise ValueError("chromaticities must be eight finite numbers")
    if np.abs(given - REC709).max() < SAME:
        return None
    source, target = _to_xyz(given), _to_xyz(np.array(REC709))
    cones = BRADFORD @ source.sum(axis=1), BRADFORD @ target.sum(axis=1)  # of the two whites
    if not (cones[0] > 0.0).all():
        raise ValueError("the white point is no color")
    adapted = np.linalg.inv(BRADFORD) @ np.diag(cones[1] / cones[0]) @ BRADFORD
    matrix: Array = np.linalg.inv(target) @ adapted @ source
    return matrix


def _to_xyz(chromaticities: Array) -> Array:
    """Return the matrix from RGB to XYZ with Y = 1 for white (SMPTE RP 177-1993, section 3.3)."""
    x, y = chromaticities.reshape(4, 2).T
    if not (y[3] > 0.0 and abs(np.linalg.det(np.stack([x, y, np.ones(4)])[:, :3])) > SAME):
        raise ValueError("the primaries are no three colors")
    columns = np.stack([x, y, 1.0 - x - y])
    weights = np.linalg.solve(columns[:, :3], columns[:, 3] / y[3])
    if not (weights > 0.0).all():
        raise ValueError("white is not between the primaries")
    matrix: Array = columns[:, :3] * weights
    return matrix
