# SPDX-License-Identifier: GPL-3.0-or-later
"""What a gravitational and Doppler shift does to the color and the brightness of a sky.

Physics
-------
Liouville's theorem keeps the photon density in phase space constant along a ray, so the specific intensity
I_nu divided by nu cubed is the same at the source and at the camera (Misner, Thorne & Wheeler 1973,
"Gravitation", section 22.6). With 1 + z = nu_source / nu_camera this reads

    I_camera(nu) = I_source((1 + z) nu) / (1 + z)^3.

If the source is a black body of temperature T, Planck's law turns into Planck's law of temperature T / (1 +
z): the sky stays a black body and merely changes its temperature. What the picture has of it is RGB(T), the CIE's
integral over the spectrum (`black_body`), and a pixel of the sky is multiplied by RGB(T / (1 + z)) / RGB(T). Summed
over all frequencies the intensity changes by (1 + z)^-4, and dividing by this leaves the change of color alone. Both
parts can be dialled by an amount between 0 (no effect) and 1 (the physical effect):

    gain_c = (1 + z)^(4 (color - brightness)) (RGB_c(T / (1 + z)) / RGB_c(T))^color.

With both amounts at 1 the gain is exactly the ratio.

T is each pixel's own. Along the colors of black bodies green / red gives the temperature. Where a pixel's blue is what
such a body has, it is taken for one; where it is not, it gets the temperature that the artist has set, and in between
1 / T is mixed. So do pixels that are black, negative or not finite.

Numbers
-------
RGB(T) = Y(T) C(T), luminance times color, is written in x = 1000 K / T as

    ln Y = P(t) - ln(exp(a x) - 1),    C = Q(t),    t = 2 min(x, 1) - 1,

with polynomials P, Q that were fitted to `black_body`: the node groups and the lens evaluate the same ones. Errors are
below 1e-4 of Y. Below 1000 K the color stays and the light decays further. C is 0.001 at least, so that ratios exist:
blue below 1950 K, which the picture's primaries cannot show (`black_body`).

Limits
------
An RGB picture has no spectrum. Emission lines, colors that are no black body's, and light from outside the visible
band that a strong shift brings into it are not represented.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike, NDArray

from ..numerics.arrays import Array
from ..numerics.checks import number
from ..numerics.errors import BlackHoleError
from .black_body import SECOND_RADIATION_CONSTANT

DEFAULT_TEMPERATURE = 6500.0
"""Sky temperature (kelvin) whose black body is closest to the D65 white of the picture's color space."""

LOG_LUMINANCE = (
    19.5530394,
    0.631906138,
    0.375926294,
    -0.0314183906,
    0.00410038723,
    -0.0347579736,
    0.0205685479,
    0.0331480983,
    -0.0258371455,
)
"""Coefficients of P, from the constant up."""

LUMINANCE_EXPONENT = SECOND_RADIATION_CONSTANT / (552e-9 * 1000.0)
"""a."""

COLORS = (
    (2.52014047, 0.646905529, 0.0204291774),
    (2.26720942, -0.62984456, -0.425352997),
    (-0.0251663427, -0.0633253685, 0.696856957),
    (-0.252000331, 0.125239309, -0.66200597),
    (0.0230186845, -0.04764277, 0.441171711),
    (0.129531866, 0.0577602291, -0.401214709),
    (0.186762703, -0.103433661, 0.399066491),
    (-0.335750275, 0.0206813945, 0.0881639719),
    (-0.0726277483, 0.075269641, -0.487908661),
    (0.159459356, -0.0420167379, 0.240878937),
)
"""Coefficients of Q for red, green and blue, from the constant up."""

LEAST_COLOR = 1e-3
"""Lowest red, green or blue of a color of luminance 1."""

GREEN_SHARES = (0.216516, 1.449903)
"""Ratios of green to red from which temperatures are taken: 1835 K to 125000 K."""

INVERSE_TEMPERATURE = (
    0.958989125,
    -2.93268594,
    6.50484144,
    -10.3117331,
    10.7644377,
    -7.00500978,
    2.56269449,
    -0.403704183,
)
"""Coefficients of 1000 K / T in green / red, from the constant up."""

BLUE_SHARE = (-0.00500877548, -0.200450135, 0.780592943, 0.974938549, -0.714889651, 0.32223803)
"""Coefficients of blue / red of a black body in green / red, from the constant up."""

NEAR, FAR = 0.02, 0.1
"""By how much of red + green + blue a pixel may differ from a black body, to count as one wholly or not at all."""

TINIEST = 1e-30

# Where arithmetic holds: nothing that is seen comes near.
LARGEST_SHIFT = 1e100
COLDEST, HOTTEST = 1.0, 1e9
LARGEST_AMOUNT = 100.0
# Of the logarithm of a gain.
MOST = 700.0


def _log_of_exp_minus_one(x: Array) -> Array:
    """ln(exp(x) - 1) for x > 0, without overflow at large x and without cancellation at small x."""
    result: Array = x + np.log(-np.expm1(-x))
    return result


def light_at(inverse: Array) -> tuple[Array, Array]:
    """Logarithm of the luminance, and color of luminance 1, of black bodies by the polynomials.

    Parameters
    ----------
    inverse : ndarray, shape (...)
        1000 K / T, > 0.

    Returns
    -------
    (ndarray, ndarray), shapes (...) and (..., 3)
        ln Y, and linear Rec. 709, >= `LEAST_COLOR`.
    """
    t = 2.0 * np.minimum(inverse, 1.0) - 1.0
    luminance: Array = polyval(t, LOG_LUMINANCE) - _log_of_exp_minus_one(LUMINANCE_EXPONENT * inverse)
    color = np.maximum(np.moveaxis(polyval(t, np.array(COLORS)), 0, -1), LEAST_COLOR)
    return luminance, color


def inverse_temperature(light: ArrayLike, temperature: float) -> Array:
    """1000 K / T by which a pixel's light is shifted.

    Parameters
    ----------
    light : array_like, shape (..., 3)
        Linear Rec. 709, any numbers.
    temperature : float
        T in kelvin of what is not colored as a black body.

    Returns
    -------
    ndarray, shape (...)
        Finite and > 0.
    """
    pixels: Array = np.asarray(light, dtype=np.float64)
    finite = np.isfinite(pixels).all(axis=-1)
    red, green, blue = np.moveaxis(np.where(finite[..., np.newaxis], pixels, 0.0), -1, 0)
    share = green / np.maximum(red, TINIEST)
    inside = np.clip(share, *GREEN_SHARES)
    total = np.maximum(red + green + blue, TINIEST)
    # Of blue, and of green where it is outside.
    off = (np.abs(blue - red * polyval(inside, BLUE_SHARE)) + np.abs(green - red * inside)) / total
    weight = np.clip((FAR - off) / (FAR - NEAR), 0.0, 1.0)
    weight = np.where(red > TINIEST, weight, 0.0)
    artist = 1000.0 / temperature
    mixed: Array = artist + weight * (polyval(inside, INVERSE_TEMPERATURE) - artist)
    return mixed


def redshift_gain(
    one_plus_z: ArrayLike,
    color_amount: float = 1.0,
    brightness_amount: float = 1.0,
    temperature: float = DEFAULT_TEMPERATURE,
    light: ArrayLike | None = None,
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
        Temperature in kelvin, > 0, of light that is not colored as a black body is.
    light : array_like, shape (..., 3), optional
        The sky's light before the shift, linear Rec. 709, by which each pixel has a temperature of its own. Default:
        all of it has `temperature`.

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
    if not np.all((ratio > 0.0) & (ratio >= 1.0 / LARGEST_SHIFT) & (ratio <= LARGEST_SHIFT)):
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
    if light is None:
        inverse: Array = np.full(ratio.shape, 1000.0 / temperature)
    else:
        inverse = inverse_temperature(light, temperature)
    luminance, color = light_at(inverse)
    seen_luminance, seen_color = light_at(inverse * ratio)
    exponent = 4.0 * (color_amount - brightness_amount) * np.log(ratio) + color_amount * (seen_luminance - luminance)
    colors = color_amount * np.log(seen_color / color)
    gain: Array = np.exp(np.clip(exponent[..., np.newaxis] + colors, -MOST, MOST))
    return gain
