# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp maps in memory: what the pixels say, in which frame, and what baking promises."""

import dataclasses
import math

import numpy as np
import pytest
from references import about, angle_between, unit_vectors
from shots import shot

from physics import (
    BlackHoleError,
    Cancelled,
    Disk,
    Fate,
    PanoramaCamera,
    PerspectiveCamera,
    WarpMapParameters,
    bake,
    bake_steps,
    looking_at_hole,
    trace_rays,
    unstable_orbit_warning,
)
from physics.maps import painting


def test_pixels_are_the_rays_of_their_centers():
    """The map against `trace_rays`, by a camera frame set up by hand: circular orbit, B = phi-hat."""
    parameters = shot(inclination=90.0, radius=8.0, spin=0.9)
    warp_map = bake(parameters)
    y, x = np.mgrid[0:27, 0:48] + 0.5
    # Camera at x = 8 looking along -x with z up: right is +y (phi-hat), up is +z (-theta-hat).
    half = math.tan(math.radians(30.0))
    right, up = (x - 24.0) / 13.5 * half, (13.5 - y) / 13.5 * half
    norm = np.sqrt(1.0 + right**2 + up**2)
    # e_x = r-hat (+x), e_y = phi-hat (+y), e_z = -theta-hat (+z)
    theta_rd, phi_rd = np.arccos(up / norm), np.arctan2(right, -1.0)
    traced = trace_rays(0.9, parameters.observer(), theta_rd, phi_rd)
    whole = warp_map.visibility == 1.0
    assert whole.sum() > 500
    assert (traced.fate[whole] == Fate.SKY).all()
    assert (traced.fate[warp_map.visibility == 0.0] == Fate.SHADOW).all()
    distance = angle_between(
        unit_vectors(warp_map.theta.astype(float), warp_map.phi.astype(float))[whole],
        unit_vectors(traced.theta, traced.phi)[whole],
    )
    # Single precision of phi: 2.4e-7, and another rounding of the direction, amplified near the edge.
    assert distance.max() < 1e-6
    assert warp_map.one_plus_z[whole] == pytest.approx(traced.one_plus_z[whole], rel=1e-7)


def test_directions_are_in_world_axes():
    """Tilting hole and camera together turns every direction by the same rotation and changes nothing else."""
    tilt = about(0, 0.7) @ about(2, -0.4)
    plain = bake(shot())
    tilted = bake(shot(hole_to_world=tilt.tolist()))
    expected = unit_vectors(plain.theta.astype(float), plain.phi.astype(float)) @ tilt.T
    seen = plain.visibility > 0.0
    distance = angle_between(unit_vectors(tilted.theta.astype(float), tilted.phi.astype(float)), expected)[seen]
    assert distance.max() < 1e-6
    assert np.array_equal(plain.one_plus_z, tilted.one_plus_z)
    assert np.array_equal(plain.visibility, tilted.visibility)


def test_moving_the_camera_about_the_axis_turns_the_sky():
    position = (8.0, 0.0, 2.0)
    turn = about(2, 1.1)
    one = bake(shot(camera_position=position, camera_to_hole=looking_at_hole(position)))
    other = bake(
        shot(
            camera_position=(turn @ position).tolist(),
            camera_to_hole=(turn @ np.array(looking_at_hole(position))).tolist(),
        )
    )
    seen = one.visibility == 1.0
    distance = angle_between(
        unit_vectors(one.theta.astype(float), one.phi.astype(float)) @ turn.T,
        unit_vectors(other.theta.astype(float), other.phi.astype(float)),
    )[seen]
    # The same rays with other roundings: amplified where the sky is magnified most.
    assert np.quantile(distance, 0.99) < 1e-6
    assert one.visibility == pytest.approx(other.visibility, abs=1e-6)


@pytest.mark.parametrize("motion", ["fido", "static", "circular", "circular_retrograde", "free_fall"])
def test_without_mass_the_sky_is_where_it_was(motion):
    """Mass towards 0 is distance towards infinity: directions tend to the camera's own, 1 + z to 1."""
    camera = PerspectiveCamera(40, 30, 30.0)
    position = (3e9, -4e9, 1e9)
    to_hole = about(1, 0.3) @ about(2, 2.0)
    warp_map = bake(shot(camera=camera, camera_position=position, camera_to_hole=to_hole.tolist(), motion=motion))
    y, x = np.mgrid[0:30, 0:40] + 0.5
    straight = camera.directions(x, y) @ to_hole.T
    distance = angle_between(unit_vectors(warp_map.theta.astype(float), warp_map.phi.astype(float)), straight)
    # Orbits and falls still move, at sqrt(1 / r) and sqrt(2 / r): aberration and redshift by at most 2e-5. The rest is
    # single precision and the tolerance.
    speed = math.sqrt(2.0 / math.hypot(*position)) if motion not in ("fido", "static") else 0.0
    assert distance.max() < 1e-6 + speed
    assert warp_map.one_plus_z == pytest.approx(1.0, abs=1e-6 + 1.5 * speed)
    assert (warp_map.visibility == 1.0).all()


@pytest.mark.parametrize("fov", [22.0, 60.0])
def test_a_vanishing_hole_leaves_no_speck(fov):
    """Looking straight at a hole of no size: no pixel may be darker for it."""
    warp_map = bake(shot(320, 180, radius=1e8, motion="fido", fov=fov))
    assert (warp_map.visibility == 1.0).all()


def test_velocity_agrees_with_the_presets():
    """The circular observer's velocity given as Cartesian components makes the same map."""
    circular = shot()
    observer = circular.observer()
    along = np.array([0.0, observer.beta, 0.0])  # phi-hat at phi = 0 is +y
    moving = bake(shot(motion="velocity", velocity=along.tolist()))
    reference = bake(circular)
    assert moving.one_plus_z == pytest.approx(reference.one_plus_z, rel=1e-6)
    assert moving.visibility == pytest.approx(reference.visibility, abs=1e-5)
    assert shot(motion="velocity").observer().beta == 0.0


def test_supersampling_divides_the_pixels():
    one, four = bake(shot()), bake(shot(supersampling=4))
    assert four.theta.shape == (4 * 27, 4 * 48)
    boxes = four.visibility.reshape(27, 4, 48, 4).mean(axis=(1, 3))
    # Two exact measures of the same area.
    assert boxes == pytest.approx(one.visibility, abs=2e-3)


def test_values_are_within_what_the_format_promises():
    warp_map = bake(shot(camera=PanoramaCamera(128, 64), radius=4.0))
    assert warp_map.theta.dtype == warp_map.visibility.dtype == np.float32
    assert (warp_map.theta >= 0.0).all()
    assert (warp_map.theta <= np.float32(math.pi)).all()
    assert (warp_map.phi >= 0.0).all()
    assert (warp_map.phi < np.float32(2.0 * math.pi)).all()
    assert (warp_map.one_plus_z > 0.0).all()
    dark = warp_map.visibility == 0.0
    assert dark.any()
    assert (warp_map.one_plus_z[dark] == 1.0).all()
    assert (warp_map.theta[dark] == 0.0).all()


def test_partly_covered_pixels_carry_a_direction_from_their_visible_part():
    warp_map = bake(shot())
    partial = (warp_map.visibility > 0.0) & (warp_map.visibility < 1.0)
    assert partial.any()
    assert (warp_map.theta[partial] > 0.0).all()
    # The edge's redshift is close to that of the sky beside it.
    rows, columns = np.nonzero(partial)
    inside = (rows > 0) & (rows < 26) & (columns > 0) & (columns < 47)
    for row, column in zip(rows[inside], columns[inside], strict=True):
        around = (slice(row - 1, row + 2), slice(column - 1, column + 2))
        beside = warp_map.one_plus_z[around][warp_map.visibility[around] == 1.0]
        if len(beside):
            assert np.abs(beside - warp_map.one_plus_z[row, column]).min() < 0.05


def test_counts_add_up():
    warp_map = bake(shot())
    assert sum(warp_map.counts[name] for name in ("sky", "edge", "shadow", "unresolved")) == 48 * 27
    assert warp_map.counts["rays"] > 0
    assert warp_map.counts["unresolved"] == 0
    assert warp_map.counts["edge"] == ((warp_map.visibility > 0.0) & (warp_map.visibility < 1.0)).sum()


def test_unresolved_pixels_are_marked_and_counted():
    """Eq. 2 as printed cannot carry rays through the poles: such pixels hold 1 + z = -1, which no sky has."""
    pole = {"inclination": 20.0, "radius": 15.0, "spin": 0.5, "motion": "fido"}
    warp_map = bake(shot(**pole, method="cash-karp-printed", interpolation=0.0))
    lost = warp_map.one_plus_z == -1.0
    assert 0 < lost.sum() == warp_map.counts["unresolved"] < 200


@pytest.mark.parametrize("interpolation", [0.0, 2e-6])
def test_groups_and_blocks_make_no_difference(monkeypatch, interpolation):
    whole = bake(shot(interpolation=interpolation))
    monkeypatch.setattr(painting, "GROUP_PIXELS", 100)
    monkeypatch.setattr(painting, "BLOCK_SIZE", 17)
    monkeypatch.setattr(painting, "TRACED_SIDE", 16)
    pieces = bake(shot(interpolation=interpolation))
    for name in ("theta", "phi", "one_plus_z", "visibility"):
        assert np.array_equal(getattr(whole, name), getattr(pieces, name)), name


def test_progress_rises_to_one_and_cancelling_stops():
    fractions = []
    bake(shot(), progress=fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == pytest.approx(1.0)
    with pytest.raises(Cancelled):
        bake(shot(), cancel=lambda: True)
    steps = bake_steps(shot())
    next(steps)
    steps.close()


def test_hash_holds_exactly_while_nothing_changes():
    base = shot()
    assert base.hash == shot().hash
    changes = {
        "spin": 0.9,
        "camera": PerspectiveCamera(48, 27, 20.0),
        "camera_position": (9.0, 0.0, 0.0),
        "camera_to_hole": about(0, 0.1).tolist(),
        "hole_to_world": about(1, 0.1).tolist(),
        "motion": "fido",
        "velocity": (0.1, 0.0, 0.0),
        "supersampling": 2,
        "tolerance": 1e-7,
        "method": "cash-karp-printed",
        "interpolation": 0.0,
        "disk": Disk(),
    }
    assert set(changes) == {field.name for field in dataclasses.fields(WarpMapParameters)}
    hashes = {dataclasses.replace(base, **{name: value}).hash for name, value in changes.items()}
    assert len(hashes | {base.hash}) == len(changes) + 1


def test_parameters_survive_the_metadata():
    for parameters in (shot(), shot(camera=PanoramaCamera(20, 10, latitude_max=1.0))):
        assert WarpMapParameters.from_metadata(parameters.to_metadata()) == parameters


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"spin": 1.5}, "spin"),
        ({"camera_position": (1.0, 0.0, 0.0)}, "inside the black hole"),
        ({"camera_position": (0.0, 0.0, 0.0)}, "inside the black hole"),
        ({"camera_position": (math.nan, 0.0, 0.0)}, "finite"),
        ({"motion": "static", "camera_position": (1.5, 0.0, 0.0)}, "ergosphere"),
        ({"motion": "circular_retrograde", "camera_position": (3.0, 0.0, 0.0)}, "photon orbit"),
        ({"motion": "velocity", "velocity": (0.8, 0.8, 0.0)}, "speed of light"),
        ({"motion": "sideways"}, "no motion 'sideways'"),
        ({"supersampling": 3}, "supersampling"),
        ({"tolerance": 1.0}, "tolerance"),
        ({"method": "guess"}, "no method"),
        ({"interpolation": -1e-6}, "interpolation"),
        ({"interpolation": math.nan}, "interpolation"),
        ({"camera_to_hole": ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 1.0))}, "not a rotation"),
        ({"hole_to_world": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))}, "not a rotation"),
    ],
)
def test_impossible_shots_are_refused_in_words(changes, words):
    with pytest.raises(BlackHoleError, match=words):
        next(bake_steps(shot(**changes)))


def test_unstable_orbits_are_said():
    assert unstable_orbit_warning(shot(spin=0.0, radius=5.0)) is not None
    assert "6 M" in unstable_orbit_warning(shot(spin=0.0, radius=5.0))
    assert unstable_orbit_warning(shot(spin=0.0, radius=7.0)) is None
    assert unstable_orbit_warning(shot(spin=0.0, radius=5.0, motion="fido")) is None
