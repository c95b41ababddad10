# SPDX-License-Identifier: GPL-3.0-or-later
"""How a disk looks: published curves, closed forms against integrals, and pictures against a loop over pixels."""

import dataclasses
import math

import numpy as np
import pytest
from shots import shot

from physics import BlackHoleError, Disk, Observer, bake, trace_disk
from physics.kerr.metric import isco_radius
from physics.kerr.orbiting_matter import circular_constants, orbital_frequency
from physics.light import black_body
from physics.light.disk_flux import page_thorne_flux, peak_radius, relative_flux
from physics.light.disk_look import emission, shade
from physics.light.disk_settings import PRESETS, DiskLook
from physics.light.disk_texture import (
    SHEAR_TURNS,
    disk_texture,
    look_up,
    moving_texture,
    pattern_period,
    pattern_shares,
)
from physics.reference.disk_render import disk_layers, over_sky

FAR = 1e6
TEXTURE = disk_texture(width=256, height=64)


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


def test_ansae_differ_in_brightness_as_doppler_says():
    """Brightness of the two ends of one isoradial curve, edge on enough for most of the speed to be along the line."""
    look = DiskLook(streaks=0.0, clumps=0.0)
    disk, radius, sin_i = Disk(), 12.0, math.sin(math.radians(80.0))

    def end(sign):
        low, high = 8.0, 20.0
        for _ in range(50):
            middle = 0.5 * (low + high)
            inside = image_plane(0.0, 80.0, middle, sign * 0.5 * math.pi).radius[0] < radius
            low, high = (middle, high) if inside else (low, middle)
        return middle, image_plane(0.0, 80.0, middle, sign * 0.5 * math.pi)

    (b, left), (other_b, right) = end(-1.0), end(1.0)
    assert b == pytest.approx(other_b, rel=1e-6)
    doppler = (1.0 + radius**-1.5 * b * sin_i) / (1.0 - radius**-1.5 * b * sin_i)
    one, other = (
        emission(look, disk, 0.0, np.array([radius]), side.g[:1])[0] @ [0.2126, 0.7152, 0.0722]
        for side in (left, right)
    )
    assert one / other == pytest.approx(doppler**4, rel=1e-3)
    narrow = dataclasses.replace(look, beaming=3)
    one, other = (
        emission(narrow, disk, 0.0, np.array([radius]), side.g[:1])[0] @ [0.2126, 0.7152, 0.0722]
        for side in (left, right)
    )
    assert one / other == pytest.approx(doppler**3, rel=1e-3)


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


def test_amounts_go_from_artistic_to_physical():
    disk, radius = Disk(), np.array([10.0])
    still = DiskLook(doppler_color=0.0, doppler_brightness=0.0)
    assert np.array_equal(
        emission(still, disk, 0.5, radius, np.array([0.5])), emission(still, disk, 0.5, radius, np.array([1.5]))
    )
    red, blue = (emission(DiskLook(), disk, 0.5, radius, np.array([g]))[0] for g in (0.6, 1.4))
    assert red[0] / red[2] > blue[0] / blue[2]
    assert blue[1] > red[1]
    for wrong in ({"beaming": 2}, {"temperature": 1.0}, {"opacity": 2.0}, {"profile": "flat"}):
        with pytest.raises(BlackHoleError):
            DiskLook(**wrong).validate()
    for look in PRESETS.values():
        look.validate()


def test_texture_repeats_and_moves_with_the_matter():
    radius = np.geomspace(3.0, 20.0, 50)
    assert look_up(TEXTURE, radius, np.zeros(50), 3.0, 20.0) == pytest.approx(
        look_up(TEXTURE, radius, np.full(50, 2.0 * math.pi), 3.0, 20.0), abs=1e-9
    )
    # The pattern with the larger share, at a small step of time, is where matter has carried it.
    spin, inner, outer = 0.6, 3.0, 20.0
    period = pattern_period(spin, inner, outer)
    time, step = 0.5 * period, 1e-4 * period
    phi = np.linspace(0.0, 6.0, 50)
    before = moving_texture(TEXTURE, radius, phi, time, spin, inner, outer)
    carried = phi + orbital_frequency(spin, radius) * step
    after = moving_texture(TEXTURE, radius, carried, time + step, spin, inner, outer)
    still = moving_texture(TEXTURE, radius, phi, time + step, spin, inner, outer)
    assert np.abs(after - before).max() < 0.1 * np.abs(still - before).max()


def test_shear_stays_bounded_in_a_long_shot_without_a_jump():
    spin, inner, outer = 0.9, 2.32, 20.0
    period = pattern_period(spin, inner, outer)
    radius, phi = np.full(400, 6.0), np.linspace(0.0, 2.0 * math.pi, 400)
    for time in (0.0, 0.25 * period, 1234.5 * period, 98765.4321 * period):
        shares = pattern_shares(time, period)
        assert sum(share for _, share, _ in shares) == pytest.approx(1.0)
        for age, _, _ in shares:
            fast, slow = orbital_frequency(spin, np.array([inner, outer]))
            assert 0.0 <= (fast - slow) * age <= 2.0 * math.pi * SHEAR_TURNS * (1.0 + 1e-9)
        # Contrast stays: neither patterns sheared to noise nor two averaged to gray.
        assert moving_texture(TEXTURE, radius, phi, time, spin, inner, outer)[:, 1].std() > 0.1
    # Across a pattern's end and beginning nothing jumps.
    ends = [moving_texture(TEXTURE, radius, phi, 7.0 * period + t, spin, inner, outer) for t in (-1e-6, 1e-6)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-3


@pytest.fixture(scope="module")
def baked():
    return bake(shot(48, 27, radius=25.0, spin=0.8, motion="fido", disk=Disk(crossings=3)))


def test_compositing_is_that_of_a_loop_over_pixels(baked):
    look, time = PRESETS["physical"], 37.0
    light, through = disk_layers(baked.disk_passes, look, TEXTURE, time)
    sky = np.random.default_rng(0).random((27, 48, 4))
    picture = over_sky(sky, light, through)
    disk = Disk(**baked.metadata["parameters"]["disk"])
    partly = 0
    for row, column in np.ndindex(27, 48):
        color, left = np.zeros(3), 1.0
        for one in baked.disk_passes:
            place = [np.float64(plane[row, column]) for plane in (one.radius, one.phi, one.g, one.coverage)]
            if place[3] > 0.0:
                face, opacity = shade(look, disk, 0.8, tuple(np.array([x]) for x in place), TEXTURE, time)
                color += left * opacity[0] * place[3] * face[0]
                left *= 1.0 - opacity[0] * place[3]
        partly += 0.0 < left < 1.0
        assert picture[row, column, :3] == pytest.approx(color + left * sky[row, column, :3], rel=1e-9, abs=1e-12)
        assert picture[row, column, 3] == pytest.approx(1.0 - left + left * sky[row, column, 3], rel=1e-9)
    assert partly > 100
    opaque = over_sky(sky[..., :3], light, through)
    np.testing.assert_array_equal(opaque[..., :3], picture[..., :3])
    np.testing.assert_allclose(opaque[..., 3], 1.0, atol=1e-15)


PLACE = np.array([4.0, 8.0, 12.0]), np.array([0.3, 2.0, 5.0]), np.array([0.5, 1.0, 1.4]), np.ones(3)


def test_an_even_picture_shows_its_color_at_any_time():
    """Premultiplied, alpha one half: two patterns mixed give back what both are; the look's factors are known."""
    picture = np.broadcast_to([0.4, 0.2, 0.1, 0.5], (8, 16, 4))
    disk = Disk(inner_radius=3.0, outer_radius=20.0)
    look = DiskLook(
        falloff=0.0, doppler_color=0.0, doppler_brightness=0.0, exposure=1.0, opacity=0.8, inner_softness=0.0,
        outer_softness=0.0,
    )  # fmt: skip
    for time in (0.0, 12.3, 4567.8):
        light, opacity = shade(look, disk, 0.5, PLACE, picture, time)
        np.testing.assert_allclose(light, np.tile([1.6, 0.8, 0.4], (3, 1)), rtol=1e-12)
        np.testing.assert_allclose(opacity, 0.4, rtol=1e-12)
    moving = dataclasses.replace(look, doppler_color=1.0, doppler_brightness=1.0)
    light, _ = shade(moving, disk, 0.5, PLACE, picture, 0.0)
    # The black body's own light at g T against that at T; the look has polynomials for it.
    gain = black_body.rgb(look.temperature * PLACE[2]) / black_body.rgb(look.temperature)
    np.testing.assert_allclose(light, gain * [1.6, 0.8, 0.4], rtol=5e-3)
    assert np.all(shade(look, disk, 0.5, PLACE, np.zeros((8, 16, 4)), 0.0)[1] == 0.0)


def test_a_picture_turns_with_each_radius():
    """A mark at one azimuth is at phi_0 + Omega t while the first pattern is alone."""
    width, spin, inner, outer = 720, 0.6, 3.0, 20.0
    picture = np.zeros((64, width, 4))
    mark = np.exp(-(((np.arange(width) + 0.5) / width * 2.0 * math.pi - 3.0) ** 2) / 0.02)
    picture[...] = mark[None, :, None]
    period = pattern_period(spin, inner, outer)
    phi = np.linspace(0.0, 2.0 * math.pi, 2000, endpoint=False)
    for radius in (4.0, 9.0, 18.0):
        shown = moving_texture(picture, np.full(2000, radius), phi, 0.5 * period, spin, inner, outer)[:, 3]
        expected = (3.0 + orbital_frequency(spin, radius) * 0.5 * period) % (2.0 * math.pi)
        seen = phi[np.argmax(shown)]
        assert abs((seen - expected + math.pi) % (2.0 * math.pi) - math.pi) < 0.01


def test_another_period_is_another_rhythm_of_the_same_patterns():
    radius, phi = np.full(50, 6.0), np.linspace(0.0, 6.0, 50)
    disk = 0.6, 3.0, 20.0
    own = pattern_period(*disk)
    default = moving_texture(TEXTURE, radius, phi, 31.0, *disk)
    np.testing.assert_array_equal(moving_texture(TEXTURE, radius, phi, 31.0, *disk, period=own), default)
    # Half-way through its life a pattern is alone: the first has turned for half of the period that is given.
    alone = moving_texture(TEXTURE, radius, phi, 10.0, *disk, period=20.0)
    turned = look_up(TEXTURE, radius, phi - orbital_frequency(0.6, radius) * 10.0, 3.0, 20.0)
    np.testing.assert_allclose(alone, turned, atol=1e-12)


def test_passes_that_do_not_belong_together_are_refused(baked):
    with pytest.raises(BlackHoleError, match="none left out"):
        disk_layers(baked.disk_passes[1:], DiskLook(), TEXTURE)
    with pytest.raises(BlackHoleError, match="one map"):
        disk_layers([], DiskLook(), TEXTURE)
