# SPDX-License-Identifier: GPL-3.0-or-later
"""Sky or shadow: the closed forms against polynomial roots and against the source text's own flowchart."""

import math

import numpy as np
import pytest
from references import random_sky

from physics import BlackHoleError, Observer
from physics.kerr.critical_curve import (
    comes_from_sky,
    critical_carter_constant,
    critical_impact_parameters,
    edge_angles,
    edge_function,
    spherical_orbit,
    spherical_orbit_radii,
)
from physics.kerr.metric import horizon_radius
from physics.kerr.rays import camera_directions, rays_from_camera

CAMERAS = [
    (0.0, Observer.fido(10.0, 1.2, 0.0)),
    (1e-7, Observer.fido(10.0, 1.2, 0.0)),
    (0.5, Observer.fido(3.0, 0.4, 1.0)),
    (0.9, Observer(2.3, 1.7, 0.0, 0.5, (0.36, 0.48, -0.8))),
    (0.999, Observer.circular_orbit(0.999, 6.03)),
    (0.9999, Observer.fido(1.2, math.pi / 2, 0.0)),  # inside the ergosphere and the photon orbits
    (-0.7, Observer.fido(2.9, 2.8, 0.0)),
    (0.998, Observer.fido(1000.0, 0.0, 0.0)),
]


def rays_of(spin, observer, count=3000):
    return rays_from_camera(spin, observer, camera_directions(*random_sky(count)))


def sky_by_polynomial_roots(spin, observer, rays):
    """Whether R (Eq. 3) has a root between the camera and the end of the backward ray: by eigenvalues."""
    answers = []
    for i in range(len(rays)):
        b, q, outgoing = rays.b[i], rays.q[i], rays.radial[i] > 0.0
        if not rays.escapes[i]:
            answers.append(False)
            continue
        roots = np.roots([1.0, 0.0, spin**2 - b**2 - q, 2.0 * ((b - spin) ** 2 + q), -(spin**2) * q])
        real = np.sort(roots[np.abs(roots.imag) < 1e-9 * np.abs(roots)].real)
        inner = real[(real < observer.r) & (real > horizon_radius(spin))]
        outer = real[real > observer.r]
        answers.append(len(inner) > 0 if outgoing else len(outer) == 0)
    return np.array(answers)


@pytest.mark.parametrize(("spin", "observer"), CAMERAS)
def test_closed_form_agrees_with_polynomial_roots(spin, observer):
    rays = rays_of(spin, observer)
    # Double roots on the edge itself are not for eigenvalues to find: 1e-7 of the sky's width is left out.
    clear = np.abs(edge_function(rays)) > 1e-7
    assert clear.sum() > 0.99 * len(rays)
    expected = sky_by_polynomial_roots(spin, observer, rays)
    assert np.array_equal(comes_from_sky(rays)[clear], expected[clear])


@pytest.mark.parametrize(("spin", "observer"), [camera for camera in CAMERAS if abs(camera[0]) > 1e-3])
def test_closed_form_agrees_with_the_flowchart(spin, observer):
    """Eqs. 11 and 12: rays within the range of b and below q0(b) have no turning point, p_r decides; the others
    come from the sky exactly if the camera is outside the largest root of R."""
    rays = rays_of(spin, observer)
    low, high = critical_impact_parameters(spin)
    inside = (rays.b > low) & (rays.b < high)
    free = np.zeros(len(rays), dtype=bool)
    free[inside] = rays.q[inside] < critical_carter_constant(spin, rays.b[inside])
    expected = np.zeros(len(rays), dtype=bool)
    for i in np.flatnonzero(rays.escapes):
        if free[i]:
            expected[i] = rays.radial[i] < 0.0
        else:
            c2, c3 = spin**2 - rays.b[i] ** 2 - rays.q[i], 2.0 * ((rays.b[i] - spin) ** 2 + rays.q[i])
            roots = np.roots([1.0, 0.0, c2, c3, -(spin**2) * rays.q[i]])
            # Next to its turning point the camera may be on the root itself, which rounding puts a little outside.
            expected[i] = observer.r >= max(roots[np.abs(roots.imag) < 1e-9].real) * (1.0 - 1e-9)
    clear = np.abs(edge_function(rays)) > 1e-7
    assert np.array_equal(comes_from_sky(rays)[clear], expected[clear])


@pytest.mark.parametrize(("spin", "observer"), CAMERAS)
def test_edge_function_has_the_sign_of_the_fate(spin, observer):
    rays = rays_of(spin, observer, 20_000)
    assert np.array_equal(edge_function(rays) > 0.0, comes_from_sky(rays))


@pytest.mark.parametrize("radius", [1e3, 1e4, 1e6, 1e9])
@pytest.mark.parametrize("spin", [0.0, 0.5, 0.999])
def test_edge_function_keeps_its_sign_for_distant_holes(spin, radius):
    """Rays within a few shadow radii of a hole's center, where R(r_cam) and Y^2 are equal to the last digits."""
    random = np.random.default_rng(1)
    angle, turn = 20.0 / radius * np.sqrt(random.uniform(size=5000)), random.uniform(0.0, 2.0 * math.pi, 5000)
    looking = np.stack([-np.cos(angle), np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn)], axis=-1)
    rays = rays_from_camera(spin, Observer.fido(radius, 1.3, 0.0), looking)
    sky = comes_from_sky(rays)
    assert 0.02 < 1.0 - sky.mean() < 0.2  # the shadow is some 5 / 20 of the cone's radius
    assert np.array_equal(edge_function(rays) > 0.0, sky)


def test_edge_function_is_smooth_across_the_edge():
    """Along a line across the edge its second differences stay small: what anti-aliasing needs."""
    observer = Observer.circular_orbit(0.999, 6.03)
    phi = np.linspace(2.9990 - 0.01, 2.9990 + 0.01, 201)
    values = edge_function(rays_from_camera(0.999, observer, camera_directions(np.full(201, math.pi / 2), phi)))
    slope = np.diff(values)
    assert values[0] * values[-1] < 0.0
    # A kink would double the slope from one step to the next; a smooth function changes it by a share of 1/200.
    assert np.abs(np.diff(slope)).max() < 0.05 * np.abs(slope).max()


@pytest.mark.parametrize("spin", [0.01, 0.5, 0.9, 0.9999, -0.6])
def test_spherical_orbits_round_trip(spin):
    """q0 through the cubic for r0 equals Eq. 9 evaluated at r0, and the ends of b are those of Eqs. 9, 10."""
    prograde, retrograde = spherical_orbit_radii(spin)
    low, high = critical_impact_parameters(spin)
    ends, _ = spherical_orbit(spin, [retrograde, prograde])
    # Eq. 9 divides by the spin: 1e-15 / a.
    assert ends == pytest.approx([low, high], abs=1e-11 / abs(spin))
    radius = np.linspace(prograde, retrograde, 50)[1:-1]
    b, q = spherical_orbit(spin, radius)
    assert critical_carter_constant(spin, b) == pytest.approx(q, rel=1e-9, abs=1e-11 / spin**2)


def test_spherical_orbits_without_spin():
    low, high = critical_impact_parameters(0.0)
    assert (low, high) == pytest.approx((-math.sqrt(27.0), math.sqrt(27.0)))
    b = np.linspace(-5.0, 5.0, 11)
    assert critical_carter_constant(0.0, b) == pytest.approx(27.0 - b**2, rel=1e-13)
    with pytest.raises(BlackHoleError, match="without spin"):
        spherical_orbit(0.0, 3.0)
    with pytest.raises(BlackHoleError, match="between"):
        critical_carter_constant(0.5, 9.0)


def test_rays_of_negative_energy_are_shadow():
    """Inside the ergosphere part of the sky carries negative energy at infinity: it can only come from the hole."""
    rays = rays_of(0.9999, Observer.fido(1.1, math.pi / 2, 0.0), 20_000)
    assert 0 < np.count_nonzero(~rays.escapes) < len(rays)
    assert not comes_from_sky(rays)[~rays.escapes].any()
    assert np.isnan(rays.one_plus_z[~rays.escapes]).all()


@pytest.mark.parametrize("error", [1e-4, 1e-7, 1e-12])
@pytest.mark.parametrize(("off", "reach"), [(0.0, 1e-3), (9e-4, 1e-3), (-9e-4, 1e-3), (0.1, 1e-3), (-0.2, 0.5)])
@pytest.mark.parametrize("radius", [3.5, 12.0, 1000.0])
def test_the_edge_is_found_wherever_it_is_looked_for_first(radius, off, reach, error):
    """Synge's closed form for a camera at rest outside a hole without spin, sin^2 = 27 (1 - 2 / r) / r^2, and on the
    sky's side. Rounding of it costs 1e-15 times the radius."""
    turn = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    expected = math.asin(math.sqrt(27.0 * (1.0 - 2.0 / radius)) / radius)
    about = np.full(len(turn), expected + off)
    found = edge_angles(0.0, Observer.fido(radius, 1.1, 0.3), np.cos(turn), np.sin(turn), error, about=(about, reach))
    assert np.all(found >= expected - 1e-14 * radius)
    assert np.all(found <= expected + error + 1e-14 * radius)
