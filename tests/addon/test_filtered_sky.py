# SPDX-License-Identifier: GPL-3.0-or-later
"""The filtered sky of the compositor's node group against numpy's reference, which states what the picture is."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from compositor_scene import FloatArray, GroupRenderer, MapArrays

import physics
from physics.reference import reference_render

SIZE = (160, 90)
ROTATIONS = [(0.0, 0.0, 0.0), (0.3, -0.7, 2.0)]


@pytest.fixture
def group(addon_module: Callable[[str], ModuleType], tmp_path: Path) -> GroupRenderer:
    return GroupRenderer(addon_module("nodes.black_hole_group"), tmp_path)


@cache
def beside_the_shadow() -> physics.WarpMap:
    """A map of 13 degrees at the left edge of the shadow of a hole of spin 0.9: 0.08 degrees a pixel."""
    place = (30.0 * math.cos(0.2), 0.0, 30.0 * math.sin(0.2))
    aside = math.radians(-11.0)
    turn = [[math.cos(aside), 0.0, math.sin(aside)], [0.0, 1.0, 0.0], [-math.sin(aside), 0.0, math.cos(aside)]]
    look = np.array(physics.looking_at_hole(place)) @ turn
    camera = physics.PerspectiveCamera.from_field_of_view(*SIZE, math.radians(13.0))
    parameters = physics.WarpMapParameters(
        spin=0.9, camera=camera, camera_position=place, camera_to_hole=tuple(map(tuple, look.tolist())), motion="fido"
    )
    return physics.bake(parameters)


def channels_of(warp_map: physics.WarpMap) -> FloatArray:
    return np.stack([warp_map.theta, warp_map.phi, warp_map.one_plus_z, warp_map.visibility], axis=-1)


@cache
def sky(rows: int = 1024) -> FloatArray:
    """Points of light on a dim ground, as a sky of stars has: what a filter is hardest for."""
    rng = np.random.default_rng(3)
    picture = np.full((rows, 2 * rows, 4), 0.05, np.float32)
    spots = rng.integers(0, rows, 16000), rng.integers(0, 2 * rows, 16000)
    picture[spots] = rng.gamma(0.5, 2.0, (16000, 4))
    picture[..., 3] = 1.0
    return picture


def with_alpha(colors: FloatArray) -> FloatArray:
    return np.concatenate([colors, np.ones_like(colors[..., :1])], axis=-1)


def filtered(group: GroupRenderer, looks: int, rotation: tuple[float, ...], picture: FloatArray) -> FloatArray:
    warp_map = beside_the_shadow()
    return group.render(
        SIZE,
        warp_map=channels_of(warp_map),
        environment=picture,
        levels=with_alpha(physics.sky_levels(picture[..., :3]).atlas()),
        footprint=physics.footprint(warp_map).astype(np.float32),
        looks=looks,
        values={"Environment Rotation": rotation},
    )


def reference(looks: int, rotation: tuple[float, ...], picture: FloatArray) -> FloatArray:
    turned = [float(np.float32(angle)) for angle in rotation]
    return reference_render.render(
        MapArrays.of(channels_of(beside_the_shadow())), picture, rotation=turned, looks=looks
    ).image


@pytest.mark.parametrize("rotation", ROTATIONS)
@pytest.mark.parametrize("looks", [8, 16])
def test_pixels_are_the_references(group: GroupRenderer, looks: int, rotation: tuple[float, ...]) -> None:
    """Within 1e-3 of the larger of pixel and mean light in 99.9 % of pixels.

    Single precision places a look within 3e-4 of a texel, and chooses the other one of two levels in a few pixels.
    """
    picture, expected = filtered(group, looks, rotation, sky()), reference(looks, rotation, sky())
    light, truth = picture[..., :3].mean(axis=-1), expected[..., :3].mean(axis=-1)
    error = np.abs(light - truth) / np.maximum(truth, truth.mean())
    assert np.quantile(error, 0.999) <= 1e-3
    unfiltered = reference(0, rotation, sky())[..., :3].mean(axis=-1)
    assert np.abs(light - unfiltered).mean() > 0.1 * truth.mean()


def test_magnified_pixels_are_those_without_a_filter(group: GroupRenderer) -> None:
    """A sky of 32 rows has texels of 5.6 degrees: only the pixels next to the shadow see more than one."""
    coarse = sky(32)
    picture = filtered(group, 8, ROTATIONS[0], coarse)
    plain = group.render(SIZE, warp_map=channels_of(beside_the_shadow()), environment=coarse)
    major = np.linalg.norm(physics.footprint(beside_the_shadow())[..., :3].astype(np.float64), axis=-1)
    magnified = major < 0.999 * math.pi / 32.0
    assert 0.5 < magnified.mean() < 1.0
    np.testing.assert_array_equal(picture[magnified], plain[magnified])


def test_texels_that_are_no_numbers_do_not_spread(group: GroupRenderer) -> None:
    """One in the corner of the picture, and a few elsewhere: the other pixels do not know of them."""
    broken = sky().copy()
    broken[-1, 0] = broken[-1, -1] = broken[0, 0] = np.nan
    broken[300:302, 700:702, :3] = np.inf
    whole = sky().copy()
    whole[~np.isfinite(broken)] = 0.0
    picture, expected = (filtered(group, 8, ROTATIONS[0], each)[..., :3] for each in (broken, whole))
    finite = np.isfinite(picture).all(axis=-1)
    assert 0.99 < finite.mean() <= 1.0
    assert np.median(np.abs(picture - expected)[finite]) < 1e-6


@pytest.mark.parametrize("missing", ["levels", "footprint"])
def test_without_its_pictures_the_group_does_not_filter(group: GroupRenderer, missing: str) -> None:
    warp_map = beside_the_shadow()
    given: dict[str, Any] = {
        "levels": with_alpha(physics.sky_levels(sky()[..., :3]).atlas()),
        "footprint": physics.footprint(warp_map).astype(np.float32),
    }
    del given[missing]
    picture = group.render(SIZE, warp_map=channels_of(warp_map), environment=sky(), looks=8, **given)
    plain = group.render(SIZE, warp_map=channels_of(warp_map), environment=sky())
    np.testing.assert_array_equal(picture, plain)
