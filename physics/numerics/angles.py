# SPDX-License-Identifier: GPL-3.0-or-later
"""Angles on a circle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, Image, Index


def wrap_once(angle: NDArray[np.floating[Any]]) -> Image:
    """Return angles wrapped to [0, 2 pi), in single precision.

    Parameters
    ----------
    angle : ndarray
        Radians, from -pi to 2 pi.

    Returns
    -------
    ndarray of float32
        Of the same shape. Where an angle would round up to 2 pi itself, it is 0.
    """
    turn = 2.0 * math.pi
    single = (angle + (angle < 0.0) * angle.dtype.type(turn)).astype(np.float32)
    single *= single < np.float32(turn)
    return single


def wrap(angle: NDArray[np.floating[Any]]) -> Image:
    """Return angles wrapped to [0, 2 pi), in single precision.

    Parameters
    ----------
    angle : ndarray
        Radians, any finite values.

    Returns
    -------
    ndarray of float32
        Of the same shape; the array itself if there is nothing to do.
    """
    turn = angle.dtype.type(2.0 * math.pi)
    single = angle.astype(np.float32, copy=False)
    if single.size and single.min() >= 0.0 and single.max() < np.float32(turn):
        return single
    rest = np.floor(angle * (1.0 / turn))
    rest *= turn
    np.subtract(angle, rest, out=rest)
    single = rest.astype(np.float32, copy=False)
    single[(single < 0.0) | (single >= np.float32(turn))] = 0.0  # by rounding
    return single


def wrap_symmetric(angle: Array) -> Array:
    """Return angles wrapped to [-pi, pi].

    Parameters
    ----------
    angle : ndarray
        Radians, any finite values.

    Returns
    -------
    ndarray
        Of the same shape.
    """
    turn = 2.0 * math.pi
    near: Array = angle - turn * np.round(angle * (1.0 / turn))
    return near


def circle_steps(angle: Array, count: int) -> tuple[Index, Array]:
    """Return angles in units of a circle divided into `count` equal steps.

    Parameters
    ----------
    angle : ndarray
        Radians, [0, 2 pi].
    count : int

    Returns
    -------
    whole : ndarray of int
        The step that each angle lies in, 0 to count - 1.
    part : ndarray
        Where in that step, 0 to 1.
    """
    steps = angle * (count / (2.0 * math.pi))
    whole = np.minimum(steps.astype(np.intp), count - 1)
    return whole, steps - whole
