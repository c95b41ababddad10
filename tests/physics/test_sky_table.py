# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of the sky against rays traced by another method, and maps made with them against maps made without."""

import dataclasses
import math

import numpy as np
import pytest
from references import about, angle_between, unit_vectors
from shots import shot

from physics import Fate, MapBaker, Observer, PanoramaCamera, PerspectiveCamera, bake
from physics.geodesics.tracer import trace_block
from physics.kerr.rays import light_in_fido_frame, rays_from_triad
from physics.maps.sky_table import sky_table_steps
from physics.numerics.work import drain

# Spin, radius and inclination of a camera, the motion it is given, and the share of the sky that must be served: less
# for fast holes, next to whose prograde edge the sky turns too fast for any regular grid.
PLACES = {
    "close orbit": (0.999, 10.0, 90.0, "circular", 0.95),
    "without spin": (0.0, 20.0, 70.0, "static", 0.99),
    "inside the photon orbits": (0.9, 2.2, 75.0, "fido", 0.9),
    "next to the horizon": (-0.9, 1.6, 40.0, "fido", 0.8),
    "on the axis": (0.7, 8.0, 0.0, "fido", 0.98),
    "far away": (0.5, 5000.0, 90.0, "free_fall", 0.99),
}


@pytest.mark.parametrize("name", PLACES)
def test_a_table_gives_the_directions_of_rays(name):
    spin, radius, inclination, motion, share = PLACES[name]
    parameters = shot(spin=spin, radius=radius, inclination=inclination, motion=motion)
    table = drain(sky_table_steps(parameters))
    observer = parameters.observer()
    generator = np.random.default_rng(5)
    looking = generator.standard_normal((4000, 3))
    looking /= np.linalg.norm(looking, axis=1)[:, None]
    rays = rays_from_triad(spin, observer, looking)
    fate, exact = trace_block(rays, 1e-11, "cash-karp")
    light, _ = light_in_fido_frame(observer, looking, np.eye(3))
    found = table.directions(light, observer.phi)
    served = ~np.isnan(found[:, 0])
    assert (fate[served] == Fate.SKY).all()
    assert served.sum() >= share * (fate == Fate.SKY).sum()
    # What is allowed is 5e-6 in all; half of it is left to the tiles.
    assert np.linalg.norm(found - exact, axis=1)[served].max() < 2.5e-6


def turned(parameters, angle):
    return dataclasses.replace(
        parameters, camera_to_hole=(np.array(parameters.camera_to_hole) @ about(1, angle)).tolist()
    )


BASE = shot(240, 135, radius=12.0, inclination=70.0, spin=0.9, motion="velocity", velocity=(0.1, 0.3, 0.0))
MOVES = {
    "turn": [turned(BASE, 0.1 * k) for k in range(3)],
    "zoom": [
        dataclasses.replace(BASE, camera=PerspectiveCamera.from_field_of_view(240, 135, math.radians(angle)))
        for angle in (60.0, 40.0, 25.0)
    ],
    "speed": [dataclasses.replace(BASE, velocity=(0.1, speed, 0.0)) for speed in (0.3, 0.35, -0.8)],
    "lens": [BASE, dataclasses.replace(BASE, camera=PanoramaCamera(256, 128))],
    "turn and azimuth": [
        dataclasses.replace(
            turned(BASE, 0.2 * k),
            camera_position=(about(2, 0.5 * k) @ BASE.camera_position).tolist(),
            camera_to_hole=(about(2, 0.5 * k) @ np.array(turned(BASE, 0.2 * k).camera_to_hole)).tolist(),
            hole_to_world=about(0, 0.4 * k).tolist(),
        )
        for k in range(3)
    ],
}


@pytest.mark.parametrize("name", MOVES)
def test_frames_seen_from_one_place_share_a_table(name):
    baker = MapBaker()
    for number, parameters in enumerate(MOVES[name]):
        shared, alone = drain(baker.steps(parameters)), bake(parameters)
        assert shared.metadata["hash"] == parameters.hash
        assert np.array_equal(shared.visibility, alone.visibility)
        assert np.array_equal(shared.one_plus_z, alone.one_plus_z)
        if number:
            assert shared.counts["rays"] < 0.3 * alone.counts["rays"]
            assert shared.counts["rays"] + shared.counts["shared"] == alone.counts["rays"]
        seen = alone.visibility > 0.0
        error = angle_between(
            unit_vectors(shared.theta.astype(float), shared.phi.astype(float)),
            unit_vectors(alone.theta.astype(float), alone.phi.astype(float)),
        )[seen]
        # Each of the two keeps to 5e-6 of the exact map.
        assert error.max() < 1e-5
        assert np.quantile(error, 0.999) < 5e-6


def test_other_places_and_exact_maps_share_nothing():
    moving = [dataclasses.replace(BASE, camera_position=(12.0 + 1e-3 * k, 0.0, 1.0)) for k in range(3)]
    exact = [dataclasses.replace(turned(BASE, 0.1 * k), interpolation=0.0) for k in range(2)]
    for frames in (moving, exact):
        baker = MapBaker()
        for parameters in frames:
            shared, alone = drain(baker.steps(parameters)), bake(parameters)
            assert np.array_equal(shared.theta, alone.theta)
            assert np.array_equal(shared.phi, alone.phi)
            assert shared.counts == alone.counts


def test_a_table_that_answers_too_little_is_not_asked_again():
    """Close to the flat side of a hole at full speed hardly a ray has a neighbor that tells where it comes from."""
    base = shot(160, 90, spin=0.9999, radius=4.0, fov=20.0, inclination=90.0, motion="fido")
    frames = [turned(base, angle) for angle in (0.45, 0.46, 0.47)]
    baker = MapBaker()
    shared = [drain(baker.steps(parameters)).counts["shared"] for parameters in frames]
    assert shared[0] == 0
    assert shared[1] > 0
    assert shared[2] == 0


def test_a_table_serves_every_azimuth_of_its_place_and_no_other():
    table = drain(sky_table_steps(BASE))
    assert table.serves(MOVES["turn and azimuth"][2])
    assert not table.serves(dataclasses.replace(BASE, spin=0.91))
    assert not table.serves(dataclasses.replace(BASE, interpolation=1e-6))
    assert not table.serves(dataclasses.replace(BASE, camera_position=tuple(1.0001 * x for x in BASE.camera_position)))


def test_observers_at_one_place_see_one_sky():
    """The FIDO and a moving camera look at the same light in different directions (Eq. 5): one entry serves both."""
    fido = Observer.fido(8.0, 1.1, 0.0)
    moving = Observer(8.0, 1.1, 0.0, 0.7, (0.6, 0.0, 0.8))
    looking = unit_vectors(np.linspace(0.1, 3.0, 50), np.linspace(0.0, 6.0, 50))
    light, _ = light_in_fido_frame(moving, looking, np.eye(3))
    at_rest = rays_from_triad(0.8, fido, -light.T)
    in_motion = rays_from_triad(0.8, moving, looking)
    assert at_rest.b == pytest.approx(in_motion.b, rel=1e-12)
    assert at_rest.q == pytest.approx(in_motion.q, rel=1e-11)
