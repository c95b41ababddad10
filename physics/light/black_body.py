# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of black bodies as the eye and the picture have it: Planck's law by the CIE's observer, in linear Rec. 709.

    XYZ_i(T) = integral of B_lambda(T) times the color-matching function i over the wavelength,

with B_lambda(T) = 2 h c^2 / lambda^5 / (exp(h c / (lambda k T)) - 1) (Planck 1901) and the functions of the CIE's
standard observer of 1931 (`cie_1931`), and RGB = M XYZ with the primaries and the white (D65) of Rec. 709. The
numbers are radiances, so that two temperatures compare as two bodies of the same size do. A body that is seen with the
shift 1 + z looks as one of temperature T / (1 + z) does (Liouville's theorem, see `color`).

Colors of bodies below some 1900 K are outside of Rec. 709: they have less than no blue, below some 900 K less than no
green. `rgb` clips these channels to 0 and keeps the luminance.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from ..numerics.arrays import Array
from .cie_1931 import MATCHING_FUNCTIONS, WAVELENGTHS

SECOND_RADIATION_CONSTANT = 0.014387768775
"""h c / k_B in meter kelvin (CODATA 2018; exact by the SI's definitions, rounded to the digits written)."""

FIRST_RADIATION_CONSTANT = 1.191042972e-16
"""2 h c^2 in W m^2 / sr (CODATA 2018)."""

LUMINANCE_WEIGHTS = np.array([0.2126390058715, 0.7151686787677, 0.0721923153607])
"""Shares of red, green and blue in the luminance: ITU-R BT.709's, to all digits that its primaries give."""

# Chromaticities of the primaries and of D65 (ITU-R BT.709-6, table 1, items 1.3 and 1.4).
_PRIMARIES = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])
_WHITE = np.array([0.3127, 0.3290])

COLDEST, HOTTEST = 100.0, 1e9
"""Temperatures (kelvin) between which light is tabulated. Colder bodies are black, hotter ones grow with T."""

_NODES = 16384
_TABLE = np.linspace(np.log(COLDEST), np.log(HOTTEST), _NODES)


def _tristimulus(chromaticity: Array) -> Array:
    x, y = chromaticity[..., 0], chromaticity[..., 1]
    result: Array = np.stack([x / y, np.ones_like(y), (1.0 - x - y) / y], axis=-1)
    return result


@cache
def xyz_to_rgb() -> Array:
    """Matrix from CIE XYZ to linear Rec. 709 (SMPTE RP 177-1993, section 3.3), shape (3, 3)."""
    primaries = _tristimulus(_PRIMARIES).T
    scale = np.linalg.solve(primaries, _tristimulus(_WHITE))
    matrix: Array = np.linalg.inv(primaries * scale)
    return matrix


def tristimulus(temperature: ArrayLike) -> Array:
    """CIE XYZ of a black body by direct integration.

    Parameters
    ----------
    temperature : array_like, shape (...)
        Kelvin, from `COLDEST` to `HOTTEST`.

    Returns
    -------
    ndarray, shape (..., 3)
        X, Y and Z in W / (m^2 sr), weighted by the color-matching functions, whose largest Y is 1.
    """
    kelvin: Array = np.asarray(temperature, dtype=np.float64)[..., np.newaxis]
    meters = WAVELENGTHS * 1e-9
    x = SECOND_RADIATION_CONSTANT / (meters * kelvin)
    radiance = FIRST_RADIATION_CONSTANT / meters**5 * np.exp(-x) / -np.expm1(-x)
    step = 5e-9
    result: Array = radiance @ MATCHING_FUNCTIONS * step
    return result


@cache
def _table() -> tuple[Array, Array]:
    """Logarithms of the luminance, and colors of luminance 1, at the nodes."""
    light = tristimulus(np.exp(_TABLE))
    luminances = light[:, 1]
    colors = np.maximum((light / luminances[:, np.newaxis]) @ xyz_to_rgb().T, 0.0)
    colors /= (colors @ LUMINANCE_WEIGHTS)[:, np.newaxis]
    return np.log(luminances), colors


def luminance(temperature: ArrayLike) -> Array:
    """Luminance of a black body.

    Parameters
    ----------
    temperature : array_like, shape (...)
        Kelvin, >= 0.

    Returns
    -------
    ndarray, shape (...)
        The tristimulus value Y in W / (m^2 sr); times 683 it is cd / m^2. Interpolated with a relative error below
        1e-4; 0 below `COLDEST`.
    """
    kelvin: Array = np.asarray(temperature, dtype=np.float64)
    logs, _ = _table()
    place = np.log(np.clip(kelvin, COLDEST, HOTTEST))
    beyond = np.where(kelvin < COLDEST, 0.0, np.maximum(kelvin / HOTTEST, 1.0))
    result: Array = np.exp(np.interp(place, _TABLE, logs)) * beyond
    return result


def color(temperature: ArrayLike) -> Array:
    """Color of a black body in linear Rec. 709, of luminance 1.

    Parameters
    ----------
    temperature : array_like, shape (...)
        Kelvin, >= 0.

    Returns
    -------
    ndarray, shape (..., 3)
        Red, green and blue, >= 0. Channels that would be negative are 0, and the others brighter for it.
    """
    kelvin: Array = np.asarray(temperature, dtype=np.float64)
    _, colors = _table()
    place = np.log(np.clip(kelvin, COLDEST, HOTTEST))
    result: Array = np.stack([np.interp(place, _TABLE, colors[:, channel]) for channel in range(3)], axis=-1)
    return result


def rgb(temperature: ArrayLike) -> Array:
    """Light of a black body in linear Rec. 709: its color times its luminance.

    Parameters
    ----------
    temperature : array_like, shape (...)
        Kelvin, >= 0. For a body that is shifted: T / (1 + z).

    Returns
    -------
    ndarray, shape (..., 3)
        Red, green and blue in W / (m^2 sr), >= 0, not normalized: divide by `luminance` of a reference temperature.
    """
    light: Array = color(temperature) * luminance(temperature)[..., np.newaxis]
    return light
