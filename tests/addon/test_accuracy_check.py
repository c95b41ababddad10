# SPDX-License-Identifier: GPL-3.0-or-later
"""The accuracy report by a click: of a good map, of a spoiled one, and where there is nothing to check."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from small_scene import add_hole, shrink

import physics
from physics.accuracy_check.accuracy import check_accuracy


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene)
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


def check(addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene) -> object:
    assert bpy.ops.umbra.check_accuracy() == {"FINISHED"}
    return addon_module("ui.accuracy_check").report_of(scene)[1]


def test_the_report_is_that_of_the_physics(addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene) -> None:
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    report = check(addon_module, scene)
    (path,) = Path(scene.umbra.map_folder).glob("*.exr")
    width = scene.umbra.environment_image.size[0]
    assert report.to_json() == check_accuracy(path, environment_width=width).to_json()
    assert report.worst < 1e-5
    assert report.environment_width == width
    # the panel's lines are these
    lines = [
        line.text for sentence in report.sentences() for line in addon_module("ui.status").wrapped(sentence, "DOT")
    ]
    assert any("arc seconds" in line for line in lines)


def test_a_spoiled_map_is_found(addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene) -> None:
    bpy.ops.umbra.bake_frame()
    (path,) = Path(scene.umbra.map_folder).glob("*.exr")
    good = physics.read_warp_map(path)
    theta = good.theta.copy()
    theta[3, 5] += math.radians(0.1)
    physics.write_warp_map(path, dataclasses.replace(good, theta=theta))
    report = check(addon_module, scene)
    assert report.worst_pixel == (5, 3)
    assert report.worst == pytest.approx(math.radians(0.1), rel=0.01)


def test_disk_and_lens_are_checked_too(addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene) -> None:
    scene.umbra.active_hole.umbra.disk.enabled = scene.umbra.disk_passes = True
    bpy.ops.umbra.bake_frame()
    assert check(addon_module, scene).disk[0].compared > 20
    scene.umbra.active_hole.umbra.disk.enabled = False
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    bpy.ops.umbra.bake_frame()
    assert check(addon_module, scene).impact < 1e-3


def test_without_a_map_it_says_what_to_do(scene: bpy.types.Scene) -> None:
    with pytest.raises(RuntimeError, match="is missing: press Bake This Frame first"):
        bpy.ops.umbra.check_accuracy()
    bpy.ops.umbra.bake_frame()
    scene.umbra.active_hole.umbra.spin = 0.5
    with pytest.raises(RuntimeError, match="is out of date: press Bake This Frame first"):
        bpy.ops.umbra.check_accuracy()
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    scene.umbra.lens_rays = "IN_SHADER"
    with pytest.raises(RuntimeError, match="there is no map to check"):
        bpy.ops.umbra.check_accuracy()
    bpy.data.objects.remove(scene.umbra.active_hole)
    with pytest.raises(RuntimeError, match="contains no black hole"):
        bpy.ops.umbra.check_accuracy()


def test_it_stops_when_asked(addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene) -> None:
    """The operator in a window draws a step at a time from this; closing it ends the work."""
    bpy.ops.umbra.bake_frame()
    steps = addon_module("ui.accuracy_check").check_frame(scene)
    fractions = [next(steps).fraction, next(steps).fraction]
    assert 0.0 <= fractions[0] < fractions[1] < 1.0
    steps.close()
    assert addon_module("ui.accuracy_check").report_of(scene) is None
