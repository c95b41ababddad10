# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever is put in: an answer whose invariants hold, or one sentence. Hypothesis finds the same cases every time."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from physics import (
    BlackHoleError,
    Disk,
    Fate,
    LightParameters,
    Observer,
    PanoramaCamera,
    PerspectiveCamera,
    UnstableOrbitWarning,
    WarpMapParameters,
    bake,
    looking_at_hole,
    render_matter,
    trace_disk,
    trace_rays,
)
from physics.geodesics.tracer import trace_block
from physics.kerr.metric import check_spin, ergosphere_radius, horizon_radius, isco_radius, photon_orbit_radius
from physics.kerr.rays import rays_from_triad
from physics.light.color import redshift_gain
from physics.light.matter_settings import MatterLook
from physics.matter.light_layer import LEAST_TRANSMITTANCE
from physics.numerics.sphere import celestial_coordinates, spherical_triad

EVERY_TIME = {"derandomize": True, "database": None, "deadline": None, "suppress_health_check": list(HealthCheck)}
many = settings(max_examples=150, **EVERY_TIME)
some = settings(max_examples=40, **EVERY_TIME)
few = settings(max_examples=12, **EVERY_TIME)

# --- what is put in ---------------------------------------------------------------------------------

ODD_FLOATS = (0.0, -0.0, 5e-324, 1e-308, 1e-16, 1.0, -1.0, math.nextafter(1.0, 0.0), math.pi, 1e16, 1e154, 1.7e308)
numbers = st.floats() | st.sampled_from([*ODD_FLOATS, *(-each for each in ODD_FLOATS), math.nan, math.inf, -math.inf])
anything = (
    numbers
    | st.none()
    | st.booleans()
    | st.integers()
    | st.just(10**400)
    | st.text(max_size=5)
    | st.lists(numbers, max_size=4)
    | st.builds(complex, numbers, numbers)
    | st.sampled_from([np.float32(0.5), np.int64(3), np.array(0.5), np.array([0.5]), np.zeros((2, 2)), b"1", {}])
)

spins = st.floats(-0.9999, 0.9999) | st.sampled_from([0.0, -0.0, 5e-324, 1e-9, 0.998, -0.998, 0.999999, 1.0 - 1e-12])
polar_angles = st.floats(0.0, math.pi) | st.sampled_from([0.0, math.pi, math.pi / 2, 5e-324, 1e-9, math.pi - 1e-9])
azimuths = st.floats(-10.0, 10.0)
distances = st.floats(-6.0, 6.0).map(lambda power: 10.0**power)  # from the horizon, in its radii
speeds = st.floats(0.0, 0.99) | st.sampled_from([0.0, 5e-324, 1e-12, 0.9999999])
directions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 3)
    .filter(lambda vector: math.hypot(*vector) > 1e-3)
    .map(lambda vector: tuple(each / math.hypot(*vector) for each in vector))
) | st.sampled_from([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)])


@st.composite
def observers(draw, spin):
    r = horizon_radius(spin) * (1.0 + draw(distances))
    return Observer(r, draw(polar_angles), draw(azimuths), draw(speeds), draw(directions))


def sky(count=24, seed=0):
    random = np.random.default_rng(seed)
    return np.arccos(random.uniform(-1.0, 1.0, count)), random.uniform(0.0, 2.0 * math.pi, count)


def answered(work):
    """What `work` returns, or None where it refuses in a sentence."""
    try:
        return work()
    except BlackHoleError as error:
        text = str(error)
        assert len(text) > 20
        assert text.endswith(".")
        assert "\n" not in text
        return None


# --- anything at all --------------------------------------------------------------------------------


@many
@given(anything)
def test_any_spin(value):
    spin = answered(lambda: check_spin(value))
    if spin is not None:
        assert -1.0 < spin < 1.0
        assert 1.0 <= horizon_radius(spin) <= 2.0
        assert 1.0 <= photon_orbit_radius(spin) <= 3.0 <= photon_orbit_radius(spin, prograde=False) <= 4.0
        assert 1.0 <= isco_radius(spin) <= 6.0 <= isco_radius(spin, prograde=False) <= 9.0


@many
@given(st.data())
def test_any_observer(data):
    values = data.draw(st.tuples(*[anything] * 4, anything | st.lists(anything, min_size=3, max_size=3)))
    observer = answered(lambda: Observer(*values))
    if observer is not None:
        assert 0.0 <= observer.beta < 1.0
        assert 0.0 <= observer.theta <= math.pi
        assert math.hypot(*observer.direction) == pytest.approx(1.0)
        assert all(type(each) is float for each in (observer.r, observer.theta, observer.phi, observer.beta))


@many
@given(st.sampled_from(["static", "keplerian", "free_fall", "circular_orbit"]), numbers, numbers, numbers, numbers)
@pytest.mark.filterwarnings("ignore::physics.UnstableOrbitWarning")
def test_any_moving_observer(kind, spin, r, theta, phi):
    make = getattr(Observer, kind)
    observer = answered(lambda: make(spin, r, phi) if kind == "circular_orbit" else make(spin, r, theta, phi))
    if observer is not None:
        assert r > horizon_radius(spin)
        assert 0.0 <= observer.beta < 1.0
        assert kind != "static" or r > ergosphere_radius(spin, theta)


@many
@given(st.sampled_from(["tolerance", "method", "max_steps", "spin", "theta_rd", "phi_rd", "crossings"]), anything)
def test_any_setting_of_a_trace(name, value):
    given_ = {"spin": 0.5, "theta_rd": 1.0, "phi_rd": 2.0, name: value}
    observer = Observer.fido(10.0, 1.0, 0.0)
    trace = trace_disk if name == "crossings" else trace_rays
    result = answered(
        lambda: trace(given_.pop("spin"), observer, given_.pop("theta_rd"), given_.pop("phi_rd"), **given_)
    )
    if result is not None:
        assert sum(result.counts.values()) == result.fate.size


@many
@given(st.sampled_from([field.name for field in dataclasses.fields(PerspectiveCamera)]), anything)
def test_any_perspective_camera(name, value):
    settings_ = {"width": 64, "height": 36, "focal_length": 50.0, name: value}
    camera = answered(lambda: PerspectiveCamera(**settings_))
    if camera is not None:
        seen = camera.directions(np.array([0.0, 31.5, 64.0]), np.array([0.0, 18.0, 36.0]))
        assert np.linalg.norm(seen, axis=-1) == pytest.approx(1.0)


@many
@given(st.sampled_from([field.name for field in dataclasses.fields(PanoramaCamera)]), anything)
def test_any_panorama(name, value):
    camera = answered(lambda: PanoramaCamera(**{"width": 64, "height": 32, name: value}))
    if camera is not None:
        assert np.linalg.norm(camera.directions(10.0, 20.0)) == pytest.approx(1.0)
    answered(lambda: PerspectiveCamera.from_field_of_view(64, 36, value))


@many
@given(st.sampled_from([field.name for field in dataclasses.fields(WarpMapParameters)]), anything)
def test_any_parameters_of_a_map(name, value):
    plain = {"spin": 0.9, "camera": PerspectiveCamera(6, 4, 50.0), "camera_position": (10.0, 0.0, 1.0)}

    def make():
        parameters = WarpMapParameters(**{**plain, name: value})
        parameters.validate()
        return parameters

    parameters = answered(make)
    if parameters is not None:
        assert WarpMapParameters.from_metadata(parameters.to_metadata()) == parameters
        warp_map = bake(parameters)
        assert sum(warp_map.counts[each] for each in ("sky", "edge", "shadow", "unresolved")) == 24
        assert (warp_map.one_plus_z != 0.0).all()
        assert np.isfinite(warp_map.one_plus_z).all()


@many
@given(st.sampled_from([field.name for field in dataclasses.fields(Disk)]), anything)
def test_any_disk(name, value):

    def make():
        disk = Disk(**{name: value})
        disk.validate(0.7, "gauss-legendre")
        return disk

    disk = answered(make)
    if disk is not None:
        inner, outer = disk.radii(0.7)
        assert horizon_radius(0.7) < inner < outer < math.inf
        assert 1 <= disk.crossings <= 8


@pytest.fixture(scope="module")
def disk_view():
    place = (20.0, 0.0, 3.0)
    return WarpMapParameters(0.9, PerspectiveCamera(12, 8, 10.0), place, looking_at_hole(place), disk=Disk())


@many
@given(st.sampled_from([field.name for field in dataclasses.fields(MatterLook)]), anything)
def test_any_look_of_a_disk(small_patterns, disk_view, name, value):
    layer = answered(lambda: render_matter(LightParameters(disk_view, MatterLook(**{name: value}), 10.0)))
    if layer is not None:
        assert np.isfinite(layer.light).all()
        assert (layer.light >= 0.0).all()
        assert ((layer.transmittance >= np.float32(LEAST_TRANSMITTANCE)) & (layer.transmittance <= 1.0)).all()


@many
@given(numbers, numbers, numbers, numbers)
def test_any_change_of_color(one_plus_z, color, brightness, temperature):
    gain = answered(lambda: redshift_gain(one_plus_z, color, brightness, temperature))
    assert gain is None or (np.isfinite(gain).all() and (gain >= 0.0).all())


# --- invariants of the answers ----------------------------------------------------------------------


@many
@given(st.data(), spins)
def test_every_ray_has_one_fate_and_its_numbers_are_in_range(data, spin):
    observer = data.draw(observers(spin))
    result = trace_rays(spin, observer, *sky())
    seen = result.fate == Fate.SKY
    assert sum(result.counts.values()) == 24
    assert result.counts["unresolved"] == 0
    for values in (result.theta, result.phi, result.one_plus_z):
        assert np.array_equal(np.isfinite(values), seen)
    assert ((result.theta[seen] >= 0.0) & (result.theta[seen] <= math.pi)).all()
    assert ((result.phi[seen] >= 0.0) & (result.phi[seen] < 2.0 * math.pi)).all()
    assert (result.one_plus_z[seen] > 0.0).all()


@some
@given(st.data(), spins)
def test_crossings_are_in_order_outside_the_horizon_and_redshifts_positive(data, spin):
    observer = data.draw(observers(spin))
    result = trace_disk(spin, observer, *sky())
    found = np.isfinite(result.radius)
    assert np.array_equal(found, np.isfinite(result.phi))
    assert (found[:, :-1] | ~found[:, 1:]).all()
    assert (result.radius[found] > horizon_radius(spin)).all()
    assert ((result.phi[found] >= 0.0) & (result.phi[found] < 2.0 * math.pi)).all()
    assert (result.g[found] > 0.0).all()
    both = found[:, 1:]
    assert (np.diff(result.mino_time, axis=1)[both] > 0.0).all()


# Next to the critical curve rounding itself is enlarged without bound, so that symmetric rays may part there: rays are
# compared whose answers do not change by more than this when they are turned by `NUDGE`.
NUDGE, LARGEST_CHANGE = 1e-7, 1e-4


def looking(count=24):
    theta, phi = sky(count)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def origins(spin, observer, vectors, method="gauss-legendre"):
    """Where light comes from that is seen along `vectors` on the FIDO's triad; NaN in the shadow."""
    fate, direction = trace_block(rays_from_triad(spin, observer, vectors), 1e-10, method)
    return fate, direction


def steady(spin, observer, vectors):
    """Which rays are not so close to the edge that rounding decides about them."""
    turned = vectors + NUDGE * np.roll(vectors, 1, axis=1)
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        change = np.linalg.norm(origins(spin, observer, turned)[1] - origins(spin, observer, vectors)[1], axis=-1)
    return change < LARGEST_CHANGE


@some
@given(st.data(), spins)
def test_turning_about_the_axis_turns_the_sky(data, spin):
    observer, angle = data.draw(observers(spin)), data.draw(st.floats(-7.0, 7.0))
    turned = dataclasses.replace(observer, phi=observer.phi + angle)
    vectors = looking()
    fate, before = origins(spin, observer, vectors)
    other_fate, after = origins(spin, turned, vectors)
    assert np.array_equal(fate, other_fate)
    rotation = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1.0]])
    compared = steady(spin, observer, vectors)
    assert np.abs(after - before @ rotation.T)[compared].max(initial=0.0) < 1e-7


@some
@given(st.data(), spins)
def test_a_hole_that_turns_the_other_way_is_the_mirror_image(data, spin):
    """(a, phi, B_phi, N_phi) -> their negatives, and phi of the sky with them."""
    observer = data.draw(observers(spin))
    b_r, b_theta, b_phi = observer.direction
    mirrored = dataclasses.replace(observer, phi=-observer.phi, direction=(b_r, b_theta, -b_phi))
    vectors = looking()
    fate, before = origins(spin, observer, vectors)
    other_fate, after = origins(-spin, mirrored, vectors * [1.0, 1.0, -1.0])
    compared = steady(spin, observer, vectors)
    assert np.array_equal(fate[compared], other_fate[compared])
    assert np.abs(after - before * [1.0, -1.0, 1.0])[compared].max(initial=0.0) < 1e-7


@some
@given(st.data(), spins)
def test_below_the_plane_is_the_mirror_image_of_above(data, spin):
    observer = data.draw(observers(spin))
    b_r, b_theta, b_phi = observer.direction
    below = dataclasses.replace(observer, theta=math.pi - observer.theta, direction=(b_r, -b_theta, b_phi))
    vectors = looking()
    fate, before = origins(spin, observer, vectors)
    other_fate, after = origins(spin, below, vectors * [1.0, -1.0, 1.0])
    compared = steady(spin, observer, vectors)
    assert np.array_equal(fate[compared], other_fate[compared])
    # pi - theta rounds theta by 2e-16, which aberration next to the horizon enlarges.
    assert np.abs(after - before * [1.0, 1.0, -1.0])[compared].max(initial=0.0) < 1e-6


@some
@given(st.data())
def test_without_spin_rays_stay_in_a_plane_and_bend_alike_all_round(data):
    """Schwarzschild: the origin lies in the plane of hole, camera and view, as far round whichever way that lies."""
    observer = dataclasses.replace(data.draw(observers(0.0)), beta=0.0)
    away, turn = data.draw(st.floats(0.05, 3.1)), data.draw(st.lists(azimuths, min_size=6, max_size=6))
    triad = spherical_triad(observer.theta, observer.phi)
    around = np.stack([np.zeros(6), np.cos(turn), np.sin(turn)], axis=-1)
    vectors = math.cos(away) * np.array([1.0, 0.0, 0.0]) + math.sin(away) * around
    fate, found = origins(0.0, observer, vectors)
    assert len(set(fate.tolist())) == 1
    if fate[0] != Fate.SKY or not steady(0.0, observer, vectors).all():
        return
    local = found @ triad.T
    normal = np.cross([1.0, 0.0, 0.0], around)
    assert np.abs((local * normal).sum(axis=-1)).max() < 1e-8
    along, aside = local[:, 0], (local * around).sum(axis=-1)
    assert np.ptp(along) < 1e-8
    assert np.ptp(aside) < 1e-8


@few
@given(st.data(), spins)
def test_steps_and_closed_forms_agree(data, spin):
    observer = data.draw(observers(spin))
    vectors = looking(60)
    fate, fast = origins(spin, observer, vectors)
    other, steps = origins(spin, observer, vectors, "cash-karp")
    compared = steady(spin, observer, vectors) & (other != Fate.UNRESOLVED)
    assert np.array_equal(fate[compared], other[compared])
    assert np.abs(fast - steps)[compared].max(initial=0.0) < 1e-6
    theta, phi = celestial_coordinates(fast[fate == Fate.SKY])
    assert ((theta >= 0.0) & (theta <= math.pi) & (phi >= 0.0) & (phi < 2.0 * math.pi)).all()


@few
@given(st.data(), spins)
def test_constants_of_motion_are_those_of_the_momentum(data, spin):
    """Eq. 3 at the camera: Theta = p_theta^2 and R = (Delta p_r)^2, from b and q alone."""
    observer = data.draw(observers(spin))
    rays = rays_from_triad(spin, observer, looking())
    rays = rays.select(rays.escapes)
    a, r = spin, observer.r
    cosine = math.cos(observer.theta)
    if math.sin(observer.theta) > 1e-3:
        theta_potential = rays.q + cosine**2 * (a * a - rays.b**2 / math.sin(observer.theta) ** 2)
        scale = 1.0 + np.abs(rays.q_plus_b2) + rays.b**2 / math.sin(observer.theta) ** 2
        assert np.abs(theta_potential - rays.polar**2).max(initial=0.0) < 1e-9 * scale.max(initial=1.0)
    delta = (r - horizon_radius(a)) * (r - a * a / horizon_radius(a))
    big = r * r + a * a - a * rays.b
    radial = big**2 - delta * ((rays.b - a) ** 2 + rays.q)
    assert np.abs(radial - rays.radial**2).max(initial=0.0) < 1e-8 * (1.0 + (big**2).max(initial=1.0))


def test_the_warning_of_unstable_orbits_is_still_one():
    with pytest.warns(UnstableOrbitWarning):
        Observer.circular_orbit(0.0, 5.0)
