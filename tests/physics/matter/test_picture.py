# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's picture on the disk: against sums over texels, the black body's own law, and orbits."""

import dataclasses
import math

import numpy as np
import pytest
from test_thin_layer import SPIN, shot

import physics
from physics.kerr.orbiting_matter import orbital_frequency
from physics.light import black_body
from physics.light.matter_settings import MatterLook
from physics.matter.picture import LARGEST, Picture
from physics.matter.surface import Surface

DISK = physics.Disk(1, 3.0, 12.0)
EVEN = MatterLook(
    falloff=0.0,
    color_variation=0.0,
    doppler_color=0.0,
    doppler_brightness=0.0,
    inner_softness=0.0,
    outer_softness=0.0,
    temperature=5000.0,
)


def shaded(look, picture, radius, phi, g=1.0, time=0.0, footprint=0.0, delay=None):
    """Light and optical depth of places on the disk."""
    radius, phi, g, footprint = (each.astype(np.float32) for each in np.broadcast_arrays(radius, phi, g, footprint))
    surface = Surface(look, DISK, SPIN, picture)
    levels = surface.levels(footprint, footprint)
    light, depth, _ = surface.emission(np.log(radius), phi, np.log(g), time, delay, levels)
    return light[:, :3], depth


def test_an_even_color_comes_back():
    # Premultiplied by an alpha of one half: the color is the disk's, the alpha its density.
    picture = Picture(np.broadcast_to([0.4, 0.2, 0.1, 0.5], (6, 10, 4)), is_color=True)
    radius, phi, g = np.array([4.0, 8.0, 11.0]), np.array([0.3, 2.0, 5.0]), np.array([0.6, 1.0, 1.4])
    look = dataclasses.replace(EVEN, exposure=1.0, depth=3.0)
    for footprint in (0.0, 0.4):
        light, depth = shaded(look, picture, radius, phi, g, time=12.0, footprint=footprint)
        np.testing.assert_allclose(light, np.tile([1.6, 0.8, 0.4], (3, 1)), rtol=2e-3)
        np.testing.assert_allclose(depth, 1.5, rtol=1e-6)
    # Shifted, it changes as the light of the hottest matter does: RGB(g T) / RGB(T) in each channel.
    moving = dataclasses.replace(look, doppler_color=1.0, doppler_brightness=1.0)
    light, _ = shaded(moving, picture, radius, phi, g)
    gain = black_body.rgb(look.temperature * g) / black_body.rgb(look.temperature)
    np.testing.assert_allclose(light, gain * [1.6, 0.8, 0.4], rtol=0.02)


def test_a_ramp_gives_colors_by_radius_and_leaves_the_turbulence():
    """Two rows: the inner half, in ln r, is red, the outer one blue; density and heat are those without it."""
    pixels = np.zeros((2, 4, 4), np.float32)
    pixels[0], pixels[1] = (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)
    ramp = Picture(pixels, is_color=True, is_ramp=True)
    look = dataclasses.replace(EVEN, strands=0.3, smoke=1.0)
    radius, phi = np.array([3.2, 3.2, 11.5, 11.5]), np.array([0.3, 2.0, 0.3, 2.0])
    light, depth = shaded(look, ramp, radius, phi)
    plain, plain_depth = shaded(look, None, radius, phi)
    np.testing.assert_array_equal(depth, plain_depth)
    np.testing.assert_allclose(light[:2, 1:], 0.0, atol=1e-6)
    np.testing.assert_allclose(light[2:, :2], 0.0, atol=1e-6)
    # The light of black bodies of both temperatures has luminances in the ratio of the ramp's lights.
    luminance = plain @ np.array([0.2126, 0.7152, 0.0722])
    assert luminance[0] / luminance[1] == pytest.approx(light[0, 0] / light[1, 0], rel=0.02)
    assert luminance[2] / luminance[3] == pytest.approx(light[2, 2] / light[3, 2], rel=0.02)


def test_brightness_is_density():
    # Where the picture is black there is nothing; light has the black body's color.
    pixels = np.zeros((1, 2, 4), np.float32)
    pixels[0, 1] = 0.5, 1.0, 0.25, 1.0
    picture = Picture(pixels, is_color=False)
    light, depth = shaded(dataclasses.replace(EVEN, depth=2.0), picture, 6.0, np.array([0.5, 1.5]) * math.pi)
    np.testing.assert_allclose(depth, [0.0, 2.0 * (0.5 * 0.2126 + 0.7152 + 0.25 * 0.0722)], rtol=1e-5, atol=1e-6)
    # The table's step of ln T is 1.4e-3, and light goes like T^5 there.
    np.testing.assert_allclose(light[1], black_body.color(5000.0), rtol=4e-3)


def test_a_footprint_sees_the_mean_over_it():
    # Footprints of whole texels of a level, against the sum over the texels that they cover; off the centers, linear
    # in between.
    rows, columns = 32, 128
    pixels = np.random.default_rng(2).random((rows, columns, 4)).astype(np.float32)
    picture = Picture(pixels, is_color=True)
    for down, across in ((1, 1), (1, 8), (4, 1), (8, 32), (32, 128)):
        means = pixels.reshape(rows // down, down, columns // across, across, 4).mean(axis=(1, 3))
        row, column = (each.ravel() for each in np.mgrid[: rows // down, : columns // across])
        place = (row + 0.5) * down / rows
        phi = (column + 0.5) * across / columns * 2.0 * math.pi
        sides = np.full((2, len(row)), [[down / rows], [across / columns * 2.0 * math.pi]])
        found = picture.at(*(each.astype(np.float32) for each in (place, phi, *sides)))
        np.testing.assert_allclose(found, means[row, column], atol=2e-5)
        aside = picture.at(*(each.astype(np.float32) for each in (place, phi + 0.25 * sides[1], *sides)))
        mixed = 0.75 * means[row, column] + 0.25 * means[row, (column + 1) % (columns // across)]
        np.testing.assert_allclose(aside, mixed, atol=2e-4)


def test_a_footprint_beyond_the_edges_sees_the_edge():
    pixels = np.zeros((4, 4, 4), np.float32)
    pixels[0], pixels[3] = 1.0, 2.0
    picture = Picture(pixels, is_color=True)
    place, none = np.float32([-1.0, 0.0, 1.0, 9.0]), np.zeros(4, np.float32)
    np.testing.assert_array_equal(picture.at(place, none, none, none)[:, 0], [1.0, 1.0, 2.0, 2.0])


@pytest.mark.parametrize("size", [(3, 5), (7, 100), (1, 1), (LARGEST[1] + 100, 3)])
def test_pictures_of_any_size_keep_their_light(size):
    # A footprint of all of it: the mean, whatever the sizes in between are.
    pixels = np.random.default_rng(4).random((*size, 4)).astype(np.float32)
    whole = np.float32([1.0]), np.float32([2.0 * math.pi])
    found = Picture(pixels, is_color=True).at(np.float32([0.5]), np.float32([1.0]), *whole)
    np.testing.assert_allclose(found[0], pixels.mean(axis=(0, 1)), rtol=1e-4)


def test_the_picture_turns_as_a_whole_with_the_middle_of_the_disk():
    # Omega at r = 6, the middle of ln r; a place that is seen late is seen where it was.
    omega = float(orbital_frequency(SPIN, np.array([6.0]))[0])
    assert omega == pytest.approx(1.0 / (6.0**1.5 + SPIN))
    columns, start = 720, 3.0
    azimuth = (np.arange(columns) + 0.5) / columns * 2.0 * math.pi
    mark = np.exp(-((azimuth - start) ** 2) / 0.02)
    picture = Picture(np.broadcast_to(mark[None, :, None], (8, columns, 4)), is_color=False)
    phi = np.linspace(0.0, 2.0 * math.pi, 4000, endpoint=False)
    late = np.full(4000, 5.0, np.float32)
    for time, delay, seen in ((0.0, None, 0.0), (40.0, None, 40.0), (40.0, late, 35.0), (1e6, None, 1e6)):
        for radius in (3.5, 6.0, 11.0):
            _, depth = shaded(EVEN, picture, radius, phi, time=time, delay=delay)
            away = phi[np.argmax(depth)] - (start + omega * seen)
            assert abs((away + math.pi) % (2.0 * math.pi) - math.pi) < 0.01


def test_a_layer_shows_the_picture():
    # Half of it is empty: the disk is there on one side only, half an orbit later on the other.
    pixels = np.zeros((4, 64, 4), np.float32)
    pixels[:, :32] = 0.2, 0.4, 1.0, 1.0
    picture = Picture(pixels, is_color=True)
    view = shot(96, 54, 30.0, disk=DISK, supersampling=1)
    passes = physics.DiskPasses.of(physics.bake(view))
    direct = passes.images[0]
    seen = (direct.coverage == 1.0) & (np.abs(direct.phi % math.pi - 0.5 * math.pi) < 1.3)
    first = seen & (direct.phi < math.pi)
    half = math.pi * (6.0**1.5 + SPIN)
    for time, there in ((0.0, first), (half, seen & ~first)):
        layer = physics.render_matter(physics.LightParameters(view, EVEN, time, picture), passes)
        only_direct = np.logical_and.reduce([each.coverage == 0.0 for each in passes.images[1:]], initial=True)
        assert layer.transmittance[there].max() < 0.2
        assert layer.transmittance[seen & ~there & only_direct].min() == pytest.approx(1.0, abs=1e-3)
        light = layer.light[there].mean(axis=0)
        np.testing.assert_allclose(light / light[2], [0.2, 0.4, 1.0], rtol=0.02)
        assert layer.metadata["picture"] == picture.digest


def test_another_picture_or_use_is_another_layer():
    pixels = np.random.default_rng(5).random((4, 8, 4)).astype(np.float32)
    view = shot(16, 9, 30.0, disk=DISK)
    others = [None, Picture(pixels, True), Picture(pixels, False), Picture(pixels.reshape(8, 4, 4), True)]
    hashes = {physics.LightParameters(view, EVEN, 0.0, each).hash for each in others}
    assert len(hashes) == len(others)
    again = physics.LightParameters(view, EVEN, 0.0, Picture(pixels.copy(), True))
    assert again.hash in hashes
    made = physics.render_matter(again).metadata
    assert again.agrees_with(made)
    assert not any(physics.LightParameters(view, EVEN, 0.0, each).agrees_with(made) for each in (None, others[2]))


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((0, 4, 4)),
        np.zeros((4, 0, 4)),
        np.zeros((4, 4, 3)),
        np.zeros((4, 4)),
        np.full((4, 4, 4), np.nan),
        np.full((4, 4, 4), np.inf),
    ],
)
def test_damaged_pictures_are_refused(pixels):
    with pytest.raises(physics.BlackHoleError, match="picture on the disk") as refused:
        Picture(pixels, is_color=True)
    assert refused.value.code == "disk.picture"


def test_negative_light_counts_as_none():
    picture = Picture(np.full((2, 2, 4), -1.0), is_color=True)
    light, depth = shaded(EVEN, picture, 6.0, np.array([1.0]))
    assert not light.any()
    assert not depth.any()
