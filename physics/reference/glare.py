# SPDX-License-Identifier: GPL-3.0-or-later
"""Numpy's own glare, in float64: what the compositor's node group is judged against."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..light.glare import GLARES
from ..numerics.errors import BlackHoleError

FloatArray = NDArray[np.float64]

_REACH = 5.0
"""Standard deviations at which a Gaussian is cut off: 6e-7 of its light lies beyond."""


def add_glare(light: ArrayLike, kind: int) -> FloatArray:
    """Spread a share of a picture's light as a lens does.

    Parameters
    ----------
    light : array_like, shape (height, width, channels)
        Scene-linear light.
    kind : int
        One of `light.glare.GLARES`.

    Returns
    -------
    ndarray, shape (height, width, channels)
        (1 - sum of shares) light + sum of share times the light blurred by each Gaussian. Beyond its edges the picture
        goes on as it is there.

    Raises
    ------
    BlackHoleError
        If there is no such kind, or the light has no such shape.
    """
    picture: FloatArray = np.asarray(light, dtype=np.float64)
    if picture.ndim != 3:
        raise BlackHoleError(
            f"The light has shape {picture.shape}, expected (height, width, channels).", code="settings.array"
        )
    if kind not in GLARES:
        raise BlackHoleError(f"The glare is {kind}; give {', '.join(map(str, GLARES))}.", code="settings.range")
    height = picture.shape[0]
    spreads = GLARES[kind]
    result: FloatArray = picture * (1.0 - sum(each.share for each in spreads))
    for each in spreads:
        result += each.share * _blurred(_blurred(picture, 0, each.down * height), 1, each.across * height)
    return result


def _blurred(picture: FloatArray, axis: int, deviation: float) -> FloatArray:
    """Convolve along one axis with a Gaussian of so many pixels, by Fourier transforms."""
    margin = math.ceil(_REACH * deviation)
    if margin == 0:
        return picture
    kernel = np.exp(-0.5 * (np.arange(-margin, margin + 1) / deviation) ** 2)
    kernel /= kernel.sum()
    pad = [(margin, margin) if each == axis else (0, 0) for each in range(picture.ndim)]
    padded = np.pad(picture, pad, mode="edge")
    length = padded.shape[axis] + 2 * margin
    shape = [-1 if each == axis else 1 for each in range(picture.ndim)]
    spectrum = np.fft.rfft(padded, length, axis=axis) * np.fft.rfft(kernel, length).reshape(shape)
    whole = np.fft.irfft(spectrum, length, axis=axis)
    cut: FloatArray = np.take(whole, np.arange(2 * margin, 2 * margin + picture.shape[axis]), axis=axis)
    return cut
