# SPDX-License-Identifier: GPL-3.0-or-later
"""The color of shifted light against Planck's law in SI units and against the CIE's spectral locus."""

import numpy as np
import pytest
from numpy.typing import NDArray

from physics.light.black_body import SECOND_RADIATION_CONSTANT
from physics.light.color import CHANNEL_WAVELENGTHS, DEFAULT_TEMPERATURE, redshift_gain

PLANCK = 6.62607015e-34  # J s
LIGHT_SPEED = 299792458.0  # m / s
BOLTZMANN = 1.380649e-23  # J / K

SHIFTS = np.array([0.05, 0.3, 0.8, 0.999, 1.001, 1.3, 2.0, 5.0])


def planck_by_frequency(frequency: NDArray[np.float64], temperature: float) -> NDArray[np.float64]:
    """Spectral radiance B_nu in W / (m^2 sr Hz)."""
    energy = PLANCK * frequency
    return 2.0 * energy * frequency**2 / LIGHT_SPEED**2 / np.expm1(energy / (BOLTZMANN * temperature))


@pytest.mark.parametrize("temperature", [3000.0, 6500.0, 25000.0])
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_physical_gain_follows_from_planck_and_liouville(temperature: float, channel: int) -> None:
    frequency = np.full_like(SHIFTS, LIGHT_SPEED / CHANNEL_WAVELENGTHS[channel])
    # I_nu / nu^3 is the same at the source, where the frequency was (1 + z) nu, and at the camera.
    seen = planck_by_frequency(SHIFTS * frequency, temperature) / SHIFTS**3
    expected = seen / planck_by_frequency(frequency, temperature)
    gain = redshift_gain(SHIFTS, temperature=temperature)[:, channel]
    np.testing.assert_allclose(gain, expected, rtol=1e-9)


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


# CIE 1931 chromaticities (x, y) of monochromatic light at two neighboring wavelengths (nm), and the primary between.
LOCUS = [
    (610.0, (0.6658, 0.3340), 615.0, (0.6801, 0.3197), (0.64, 0.33)),
    (545.0, (0.2658, 0.7243), 550.0, (0.3016, 0.6923), (0.30, 0.60)),
    (460.0, (0.1440, 0.0297), 465.0, (0.1355, 0.0399), (0.15, 0.06)),
]


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_wavelengths_are_the_dominant_ones_of_the_primaries(channel: int) -> None:
    start, start_xy, end, end_xy, primary = LOCUS[channel]
    white = np.array([0.3127, 0.3290])
    # white + s (primary - white) = start + t (end - start)
    matrix = np.column_stack([np.subtract(primary, white), np.subtract(start_xy, end_xy)])
    _, share = np.linalg.solve(matrix, np.subtract(start_xy, white))
    assert CHANNEL_WAVELENGTHS[channel] * 1e9 == pytest.approx(start + share * (end - start), abs=0.3)


def test_refuses_what_is_not_a_frequency_ratio_or_temperature() -> None:
    with pytest.raises(ValueError, match="1 \\+ z must be positive"):
        redshift_gain([1.0, 0.0])
    with pytest.raises(ValueError, match="1 \\+ z must be positive"):
        redshift_gain(np.nan)
    with pytest.raises(ValueError, match="temperature is 0"):
        redshift_gain(1.0, temperature=0.0)
