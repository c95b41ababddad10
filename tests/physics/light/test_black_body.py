# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of black bodies against colour-science, which sums the CIE's tables per nanometer."""

import numpy as np
import pytest

from physics.light import black_body
from physics.light.cie_1931 import MATCHING_FUNCTIONS, WAVELENGTHS

with np.printoptions():  # which it sets for the whole process
    import colour

OBSERVER = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
PICTURE = colour.RGB_COLOURSPACES["ITU-R BT.709"]


def spectral_sum(temperature: float) -> np.ndarray:
    """XYZ in W / (m^2 sr)."""
    radiance = colour.colorimetry.planck_law(OBSERVER.wavelengths * 1e-9, temperature)
    return radiance @ OBSERVER.values * 1e-9


def test_the_table_of_the_observer() -> None:
    np.testing.assert_array_equal(WAVELENGTHS, OBSERVER.wavelengths[::5])
    np.testing.assert_allclose(MATCHING_FUNCTIONS, OBSERVER.values[::5], rtol=1e-6)


@pytest.mark.parametrize("temperature", [1000.0, 2000.0, 3000.0, 6500.0, 15000.0, 40000.0, 120000.0])
def test_light_is_the_spectral_sum(temperature: float) -> None:
    # Steps of 5 nm instead of 1 nm differ by 4e-4 at 1000 K.
    expected = spectral_sum(temperature)
    assert black_body.luminance(temperature) == pytest.approx(expected[1], rel=5e-4)
    if temperature >= 2000.0:  # within the gamut
        linear = PICTURE.matrix_XYZ_to_RGB @ expected
        np.testing.assert_allclose(black_body.rgb(temperature), linear, rtol=1e-3, atol=1e-4 * expected[1])


@pytest.mark.parametrize("temperature", [120.0, 700.0, 1000.0, 1800.0, 5000.0, 1e8])
def test_clipping_keeps_the_luminance(temperature: float) -> None:
    light = black_body.rgb(temperature)
    assert (light >= 0.0).all()
    assert light @ black_body.LUMINANCE_WEIGHTS == pytest.approx(black_body.luminance(temperature), rel=5e-4)


def test_hottest_and_coldest() -> None:
    # Rayleigh and Jeans: in proportion to the temperature, with the color of the hottest.
    np.testing.assert_allclose(black_body.rgb(1e12), 1e3 * black_body.rgb(1e9), rtol=1e-6)
    assert black_body.luminance([0.0, 99.0]).tolist() == [0.0, 0.0]
    assert (np.diff(black_body.luminance(np.geomspace(100.0, 1e10, 999))) > 0.0).all()
