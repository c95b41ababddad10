# SPDX-License-Identifier: GPL-3.0-or-later
"""Light-travel times, against geodesics stepped in Boyer-Lindquist coordinates with the metric alone."""

import math

import numpy as np
import pytest

import physics
from physics.geodesics.travel_time import time_to_plane
from physics.kerr.rays import camera_triad, rays_from_camera

SPIN = 0.9


def inverse_metric(r, theta):
    """g^tt, g^tphi, g^phiphi, g^rr, g^thetatheta of the Kerr metric (Bardeen, Press & Teukolsky 1972, Eq. 2.1)."""
    sigma, delta = r * r + (SPIN * math.cos(theta)) ** 2, r * r - 2.0 * r + SPIN**2
    a = (r * r + SPIN**2) ** 2 - SPIN**2 * delta * math.sin(theta) ** 2
    return np.array(
        [
            -a / (sigma * delta),
            -2.0 * SPIN * r / (sigma * delta),
            (delta - (SPIN * math.sin(theta)) ** 2) / (sigma * delta * math.sin(theta) ** 2),
            delta / sigma,
            1.0 / sigma,
        ]
    )


def rates(state, b):
    """Hamilton's equations of H = g^ab p_a p_b / 2, the metric's derivatives by differences."""
    r, theta, _, _, p_r, p_theta = state
    tt, tp, pp, rr, hh = inverse_metric(r, theta)
    momenta = np.array([1.0, -2.0 * b, b * b, p_r * p_r, p_theta * p_theta])
    step = 1e-5
    by_r = (inverse_metric(r + step, theta) - inverse_metric(r - step, theta)) @ momenta / (4.0 * step)
    by_theta = (inverse_metric(r, theta + step) - inverse_metric(r, theta - step)) @ momenta / (4.0 * step)
    return np.array([rr * p_r, hh * p_theta, -tp + pp * b, -tt + tp * b, -by_r, -by_theta])


def stepped(rays, number, crossings, step=2e-3):
    """Time and radius of the crossings of one ray, backward: the fourth-order Runge-Kutta method, steps of step * r."""
    camera, b = rays.observer, float(rays.b[number])
    delta = camera.r**2 - 2.0 * camera.r + SPIN**2
    state = np.array([camera.r, camera.theta, 0.0, 0.0, rays.radial[number] / delta, rays.polar[number]])
    found = []
    while len(found) < crossings:
        size = -step * state[0]
        k1 = rates(state, b)
        k2 = rates(state + 0.5 * size * k1, b)
        k3 = rates(state + 0.5 * size * k2, b)
        k4 = rates(state + size * k3, b)
        following = state + size / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        one, other = math.cos(state[1]), math.cos(following[1])
        if one * other < 0.0:
            share = one / (one - other)
            found.append((-(state + share * (following - state))[3], (state + share * (following - state))[0]))
        state = following
    return found


@pytest.mark.parametrize("motion", ["fido", "keplerian"])
def test_times_are_those_of_stepped_geodesics(motion):
    camera = getattr(physics.Observer, motion)(
        *((SPIN,) if motion == "keplerian" else ()), 15.0, math.radians(75.0), 0.3
    )
    looking = np.array([[-1.0, 0.25, 0.33], [-1.0, -0.2, 0.36], [-1.0, 0.1, -0.4]])
    looking /= np.linalg.norm(looking, axis=-1, keepdims=True)
    # Rows r, theta, phi to the camera's own axes.
    rays = rays_from_camera(SPIN, camera, looking[:, [0, 2, 1]] @ camera_triad(camera).T)
    met = 0
    for number in range(3):
        time, _, u = time_to_plane(rays, 0, 1e-9)
        if 2.5 < 1.0 / u[number] < 60.0:
            wanted, radius = stepped(rays, number, 1)[0]
            assert 1.0 / u[number] == pytest.approx(radius, rel=1e-3)
            assert time[number] == pytest.approx(wanted, rel=1e-3, abs=0.02)
            met += 1
    assert met >= 2
