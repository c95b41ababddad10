# SPDX-License-Identifier: GPL-3.0-or-later
"""Types of numpy arrays, and selections of their members."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]
Indices = Index | slice


def indices(members: Mask) -> Indices:
    """Return the indices of the members of a mask.

    Parameters
    ----------
    members : ndarray of bool, shape (n,)

    Returns
    -------
    slice or ndarray of int
        A slice where all are members, which selects without copying; otherwise the indices of the members.
    """
    return slice(None) if members.all() else np.flatnonzero(members)
