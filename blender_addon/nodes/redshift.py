# SPDX-License-Identifier: GPL-3.0-or-later
"""What a frequency shift does to the color and brightness of light, as nodes. Shared by all of the groups.

The formulas and their coefficients are those of `physics.light.color`.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..core.physics_api import physics
from .arithmetic import clamp, combine, exp, log, maximum, minimum, mix, multiply_add, tanh
from .builder import Float, Number, Vector

_LAW = physics.color_law

# Of the logarithm of a gain; in single precision exp(88) is the end.
_MOST = 80.0


def redshift_gain(
    one_plus_z: Float, amount: Float, brightness_amount: Number, temperature: Float, light: Vector | None = None
) -> Vector:
    """Gains of red, green and blue: what the light is multiplied by, component by component.

    Parameters
    ----------
    one_plus_z : Float
        Frequency ratio, emitted over observed; above 0.
    amount : Float
        How much the shift changes the color, 0 to 1.
    brightness_amount : Float or float
        How much the shift changes the brightness, 0 to 1.
    temperature : Float
        Color temperature of the unshifted light in kelvin; below 1 it counts as 1.
    light : Vector, optional
        The light before the shift: where it is colored as a black body, it has that body's temperature.

    Returns
    -------
    Vector
        The three gains, above 0.
    """
    inverse = 1000.0 / maximum(1.0, temperature)
    if light is not None:
        inverse = _inverse_temperature(light, inverse)
    luminance, color = _light_at(inverse)
    seen_luminance, seen_color = _light_at(inverse * one_plus_z)
    exponent = multiply_add(amount, seen_luminance - luminance, 4.0 * (amount - brightness_amount) * log(one_plus_z))
    ratios = (seen_color / color).separate()
    shift = exp(clamp(exponent, -_MOST, _MOST))
    return (combine(*(ratio**amount for ratio in ratios)) * shift).labeled("Gains")


def _inverse_temperature(light: Vector, artist: Float) -> Float:
    """1000 K / T of each pixel."""
    red, green, blue = light.separate()
    some_red = maximum(_LAW.TINIEST, red)
    inside = clamp(green / some_red, *_LAW.GREEN_SHARES)
    off = abs(blue - some_red * _polynomial(_LAW.BLUE_SHARE, inside)) + abs(green - some_red * inside)
    off = off / maximum(_LAW.TINIEST, red + green + blue)
    # 0 for NaN as well.
    weight = clamp(multiply_add(off, -1.0 / (_LAW.FAR - _LAW.NEAR), _LAW.FAR / (_LAW.FAR - _LAW.NEAR)), 0.0, 1.0)
    weight = weight * red.greater_than(_LAW.TINIEST)
    return mix(weight, artist, _polynomial(_LAW.INVERSE_TEMPERATURE, inside)).labeled("1000 K / T")


def _light_at(inverse: Float) -> tuple[Float, Vector]:
    """Logarithm of the luminance, and color of luminance 1, of a black body."""
    t = multiply_add(minimum(1.0, inverse), 2.0, -1.0)
    y = inverse * _LAW.LUMINANCE_EXPONENT
    luminance = _polynomial(_LAW.LOG_LUMINANCE, t) - (y + _log_of_planck_term(y))
    across = combine(t, t, t)
    *lower, second, first = _LAW.COLORS
    color = multiply_add(across, first, second)
    for coefficient in reversed(lower):
        color = multiply_add(color, across, coefficient)
    return luminance, color.at_least((_LAW.LEAST_COLOR,) * 3)


def _polynomial(coefficients: Sequence[float], x: Float) -> Float:
    *lower, second, first = coefficients
    value = multiply_add(x, first, second)
    for coefficient in reversed(lower):
        value = multiply_add(value, x, coefficient)
    return value


def _log_of_planck_term(value: Float) -> Float:
    """ln(1 - exp(-y)), with 1 - exp(-y) = tanh(y / 2) (1 + exp(-y)), which keeps its digits at small y."""
    decay = exp(-value)
    return log(tanh(value * 0.5) * (1.0 + decay))
