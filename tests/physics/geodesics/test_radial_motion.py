# SPDX-License-Identifier: GPL-3.0-or-later
"""The radial motion in closed form against series in the radius: neither its functions nor its quadrature in common."""

import math

import numpy as np
import pytest

from physics import Observer, trace_disk
from physics.geodesics.polar import PolarMotion
from physics.geodesics.quadrature import negative_root
from physics.geodesics.radial_motion import TIGHTEST, places_of_rays
from physics.geodesics.radial_path import places_of_rays as places_by_series
from physics.geodesics.radial_path import winding
from physics.kerr.critical_curve import around_hole, edge_angles, find_barrier
from physics.kerr.metric import horizon_radius
from physics.kerr.rays import rays_from_triad

CROSSINGS = 4


def some_rays(seed):
    """Rays from a random camera outside the ergosphere, most of them around the shadow's edge."""
    random = np.random.default_rng(seed)
    spin = random.choice([0.0, 0.1, 0.6, 0.9, 0.99, 0.999, 0.9999, -0.7, -0.999])
    r = 10.0 ** random.uniform(math.log10(2.05), 3.0)
    fido = Observer.fido(r, random.uniform(0.02, math.pi - 0.02), 0.3)
    away = np.minimum(10.0 ** random.uniform(-2.0, 1.2, 800) * 5.0 / r, math.pi)
    turn = random.uniform(0.0, 2.0 * math.pi, 800)
    rays = rays_from_triad(spin, fido, around_hole(away, np.cos(turn), np.sin(turn)))
    return rays, find_barrier(rays), PolarMotion.of(rays).plane_crossings(CROSSINGS, 1e-12)[0]


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("tolerance", [1e-6, 2e-5])
def test_places_are_those_of_series_in_the_radius(seed, tolerance):
    rays, barrier, times = some_rays(seed)
    found, expected = places_of_rays(rays, barrier, times, tolerance), places_by_series(rays, barrier, times, 1e-12)
    both = (found.resolved & expected.resolved) & np.isfinite(expected.u)
    assert np.isfinite(times).any(axis=0).sum() - both.any(axis=0).sum() < 8
    horizon = 1.0 / horizon_radius(rays.spin)
    inside = both & (expected.u > 1e-3) & (expected.u < 0.999 * horizon)
    assert inside.sum() > 150
    # u: rounding grows by e^pi with every half turn next to the critical curve, and the far end of a ray is 1e-3 small.
    # The azimuth is what the tolerance is about, for the few that are left to series at this tolerance, too.
    assert np.abs(found.u / expected.u - 1.0)[inside].max() < 3e-6
    assert np.abs(found.u_slope - expected.u_slope)[inside].max() < 1e-5
    assert np.abs(found.unwound - expected.unwound)[inside].max() < 1.5 * tolerance
    # Rays that have ended are known to have.
    assert (found.u[both & (expected.u <= 0.0)] <= 0.0).all()
    assert (found.u[both & (expected.u >= horizon)] >= 0.999 * horizon).all()


@pytest.mark.parametrize("seed", range(6))
def test_rays_into_the_hole_go_on_as_they_do_in_series(seed):
    """Through the horizon to where paths end, and along the same parabola from there."""
    rays, barrier, times = some_rays(seed)
    found, expected = places_of_rays(rays, barrier, times, 1e-6), places_by_series(rays, barrier, times, 1e-12)
    horizon = 1.0 / horizon_radius(rays.spin)
    beyond = (found.resolved & expected.resolved) & (expected.u > horizon) & (expected.u < 50.0 * horizon)
    beyond &= ~barrier.blocks
    assert beyond.sum() > 50
    assert np.abs(found.u / expected.u - 1.0)[beyond].max() < 1e-4
    if rays.spin != 0.0:
        # where the inner horizon is next to the outer one, so is a pole of the rate
        assert np.quantile(np.abs(found.unwound - expected.unwound)[beyond], 0.98) < 1e-3


def test_rays_beyond_infinity_stay_there():
    """Whatever the time: the closed form itself would bring them back."""
    rays, barrier, times = some_rays(5)
    long_gone = np.broadcast_to(np.fmax.reduce(times, axis=0) * np.array([[1.5], [2.0], [4.0]]), (3, len(rays)))
    found = places_of_rays(rays, barrier, long_gone, 1e-6)
    sky = found.resolved & barrier.blocks & (rays.observer.r > barrier.radius) & np.isfinite(long_gone).all(axis=0)
    straight_out = found.resolved & ~barrier.blocks & (rays.radial < 0.0)
    expected = places_by_series(rays, barrier, long_gone, 1e-12)
    ended = (sky | straight_out) & (expected.u < 0.0)
    assert ended.sum() > 500
    assert (found.u[ended] <= 0.0).all()
    # not on the way back either: next to U's negative root, where the series stay at 0.7 of the way or more
    far = np.broadcast_to(-0.69 * negative_root(rays), ended.shape)
    assert (ended & (expected.u < far)).sum() > 500
    assert (found.u < 0.9 * far)[ended & (expected.u < far)].all()


def around_the_edge(spin, r, theta, shares):
    """Rays at shares of the angle of the shadow's edge from it, beside the edge all around; rays, barrier, times."""
    fido = Observer.fido(r, theta, 0.0)
    turn = np.linspace(0.0, 2.0 * math.pi, len(shares), endpoint=False) * 17.0
    edge = edge_angles(spin, fido, np.cos(turn), np.sin(turn), 1e-13)
    rays = rays_from_triad(spin, fido, around_hole(edge * (1.0 + shares), np.cos(turn), np.sin(turn)))
    return rays, find_barrier(rays), PolarMotion.of(rays).plane_crossings(8, 1e-12)[0]


@pytest.mark.parametrize("spin", [0.0, 0.001, 0.05, 0.9])
def test_rays_that_fell_in_do_not_come_out_again(spin):
    """At late crossings the closed form may be past the pole, and on its way back."""
    rays, barrier, times = around_the_edge(spin, 15.0, 1.2, -np.geomspace(1e-7, 0.999, 4000))
    found, expected = places_of_rays(rays, barrier, times, 1e-6), places_by_series(rays, barrier, times, 1e-9)
    horizon = 1.0 / horizon_radius(spin)
    fallen = (found.resolved & expected.resolved) & (expected.u > 1.01 * horizon)
    assert fallen.sum() > 10_000
    assert (found.u[fallen] > 0.99 * horizon).all()


@pytest.mark.parametrize("spin", [0.0, 0.6, 0.999])
@pytest.mark.parametrize("beyond", [True, False])
def test_rays_that_hover_have_not_ended(spin, beyond):
    """Within 1e-13 of the edge rounding tells the sign of their slope."""
    shares = np.geomspace(1e-13, 1e-9, 2000) * np.tile([1.0, -1.0], 1000)
    rays, barrier, times = around_the_edge(spin, 15.0, 1.3, shares)
    found, expected = (way(rays, barrier, times, 1e-6) for way in (places_of_rays, places_by_series))
    if not beyond:
        found = places_of_rays(rays, barrier, times, 1e-6, beyond=False)
    horizon = 1.0 / horizon_radius(spin)
    both = found.resolved & expected.resolved
    clear = both & (expected.u > 0.01) & (expected.u < 0.9 * horizon)
    assert clear.sum() > 5000
    assert ((found.u > 0.0) & (found.u < horizon))[clear].all()


def test_where_the_closed_form_cancels_it_does_not_answer():
    """As long before the camera as after it this ray would be at the pole, where all of the quotient is rounding."""
    fido = Observer.fido(2.2, 1.2, 0.0)
    directions = 0.9865548311539617, 5.721813758960459
    found, expected = (trace_disk(0.0, fido, *directions, tolerance=tolerance) for tolerance in (1e-6, 1e-10))
    assert found.radius[1] == pytest.approx(expected.radius[1], rel=1e-4)
    assert expected.radius[1] == pytest.approx(11.03, abs=0.01)


def test_without_what_is_beyond_only_the_ends_are_known():
    rays, barrier, times = some_rays(3)
    whole, short = (places_of_rays(rays, barrier, times, 1e-6, beyond=beyond) for beyond in (True, False))
    horizon = 1.0 / horizon_radius(rays.spin)
    with np.errstate(invalid="ignore"):
        on_the_way = (whole.u > 0.0) & (whole.u < horizon)
    assert on_the_way.sum() > 150
    for name in ("u", "u_slope", "unwound"):
        assert np.array_equal(getattr(whole, name)[on_the_way], getattr(short, name)[on_the_way])
    with np.errstate(invalid="ignore"):
        assert np.array_equal((short.u > 0.0) & (short.u < horizon), on_the_way)


def test_tight_tolerances_are_left_to_the_series():
    rays, barrier, times = some_rays(1)
    found = places_of_rays(rays, barrier, times, 0.5 * TIGHTEST)
    expected = places_by_series(rays, barrier, times, 0.5 * TIGHTEST)
    assert np.array_equal(found.u, expected.u, equal_nan=True)


def test_the_azimuth_winds_up_at_the_horizon_alone():
    """W is all that is singular there: on the way in, psi - W(u) is smooth through the horizon."""
    rays, barrier, times = some_rays(2)
    falling = np.flatnonzero(~barrier.blocks & (rays.radial > 0.0))[:40]
    part, wall = rays.select(falling), barrier.select(falling)
    reach = np.linspace(0.05, 3.0, 400)[:, None] * np.fmin.reduce(times[:, falling], axis=0)
    found = places_of_rays(part, wall, reach, 1e-6)
    horizon = 1.0 / horizon_radius(rays.spin)
    near = np.abs(found.u[1:-1] - horizon) < 0.05 * horizon
    assert near.any()
    bend = np.abs(np.diff(found.unwound, n=2, axis=0))
    assert bend[near].max() < 0.05
    with np.errstate(invalid="ignore"):
        wound = found.unwound + winding(rays.spin, np.minimum(found.u, horizon * (1.0 - 1e-12)))
    assert np.abs(np.diff(wound, n=2, axis=0))[near].max() > 1.0
