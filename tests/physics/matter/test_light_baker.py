# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers that share their geometry are those that are made alone."""

import dataclasses
import math

import numpy as np
import pytest
from test_thin_layer import shot

import physics
from physics.matter import light_layer


@pytest.fixture
def traced(monkeypatch):
    """The views that were traced."""
    found = []
    trace = light_layer.disk_pass_steps

    def noted(parameters):
        found.append(parameters)
        return trace(parameters)

    monkeypatch.setattr(light_layer, "disk_pass_steps", noted)
    return found


def orbited(view, azimuth):
    """The view of a camera farther on its circular orbit, that tracks the hole."""
    turn = np.array(
        [[math.cos(azimuth), -math.sin(azimuth), 0.0], [math.sin(azimuth), math.cos(azimuth), 0.0], [0.0, 0.0, 1.0]]
    )
    place = tuple((turn @ view.camera_position).tolist())
    axes = tuple(map(tuple, (turn @ np.array(view.camera_to_hole)).tolist()))
    return dataclasses.replace(view, camera_position=place, camera_to_hole=axes)


def test_looks_times_and_orbits_are_traced_once(traced):
    view, film = shot(96, 54, 10.0), physics.MATTER_PRESETS["gargantua"]
    wanted = [
        physics.LightParameters(view, film, 3.0),
        physics.LightParameters(view, dataclasses.replace(film, temperature=9000.0), 3.0),
        physics.LightParameters(view, film, 40.0),
        physics.LightParameters(orbited(view, 0.7), film, 40.0),
    ]
    baker = physics.LightBaker()
    shared = [physics.drain(baker.steps(each)) for each in wanted]
    assert len(traced) == 1
    for parameters, layer in zip(wanted, shared, strict=True):
        alone = physics.render_matter(parameters)
        assert layer.metadata == alone.metadata
        # The same rays but for the noise of single precision, in azimuths that single precision holds to 5e-7.
        assert np.abs(layer.light - alone.light).mean() < 2e-4 * alone.light.mean()
        np.testing.assert_allclose(layer.transmittance, alone.transmittance, atol=5e-3)
    assert np.abs(shared[0].light - shared[2].light).mean() > 0.05 * shared[0].light.mean()


def test_another_place_is_traced_again(traced):
    view, film = shot(32, 18, 10.0), physics.MATTER_PRESETS["gargantua"]
    baker = physics.LightBaker()
    for each in (view, shot(32, 18, 11.0)):
        physics.drain(baker.steps(physics.LightParameters(each, film)))
    assert [each.camera_position for each in traced] == [view.camera_position, shot(32, 18, 11.0).camera_position]


def test_all_around_is_the_layer_of_a_camera_within_it():
    """Where a perspective camera looks, the layer for all directions has the same light, at its own resolution."""
    look = dataclasses.replace(physics.MATTER_PRESETS["physical"], strands=0.0, smoke=0.0, light_travel=0.0)
    parameters = physics.LightParameters(shot(160, 90, 20.0), look)
    layer = physics.render_matter(parameters)
    around = physics.world_light_parameters(parameters, (1536, 512))
    whole = physics.render_matter(around)
    x, y = np.meshgrid(np.arange(160) + 0.5, np.arange(90) + 0.5)
    looking = parameters.view.camera.directions(x.ravel(), y.ravel()) @ np.array(parameters.view.camera_to_hole).T
    column, row = around.view.camera.pixels(looking @ np.array(around.view.camera_to_hole))
    column, row = column.astype(int) % 1536, np.minimum(row.astype(int), 511)
    found = whole.light[row, column].reshape(90, 160, 3)
    within = (layer.transmittance < 0.1) & (whole.transmittance[row, column].reshape(90, 160) < 0.1)
    assert within.sum() > 500
    # Half a pixel apart at the most: the light changes by some percent per pixel.
    assert np.abs(found - layer.light)[within].sum() < 0.05 * layer.light[within].sum()
