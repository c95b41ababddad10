# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays that never meet the plane, or hardly turn, through thick layers: against stepped geodesics, and for steps."""

import dataclasses
import math

import numpy as np
import pytest
from test_thin_layer import SPIN, shot
from test_travel_time import rates

import physics
from physics.kerr.rays import camera_triad, rays_from_camera
from physics.light.matter_settings import MATTER_PRESETS, MatterLook
from physics.matter.slow_paths import SlowPaths
from physics.sampling.view import View

PLAIN = MatterLook(strands=0.0, smoke=0.0, depth=1.0, inner_softness=0.1, thickness=0.1)


def test_places_are_those_of_stepped_geodesics():
    # Hamilton's equations of the metric itself, in steps of 2e-3 r, for vortical rays past the axis and near the plane.
    camera = physics.Observer.fido(15.0, math.radians(80.0), 0.3)
    looking = np.array([[-1.0, 0.005, 0.004], [-1.0, -0.03, -0.006], [-1.0, 0.02, 0.03], [-1.0, 0.0, 0.001]])
    looking /= np.linalg.norm(looking, axis=-1, keepdims=True)
    rays = rays_from_camera(SPIN, camera, looking[:, [0, 2, 1]] @ camera_triad(camera).T)
    assert (rays.q < 0.0).sum() >= 2
    assert (rays.q > 0.0).any()
    paths = SlowPaths(rays, 1.0, np.ones(4, dtype=bool))
    chosen, low, high = paths.passes(0, 1, 2.5, 20.0)
    assert len(chosen) == 4
    samples = paths.samples(chosen, low, high, np.linspace(0.0, 1.0, 401)[:, None], True)
    for number in range(4):
        b, delta = float(rays.b[number]), camera.r**2 - 2.0 * camera.r + SPIN**2
        state = np.array([camera.r, camera.theta, camera.phi, 0.0, rays.radial[number] / delta, rays.polar[number]])
        place = 0
        wanted = [60, 200, 330]
        while place < 3:
            size = -2e-3 * state[0]
            k1 = rates(state, b)
            k2 = rates(state + 0.5 * size * k1, b)
            k3 = rates(state + 0.5 * size * k2, b)
            k4 = rates(state + size * k3, b)
            after = state + size / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            radius = 1.0 / samples.u[wanted[place], number]
            if after[0] < radius:
                _, theta, phi, time, *_ = state + (state[0] - radius) / (state[0] - after[0]) * (after - state)
                assert math.cos(theta) == pytest.approx(samples.height[wanted[place], number], abs=2e-6)
                turn = phi - samples.phi[wanted[place], number]
                assert turn - 2.0 * math.pi * round(turn / (2.0 * math.pi)) == pytest.approx(0.0, abs=1e-4)
                assert -time == pytest.approx(samples.delay[wanted[place], number], abs=2e-3)
                place += 1
            state = after


def narrow(parameters, ray_of, value):
    """Return the same shot, of 8 x 1 pixels of nearly one direction: that to the right of the hole's, on a slant, where
    a property of rays takes a value."""
    looking = np.array(parameters.camera_to_hole)
    camera = physics.PerspectiveCamera.from_field_of_view(8, 1, 3e-5)

    def toward(angle):
        turn, cos, sin = np.eye(3), math.cos(angle), math.sin(angle)
        turn[[0, 0, 2, 2], [0, 2, 0, 2]] = cos, -sin, sin, cos
        changed = tuple(tuple(float(each) for each in row) for row in looking @ turn)
        return dataclasses.replace(parameters, camera=camera, camera_to_hole=changed)

    low, high = 0.0, 0.08
    sign = np.sign(ray_of(View(toward(low)).rays(np.array([4.0]), np.array([0.5])))[0] - value)
    for _ in range(60):
        middle = 0.5 * (low + high)
        here = ray_of(View(toward(middle)).rays(np.array([4.0]), np.array([0.5])))[0] - value
        low, high = (middle, high) if np.sign(here) == sign else (low, middle)
    return toward(low)


@pytest.mark.parametrize("degrees", [1.0, 3.0])
def test_light_has_no_step_where_carters_constant_is_zero(degrees):
    def carter(rays):
        return rays.q

    parameters = narrow(shot(8, 1, degrees, supersampling=1), carter, 0.0)
    q = View(parameters).rays(np.arange(8) + 0.5, np.full(8, 0.5)).q
    assert q.min() < 0.0 < q.max()
    assert np.abs(q).max() < 0.02
    layer = physics.render_matter(physics.LightParameters(parameters, PLAIN))
    assert layer.light.min() > 1e-3
    for value in (layer.light[0, :, 0], layer.transmittance[0]):
        assert np.ptp(value) < 5e-3 * value.mean() + 1e-5


def test_light_has_no_step_where_paths_are_followed_otherwise():
    # At A = 1 the two ways of finding places meet: their nodes differ, so the light does by what they leave out.
    def base(rays):
        reduced = rays.q_plus_b2 - SPIN**2
        return 0.5 * (reduced + np.sqrt(np.maximum(reduced**2 + 4.0 * SPIN**2 * rays.q, 0.0)))

    parameters = narrow(shot(8, 1, 5.0, supersampling=1), base, 1.0)
    layer = physics.render_matter(physics.LightParameters(parameters, PLAIN))
    for value in (layer.light[0, :, 0], layer.transmittance[0]):
        assert np.ptp(value) < 0.04 * value.mean() + 1e-3


@pytest.mark.parametrize(
    ("degrees", "radius"), [(5.0, 30.0), (20.0, 30.0), (2.0, 12.0), (90.0, 30.0), (0.0, 10.0), (89.9, 30.0)]
)
def test_no_ray_is_left_out(degrees, radius):
    angle = math.radians(degrees)
    place = (radius * math.cos(angle), 0.0, radius * math.sin(angle))
    parameters = dataclasses.replace(
        shot(49, 27, 0.0), camera_position=place, camera_to_hole=physics.looking_at_hole(place)
    )
    layer = physics.render_matter(physics.LightParameters(parameters, MATTER_PRESETS["torus"]))
    assert layer.counts["unresolved"] == 0
    assert np.isfinite(layer.light).all()
