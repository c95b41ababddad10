# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of a thick disk, against the thin one's law, its own symmetry, and counting."""

import dataclasses
import math

import numpy as np
import pytest
from test_thin_layer import SPIN, rendered, shot

import physics
from physics.kerr.rays import camera_triad
from physics.light.matter_settings import MATTER_PRESETS, MatterLook
from physics.matter.surface import Surface
from physics.matter.thick_layer import thick_layer_steps
from physics.matter.thick_nodes import HIGHEST, NODES, profile
from physics.matter.thick_paths import LayerPaths
from physics.matter.thin_layer import thin_layer
from physics.numerics.sphere import spherical_triad
from physics.numerics.work import drain
from physics.sampling.view import View

PLAIN = MatterLook(strands=0.0, smoke=0.0, depth=2.0, inner_softness=0.1)


def test_profile_holds_the_vertical_depth():
    zeta = np.linspace(-HIGHEST, HIGHEST, 20_001)
    assert profile(zeta).mean() * 2.0 * HIGHEST == pytest.approx(1.0, rel=1e-3)


def test_samples_at_the_plane_are_the_crossings():
    # Radius, azimuth and Mino time of the middle of a pass through a thin layer, by another solution of the motion.
    parameters = shot(64, 36, 12.0)
    view = View(parameters)
    y, x = (each.ravel() + 0.5 for each in np.mgrid[0:36, 0:64])
    paths = LayerPaths(view.rays(x, y), 1e-4)
    found, _ = view.crossings(x, y, 3, 1e-9, "gauss-legendre")
    compared = 0
    for order in range(2):
        chosen, low, high = paths.passes(order + 1, 3, 2.4, 18.0)
        samples = paths.samples(chosen, low, high, np.array([[0.0], [0.5 - 1e-9], [0.5 + 1e-9], [1.0]]), True)
        ray = paths.live[chosen]
        on_disk = (found.u[order, ray] > 1.0 / 18.0) & (found.u[order, ray] < 1.0 / 2.4)
        compared += on_disk.sum()
        ray = ray[on_disk]
        assert samples.u[1, on_disk] == pytest.approx(found.u[order, ray], rel=1e-4)
        assert samples.time[1, on_disk] == pytest.approx(found.mino_time[order, ray], rel=1e-4)
        passes = physics.trace_disk(
            SPIN, parameters.observer(), *_angles(parameters, x[ray], y[ray]), crossings=order + 1, tolerance=1e-9
        )
        turn = samples.phi[1, on_disk] - passes.phi[:, order]
        assert np.abs(turn - 2.0 * math.pi * np.rint(turn / (2.0 * math.pi))).max() < 2e-3
    assert compared > 500


def _angles(parameters, x, y):
    """theta_rd, phi_rd of pixels in the camera's frame of motion."""
    observer = parameters.observer()
    to_triad = spherical_triad(observer.theta, observer.phi) @ np.array(parameters.camera_to_hole)
    looking = parameters.camera.directions(x, y) @ to_triad.T @ camera_triad(observer).T
    return np.arccos(looking[:, 2]), np.arctan2(looking[:, 1], looking[:, 0])


def test_a_layer_of_no_height_is_the_thin_disk():
    parameters = shot(160, 90, 20.0)
    baked = physics.bake(parameters)
    thin = thin_layer(Surface(PLAIN, parameters.disk, SPIN), baked.disk_passes, View(parameters), 0.0, filtered=False)
    thick = rendered(baked, dataclasses.replace(PLAIN, thickness=0.001))
    whole = np.logical_and.reduce([(each.coverage == 1.0) | (each.coverage == 0.0) for each in baked.disk_passes])
    whole &= baked.disk_passes[0].coverage == 1.0
    error = np.abs(thick.light - thin[..., :3])[whole].sum() / thin[..., :3][whole].sum()
    assert error < 0.01
    assert np.abs(thick.transmittance - thin[..., 3])[whole].mean() < 0.01
    nothing = np.logical_and.reduce([each.coverage == 0.0 for each in baked.disk_passes])
    assert ((1.0 - thick.transmittance)[nothing] > 0.05).mean() < 0.01


def test_light_is_steady_while_the_camera_crosses_the_plane_inside_the_layer():
    look = dataclasses.replace(PLAIN, thickness=0.1)
    total = []
    for degrees in (-0.01, 0.0, 0.01):
        angle = math.radians(degrees)
        place = (12.0 * math.cos(angle), 0.0, 12.0 * math.sin(angle))
        looking = physics.looking_at_hole(place)
        parameters = dataclasses.replace(shot(96, 54, 0.0), camera_position=place, camera_to_hole=looking)
        total.append(float(rendered(physics.bake(parameters), look).light.sum()))
    assert total[1] == pytest.approx(total[0], rel=0.01)
    assert total[1] == pytest.approx(total[2], rel=0.01)


def test_the_torus_is_thick_and_counts_what_it_leaves_out():
    baked = physics.bake(shot(96, 54, 5.0))
    layer = rendered(baked, MATTER_PRESETS["torus"])
    thin = rendered(baked, dataclasses.replace(MATTER_PRESETS["torus"], thickness=0.0))
    assert ((1.0 - layer.transmittance) > 0.5).sum() > 1.3 * ((1.0 - thin.transmittance) > 0.5).sum()
    assert np.isfinite(layer.light).all()
    assert 0 <= layer.counts["unresolved"] < 0.01 * (1.0 - layer.transmittance).size


@pytest.mark.parametrize("degrees", [5.0, 20.0])
def test_rays_between_traced_ones_are_nearly_those_traced(degrees):
    # In the smooth gas all of the difference is the geometry's: half a percent. What is a sharp edge is traced anyway.
    parameters = shot(256, 144, degrees)
    surface, view = Surface(dataclasses.replace(PLAIN, thickness=0.1), parameters.disk, SPIN), View(parameters)
    few, every = (
        drain(thick_layer_steps(surface, view, (256, 144), parameters.disk, SPIN, 0.0, side=side))[0] for side in (4, 1)
    )
    assert np.abs(few - every)[..., :3].sum() < 0.005 * every[..., :3].sum()
    assert np.abs(few - every)[..., 3].mean() < 0.002


def test_few_nodes_see_what_many_do():
    parameters = shot(96, 54, 20.0)
    surface, view = Surface(dataclasses.replace(PLAIN, thickness=0.1), parameters.disk, SPIN), View(parameters)
    few, many = (
        drain(thick_layer_steps(surface, view, (96, 54), parameters.disk, SPIN, 0.0, nodes))[0]
        for nodes in (NODES, 8 * NODES)
    )
    assert np.abs(few - many)[..., :3].sum() < 0.015 * many[..., :3].sum()
