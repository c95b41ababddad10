# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast method against the reference method, ray by ray, on cameras of every kind."""

import math

import numpy as np
import pytest
from references import angle_between, random_sky, unit_vectors

from physics import METHODS, Fate, Observer, trace_rays
from physics.geodesics.polar import PolarMotion
from physics.geodesics.quadrature import NODE_COUNTS, RULES
from physics.geodesics.tracer import trace_block
from physics.kerr.critical_curve import around_hole, edge_angles
from physics.kerr.metric import horizon_radius
from physics.kerr.rays import camera_directions, rays_from_camera, rays_from_triad

CAMERAS = {
    "orbit": (0.999, Observer.circular_orbit(0.999, 10.0)),
    "schwarzschild": (0.0, Observer.static(0.0, 10.0, 1.0, 0.3)),
    "hardly spinning": (1e-7, Observer.fido(5.0, 1.0, 0.0)),
    "over the pole": (0.9, Observer.fido(6.0, 0.0, 1.0)),
    "beside the pole": (0.9, Observer.fido(6.0, math.pi - 1e-9, 1.0)),
    "inside the photon orbits": (0.9, Observer(2.3, 1.7, 0.0, 0.5, (0.36, 0.48, -0.8))),
    "inside the ergosphere": (0.9999, Observer.fido(1.3, math.pi / 2, 0.0)),
    "next to the horizon": (0.9999, Observer.fido(horizon_radius(0.9999) * 1.001, 1.0, 0.0)),
    "fast": (0.7, Observer(20.0, 1.2, 0.0, 0.99, (-0.6, 0.0, 0.8))),
    "far": (0.95, Observer.free_fall(0.95, 1e5, 1.2, 0.0)),
    "on the photon sphere": (0.0, Observer.fido(3.0, 1.3, 0.0)),
    "retrograde": (-0.998, Observer.fido(4.0, 2.0, 0.0)),
}


@pytest.mark.parametrize("camera", CAMERAS)
def test_the_fast_method_agrees_with_the_reference(camera):
    spin, observer = CAMERAS[camera]
    theta_rd, phi_rd = random_sky(4000)
    fast = trace_rays(spin, observer, theta_rd, phi_rd, method="gauss-legendre")
    reference = trace_rays(spin, observer, theta_rd, phi_rd, method="cash-karp", tolerance=1e-10)
    assert np.array_equal(fast.fate, reference.fate)
    assert np.array_equal(fast.one_plus_z, reference.one_plus_z, equal_nan=True)
    sky = fast.fate == Fate.SKY
    error = angle_between(unit_vectors(fast.theta, fast.phi), unit_vectors(reference.theta, reference.phi))[sky]
    # The default tolerance is 1e-6 rad; the amplification next to the edge, a few tens at most among so many random
    # rays, is allowed for in the largest error alone.
    assert np.median(error) < 1e-6
    assert np.quantile(error, 0.99) < 5e-6
    assert error.max() < 1e-4


@pytest.mark.parametrize("camera", CAMERAS)
def test_the_fast_method_follows_its_tolerance(camera):
    spin, observer = CAMERAS[camera]
    theta_rd, phi_rd = random_sky(1000)
    reference = trace_rays(spin, observer, theta_rd, phi_rd, method="cash-karp", tolerance=1e-12)
    sky = reference.fate == Fate.SKY
    for tolerance in (1e-4, 1e-8, 1e-11):
        fast = trace_rays(spin, observer, theta_rd, phi_rd, method="gauss-legendre", tolerance=tolerance)
        error = angle_between(unit_vectors(fast.theta, fast.phi), unit_vectors(reference.theta, reference.phi))[sky]
        # Rounding leaves 1e-11 for the farthest camera (1e-16 of b = 1e5) and 1e-10 next to the horizon.
        assert np.quantile(error, 0.95) < 3.0 * tolerance + 1e-10


@pytest.mark.parametrize("method", METHODS)
def test_a_view_of_nothing_but_shadow(method):
    result = trace_rays(0.5, Observer.fido(10.0, 1.0, 0.0), math.pi / 2, math.pi, method=method)
    assert result.fate == Fate.SHADOW


@pytest.mark.parametrize("theta", [0.0, 1e-5, math.pi])
def test_equation_2_as_printed_does_not_start_on_the_axis(theta):
    result = trace_rays(0.9, Observer.fido(8.0, theta, 0.0), *random_sky(3000), method="cash-karp-printed")
    assert result.counts["sky"] == 0
    assert result.counts["unresolved"] > 2000


def test_gauss_legendre_rules_integrate_polynomials_exactly():
    for count in NODE_COUNTS[:3]:
        nodes, weights = (np.array(each) for each in RULES[count])
        for power in range(2 * count):
            exact = 0.0 if power % 2 else 2.0 / (power + 1)
            assert weights @ nodes**power == pytest.approx(exact, abs=1e-14)


def test_polar_motion_is_a_great_circle_without_spin():
    observer = Observer.fido(10.0, 1.0, 0.4)
    directions = camera_directions(*random_sky(200))
    rays = rays_from_camera(0.0, observer, directions)
    time = 2.0 / np.sqrt(rays.q_plus_b2)
    end = PolarMotion.of(rays).direction(time, np.zeros(200), 1e-12).T
    start = unit_vectors(np.array(1.0), np.array(0.4))
    # Mino time times the angular momentum is the angle.
    assert angle_between(end, start) == pytest.approx(2.0, abs=1e-12)


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.4, math.pi])
def test_polar_motion_conserves_carters_constant(theta):
    """The speed on the sphere by finite differences: |n'|^2 = q + b^2 + a^2 cos^2 theta, and b = (n x n')_z."""
    spin, observer = 0.95, Observer.fido(5.0, theta, 0.4)
    rays = rays_from_camera(spin, observer, camera_directions(*random_sky(300)))
    motion = PolarMotion.of(rays)
    usable = motion.usable(1e-12)
    assert usable.sum() > 200
    rays = rays.select(usable)
    motion = PolarMotion.of(rays)
    time, step = 1.5 / np.sqrt(rays.q_plus_b2), 1e-5 / np.sqrt(rays.q_plus_b2)
    still = np.zeros(len(rays))
    before, here, after = (motion.direction(time + shift, still, 1e-13) for shift in (-step, 0.0 * step, step))
    speed = (after - before) / (2.0 * step)
    expected = rays.q_plus_b2 + spin**2 * here[2] ** 2
    # Central differences: the square of the step and rounding over the step, 1e-10 each.
    assert (speed**2).sum(axis=0) == pytest.approx(expected, rel=1e-8)
    turning = here[0] * speed[1] - here[1] * speed[0]
    assert turning == pytest.approx(-rays.b, abs=1e-8 * np.sqrt(rays.q_plus_b2).max())


@pytest.mark.parametrize(
    ("spin", "observer", "ordinary", "beside"),
    [
        (0.9, Observer.fido(20.0, 1.4, 0.0), (0.0, 0.01), (0.9, 1.0)),
        (0.0, Observer.fido(10.0, 1.0, 0.0), (0.0, 0.01), (0.9, 1.0)),
        (0.999, Observer.fido(1.4, 1.5, 0.0), (0.1, 0.2), (0.3, 0.6)),
        (0.9999, Observer.fido(1.2, 1.4, 0.0), (0.25, 0.4), (0.3, 0.6)),
    ],
)
def test_boyer_and_lindquists_coordinates_carry_what_the_manual_says(spin, observer, ordinary, beside):
    """Of rays from all of the sky, and of those a hundredth outside of the shadow's edge; the others are right."""
    theta_rd, phi_rd = random_sky(600)
    best = trace_rays(spin, observer, theta_rd, phi_rd)
    printed = trace_rays(spin, observer, theta_rd, phi_rd, method="cash-karp-printed")
    lost = printed.fate == Fate.UNRESOLVED
    sky = best.fate == Fate.SKY
    assert ordinary[0] <= lost[sky].mean() <= ordinary[1]
    assert np.array_equal(printed.fate[~lost], best.fate[~lost])
    around = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False) + 0.003
    edge = edge_angles(spin, observer, np.cos(around), np.sin(around), 1e-12)
    rays = rays_from_triad(spin, observer, around_hole(1.01 * edge, np.cos(around), np.sin(around)))
    fate, _ = trace_block(rays, 1e-6, "cash-karp-printed")
    assert beside[0] <= (fate == Fate.UNRESOLVED).mean() <= beside[1]
