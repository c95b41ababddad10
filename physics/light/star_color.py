# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures of stars from their color index B-V; `black_body` has the colors that belong to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..numerics.arrays import Array

UNKNOWN_COLOR_INDEX = 0.45
"""B-V taken where none was measured: a white star of about 6600 K."""


def temperature_from_color_index(b_v: ArrayLike) -> Array:
    """Effective temperature of a star from its color index.

    Parameters
    ----------
    b_v : array_like, shape (...)
        Color index B-V in magnitudes, above -0.6; NaN (unknown) counts as `UNKNOWN_COLOR_INDEX`.

    Returns
    -------
    ndarray, shape (...)
        Temperature in kelvin.

    Notes
    -----
    Source: Ballesteros 2012, "New insights into black bodies", EPL 97, 34008, Eq. 14.
    """
    index: Array = np.asarray(b_v, dtype=np.float64)
    index = np.where(np.isnan(index), UNKNOWN_COLOR_INDEX, index)
    return 4600.0 * (1.0 / (0.92 * index + 1.7) + 1.0 / (0.92 * index + 0.62))
