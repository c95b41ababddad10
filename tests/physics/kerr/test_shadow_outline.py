# SPDX-License-Identifier: GPL-3.0-or-later
"""The shadow's outline against Synge's formula, aberration, and the closed ends of Kerr's critical curve."""

import math

import numpy as np
import pytest

import physics
from physics.kerr.critical_curve import critical_impact_parameters

TOLERANCE = 1e-4
"""Of the shadow's angle: what the outline is known to."""


def away(outline: np.ndarray, position: tuple[float, float, float]) -> np.ndarray:
    """Angles from the hole's direction, radians."""
    toward = -np.array(position) / np.linalg.norm(position)
    return np.arctan2(np.linalg.norm(np.cross(outline, toward), axis=-1), outline @ toward)


@pytest.mark.parametrize("r", [2.1, 3.0, 10.0, 1000.0])
def test_without_spin_it_is_synges_circle(r: float) -> None:
    """sin(alpha) = sqrt(27) sqrt(1 - 2/r) / r, more than a right angle inside of the photon sphere (Synge 1966)."""
    outline = physics.shadow_outline(0.0, physics.Observer.fido(r, 1.0, 0.3), 16)
    position = (math.sin(1.0) * math.cos(0.3), math.sin(1.0) * math.sin(0.3), math.cos(1.0))
    alpha = math.asin(min(math.sqrt(27.0 * (1.0 - 2.0 / r)) / r, 1.0))
    alpha = math.pi - alpha if r < 3.0 else alpha
    np.testing.assert_allclose(away(outline, position), alpha, rtol=TOLERANCE, atol=TOLERANCE / r)
    np.testing.assert_allclose(np.linalg.norm(outline, axis=-1), 1.0, rtol=1e-12)


def test_one_who_falls_sees_it_smaller() -> None:
    """Aberration: cos(alpha') = (cos(alpha) + beta) / (1 + beta cos(alpha)), with beta = sqrt(2/r)."""
    r = 10.0
    outline = physics.shadow_outline(0.0, physics.Observer.free_fall(0.0, r, math.pi / 2, 0.0), 8)
    cosine, beta = math.sqrt(1.0 - 27.0 * (1.0 - 2.0 / r) / r**2), math.sqrt(2.0 / r)
    np.testing.assert_allclose(
        away(outline, (1.0, 0.0, 0.0)), math.acos((cosine + beta) / (1.0 + beta * cosine)), rtol=2.0 * TOLERANCE
    )


@pytest.mark.parametrize("spin", [0.5, 0.998, -0.9])
def test_from_afar_its_ends_are_those_of_the_critical_curve(spin: float) -> None:
    """In the plane of rotation the impact parameters b_1 and b_2 are seen, and up is q = 27 at b = 2 a (Bardeen)."""
    r = 1e5
    outline = r * physics.shadow_outline(spin, physics.Observer.fido(r, math.pi / 2, 0.0), 1024)
    ends = -outline[:, 1].max(), -outline[:, 1].min()  # light comes from where the observer looks
    np.testing.assert_allclose(sorted(ends), sorted(critical_impact_parameters(spin)), rtol=1e-3)
    assert outline[:, 2].max() == pytest.approx(math.sqrt(27.0), rel=1e-3)
    assert outline[:, 2].min() == pytest.approx(-math.sqrt(27.0), rel=1e-3)


def test_what_has_no_outline_is_refused() -> None:
    with pytest.raises(physics.BlackHoleError, match="horizon"):
        physics.shadow_outline(0.9, physics.Observer.fido(1.2, 1.0, 0.0))
    with pytest.raises(physics.BlackHoleError, match="3 points at least"):
        physics.shadow_outline(0.9, physics.Observer.fido(10.0, 1.0, 0.0), 2)
