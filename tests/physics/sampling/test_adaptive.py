# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive sampling against tracing every pixel, on cameras of every kind."""

import dataclasses

import numpy as np
import pytest
from references import angle_between, unit_vectors
from shots import AWAY, shot

from physics import PanoramaCamera, PerspectiveCamera, bake
from physics.sampling.tiles import Tiles, interpolate, sample, tiles_of

SHOTS = {
    "orbit": shot(400, 225),
    "over the pole": shot(320, 180, inclination=0.0, motion="fido", spin=0.9),
    "inside the photon orbits": shot(
        camera=PanoramaCamera(320, 160), camera_position=(2.2, 0.5, 0.3), motion="fido", spin=0.9
    ),
    "next to the horizon, looking out": shot(
        320, 180, camera_position=(1.6, 0.0, 0.0), camera_to_hole=AWAY, motion="fido", spin=0.9, fov=120.0
    ),
    "fast": shot(320, 180, motion="velocity", velocity=(-0.5, 0.6, 0.3)),
    "extreme spin": shot(320, 180, spin=0.9999, radius=6.0, inclination=90.0),
    "narrow lens": shot(400, 225, fov=5.0, radius=60.0),
    "wide lens": shot(400, 225, fov=160.0, radius=6.0),
    "whole sky": shot(camera=PanoramaCamera(512, 256), radius=5.0),
    "far away": shot(320, 180, radius=5000.0, fov=30.0),
    "very far away": shot(320, 180, radius=2e5, fov=30.0, motion="fido"),
    "a distant hole through a long lens": shot(320, 180, radius=1e4, fov=0.115, motion="fido"),
    "next to nothing": shot(320, 180, radius=2e6, fov=22.0, motion="fido"),
    "tilted, supersampled": shot(160, 90, supersampling=2, hole_to_world=((0, 0, 1), (1, 0, 0), (0, 1, 0))),
    "sides not multiples of a tile": shot(333, 77),
}


@pytest.mark.parametrize("name", SHOTS)
def test_adaptive_sampling_keeps_its_promise(name):
    adaptive = bake(SHOTS[name])
    every = bake(dataclasses.replace(SHOTS[name], interpolation=0.0))
    assert np.array_equal(adaptive.visibility, every.visibility)
    assert np.array_equal(adaptive.visibility > 0.0, every.visibility > 0.0)
    # Never interpolated.
    assert np.array_equal(adaptive.one_plus_z, every.one_plus_z)
    seen = every.visibility > 0.0
    error = angle_between(
        unit_vectors(adaptive.theta.astype(float), adaptive.phi.astype(float)),
        unit_vectors(every.theta.astype(float), every.phi.astype(float)),
    )[seen]
    # The tolerance is 5e-6, which the estimate keeps with room to spare; each map rounds phi to 2.4e-7 rad.
    assert np.quantile(error, 0.999) < 5e-6
    assert error.max() < 1e-4
    assert adaptive.counts["unresolved"] == 0


def test_adaptive_sampling_traces_few_rays_of_a_large_picture():
    adaptive = bake(shot(960, 540, radius=30.0))
    assert adaptive.counts["rays"] < 0.25 * adaptive.counts["sky"]


def test_a_tighter_tolerance_is_kept():
    parameters = shot(256, 144, interpolation=1e-9, tolerance=1e-11)
    adaptive = bake(parameters)
    every = bake(dataclasses.replace(parameters, interpolation=0.0))
    seen = every.visibility > 0.0
    # Nothing but the rounding of phi, at most half of 4.8e-7 in each map, is left.
    error = angle_between(
        unit_vectors(adaptive.theta.astype(float), adaptive.phi.astype(float)),
        unit_vectors(every.theta.astype(float), every.phi.astype(float)),
    )[seen]
    assert error.max() < 1e-6


def smooth_field(x, y):
    """A unit vector field with known values, as smooth as a lensed sky far from the hole."""
    theta, phi = 1.0 + 0.002 * y + 1e-6 * x * y, 0.003 * x + 0.5 * np.sin(0.004 * y)
    return unit_vectors(theta, phi)


def test_interpolation_reproduces_a_smooth_field():
    tiles = Tiles(64, np.array([0, 128]), np.array([64, 0]))
    coefficients, good = sample(tiles, smooth_field, 1e-9)
    assert good.all()
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    values = interpolate(coefficients, 64, turn)
    columns, rows = tiles.pixels()
    exact = smooth_field(columns + 0.5, rows + 0.5) @ turn.T
    # The last sum, of eleven products, is in single precision: some of its roundings of 6e-8, no more than a map's own.
    assert np.moveaxis(values, 0, -1) == pytest.approx(exact, abs=2.5e-7)


def test_a_field_with_a_kink_is_not_taken_for_smooth():
    tiles = Tiles(64, np.array([0]), np.array([0]))
    _, good = sample(tiles, lambda x, y: smooth_field(np.abs(x - 30.0), y), 1e-6)
    assert not good.any()
    _, good = sample(tiles, lambda x, y: np.where(x[:, None] > 60.0, np.nan, smooth_field(x, y)), 1e-6)
    assert not good.any()


def test_tiles_cover_each_pixel_once():
    cover = np.zeros((77, 333), dtype=int)
    tiles = tiles_of(333, 77, 64)
    for part in (tiles, tiles.divided().within(333, 77).divided().within(333, 77)):
        cover[:] = 0
        columns, rows = (np.broadcast_to(each, (len(part), part.side, part.side)) for each in part.pixels())
        inside = (columns < 333) & (rows < 77)
        np.add.at(cover, (rows[inside], columns[inside]), 1)
        assert (cover == 1).all()


def test_camera_behind_the_hole_needs_no_edge():
    camera = PerspectiveCamera(320, 180, 50.0)
    warp_map = bake(shot(camera=camera, camera_position=(12.0, 0.0, 0.0), camera_to_hole=AWAY, motion="fido"))
    assert (warp_map.visibility == 1.0).all()
    assert warp_map.counts["rays"] < 0.2 * 320 * 180
