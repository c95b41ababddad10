# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps made from others by a rotation, against maps that were traced."""

import dataclasses
import math

import numpy as np
import pytest
from references import about, angle_between, unit_vectors
from shots import shot

from physics import MapBaker, PerspectiveCamera, bake, turned_map
from physics.numerics.work import drain


def orbiting(parameters, angle, **changes):
    """The same camera further along its orbit."""
    turn = about(2, angle)
    return dataclasses.replace(
        parameters,
        camera_position=(turn @ parameters.camera_position).tolist(),
        camera_to_hole=(turn @ np.array(parameters.camera_to_hole)).tolist(),
        velocity=(turn @ parameters.velocity).tolist(),
        **changes,
    )


BASE = shot(160, 90, radius=9.0)


@pytest.mark.parametrize("angle", [1e-3, 1.0, 3.1, -2.0])
@pytest.mark.parametrize("tilt", [np.eye(3), about(0, 0.8) @ about(1, -0.3)], ids=["upright", "tilted"])
@pytest.mark.parametrize("motion", ["circular", "velocity"])
def test_an_orbits_frames_share_their_rays(angle, tilt, motion):
    base = dataclasses.replace(BASE, hole_to_world=tilt.tolist(), motion=motion, velocity=(0.1, 0.2, 0.05))
    parameters = orbiting(base, angle)
    shared = turned_map(bake(base), parameters)
    traced = bake(parameters)
    assert shared.metadata["hash"] == parameters.hash
    assert shared.metadata["parameters"] == parameters.to_metadata()
    assert shared.visibility == pytest.approx(traced.visibility, abs=1e-5)
    assert shared.one_plus_z == pytest.approx(traced.one_plus_z, rel=1e-6)
    seen = traced.visibility == 1.0
    error = angle_between(
        unit_vectors(shared.theta.astype(float), shared.phi.astype(float)),
        unit_vectors(traced.theta.astype(float), traced.phi.astype(float)),
    )[seen]
    # Single precision in both maps, and roundings of the camera's place that the sky next to the edge amplifies.
    assert np.quantile(error, 0.999) < 2e-6
    assert error.max() < 1e-4
    assert (shared.phi >= 0.0).all()
    assert (shared.phi < np.float32(2.0 * math.pi)).all()
    assert (shared.theta[traced.visibility == 0.0] == 0.0).all()


def test_single_precision_noise_of_the_camera_does_not_keep_frames_apart():
    parameters = orbiting(BASE, 0.7)
    noisy = dataclasses.replace(
        parameters,
        camera_position=np.float32(parameters.camera_position).tolist(),
        camera_to_hole=np.float32(parameters.camera_to_hole).tolist(),
    )
    assert turned_map(bake(BASE), noisy) is not None


def test_a_slow_pan_of_a_long_lens_is_not_a_standstill():
    """A tenth of a pixel a frame is far less than the interpolation's tolerance allows, and still to be seen."""
    camera = PerspectiveCamera.from_field_of_view(160, 90, math.radians(0.02))
    long_lens = dataclasses.replace(BASE, camera=camera, interpolation=1e-4)
    earlier = bake(long_lens)
    pan = 0.1 * math.radians(0.02) / 90
    panned = dataclasses.replace(long_lens, camera_to_hole=(np.array(BASE.camera_to_hole) @ about(1, pan)).tolist())
    assert turned_map(earlier, panned) is None


@pytest.mark.parametrize(
    "changes",
    [
        {"camera_position": tuple(1.00001 * np.array(BASE.camera_position))},
        {"camera_to_hole": (np.array(BASE.camera_to_hole) @ about(1, 1e-5)).tolist()},
        {"spin": 0.9},
        {"motion": "fido"},
        {"supersampling": 2},
        {"camera": dataclasses.replace(BASE.camera, focal_length=30.0)},
        {"tolerance": 1e-7},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_other_skies_are_not_shared(changes):
    assert turned_map(bake(BASE), dataclasses.replace(BASE, **changes)) is None


def test_exact_maps_are_shared_only_with_exactly_the_same_sky():
    exact = dataclasses.replace(BASE, interpolation=0.0, camera=dataclasses.replace(BASE.camera, width=32, height=18))
    earlier = bake(exact)
    assert turned_map(earlier, orbiting(exact, 0.5)) is None  # the rotation itself rounds
    tilted = dataclasses.replace(exact, hole_to_world=about(0, 0.5).tolist())
    assert turned_map(earlier, tilted) is not None


def test_other_places_and_other_directions_share_nothing():
    moving = [dataclasses.replace(BASE, camera_position=(12.0 + 1e-3 * k, 0.0, 1.0)) for k in range(3)]
    panning = [
        dataclasses.replace(BASE, camera_to_hole=(np.array(BASE.camera_to_hole) @ about(1, 0.1 * k)).tolist())
        for k in range(2)
    ]
    exact = [dataclasses.replace(parameters, interpolation=0.0) for parameters in panning]
    for frames in (moving, panning, exact):
        baker = MapBaker()
        for parameters in frames:
            shared, alone = drain(baker.steps(parameters)), bake(parameters)
            assert np.array_equal(shared.theta, alone.theta)
            assert np.array_equal(shared.phi, alone.phi)
            assert shared.counts == alone.counts


def test_a_baker_turns_the_map_that_was_traced():
    baker = MapBaker()
    traced = drain(baker.steps(BASE))
    for angle in (0.3, 1.0):
        turned, expected = drain(baker.steps(orbiting(BASE, angle))), turned_map(traced, orbiting(BASE, angle))
        assert np.array_equal(turned.theta, expected.theta)
        assert np.array_equal(turned.phi, expected.phi)
        assert turned.counts["rays"] == 0
        assert turned.counts["shared"] == traced.counts["rays"]
