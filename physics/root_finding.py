# SPDX-License-Identifier: GPL-3.0-or-later
"""Roots of many functions at once, each between two places where it has different signs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def bracketed_roots(
    function: Callable[[Array, Index], Array],
    ends: tuple[Array, Array],
    values: tuple[Array, Array],
    change: float,
    most_rounds: int,
) -> Array:
    """Return where functions vanish, shape (n,), by the Illinois form of false position (Dowell & Jarratt 1971,
    BIT 11, 168), whose error shrinks faster than geometrically.

    Parameters
    ----------
    function : callable
        From places, shape (m,), and the numbers of the functions they belong to, (m,), to values, (m,).
    ends, values : pair of ndarray, shape (n,)
        Two places around each root, and the values there, of different signs.
    change : float
        A root whose place changed by no more than this in a round has settled: the next change would be
        smaller by far. Each goes on until then whatever the others do, so that it does not depend on its company.
    most_rounds : int
        Rounds after which the rest are taken as they are; they are still between their ends.
    """
    (low, high), (f_low, f_high) = ends, values
    place = low + (high - low) * (f_low / (f_low - f_high))
    found, left = place.copy(), np.arange(len(place))
    for _ in range(most_rounds):
        if not len(left):
            break
        value = function(place, left)
        same = (value > 0.0) == (f_low > 0.0)
        # The end that stays has its value halved, so that it cannot stay for ever.
        f_low, f_high = np.where(same, value, 0.5 * f_low), np.where(same, 0.5 * f_high, value)
        low, high = np.where(same, place, low), np.where(same, high, place)
        gap = f_low - f_high
        better = np.where(gap == 0.0, place, low + (high - low) * (f_low / np.where(gap == 0.0, 1.0, gap)))
        found[left] = better
        going = np.abs(better - place) > change
        left, place = left[going], better[going]
        low, high, f_low, f_high = low[going], high[going], f_low[going], f_high[going]
    return found
