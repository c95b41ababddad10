# SPDX-License-Identifier: GPL-3.0-or-later
"""Colors of stars: from the color index B-V to a temperature, and from there to linear Rec. 709."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..numerics.arrays import Array
from .color import SECOND_RADIATION_CONSTANT

UNKNOWN_COLOR_INDEX = 0.45
"""B-V taken where none was measured: a white star of about 6600 K."""

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
"""Shares of red, green and blue in the luminance (ITU-R BT.709)."""

# CIE XYZ to linear Rec. 709 with D65 white (IEC 61966-2-1).
_XYZ_TO_REC709 = np.array(
    [
        [3.2406, -1.5372, -0.4986],
        [-0.9689, 1.8758, 0.0415],
        [0.0557, -0.2040, 1.0570],
    ]
)

_WAVELENGTHS = np.arange(380.0, 781.0, 5.0)  # nm


def _lobe(peak: float, center: float, width_below: float, width_above: float) -> Array:
    """One lobe of the color-matching fits: a Gaussian in wavelength with two inverse widths (1 / nm)."""
    offset = _WAVELENGTHS - center
    scaled: Array = offset * np.where(offset < 0.0, width_below, width_above)
    result: Array = peak * np.exp(-0.5 * scaled**2)
    return result


def _matching_functions() -> Array:
    """CIE 1931 color-matching functions at `_WAVELENGTHS`, shape (n, 3).

    Source: the multi-lobe fits of Wyman, Sloan & Shirley 2013, "Simple Analytic Approximations to the CIE XYZ
    Color Matching Functions", Journal of Computer Graphics Techniques 2 (2), 1, Listing 1.
    """
    x = _lobe(0.362, 442.0, 0.0624, 0.0374) + _lobe(1.056, 599.8, 0.0264, 0.0323) + _lobe(-0.065, 501.1, 0.0490, 0.0382)
    y = _lobe(0.821, 568.8, 0.0213, 0.0247) + _lobe(0.286, 530.9, 0.0613, 0.0322)
    z = _lobe(1.217, 437.0, 0.0845, 0.0278) + _lobe(0.681, 459.0, 0.0385, 0.0725)
    return np.stack([x, y, z], axis=-1)


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


def black_body_color(temperature: ArrayLike) -> Array:
    """Color of a black body in linear Rec. 709 (D65 white), scaled to luminance 1.

    Parameters
    ----------
    temperature : array_like, shape (...)
        Temperature in kelvin, > 0.

    Returns
    -------
    ndarray, shape (..., 3)
        Red, green and blue, >= 0: clipped to the gamut's edge where outside (deep red, below some 1900 K).

    Notes
    -----
    Planck's law, summed with the CIE 1931 color-matching functions from 380 to 780 nm.
    """
    kelvin: Array = np.asarray(temperature, dtype=np.float64)[..., np.newaxis]
    # Relative to the radiance at 555 nm, so that nothing underflows at low temperatures.
    x = SECOND_RADIATION_CONSTANT / (_WAVELENGTHS * 1e-9 * kelvin)
    x_reference = SECOND_RADIATION_CONSTANT / (555e-9 * kelvin)
    log_radiance = -5.0 * np.log(_WAVELENGTHS / 555.0) + (x_reference - x)
    radiance = np.exp(log_radiance) * np.expm1(-x_reference) / np.expm1(-x)
    rgb = np.maximum(radiance @ _matching_functions() @ _XYZ_TO_REC709.T, 0.0)
    color: Array = rgb / (rgb @ LUMINANCE_WEIGHTS)[..., np.newaxis]
    return color
