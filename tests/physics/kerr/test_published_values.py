# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed forms from the literature: shadows, deflection angles, Einstein rings, critical curves, redshifts."""

import math

import numpy as np
import pytest
from references import PUBLISHED, angle_between, bisect, unit_vectors

from physics import Fate, Observer, trace_rays
from physics.kerr.critical_curve import critical_carter_constant, critical_impact_parameters, spherical_orbit
from physics.kerr.metric import horizon_radius, isco_radius, photon_orbit_radius

EQUATOR = math.pi / 2


def in_shadow(spin, observer, theta_rd, phi_rd):
    return bool(trace_rays(spin, observer, theta_rd, phi_rd, tolerance=1e-2).fate == Fate.SHADOW)


def from_inward(psi: float) -> tuple[float, float]:
    """theta_rd, phi_rd in the equatorial plane, psi from the hole's direction, for B = phi-hat."""
    return EQUATOR, math.pi - psi


@pytest.mark.parametrize(("radius", "sine", "psi", "one_plus_z"), PUBLISHED["schw_static_shadow"])
def test_schwarzschild_shadow_of_a_static_observer(radius, sine, psi, one_plus_z):
    observer = Observer.static(0.0, float(radius), EQUATOR, 0.0)
    edge = bisect(lambda angle: in_shadow(0.0, observer, *from_inward(angle)), 0.0, math.pi)
    assert math.sin(edge) == pytest.approx(sine, rel=1e-11)
    assert edge == pytest.approx(psi, rel=1e-7)  # asin loses digits at r = 3, where the edge is at pi / 2
    shift = trace_rays(0.0, observer, 0.3, [1.0, 2.0, 5.0]).one_plus_z
    assert shift[np.isfinite(shift)] == pytest.approx(one_plus_z, rel=1e-13)


@pytest.mark.parametrize(("radius", "psi"), PUBLISHED["schw_rain_shadow"])
def test_schwarzschild_shadow_of_a_falling_observer(radius, psi):
    observer = Observer.free_fall(0.0, float(radius), EQUATOR, 0.0)
    # y runs along the fall, -r-hat: the angle from the inward direction is the angle from y.
    edge = bisect(lambda angle: in_shadow(0.0, observer, EQUATOR, EQUATOR + angle), 0.0, math.pi)
    assert edge == pytest.approx(psi, rel=1e-12)
    outward = trace_rays(0.0, observer, EQUATOR, EQUATOR + math.pi).one_plus_z
    assert outward == pytest.approx(1.0 + math.sqrt(2.0 / float(radius)), rel=1e-13)


def swept_from_turning_point(spin: float, b: float) -> float:
    """Angle about the axis from a ray's turning point to infinity: a camera there sees it with p_r = 0 exactly."""
    # Roots of R(r) = r^4 + (a^2 - b^2) r^2 + 2 (a - b)^2 r by eigenvalues: other mathematics than the tracer's.
    roots = np.roots([1.0, 0.0, spin**2 - b**2, 2.0 * (spin - b) ** 2])
    turning = max(root.real for root in roots if abs(root.imag) < 1e-9)
    observer = Observer.fido(turning, EQUATOR, 0.0)
    # The backward ray leaves against the light: for b > 0 it moves towards -phi, where the camera looks.
    result = trace_rays(spin, observer, EQUATOR, math.copysign(EQUATOR, -b), tolerance=1e-11)
    assert result.fate == Fate.SKY
    return float(-math.copysign(1.0, b) * result.phi) % (2.0 * math.pi)


@pytest.mark.parametrize(
    ("spin", "b", "deflection"),
    [(0.0, float(b), value) for b, value in PUBLISHED["schw_deflection"]]
    + [(float(a), float(b), value) for a, b, value in PUBLISHED["kerr_eq_deflection"] if value is not None],
)
def test_deflection_from_infinity_to_infinity(spin, b, deflection):
    if isinstance(deflection, str) or not math.isfinite(deflection):
        pytest.skip("captured: covered by the shadow's edge")
    # In and out are mirror images: the whole angle is twice that from the turning point.
    expected = 0.5 * (deflection + math.pi)
    difference = (swept_from_turning_point(spin, b) - expected + math.pi) % (2.0 * math.pi) - math.pi
    # np.roots is good to 1e-15 of the turning point, which next to the photon orbit (b = 5.197) is amplified by
    # the square root of the distance: 1e-8 there, 1e-10 elsewhere.
    assert abs(difference) < (1e-8 if abs(b) == 5.197 else 1e-10)


@pytest.mark.parametrize(("radius", "order", "_b", "psi"), PUBLISHED["schw_einstein"])
def test_einstein_rings(radius, order, _b, psi):
    """Light from straight behind the hole arrives on rings at published angles, after any number of turns."""
    observer = Observer.static(0.0, float(radius), 1.2, 0.5)
    turn = np.linspace(0.0, 2.0 * math.pi, 7)
    looking = np.stack([-np.cos(psi) * np.ones_like(turn), np.sin(psi) * np.cos(turn), np.sin(psi) * np.sin(turn)])
    result = trace_rays(0.0, observer, np.arccos(looking[2]), np.arctan2(looking[1], looking[0]), tolerance=1e-11)
    behind = unit_vectors(np.array(math.pi - 1.2), np.array(0.5 + math.pi))
    # Each turn multiplies errors by e^(2 pi): the published psi has 15 digits, a rounding of 1e-16 becomes
    # 1e-16 r e^(2 pi n).
    allowed = 1e-10 + 1e-15 * float(radius) * math.exp(2.0 * math.pi * order)
    assert angle_between(unit_vectors(result.theta, result.phi), behind).max() < allowed


@pytest.mark.parametrize("row", PUBLISHED["kerr_edges"])
def test_photon_orbits_isco_and_ends_of_the_critical_curve(row):
    spin, r1, r2, alpha_min, alpha_max, r_polar, on_axis, isco = (float(value) for value in row[:8])
    assert photon_orbit_radius(spin, True) == pytest.approx(r1, rel=1e-13)
    assert photon_orbit_radius(spin, False) == pytest.approx(r2, rel=1e-13)
    assert isco_radius(spin) == pytest.approx(isco, rel=1e-12)
    low, high = critical_impact_parameters(spin)
    assert (-high, -low) == pytest.approx((alpha_min, alpha_max), rel=1e-13)
    # Light without angular momentum about the axis: b = 0 at the polar orbit, and q + a^2 the circle's radius squared.
    b0, q0 = spherical_orbit(spin, r_polar)
    assert b0 == pytest.approx(0.0, abs=1e-11)
    assert math.sqrt(q0 + spin**2) == pytest.approx(on_axis, rel=1e-12)


def test_horizon():
    assert horizon_radius(0.0) == 2.0
    assert horizon_radius(0.998) == pytest.approx(1.06321392252, rel=1e-11)


@pytest.mark.parametrize(("spin", "_radius", "alpha", "beta"), PUBLISHED["kerr_curve_eq"])
def test_points_of_the_critical_curve(spin, _radius, alpha, beta):
    """Bardeen's alpha = -b, beta^2 = q for an observer in the equatorial plane."""
    low, high = critical_impact_parameters(float(spin))
    q = critical_carter_constant(float(spin), np.clip(-alpha, low, high))
    # beta vanishes at the ends like a square root: beta^2 is the well-conditioned quantity.
    assert q == pytest.approx(beta**2, abs=1e-11, rel=1e-11)


@pytest.mark.parametrize(("spin", "radius", "beta", "one_plus_z", "prograde", "retrograde"), PUBLISHED["camera_edges"])
def test_shadow_edges_in_a_moving_cameras_sky(spin, radius, beta, one_plus_z, prograde, retrograde):
    observer = Observer(float(radius), EQUATOR, 0.0, float(beta))
    middle = 0.5 * (prograde + retrograde)
    found = [
        bisect(lambda angle: in_shadow(float(spin), observer, EQUATOR, angle), middle, end)
        for end in (middle + 1.5 * (prograde - middle), middle + 1.5 * (retrograde - middle))
    ]
    assert found == pytest.approx([prograde, retrograde], abs=1e-12)
    outside = trace_rays(float(spin), observer, EQUATOR, prograde + 1e-10 * math.copysign(1.0, prograde - middle))
    assert outside.one_plus_z == pytest.approx(one_plus_z, rel=1e-8)


@pytest.mark.parametrize(("spin", "radius", "theta", "beta", "one_plus_z"), PUBLISHED["static_z"])
def test_static_observer_sees_one_redshift_everywhere(spin, radius, theta, beta, one_plus_z):
    observer = Observer.static(spin, radius, theta, 0.3)
    assert observer.beta == pytest.approx(beta, rel=1e-12)
    result = trace_rays(spin, observer, np.linspace(0.0, math.pi, 9)[:, None], np.linspace(0.0, 6.0, 11))
    sky = result.fate == Fate.SKY
    assert result.one_plus_z[sky] == pytest.approx(one_plus_z, rel=1e-13)


def test_redshift_on_a_circular_orbit():
    """Equatorial geodesic: 1 + z = sqrt(1 - 3/r + 2a/r^1.5) / ((1 + a/r^1.5)(1 - b Omega)), here for rays through
    the prograde edge, whose b is known in closed form."""
    spin, radius = 0.999, 6.03
    observer = Observer.circular_orbit(spin, radius)
    b = critical_impact_parameters(spin)[1]
    root = radius**1.5
    expected = math.sqrt(1.0 - 3.0 / radius + 2.0 * spin / root) / ((1.0 + spin / root) * (1.0 - b / (spin + root)))
    # The edge itself is shadow; a step of 1e-10 rad outside changes 1 + z by as little.
    seen = trace_rays(spin, observer, EQUATOR, 2.99902198835921 + 1e-10).one_plus_z
    assert seen == pytest.approx(expected, rel=1e-8)
