# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in front of the Cycles Lens: each pixel is numpy's disk over the same render without it.

LIGHT and TYPICAL are those of the disk in front of a sky (`test_disk_rendering`).
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import links_of, render, run_python, shrink

LIGHT = 2e-3
TYPICAL = 2e-5

pytestmark = pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")


@pytest.fixture
def exr(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("_physics").exr


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene with a camera above the disk's plane, a World of one colour, and maps of its own."""
    scene = bpy.context.scene
    shrink(scene, (96, 54))
    scene.umbra.map_folder = str(tmp_path / "maps")
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene.camera.location, scene.camera.rotation_euler = (0.0, -6.0, 1.5), (math.radians(76.0), 0.0, 0.0)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1.0, location=(2.0, 9.0, 0.5), segments=24, ring_count=12)
    return scene


def add_hole(scene: bpy.types.Scene, output: str = "CYCLES_LENS", **disk: object) -> bpy.types.Object:
    hole = bpy.data.objects.new("Hole", None)
    scene.collection.objects.link(hole)
    hole.umbra.is_black_hole = True
    hole.umbra.mass_scale = 0.12
    scene.umbra.active_hole = hole
    hole.umbra.disk.enabled = True
    for name, value in disk.items():
        setattr(hole.umbra.disk, name, value)
    if output == "CYCLES_LENS":
        assert bpy.ops.umbra.set_output(output=output) == {"FINISHED"}
    return hole


def expected_picture(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType], behind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The disk of the current frame over a picture, by numpy in float64, and the light of the disk in it."""
    modules, maps, disk = addon_module("_physics"), addon_module("maps"), addon_module("lens_disk")
    settings = scene.umbra.active_hole.umbra.disk
    frame = addon_module("shot").read_at(scene, scene.frame_current)
    paths = maps.pass_paths(disk.path_of(scene, frame), frame.parameters)
    passes = [modules.physics.read_disk_pass(each) for each in paths]
    time = scene.frame_current * settings.turning_speed * scene.render.fps_base / scene.render.fps
    look, texture = addon_module("disk_properties").look_of(settings), addon_module("disk_images").streaks()
    light, through = modules.disk_render.disk_layers(passes, look, texture, time)
    size = behind.shape[1], behind.shape[0]
    return modules.disk_render.over_sky(behind, light, through), modules.reference_render.resize(light, size)


def assert_same(picture: np.ndarray, expected: np.ndarray, light: np.ndarray) -> None:
    wrong = np.abs(picture - expected)
    brightest = light.max()
    assert (light.max(axis=-1) > 0.01 * brightest).mean() > 0.02, "there should be a disk in the picture"
    assert wrong.max() < LIGHT * max(brightest, 1.0)
    assert np.median(wrong) < TYPICAL * max(brightest, 1.0)


def without_disk(scene: bpy.types.Scene, path: Path, exr: ModuleType) -> np.ndarray:
    """The same frame of the lens, compositing switched off."""
    scene.render.use_compositing = False
    try:
        return render(scene, path, exr)
    finally:
        scene.render.use_compositing = True


@pytest.mark.parametrize(
    "view", ["plain", "in_shader", "panorama", "percentage", "crop", "panorama_crop", "film", "samples", "foreground"]
)
def test_disk_is_in_front_of_what_the_lens_shows(scene, tmp_path, exr, addon_module, view) -> None:
    data, settings = scene.camera.data, scene.render
    data.shift_x, data.shift_y = 0.05, -0.03
    if view.startswith("panorama"):
        data.type = "PANO"
        owner = data if hasattr(data, "panorama_type") else data.cycles
        owner.panorama_type = "EQUIRECTANGULAR"
        owner.longitude_min, owner.longitude_max = -1.0, 1.2
        owner.latitude_min, owner.latitude_max = -0.7, 0.6
    if view == "percentage":
        settings.resolution_percentage = 60
    if view.endswith("crop"):
        settings.use_border, settings.use_crop_to_border = True, True
        settings.border_min_x, settings.border_max_x = 0.17, 0.83
        settings.border_min_y, settings.border_max_y = 0.22, 0.9
    if view == "film":
        settings.film_transparent = True
    if view == "samples":
        scene.umbra.supersampling = "2"
    if view == "foreground":
        bpy.ops.mesh.primitive_cube_add(size=0.25, location=(0.3, -4.0, 1.0))
    add_hole(scene)
    if view == "in_shader":
        scene.umbra.lens_rays = "IN_SHADER"
    behind = without_disk(scene, tmp_path / "without.exr", exr)
    if view == "foreground":
        assert bpy.ops.umbra.set_up_foreground() == {"FINISHED"}
    scene.frame_set(7)
    picture = render(scene, tmp_path / "picture.exr", exr)
    assert picture.shape == behind.shape
    expected, light = expected_picture(scene, addon_module, behind)
    if view == "film":
        assert behind[..., 3].min() == 0.0
    if view != "foreground":
        assert_same(picture, expected, light)
        return
    covered = np.abs(picture - expected).max(axis=-1) > LIGHT * light.max()
    assert 10 < covered.sum() < 500, "the cube covers a part of the disk, and nothing else differs"
    assert (light.max(axis=-1) > 0.1)[covered].sum() > 10
    assert bpy.ops.umbra.remove_foreground() == {"FINISHED"}
    assert_same(render(scene, tmp_path / "after.exr", exr), expected, light)
