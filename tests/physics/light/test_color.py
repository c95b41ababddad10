# SPDX-License-Identifier: GPL-3.0-or-later
"""The color of shifted light against Planck's law in SI units and against the CIE's spectral locus."""

import numpy as np
import pytest
from numpy.typing import NDArray

from physics.light.black_body import SECOND_RADIATION_CONSTANT
from physics.light.color import DEFAULT_TEMPERATURE, inverse_temperature, redshift_gain

with np.printoptions():  # which it sets for the whole process
    import colour

PLANCK = 6.62607015e-34  # J s
LIGHT_SPEED = 299792458.0  # m / s
BOLTZMANN = 1.380649e-23  # J / K

SHIFTS = np.array([0.05, 0.3, 0.8, 0.999, 1.001, 1.3, 2.0, 5.0])


def planck_by_frequency(frequency: NDArray[np.float64], temperature: float) -> NDArray[np.float64]:
    """Spectral radiance B_nu in W / (m^2 sr Hz)."""
    energy = PLANCK * frequency
    return 2.0 * energy * frequency**2 / LIGHT_SPEED**2 / np.expm1(energy / (BOLTZMANN * temperature))


OBSERVER = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
PICTURE = colour.RGB_COLOURSPACES["ITU-R BT.709"]


def spectral_sum(temperature: NDArray[np.float64]) -> NDArray[np.float64]:
    """XYZ of black bodies by colour-science's tables per nanometer."""
    radiance = colour.colorimetry.planck_law(OBSERVER.wavelengths * 1e-9, temperature)
    return np.asarray(np.atleast_2d(radiance.T) @ OBSERVER.values * 1e-9)


def test_black_bodies_have_the_color_and_luminance_of_the_spectral_sum() -> None:
    temperature, g = (each.ravel() for each in np.meshgrid(np.geomspace(2e3, 4e4, 60), np.geomspace(0.2, 3.0, 40)))
    temperature, g = temperature[g * temperature >= 1000.0], g[g * temperature >= 1000.0]
    seen = spectral_sum(g * temperature)
    luminance = seen[:, 1:]
    expected = np.maximum(seen @ PICTURE.matrix_XYZ_to_RGB.T, 0.0)  # as the gamut has it, luminance kept
    expected *= luminance[:, :1] / (expected @ PICTURE.matrix_RGB_to_XYZ.T)[:, 1:2]
    light = spectral_sum(temperature) @ PICTURE.matrix_XYZ_to_RGB.T
    shifted = light * redshift_gain(1.0 / g, temperature=3500.0, light=light)
    found, wanted = (each @ PICTURE.matrix_RGB_to_XYZ.T / luminance[:, :1] for each in (shifted, expected))
    np.testing.assert_allclose(found[:, 1], 1.0, atol=0.02)
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    difference = colour.delta_E(*(colour.XYZ_to_Lab(each, white) for each in (found, wanted)), method="CIE 2000")
    assert difference.max() < 1.0


def test_light_below_1000_kelvin_decays() -> None:
    light = spectral_sum(np.array([2500.0])) @ PICTURE.matrix_XYZ_to_RGB.T
    shifted = light * redshift_gain(np.linspace(2.4, 12.0, 400), light=np.repeat(light, 400, axis=0))
    assert (np.diff(shifted, axis=0) < 0.0).all()
    steps = -np.diff(np.log(shifted), axis=0)
    assert steps.max() < 0.5


def test_what_is_no_black_body_has_the_temperature_of_the_artist() -> None:
    odd = [[0.0, 0.0, 0.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [np.inf, 1.0, 1.0], [np.nan, 0.0, 0.0], [0.1, 1.0, 0.1]]
    np.testing.assert_array_equal(inverse_temperature(odd, 4000.0), 0.25)
    gain = redshift_gain(np.full(6, 1.7), light=odd)
    np.testing.assert_array_equal(gain, np.broadcast_to(redshift_gain(1.7), (6, 3)))


def test_no_edge_between_both() -> None:
    # From the color of 3000 K to pure green: 1000 K / T moves in small steps.
    start = (spectral_sum(np.array([3000.0])) @ PICTURE.matrix_XYZ_to_RGB.T)[0]
    share = np.linspace(0.0, 1.0, 4000)[:, np.newaxis]
    steps = np.diff(inverse_temperature(start * (1.0 - share) + share * [0.0, start.max(), 0.0], 20000.0))
    assert np.abs(steps).max() < 5e-3


@pytest.mark.parametrize("shift", [0.5, 3.0])
def test_intensity_over_all_frequencies_falls_with_the_fourth_power(shift: float) -> None:
    frequency = np.linspace(1e10, 1e16, 100_001)
    step = frequency[1] - frequency[0]
    before = planck_by_frequency(frequency, DEFAULT_TEMPERATURE).sum() * step
    after = (planck_by_frequency(shift * frequency, DEFAULT_TEMPERATURE) / shift**3).sum() * step
    assert after / before == pytest.approx(shift**-4.0, rel=1e-4)
    brightness_alone = redshift_gain(shift, color_amount=0.0)
    np.testing.assert_allclose(brightness_alone, shift**-4.0, rtol=1e-13)


def test_amounts_are_exponents_of_the_two_parts() -> None:
    color_alone = redshift_gain(SHIFTS, 1.0, 0.0)
    brightness_alone = redshift_gain(SHIFTS, 0.0, 1.0)
    np.testing.assert_allclose(redshift_gain(SHIFTS, 0.3, 0.7), color_alone**0.3 * brightness_alone**0.7, rtol=1e-12)
    np.testing.assert_array_equal(redshift_gain(SHIFTS, 0.0, 0.0), np.ones((len(SHIFTS), 3)))


def test_no_shift_changes_nothing_at_all() -> None:
    np.testing.assert_array_equal(redshift_gain(np.ones((2, 3))), np.ones((2, 3, 3)))
    light = np.random.default_rng(5).uniform(-0.1, 2.0, (50, 3))
    np.testing.assert_array_equal(redshift_gain(np.ones(50), light=light), np.ones((50, 3)))


def test_redshift_reddens_and_blueshift_makes_bluer() -> None:
    red, green, blue = redshift_gain(1.5, 1.0, 0.0)
    assert red > green > blue
    red, green, blue = redshift_gain(0.7, 1.0, 0.0)
    assert red < green < blue


def test_hot_sky_brightens_in_proportion_to_its_temperature() -> None:
    # The Rayleigh-Jeans limit: far below the peak's frequency the radiance is proportional to T, here T / (1 + z).
    np.testing.assert_allclose(redshift_gain(1e-5) / redshift_gain(3e-5), 3.0, rtol=1e-3)


@pytest.mark.parametrize("shift", [1e-6, 1e6])
def test_extreme_shifts_do_not_overflow(shift: float) -> None:
    for color, brightness in ((1.0, 1.0), (0.5, 1.0), (1.0, 0.0), (0.01, 0.01)):
        assert np.all(np.isfinite(redshift_gain(shift, color, brightness)))


def test_second_radiation_constant() -> None:
    assert pytest.approx(PLANCK * LIGHT_SPEED / BOLTZMANN, rel=1e-10) == SECOND_RADIATION_CONSTANT


def test_refuses_what_is_not_a_frequency_ratio_or_temperature() -> None:
    with pytest.raises(ValueError, match="1 \\+ z must be positive"):
        redshift_gain([1.0, 0.0])
    with pytest.raises(ValueError, match="1 \\+ z must be positive"):
        redshift_gain(np.nan)
    with pytest.raises(ValueError, match="temperature is 0"):
        redshift_gain(1.0, temperature=0.0)
