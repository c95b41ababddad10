# SPDX-License-Identifier: GPL-3.0-or-later
"""Velocities by coordinate time, as the local FIDO measures them, against closed forms of other observers."""

import math

import numpy as np
import pytest
from test_observers_and_rays import metric_tensor

import physics
from physics.kerr.metric import metric_functions

# Rounding of a few dozen operations, some with two digits of cancellation.
ROUNDING = 1e-12


def place(r: float, theta: float, phi: float) -> np.ndarray:
    return r * np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def triad(theta: float, phi: float) -> np.ndarray:
    """r-hat, theta-hat and phi-hat as the derivatives of `place`, by central differences."""
    step = 1e-5
    rows = [
        place(1.0, theta, phi),
        (place(1.0, theta + step, phi) - place(1.0, theta - step, phi)) / (2.0 * step),
        np.array([-math.sin(phi), math.cos(phi), 0.0]),
    ]
    return np.array(rows)


def on_triad(spin, r, theta, phi, rates) -> np.ndarray:
    """What the FIDO measures along its axes, of dr/dt, dtheta/dt and dphi/dt."""
    axes = triad(theta, phi)
    velocity = np.array([1.0, r, r * math.sin(theta)]) * rates @ axes
    return axes @ physics.local_velocity(spin, place(r, theta, phi), velocity)


@pytest.mark.parametrize("prograde", [True, False])
@pytest.mark.parametrize("spin", [0.0, 0.5, 0.9, 0.998, -0.7])
@pytest.mark.parametrize("r", [4.5, 6.0, 10.0, 100.0])
def test_circular_orbits_have_the_speed_of_equation_14(spin, r, prograde):
    """BPT Eq. 3.10, the orbit's speed in the FIDO's frame without alpha, omega or varpi; Omega is their Eq. 2.16."""
    a, sense = abs(spin), 1.0 if prograde else -1.0
    turn = math.copysign(1.0, spin)
    omega = turn * sense / (r**1.5 + sense * a)
    expected = turn * sense * (r**2 - sense * 2.0 * a * math.sqrt(r) + a**2)
    expected /= math.sqrt(r**2 - 2.0 * r + a**2) * (r**1.5 + sense * a)
    found = on_triad(spin, r, math.pi / 2, 0.7, (0.0, 0.0, omega))
    assert found == pytest.approx((0.0, 0.0, expected), abs=1e-10)  # the differences of `triad`
    if r > physics.isco_radius(spin, prograde):
        observer = physics.Observer.circular_orbit(spin, r, prograde=prograde)
        assert found[2] == pytest.approx(observer.beta * observer.direction[2], abs=ROUNDING)


def test_the_orbit_at_6_m_has_half_the_speed_of_light():
    velocity = (0.0, 6.0 * 6.0**-1.5, 0.0)
    assert velocity[1] == pytest.approx(0.408, abs=5e-4)  # in flat space
    assert physics.local_velocity(0.0, (6.0, 0.0, 0.0), velocity) == pytest.approx((0.0, 0.5, 0.0), abs=ROUNDING)


@pytest.mark.parametrize("theta", [0.0, 0.2, 1.0, math.pi / 2, 3.0, math.pi])
@pytest.mark.parametrize("spin", [0.0, 0.5, 0.95, -0.8])
@pytest.mark.parametrize("r", [2.5, 7.0, 300.0])
def test_free_fall_from_rest_at_infinity(spin, r, theta):
    """The geodesic of E = 1, L = 0, Q = 0 (BPT Eqs. 2.9, 2.10): its dr/dt and dphi/dt have closed forms.

    The FIDO must measure gamma = 1 / alpha along -r-hat, which comes from the conservation of energy.
    """
    delta = r**2 - 2.0 * r + spin**2
    area = (r**2 + spin**2) ** 2 - spin**2 * delta * math.sin(theta) ** 2
    fall = -delta * math.sqrt(2.0 * r * (r**2 + spin**2)) / area
    found = on_triad(spin, r, theta, -2.0, (fall, 0.0, 2.0 * spin * r / area))
    observer = physics.Observer.free_fall(spin, r, theta, -2.0)
    assert found == pytest.approx((-observer.beta, 0.0, 0.0), abs=1e-10)  # the differences of `triad`


@pytest.mark.parametrize(("spin", "r", "theta"), [(0.9, 2.2, 1.3), (0.9, 5.0, 0.0), (-0.6, 3.0, 2.0), (0.0, 9.0, 1.0)])
def test_at_rest_is_the_static_observer(spin, r, theta):
    found = on_triad(spin, r, theta, 1.0, (0.0, 0.0, 0.0))
    observer = physics.Observer.static(spin, r, theta, 1.0)
    assert found == pytest.approx(observer.beta * np.array(observer.direction), abs=ROUNDING)
    position = tuple(place(r, theta, 1.0))
    moving = physics.WarpMapParameters(
        spin,
        physics.PanoramaCamera(8, 4),
        position,
        motion="velocity",
        velocity=physics.local_velocity(spin, position, (0.0, 0.0, 0.0)),
    ).observer()
    assert moving.beta == pytest.approx(observer.beta, abs=ROUNDING)


def test_any_velocity_has_the_proper_time_of_the_metric():
    """1 - beta^2 = (d tau / dt)^2 / alpha^2, with d tau from the metric tensor of the textbook.

    Random places outside the ergosphere and velocities up to light's, the seed is fixed.
    """
    random = np.random.default_rng(5)
    for _ in range(300):
        spin, r, theta = random.uniform(-0.99, 0.99), random.uniform(2.1, 30.0), random.uniform(0.05, 3.09)
        rates = random.uniform(-1.0, 1.0, 3) * (0.3, 0.3 / r, 0.3 / (r * math.sin(theta)))
        found = on_triad(spin, r, theta, 0.4, rates)
        g_tt, g_tp, g_pp = metric_tensor(spin, r, theta)
        rho2, delta = r**2 + (spin * math.cos(theta)) ** 2, r**2 - 2.0 * r + spin**2
        interval = g_tt + 2.0 * g_tp * rates[2] + g_pp * rates[2] ** 2
        interval += rho2 / delta * rates[0] ** 2 + rho2 * rates[1] ** 2
        alpha = metric_functions(spin, r, theta).alpha
        # 1e-8: the differences of `triad`, times factors of up to 100 next to the horizon
        assert 1.0 - found @ found == pytest.approx(-interval / alpha**2, abs=1e-8 * max(1.0, found @ found))


def test_the_axis_is_the_limit_of_places_beside_it():
    velocity = (0.1, -0.2, 0.3)
    at = physics.local_velocity(0.9, (0.0, 0.0, 4.0), velocity)
    for beside in ((1e-9, 0.0, 4.0), (0.0, -1e-9, 4.0)):
        assert physics.local_velocity(0.9, beside, velocity) == pytest.approx(at, abs=1e-8)


def test_far_away_it_is_the_velocity_itself():
    velocity = (0.3, -0.4, 0.5)
    found = physics.local_velocity(0.9, (3e8, 4e8, -5e8), velocity)
    assert found == pytest.approx(velocity, abs=1e-8)  # 2 M / r


def test_what_cannot_be_is_told():
    """Within the ergosphere nothing is at rest; inside the horizon nobody measures; nor is NaN a velocity."""
    assert math.hypot(*physics.local_velocity(0.9, (1.9, 0.0, 0.0), (0.0, 0.0, 0.0))) > 1.0
    assert math.hypot(*physics.local_velocity(0.0, (3.0, 0.0, 0.0), (0.34, 0.0, 0.0))) > 1.0  # light falls with 1/3
    for position, velocity, code in (
        ((1.2, 0.0, 0.0), (0.0, 0.0, 0.0), "camera.inside-hole"),
        ((9.0, 0.0, 0.0), (math.nan, 0.0, 0.0), "camera.position"),
        ((9.0, 0.0, math.inf), (0.0, 0.0, 0.0), "camera.position"),
        ((9.0, 0.0, 0.0), (0.0, 0.0), "settings.type"),
    ):
        with pytest.raises(physics.BlackHoleError) as caught:
            physics.local_velocity(0.9, position, velocity)
        assert caught.value.code == code
