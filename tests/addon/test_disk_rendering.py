# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in rendered pictures: each pixel is what numpy's reference says, at any frame, size and look.

The group works in float32, and takes the flux from a table; LIGHT is the share of the disk's light by which it may
differ. Streaks are the steepest part: a texture coordinate is off by 1e-6 of a turn, which is 1/500 texel, of which
neighbours differ by up to a tenth.
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, environment_pixels, render, run_python, shrink

LIGHT = 2e-3
TYPICAL = 2e-5


@pytest.fixture
def modules(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("_physics")


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene with maps of its own."""
    scene = bpy.context.scene
    shrink(scene, (96, 54))
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


def hole_with_disk(scene: bpy.types.Scene, **settings: object) -> bpy.types.Object:
    hole = add_hole(scene)
    hole.umbra.disk.enabled = True
    for name, value in settings.items():
        setattr(hole.umbra.disk, name, value)
    return hole


def expected_picture(
    scene: bpy.types.Scene,
    addon_module: Callable[[str], ModuleType],
    tmp_path: Path,
    size: tuple[int, int],
    texture: np.ndarray | None = None,
    frame: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The picture by numpy in float64, and the light of the disk in it."""
    modules, maps, shot = addon_module("_physics"), addon_module("maps"), addon_module("shot")
    settings = scene.umbra.active_hole.umbra.disk
    frame = scene.frame_current if frame is None else frame
    parameters = shot.read_at(scene, frame).parameters
    path = maps.map_path(scene, scene.umbra.active_hole.name, parameters.map_size, frame)
    physics = modules.physics
    passes = [physics.read_disk_pass(each) for each in maps.pass_paths(path, parameters)]
    look = addon_module("disk_properties").look_of(settings)
    texture = addon_module("disk_images").streaks() if texture is None else texture
    time = frame * settings.turning_speed * scene.render.fps_base / scene.render.fps
    light, through = modules.disk_render.disk_layers(passes, look, texture, time)
    sky = modules.reference_render.render(physics.read_warp_map(path), environment_pixels(), output_size=size).image
    picture = modules.disk_render.over_sky(sky, light, through)
    return picture, modules.reference_render.resize(light, size)


def assert_same(picture: np.ndarray, expected: np.ndarray, light: np.ndarray) -> None:
    wrong = np.abs(picture[..., :3] - expected[..., :3])
    brightest = light.max()
    assert brightest > 0.1
    assert (light.max(axis=-1) > 0.01 * brightest).mean() > 0.02, "there should be a disk in the picture"
    assert wrong.max() < LIGHT * max(brightest, 1.0)
    assert np.median(wrong) < TYPICAL * max(brightest, 1.0)


@pytest.mark.parametrize("percentage", [100, 50])
def test_default_disk_is_what_numpy_makes(
    scene: bpy.types.Scene,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    modules: ModuleType,
    percentage: int,
) -> None:
    hole_with_disk(scene)
    scene.render.resolution_percentage = percentage
    scene.frame_set(7)
    picture = render(scene, tmp_path / "picture.exr", modules.exr)
    size = (96 * percentage // 100, 54 * percentage // 100)
    expected, light = expected_picture(scene, addon_module, tmp_path, size)
    assert picture.shape[:2] == size[::-1]
    assert_same(picture, expected, light)
