# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of a disk's later images against rays traced one by one, and rays beyond their ends against plain steps."""

import dataclasses
import math

import numpy as np
import pytest
from shots import shot

from physics import Disk, Observer, PanoramaCamera, bake
from physics.disk_passes.disk_samples import PIXEL_ERROR, PLACE_ERROR
from physics.disk_passes.ring_grid import Needs
from physics.disk_passes.ring_tracing import ring_tables
from physics.geodesics.crossings import cross_plane
from physics.geodesics.mino import radial_polynomial
from physics.geodesics.polar import PolarMotion
from physics.geodesics.radial_path import winding
from physics.kerr.critical_curve import position_angles
from physics.kerr.rays import rays_from_triad
from physics.numerics.sphere import unit_vectors
from physics.sampling.view import View

CAMERAS = {
    "slow spin from afar": {"spin": 0.6, "radius": 48.0, "fov": 42.0},
    "fast spin": {"spin": 0.9, "radius": 30.0, "fov": 50.0},
    "extreme spin close up": {"spin": 0.999, "radius": 10.0, "fov": 60.0},
    "over the pole": {"spin": 0.7, "radius": 20.0, "inclination": 25.0},
    "without spin": {"spin": 0.0, "radius": 15.0, "inclination": 70.0},
    "from within the plane": {"spin": 0.7, "radius": 20.0, "fov": 70.0, "inclination": 90.0},
    "the other way round": {"spin": -0.8, "radius": 25.0},
}


def tables_of(parameters):
    inner, outer = parameters.disk.radii(parameters.spin)
    needs = Needs(inner, outer, 2e-5, parameters.pixel_angle, PIXEL_ERROR, PLACE_ERROR * parameters.interpolation)
    return ring_tables(parameters.spin, parameters.observer(), (1, 2), needs, View(parameters).edge_about)[0]


def around_the_edge(view, count):
    """Pixel coordinates on both sides of the shadow's edge, at all distances down to 1e-4 of its own."""
    random = np.random.default_rng(3)
    x, y = view.outline()
    chosen = random.integers(0, len(x), count)
    factor = 1.0 + random.choice([-1.0, 1.0], count) * 10.0 ** random.uniform(-4.0, -0.1, count)
    center_x, center_y = view.center()
    return center_x + (x[chosen] - center_x) * factor, center_y + (y[chosen] - center_y) * factor


@pytest.mark.parametrize("name", CAMERAS)
def test_what_a_table_answers_is_what_rays_say(name):
    parameters = dataclasses.replace(shot(1920, 1080, **CAMERAS[name]), disk=Disk())
    inner, outer = parameters.disk.radii(parameters.spin)
    view = View(parameters)
    x, y = around_the_edge(view, 4000)
    traced, _ = view.crossings(x, y, 3, 1e-9, "gauss-legendre")
    beside, _ = view.crossings(x + 1.0, y, 3, 1e-9, "gauss-legendre")
    below, _ = view.crossings(x, y + 1.0, 3, 1e-9, "gauss-legendre")
    tables = tables_of(parameters)
    assert set(tables) == {1, 2}
    for order, table in tables.items():
        u, azimuth = table.places(*position_angles(view.light(x, y)), 2)
        known = np.isfinite(u)
        exact = traced.u[order]
        on_disk = (exact > 1.0 / outer) & (exact < 1.0 / inner)
        assert on_disk.sum() > 100
        assert (known & on_disk).sum() > 0.5 * on_disk.sum()
        # A share of what neighboring pixels differ by, or the error of place that is allowed everywhere; and twice
        # that, because differences of the grid tell its errors to a factor only.
        pixel = np.hypot(beside.u[order] - exact, below.u[order] - exact)
        allowed = np.maximum(2.0 * PIXEL_ERROR * pixel, 2.0 * PLACE_ERROR * parameters.interpolation / outer)
        seen = known & on_disk
        assert (np.abs(u - exact) <= allowed)[seen].mean() > 0.999
        assert np.abs(u - exact)[seen].max() < 8e-3
        turn = np.abs(azimuth - traced.unwound[order])  # whole turns are counted alike
        assert turn[seen].max() < 0.03
        assert np.median(turn[seen]) < 2e-4
        # No place off the disk is shown on it, but within the error of a rim.
        shown = known & ~on_disk & (u > 1.0 / outer + allowed) & (u < 1.0 / inner - allowed)
        assert not shown.any()


def test_tables_save_rays_and_leave_the_picture_as_it_is(monkeypatch):
    parameters = dataclasses.replace(shot(960, 540, spin=0.9, radius=20.0, fov=40.0), disk=Disk())
    with_tables = bake(parameters)
    monkeypatch.setattr("physics.disk_passes.disk_samples.LEAST_SHADOW", math.inf)
    without = bake(parameters)
    assert with_tables.counts["disk_rays"] < 0.8 * without.counts["disk_rays"]
    for order, (one, other) in enumerate(zip(with_tables.disk_passes, without.disk_passes, strict=True)):
        covered = np.abs(one.coverage - other.coverage)
        both = (one.coverage == 1.0) & (other.coverage == 1.0)
        assert np.median(np.abs(one.radius[both] / other.radius[both] - 1.0)) < 2e-4
        if order < 2:
            # Pixels at a rim differ by what a pixel's own interpolation is allowed.
            assert covered.max() < 0.2
            assert np.count_nonzero(covered > 0.02) < 0.02 * np.count_nonzero(other.coverage)
        else:
            # Nine places in a pixel know no better what a band thinner than the pixel covers.
            assert covered.max() < 0.4
            assert one.coverage.sum() == pytest.approx(other.coverage.sum(), rel=0.05)


# Kinks beside the flat side of a fast hole's shadow, rims that are not parallel to the shadow's edge, and a panorama in
# which tiles are large and hold a pole.
ODD_CAMERAS = {
    "next to the plane": shot(
        320, 180, spin=0.9, radius=20.0, inclination=89.0, fov=40.0, disk=Disk(inner_radius=2.2, outer_radius=3.2)
    ),
    "beyond the plane": shot(
        320, 180, spin=0.999, radius=12.0, inclination=90.5, fov=50.0, disk=Disk(outer_radius=4.0)
    ),
    "a wide disk, close up": shot(
        96, 54, spin=0.999, radius=5.5, motion="fido", disk=Disk(inner_radius=13.0, outer_radius=260.0)
    ),
    "a small panorama": shot(
        camera=PanoramaCamera(80, 40),
        spin=-0.95,
        radius=2.5,
        inclination=20.0,
        motion="fido",
        disk=Disk(retrograde=True),
    ),
}


@pytest.mark.parametrize("name", ODD_CAMERAS)
def test_no_pixel_of_the_first_two_images_is_lost(name):
    """Against a ray for each pixel, with which images of little more than a pixel come out within some percent."""
    parameters = ODD_CAMERAS[name]
    every = bake(dataclasses.replace(parameters, interpolation=0.0))
    for one, other in zip(bake(parameters).disk_passes[:2], every.disk_passes[:2], strict=True):
        assert np.abs(one.coverage - other.coverage).max() < 0.2
        assert one.coverage.sum() == pytest.approx(other.coverage.sum(), rel=0.03, abs=0.1)


def stepped(rays, times, steps=4000):
    """u and psi - W(u) after Mino times, by the classical Runge-Kutta method in u'' = U' / 2 (psi' as it stands)."""
    c2, c3, c4 = radial_polynomial(rays)
    a, b = rays.spin, rays.b

    def rate(state):
        u, slope, _ = state
        plain = a * u * (a * b * u - 2.0) / (1.0 - 2.0 * u + (a * u) ** 2)
        return np.stack([slope, u * (c2 + u * (1.5 * c3 + 2.0 * c4 * u)), plain])

    start = 1.0 / rays.observer.r
    state = np.stack([np.full(len(rays), start), start**2 * rays.radial, np.zeros(len(rays))])
    h = times / steps
    for _ in range(steps):
        one = rate(state)
        two = rate(state + 0.5 * h * one)
        three = rate(state + 0.5 * h * two)
        state = state + h / 6.0 * (one + 2.0 * two + 2.0 * three + rate(state + h * three))
    return state[0], state[2]


@pytest.mark.parametrize("spin", [0.0, 0.7, -0.95])
def test_rays_go_on_through_infinity_and_the_horizon(spin):
    random = np.random.default_rng(5)
    observer = Observer.fido(12.0, 1.2, 0.0)
    theta, phi = math.pi / 2 + random.normal(0.0, 0.5, 1500), math.pi + random.normal(0.0, 0.5, 1500)
    rays = rays_from_triad(spin, observer, unit_vectors(theta, phi))
    beyond, ended = cross_plane(rays, 2, 1e-10, beyond=True), cross_plane(rays, 2, 1e-10)
    horizon = 1.0 + math.sqrt(1.0 - spin**2)
    for order in range(2):
        found = beyond.u[order]
        with np.errstate(invalid="ignore"):
            past_infinity = (found < 0.0) & (found > -0.03)
            past_horizon = (found > 1.0 / horizon) & (found < 1.1 / horizon)
            inside = (found > 0.0) & (found < 0.9 / horizon)
        assert np.isnan(ended.u[order][past_infinity | past_horizon]).all()
        np.testing.assert_array_equal(ended.u[order][inside], found[inside])
        # 4000 steps of fourth order are good to 1e-9 where the ray does not pass by the critical curve.
        for chosen in (past_infinity, past_horizon, inside):
            assert order == 1 or chosen.sum() > 5
            u, psi = stepped(rays.select(np.flatnonzero(chosen)), beyond.mino_time[order, chosen])
            assert np.abs(found[chosen] - u).max(initial=0.0) < 1e-6
            if order == 0 and chosen is inside:
                polar = PolarMotion.of(rays).plane_crossings(1, 1e-10)[1][0]  # without psi
                azimuth = beyond.unwound[0, chosen] + winding(spin, found[chosen])
                difference = azimuth - polar[chosen] - psi
                assert np.abs((difference + math.pi) % (2.0 * math.pi) - math.pi).max() < 1e-6


def test_the_azimuth_is_not_torn_beside_rays_that_never_cross():
    """There turns are counted from nothing, and answers between the grid's columns would be wrong by pi."""
    parameters = dataclasses.replace(
        shot(960, 540, spin=-0.998, radius=5.111, inclination=89.44, fov=149.0, motion="fido"),
        disk=Disk(outer_radius=100.0, retrograde=True),
    )
    view = View(parameters)
    x, y = np.mgrid[0:960:3, 0:540:3].reshape(2, -1) + 0.5
    traced, _ = view.crossings(x, y, 3, 1e-8, "gauss-legendre")
    inner, outer = parameters.disk.radii(parameters.spin)
    for order, table in tables_of(parameters).items():
        u, azimuth = table.places(*position_angles(view.light(x, y)), 2)
        seen = np.isfinite(u) & (traced.u[order] > 1.0 / outer) & (traced.u[order] < 1.0 / inner)
        turn = np.abs((azimuth - traced.unwound[order] + math.pi) % (2.0 * math.pi) - math.pi)
        assert turn[seen].max() < 0.5
        # Where the camera is next to the plane all changes within two position angles of it, far below the pixel.
        assert np.count_nonzero(turn[seen] > 0.1) <= 1 + 0.001 * np.count_nonzero(seen)
