# SPDX-License-Identifier: GPL-3.0-or-later
"""What a gravitational and Doppler shift does to the color and the brightness of a sky.

Physics
-------
Liouville's theorem keeps the photon density in phase space constant along a ray, so the specific intensity
I_nu divided by nu cubed is the same at the source and at the camera (Misner, Thorne & Wheeler 1973,
"Gravitation", section 22.6). With 1 + z = nu_source / nu_camera this reads

    I_camera(nu) = I_source((1 + z) nu) / (1 + z)^3.

If the source is a black body of temperature T, Planck's law turns into Planck's law of temperature T / (1 +
z): the sky stays a black body and merely changes its temperature. For each channel of the picture the
change is

    B(lambda, T / (1 + z)) / B(lambda, T) = (exp(x) - 1) / (exp((1 + z) x) - 1),   x = h c / (lambda k_B T),

at the dominant wavelength lambda of that channel's primary. Summed over all frequencies the intensity
changes by (1 + z)^-4, and dividing by this leaves the change of color alone. Both parts can be dialled by
an amount between 0 (no effect) and 1 (the physical effect):

    gain_c = ((1 + z)^4 (exp(x_c) - 1) / (exp((1 + z) x_c) - 1))^color * (1 + z)^(-4 brightness).

With both amounts at 1 the gain is exactly Planck's ratio.

Limits
------
An RGB picture has no spectrum, so one has to be assumed: a black body of one temperature for all of the
sky. Stars hotter or cooler than this, emission lines, and light from outside the visible band that a strong
shift brings into it are not represented. Each channel stands for one wavelength, not for the camera's broad
response curve.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..numerics.checks import number
from ..numerics.errors import BlackHoleError
from .black_body import SECOND_RADIATION_CONSTANT

CHANNEL_WAVELENGTHS = (611.4e-9, 549.1e-9, 464.3e-9)
"""Dominant wavelengths of the Rec. 709 red, green and blue primaries against D65 white (meters)."""

DEFAULT_TEMPERATURE = 6500.0
"""Sky temperature (kelvin) whose black body is closest to the D65 white of the picture's color space."""

# Where arithmetic holds: nothing that is seen comes near.
LARGEST_SHIFT = 1e100
COLDEST, HOTTEST = 1.0, 1e9
LARGEST_AMOUNT = 100.0
# Of the logarithm of a gain.
MOST = 700.0


def _log_of_exp_minus_one(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """ln(exp(x) - 1) for x > 0, without overflow at large x and without cancellation at small x."""
    result: NDArray[np.float64] = x + np.log(-np.expm1(-x))
    return result


def redshift_gain(
    one_plus_z: ArrayLike,
    color_amount: float = 1.0,
    brightness_amount: float = 1.0,
    temperature: float = DEFAULT_TEMPERATURE,
) -> NDArray[np.float64]:
    """Factors by which a frequency shift multiplies the red, green and blue of the sky.

    Parameters
    ----------
    one_plus_z : array_like, shape (...)
        Frequency ratio source / camera, > 0; above 1 is redshift.
    color_amount : float
        0 keeps the color, 1 changes it physically.
    brightness_amount : float
        0 keeps the brightness, 1 scales the total intensity by (1 + z)^-4.
    temperature : float
        Temperature of the sky's assumed black body in kelvin, > 0.

    Returns
    -------
    ndarray, shape (..., 3)
        Gains of the red, green and blue channel, >= 0; all exactly 1 where `one_plus_z` is 1.

    Raises
    ------
    BlackHoleError
        For a `temperature` or any `one_plus_z` that is not positive, or amounts that are no finite numbers; and for
        values so far out that no answer could be written down.

    Notes
    -----
    Source: Planck's law and the invariance of I_nu / nu^3, see the module's text. Evaluated through
    logarithms, so that no shift, however extreme, overflows on the way.
    """
    ratio: NDArray[np.float64] = np.asarray(one_plus_z, dtype=np.float64)
    shift = ratio[..., np.newaxis]
    if not np.all((shift > 0.0) & (shift >= 1.0 / LARGEST_SHIFT) & (shift <= LARGEST_SHIFT)):
        raise BlackHoleError(
            "1 + z must be positive everywhere: give the frequency ratio source / camera.", code="settings.range"
        )
    temperature = number(temperature, "the sky's temperature")
    if not COLDEST <= temperature <= HOTTEST:
        raise BlackHoleError(
            f"The sky's temperature is {temperature:g} K, it must be positive, from {COLDEST:g} to {HOTTEST:g} K.",
            code="sky.temperature",
        )
    for amount in (color_amount, brightness_amount):
        if not abs(number(amount, "an amount of redshift")) <= LARGEST_AMOUNT:
            raise BlackHoleError(
                f"An amount of redshift is {amount:g}; give it a value from 0 to 1.", code="settings.range"
            )
    wavelengths: NDArray[np.float64] = np.asarray(CHANNEL_WAVELENGTHS, dtype=np.float64)
    x = SECOND_RADIATION_CONSTANT / (wavelengths * temperature)
    planck_ratio_log = _log_of_exp_minus_one(x) - _log_of_exp_minus_one(x * shift)
    shift_log = np.log(shift)
    exponent = 4.0 * (color_amount - brightness_amount) * shift_log + color_amount * planck_ratio_log
    gain: NDArray[np.float64] = np.asarray(np.exp(np.clip(exponent, -MOST, MOST)), dtype=np.float64)
    return gain
