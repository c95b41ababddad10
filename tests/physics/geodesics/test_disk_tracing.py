# SPDX-License-Identifier: GPL-3.0-or-later
"""Crossings of the equatorial plane: against reference rays, against steps, and against what geometry says."""

import math

import numpy as np
import pytest
from references import random_sky, reference_cameras

from physics import BlackHoleError, Cancelled, Fate, Observer, trace_disk, trace_rays
from physics.geodesics.crossings import cross_plane, split_by_energy
from physics.kerr.critical_curve import around_hole
from physics.kerr.metric import horizon_radius, isco_radius
from physics.kerr.orbiting_matter import circular_constants, orbital_frequency, redshift_factor
from physics.kerr.rays import camera_directions, rays_from_triad

REFERENCES = {camera.name: camera for camera in reference_cameras("reference_disk.npz")}


def turn(difference):
    return np.abs((difference + math.pi) % (2.0 * math.pi) - math.pi)


@pytest.mark.parametrize("name", REFERENCES)
@pytest.mark.parametrize("method", ["gauss-legendre", "cash-karp"])
@pytest.mark.parametrize(("tolerance", "allowed"), [(1e-6, 1e-6), (1e-8, 1e-8), (1e-11, 1e-9)])
def test_crossings_are_those_of_the_reference_rays(name, method, tolerance, allowed):
    camera = REFERENCES[name]
    rows = camera.rows
    found = trace_disk(
        camera.spin, camera.observer, rows["theta_rd"], rows["phi_rd"], tolerance=tolerance, method=method
    )
    assert found.counts["unresolved"] == 0
    # Next to where a crossing appears or ends, rounding decides whether it is there.
    clear = ~(np.maximum(rows["amp_r"], rows["amp_phi"]) > 1e8)
    expected = np.isfinite(rows["r_k"])
    assert np.array_equal(np.isfinite(found.radius)[clear], expected[clear])
    chosen = expected & clear & (rows["r_k"] < 1000.0) & (rows["r_k"] > 1.01 * horizon_radius(camera.spin))
    for ours, theirs, amp in (("radius", "r_k", "amp_r"), ("mino_time", "mino_k", "amp_r"), ("g", "g_k", "amp_g")):
        judged = chosen & np.isfinite(rows[theirs]) & np.isfinite(rows[amp])
        assert judged.sum() > 200
        error = np.abs(getattr(found, ours) / rows[theirs] - 1.0) / np.maximum(rows[amp], 1.0)
        assert error[judged].max() < allowed
    assert (turn(found.phi - rows["phi_k"]) / np.maximum(rows["amp_phi"], 1.0))[chosen].max() < allowed


CAMERAS = {
    "orbit": (0.999, Observer.circular_orbit(0.999, 10.0)),
    "schwarzschild": (0.0, Observer.static(0.0, 10.0, 1.0, 0.3)),
    "hardly spinning": (1e-7, Observer.fido(5.0, 1.0, 0.0)),
    "over the pole": (0.9, Observer.fido(6.0, 0.0, 1.0)),
    "a hair above the plane": (0.9, Observer.fido(20.0, math.pi / 2 - 1e-6, 1.0)),
    "inside the photon orbits": (0.9, Observer(2.3, 1.7, 0.0, 0.5, (0.36, 0.48, -0.8))),
    "inside the ergosphere": (0.9999, Observer.fido(1.3, math.pi / 2, 0.0)),
    "inside the ergosphere, above the plane": (-0.9999, Observer.fido(1.2, 1.2, 0.0)),
    "fast": (0.7, Observer(20.0, 1.2, 0.0, 0.99, (-0.6, 0.0, 0.8))),
    "far": (0.95, Observer.free_fall(0.95, 1e4, 1.2, 0.0)),
    "retrograde": (-0.998, Observer.fido(4.0, 2.0, 0.0)),
}


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("retrograde", [False, True])
def test_closed_form_and_steps_agree(camera, retrograde):
    """Two ways that share neither the radial nor the polar solution."""
    spin, observer = CAMERAS[camera]
    theta_rd, phi_rd = random_sky(150)
    fast = trace_disk(spin, observer, theta_rd, phi_rd, retrograde=retrograde)
    steps = trace_disk(spin, observer, theta_rd, phi_rd, retrograde=retrograde, method="cash-karp")
    assert fast.counts["unresolved"] == 0
    # Steps lose some rays next to the critical curve, and say so.
    known = steps.fate != Fate.UNRESOLVED
    assert known.mean() > 0.97
    assert np.array_equal(fast.fate[known], steps.fate[known])
    assert np.array_equal(np.isfinite(fast.radius)[known], np.isfinite(steps.radius)[known])
    both = np.isfinite(fast.radius) & known[:, None]
    assert both.any()
    # The tolerance is 1e-6; random rays are amplified by some hundred at most, those next to the horizon more.
    clear = both & (fast.radius > 1.05 * horizon_radius(spin)) & (fast.radius < 1e4)
    assert np.abs(fast.radius / steps.radius - 1.0)[clear].max() < 1e-4
    assert turn(fast.phi - steps.phi)[clear].max() < 1e-4
    assert np.abs(fast.g / steps.g - 1.0)[clear].max() < 1e-4
    assert np.median(np.abs(fast.radius / steps.radius - 1.0)[clear]) < 1e-7


@pytest.mark.parametrize("camera", CAMERAS)
def test_no_ray_is_lost_at_tight_tolerances(camera):
    """Steps pass the horizon, however fast the hole turns, and agree with the closed form to ten thousand times less
    than what a pixel is judged by; rays are amplified by some hundred."""
    spin, observer = CAMERAS[camera]
    theta_rd, phi_rd = random_sky(60)
    both = [
        trace_disk(spin, observer, theta_rd, phi_rd, tolerance=1e-11, method=method)
        for method in ("gauss-legendre", "cash-karp")
    ]
    assert both[0].counts["unresolved"] == both[1].counts["unresolved"] == 0
    assert np.array_equal(both[0].fate, both[1].fate)
    fast, steps = (np.where(each.radius < 1e4, each.radius, np.nan) for each in both)
    assert np.array_equal(np.isfinite(fast), np.isfinite(steps))
    seen = np.isfinite(fast)
    assert np.abs(fast / steps - 1.0)[seen].max() < 1e-9
    assert turn(both[0].phi - both[1].phi)[seen].max() < 1e-8


def boyer_lindquist(spin, energy, momentum, carter_k, place, time, steps=2000):
    """(r, theta, phi) so much later in Mino time, by Runge and Kutta's steps in Boyer and Lindquist's coordinates.

    r'' = R'/2 and theta'' = Theta'/2 with R = P^2 - Delta K, P = E (r^2 + a^2) - a L, and Theta = K - (a E sin - L /
    sin)^2; phi' = L / sin^2 - a E + a P / Delta (Carter 1968; Chandrasekhar 1983, section 62), all backwards in time.
    """

    def rates(state):
        r, theta, _, radial, polar = state
        sine, cosine, delta = math.sin(theta), math.cos(theta), r * r - 2.0 * r + spin * spin
        p = energy * (r * r + spin * spin) - spin * momentum
        twist = spin * energy * sine - momentum / sine
        return np.array(
            [
                radial,
                polar,
                -(momentum / sine**2 - spin * energy + spin * p / delta),
                2.0 * p * energy * r - (r - 1.0) * carter_k,
                -twist * cosine * (spin * energy + momentum / sine**2),
            ]
        )

    state, step = np.array(place), time / steps
    for _ in range(steps):
        one = rates(state)
        two = rates(state + 0.5 * step * one)
        three = rates(state + 0.5 * step * two)
        four = rates(state + step * three)
        state = state + step / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    return state[:3]


@pytest.mark.parametrize("method", ["gauss-legendre", "cash-karp"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize(("spin", "r"), [(0.95, 1.4), (-0.95, 1.4), (0.9999, 1.3)])
def test_light_of_either_energy_crosses_where_boyer_and_lindquist_say(method, tolerance, spin, r):
    """Inside the ergosphere, where light of negative energy is seen, its azimuth and all. Steps of fourth order are
    good to 1e-8 outside of 1.01 r_+."""
    observer = Observer.fido(r, 1.45, 0.4)
    theta_rd, phi_rd = random_sky(300)
    found = trace_disk(spin, observer, theta_rd, phi_rd, crossings=1, tolerance=tolerance, method=method)
    assert found.counts["unresolved"] == 0
    for index, rays, sign in split_by_energy(spin, observer, camera_directions(theta_rd, phi_rd)):
        radius, time = found.radius[index, 0], found.mino_time[index, 0]
        far = (radius > 1.01 * horizon_radius(spin)) & (radius < 20.0) & (np.abs(rays.b) < 50.0)
        chosen = np.flatnonzero(far)[:5]
        assert len(chosen) == 5
        for ray in chosen:
            carter_k = rays.q_plus_b2[ray] - 2.0 * rays.b[ray] * rays.spin + spin * spin
            start = (observer.r, observer.theta, observer.phi, -rays.radial[ray], -rays.polar[ray])
            ours = found.radius[index[ray], 0], found.phi[index[ray], 0]
            theirs = boyer_lindquist(spin, sign, rays.b[ray], carter_k, start, time[ray])
            allowed = 300.0 * tolerance if method == "gauss-legendre" else 100.0 * tolerance
            assert theirs[0] == pytest.approx(ours[0], rel=allowed + 1e-8)
            assert theirs[1] == pytest.approx(math.pi / 2.0, abs=allowed + 1e-8)
            assert turn(theirs[2] - ours[1]) < allowed + 1e-8


@pytest.mark.parametrize("spin", [-0.9, 0.0, 0.9999])
def test_fates_are_those_of_the_sky(spin):
    observer = Observer.fido(2.5, 1.0, 0.0)
    theta_rd, phi_rd = random_sky(500)
    crossed = trace_disk(spin, observer, theta_rd, phi_rd)
    assert np.array_equal(crossed.fate, trace_rays(spin, observer, theta_rd, phi_rd).fate)


@pytest.mark.parametrize("spin", [-0.99, 0.0, 0.9])
def test_turns_are_counted_without_jumps_but_where_light_passes_over_the_axis(spin):
    """Light to one side of the axis goes round it one way, to the other side the other way: half a turn each time it
    passes the axis, which a camera above the plane sees before every crossing above the hole, once less below it."""
    fido = Observer.fido(20.0, 1.2, 0.7)
    around = np.linspace(0.0, 2.0 * math.pi, 20001)[:-1] + 1e-5
    away = np.full_like(around, 0.3)  # just beside the shadow, where light turns three times
    rays = rays_from_triad(spin, fido, around_hole(away, np.cos(around), np.sin(around)))
    azimuth = cross_plane(rays, 3, 1e-9, beyond=True).unwound
    below, above = len(around) - 1, len(around) // 2 - 1
    for order, unwound in enumerate(azimuth):
        step = np.diff(unwound, append=unwound[0])
        for place, passes in ((below, order), (above, order + 1)):
            assert abs(step[place]) == pytest.approx(2.0 * math.pi * passes, abs=0.05)
            step[place] = 0.0
        assert np.abs(step).max() < 0.1


def test_orders_follow_one_another():
    spin, observer = 0.9, Observer.fido(15.0, 1.3, 0.0)
    # Just outside the critical curve on the prograde side rays wind round the hole.
    theta_rd, phi_rd = random_sky(4000)
    found = trace_disk(spin, observer, theta_rd * 0.2 + 0.4 * math.pi, np.pi + 0.3 * (phi_rd - np.pi), crossings=5)
    there = np.isfinite(found.radius)
    assert (there[:, :-1] | ~there[:, 1:]).all()
    assert there[:, 2].any()
    both = there[:, :-1] & there[:, 1:]
    assert (np.diff(found.mino_time, axis=1)[both] > 0.0).all()


def test_a_camera_in_the_plane_is_no_crossing_and_motion_in_the_plane_has_none():
    observer = Observer.fido(20.0, math.pi / 2, 0.0)
    ahead = np.linspace(0.0, 2.0 * math.pi, 60)
    assert np.isnan(trace_disk(0.9, observer, math.pi / 2, ahead).radius).all()
    theta_rd, phi_rd = random_sky(300)
    radius = trace_disk(0.9, observer, theta_rd, phi_rd).radius
    assert np.isfinite(radius).any()
    assert not (np.abs(radius[:, 0] / 20.0 - 1.0) < 1e-9).any()


def test_without_mass_to_speak_of_light_goes_straight():
    """Far from the hole the first crossing is where a straight line meets the plane."""
    r, theta = 1e6, 1.0
    observer = Observer.fido(r, theta, 0.4)
    # e_x outward, e_z north: looking 60 degrees down from the outward direction
    down = np.radians(150.0)
    found = trace_disk(0.5, observer, down, 0.0)
    place = np.array([r * math.sin(theta), 0.0, r * math.cos(theta)])
    radial, north = place / r, np.array([-math.cos(theta), 0.0, math.sin(theta)])
    looking = math.sin(down) * radial + math.cos(down) * north
    x, y, _ = place - looking * (place[2] / looking[2])
    # Bending is of the order of 4 M over the impact parameter.
    assert found.radius[0] == pytest.approx(math.hypot(x, y), rel=2e-5)
    assert turn(found.phi[0] - 0.4 - math.atan2(y, x)) < 2e-5


@pytest.mark.parametrize("spin", [-0.95, 0.0, 0.6, 0.9999])
@pytest.mark.parametrize("retrograde", [False, True])
def test_falling_matter_joins_the_innermost_stable_orbit_smoothly(spin, retrograde):
    isco = isco_radius(spin, prograde=not retrograde)
    outside = redshift_factor(spin, isco * (1.0 + 1e-9), 1.5, retrograde=retrograde)
    inside = redshift_factor(spin, isco * (1.0 - 1e-9), 1.5, 1.0, 3.0, retrograde)
    assert inside == pytest.approx(outside, rel=1e-6)


def test_orbits_obey_the_virial_limit_and_their_own_constants():
    # Far out, Kepler's third law; and u^t (E - Omega L) of light with b = 0 and at rest is 1 / g alone.
    assert orbital_frequency(0.9, 1e6) == pytest.approx(1e6**-1.5, rel=1e-8)
    assert orbital_frequency(-0.9, 50.0) == -orbital_frequency(0.9, 50.0)
    energy, momentum = circular_constants(0.0, 6.0)
    assert (energy, momentum) == pytest.approx((math.sqrt(8.0 / 9.0), 2.0 * math.sqrt(3.0)))


def test_matter_at_the_photon_orbits_distance_is_seen_with_the_known_extremes():
    """a = 0, r = 6, camera far away in the plane: light along and against the motion (b = -+r / sqrt(1 - 2/r))."""
    b = 6.0 / math.sqrt(1.0 - 2.0 / 6.0)
    towards, away = redshift_factor(0.0, 6.0, b), redshift_factor(0.0, 6.0, -b)
    # v = 1/2 against the local frame, times the lapse sqrt(2/3): Doppler factors sqrt(3) and 1 / sqrt(3)
    assert towards == pytest.approx(math.sqrt(2.0 / 3.0) * math.sqrt(3.0))
    assert away == pytest.approx(math.sqrt(2.0 / 3.0) / math.sqrt(3.0))


def test_shapes_broadcast_and_bad_settings_are_refused():
    observer = Observer.fido(10.0, 1.0, 0.0)
    found = trace_disk(0.5, observer, np.full((4, 1), 1.5), np.full(3, 3.0), crossings=2)
    assert found.radius.shape == found.phi.shape == found.g.shape == found.mino_time.shape == (4, 3, 2)
    assert found.fate.shape == (4, 3)
    for settings, word in (
        ({"crossings": 0}, "crossings"),
        ({"crossings": 99}, "crossings"),
        ({"method": "cash-karp-printed"}, "disk"),
        ({"tolerance": 1.0}, "tolerance"),
    ):
        with pytest.raises(BlackHoleError, match=word):
            trace_disk(0.5, observer, 1.0, 1.0, **settings)
    with pytest.raises(BlackHoleError, match="finite"):
        trace_disk(0.5, observer, math.nan, 1.0)
    with pytest.raises(BlackHoleError, match="inside the black hole"):
        trace_disk(0.5, Observer.fido(1.0, 1.0, 0.0), [], [])
    with pytest.raises(Cancelled):
        trace_disk(0.5, observer, 1.0, 1.0, cancel=lambda: True)
