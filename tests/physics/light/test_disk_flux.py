# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a thin disk is seen, its redshift and its flux: published curves, and closed forms against integrals."""

import math

import numpy as np
import pytest

from physics import BlackHoleError, Observer, trace_disk
from physics.kerr.metric import isco_radius
from physics.kerr.orbiting_matter import circular_constants
from physics.light.disk_flux import page_thorne_flux, peak_radius, relative_flux

FAR = 1e6


def image_plane(spin, inclination, b, alpha, **settings):
    """Crossings seen by a camera far away at impact parameter b, at an angle alpha from the projected spin axis."""
    theta = math.radians(inclination)
    # e_x is outward and e_z north for B = phi-hat, so that e_y = phi-hat is to the right of one who looks inwards.
    angle = np.arcsin(np.asarray(b) * math.sqrt(1.0 - 2.0 / FAR) / FAR)
    north, east = np.sin(angle) * np.cos(alpha), np.sin(angle) * np.sin(alpha)
    theta_rd, phi_rd = np.arccos(north), np.arctan2(east, -np.cos(angle))
    return trace_disk(spin, Observer.static(spin, FAR, theta, 0.0), theta_rd, phi_rd, tolerance=1e-9, **settings)


NODES = np.polynomial.legendre.leggauss(60)


def elliptic(k2, low, high):
    """The incomplete elliptic integral of the first kind between two amplitudes, by quadrature."""
    nodes, weights = NODES
    angle = low + 0.5 * (high - low) * (1.0 + nodes)
    return 0.5 * (high - low) * float(np.sum(weights / np.sqrt(1.0 - k2 * np.sin(angle) ** 2)))


def amplitude(k2, start, value):
    """The amplitude at which the integral from `start` reaches `value`, by Newton's method."""
    angle = start
    for _ in range(50):
        change = (elliptic(k2, start, angle) - value) * math.sqrt(1.0 - k2 * math.sin(angle) ** 2)
        angle -= change
        if abs(change) < 1e-13:
            break
    return angle


def luminet_radius(b, gamma):
    """Radius where a ray of impact parameter b is at the angle gamma from the camera: Luminet 1979, Eqs. 6 and 13."""
    p = 2.0 * b / math.sqrt(3.0) * math.cos(math.acos(-3.0 * math.sqrt(3.0) / b) / 3.0)  # b^2 = P^3 / (P - 2)
    q = math.sqrt((p - 2.0) * (p + 6.0))
    k2 = (q - p + 6.0) / (2.0 * q)
    start = math.asin(math.sqrt((q - p + 2.0) / (q - p + 6.0)))
    sn = math.sin(amplitude(k2, start, 0.5 * gamma * math.sqrt(q / p)))
    return 1.0 / (-(q - p + 2.0) / (4.0 * p) + (q - p + 6.0) / (4.0 * p) * sn * sn)


@pytest.mark.parametrize("inclination", [30.0, 80.0])
def test_the_direct_image_has_luminets_isoradial_curves(inclination):
    b = np.linspace(5.4, 32.0, 12)[:, None] + np.zeros(16)
    alpha = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False) + 0.05 + np.zeros(b.shape)
    found = image_plane(0.0, inclination, b, alpha)
    compared = 0
    for i in np.ndindex(b.shape):
        # From the far camera's direction along the ray's plane to where that plane meets the disk (Luminet, Eq. 10):
        # up on the picture, cos(alpha) > 0, the far side is seen, more than a right angle away.
        level = math.hypot(math.cos(alpha[i]), 1.0 / math.tan(math.radians(inclination)))
        gamma = math.acos(-math.cos(alpha[i]) / level)
        expected = luminet_radius(b[i], gamma)
        if 6.0 < expected < 40.0:
            # The camera is 1e6 M away, not infinitely far: that changes angles by r / 1e6.
            assert found.radius[(*i, 0)] == pytest.approx(expected, rel=2e-4)
            compared += 1
    assert compared > 60


@pytest.mark.parametrize("inclination", [30.0, 80.0])
def test_redshift_over_the_image_is_luminets(inclination):
    """1 + z = (1 + r^(-3/2) b sin(i) sin(alpha)) / sqrt(1 - 3 / r) (Luminet 1979, Eq. 19), to the camera far away."""
    alpha = np.linspace(0.1, 6.2, 40)
    found = image_plane(0.0, inclination, 12.0, alpha)
    r = found.radius[:, 0]
    chosen = r > 6.0
    # p_phi of light that is seen on the right, towards +phi, is negative for matter that turns towards +phi there
    b_phi = -12.0 * math.sin(math.radians(inclination)) * np.sin(alpha)
    expected = np.sqrt(1.0 - 3.0 / r) / (1.0 - r**-1.5 * b_phi)
    camera = math.sqrt(1.0 - 2.0 / FAR)
    assert chosen.sum() > 20
    assert found.g[chosen, 0] * camera == pytest.approx(expected[chosen], rel=1e-6)


def test_rings_lie_where_they_were_published():
    """Face on, a = 0: at least two crossings for 5.02 < b < 6.17, three for 5.19 < b < 5.23.

    Gralla, Holz & Wald 2019, Phys. Rev. D 100, 024018, section III: direct, lensing ring and photon ring.
    """
    b = np.arange(4.5, 7.0, 0.001)
    count = np.isfinite(image_plane(0.0, 0.0, b, 0.3).radius).sum(axis=1)
    for times, low, high in ((2, 5.02, 6.17), (3, 5.19, 5.23)):
        inside = b[count >= times]
        assert inside.min() == pytest.approx(low, abs=0.006)
        assert inside.max() == pytest.approx(high, abs=0.006)
        assert len(inside) == pytest.approx((high - low) * 1000.0, abs=12.0)


def test_rings_close_in_on_the_critical_curve_by_the_lyapunov_factor():
    """For a = 0 each half turn brings the ring nearer to b = 3 sqrt(3) by e^pi (Luminet 1979, Eq. 8)."""

    def ring(order, radius=10.0):
        low, high = 3.0 * math.sqrt(3.0), 12.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            place = image_plane(0.0, 0.0, middle, 0.3, crossings=5).radius[order]
            # farther out on the picture, farther out on the disk, or gone to infinity
            low, high = (middle, high) if place < radius else (low, middle)
        return middle - 3.0 * math.sqrt(3.0)

    assert ring(2) / ring(3) == pytest.approx(math.exp(math.pi), rel=0.02)


SPINS = [(0.0, False), (0.5, False), (0.998, False), (-0.7, False), (0.9, True)]


@pytest.mark.parametrize(("spin", "retrograde"), SPINS)
def test_flux_is_the_integral_that_defines_it(spin, retrograde):
    """f = -Omega' / (E - Omega L)^2 times the integral of (E - Omega L) L' dr (Page & Thorne 1974, Eq. 15 n)."""
    a = -abs(spin) if retrograde else abs(spin)
    isco = isco_radius(spin, prograde=not retrograde)
    nodes, weights = np.polynomial.legendre.leggauss(80)

    def slope(function, r):
        h = 1e-5 * r
        return (function(r + h) - function(r - h)) / (2.0 * h)

    def omega(r):
        return 1.0 / (r**1.5 + a)

    def binding(r):
        energy, momentum = circular_constants(a, r)
        return energy - omega(r) * momentum

    def momentum(r):
        return circular_constants(a, r)[1]

    for r in (1.3 * isco, 2.0 * isco, 10.0 * isco):
        radii = isco + 0.5 * (r - isco) * (1.0 + nodes)
        total = 0.5 * (r - isco) * sum(w * binding(x) * slope(momentum, x) for x, w in zip(radii, weights, strict=True))
        expected = -slope(omega, r) / binding(r) ** 2 * total / r
        assert page_thorne_flux(spin, r, retrograde) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(("spin", "efficiency"), [(0.0, 0.0572), (0.9, 0.1558), (0.998, 0.321)])
def test_flux_carries_away_the_published_binding_energy(spin, efficiency):
    """All the light of both faces, redshifted to infinity, is 1 - E(isco) of what falls in: 5.7 % to 32 %."""
    isco = isco_radius(spin)
    # r = isco / s^2, Gauss-Legendre in s from 0 (infinity) to 1
    nodes, weights = np.polynomial.legendre.leggauss(400)
    s = 0.5 * (1.0 + nodes)
    r = isco / s**2
    energy = np.array([circular_constants(spin, x)[0] for x in r])
    # dL = 4 pi r F E dr for both faces together, F = f / (4 pi r) Mdot
    total = 0.5 * np.sum(weights * page_thorne_flux(spin, r) * r * energy * 2.0 * isco / s**3)
    assert total == pytest.approx(1.0 - circular_constants(spin, isco)[0], rel=1e-4)
    assert total == pytest.approx(efficiency, abs=6e-4)


def test_flux_peaks_where_it_is_known_to():
    # Without spin at 9.55 M; the disk is dark inside its innermost orbit, and falls off as r^-3 far out.
    assert peak_radius(0.0) == pytest.approx(9.55, abs=0.01)
    assert page_thorne_flux(0.0, 6.0) == 0.0
    assert page_thorne_flux(0.0, 3.0) == 0.0
    assert page_thorne_flux(0.5, 1e6) / page_thorne_flux(0.5, 2e6) == pytest.approx(8.0, rel=1e-2)
    assert page_thorne_flux(1e-9, 20.0) == pytest.approx(float(page_thorne_flux(0.0, 20.0)), rel=1e-6)
    assert relative_flux("power_law", 0.5, [3.0, 6.0], 3.0, 2.0) == pytest.approx([1.0, 0.25])
    with pytest.raises(BlackHoleError, match="profile"):
        relative_flux("flat", 0.5, 3.0, 3.0)
