# SPDX-License-Identifier: GPL-3.0-or-later
"""What a frequency shift does to the color and brightness of light, as nodes. Shared by all of the groups."""

from __future__ import annotations

from ..core.physics_api import physics
from .arithmetic import combine, exp, log, maximum, multiply_add, tanh
from .builder import Float, Number, Vector


def redshift_gain(one_plus_z: Float, amount: Float, brightness_amount: Number, temperature: Float) -> Vector:
    """Gains of red, green and blue: what the light is multiplied by, component by component.

    exp(4 (c - k) ln(1+z) + c (x - y + ln(1 - exp(-x)) - ln(1 - exp(-y)))), y = (1 + z) x, x = C2 / (wavelength T):
    by logarithms, so that no intermediate value overflows. `physics.light.color` derives the formula and names its
    sources.

    Parameters
    ----------
    one_plus_z : Float
        Frequency ratio, emitted over observed; above 0.
    amount : Float
        c, how much the shift changes the color, 0 to 1.
    brightness_amount : Float or float
        k, how much the shift changes the brightness, 0 to 1.
    temperature : Float
        T, color temperature of the unshifted light in kelvin; below 1 it counts as 1.

    Returns
    -------
    Vector
        The three gains, above 0.
    """
    excess = amount - brightness_amount
    power = 4.0 * excess * log(one_plus_z)
    temperature = maximum(1.0, temperature)
    gains = []
    for wavelength in physics.CHANNEL_WAVELENGTHS:
        x = physics.SECOND_RADIATION_CONSTANT / wavelength / temperature
        y = x * one_plus_z
        ratio = _log_of_planck_term(x) - _log_of_planck_term(y)
        ratio = x - y + ratio
        gains.append(exp(multiply_add(amount, ratio, power)))
    return combine(*gains).labeled("Gains")


def _log_of_planck_term(value: Float) -> Float:
    """ln(1 - exp(-y)), with 1 - exp(-y) = tanh(y / 2) (1 + exp(-y)), which keeps its digits at small y."""
    decay = exp(-value)
    return log(tanh(value * 0.5) * (1.0 + decay))
