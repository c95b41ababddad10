# SPDX-License-Identifier: GPL-3.0-or-later
"""A hole that is hidden or deleted is absent, as other objects are: the picture is Blender's own."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, environment_image, refused, render, run_python, world_sky

OUTPUTS = ["COMPOSITOR", "CYCLES_LENS", "WORLD"]


@pytest.fixture
def plain(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> np.ndarray:
    """The picture without the add-on's doing: the World's panorama and half a cube before it."""
    world_sky(scene, environment_image())
    scene.world.cycles.sampling_method = "NONE"  # a table of the sky's light would take longer than the render
    cube = bpy.data.objects["Cube"]
    cube.name = "Block"  # or it would be taken out of the way
    cube.location = (-3.0, 0.0, 0.0)
    return render(scene, tmp_path / "plain.exr", exr)


def same(picture: np.ndarray, plain: np.ndarray) -> None:
    """The group lays the render over a sky, and a render's alpha of 1 is a few units in the last place off."""
    np.testing.assert_allclose(picture, plain, rtol=0, atol=5e-7)


def hide_with_collection(scene: bpy.types.Scene, hole: bpy.types.Object) -> None:
    home = bpy.data.collections.new("Hidden")
    scene.collection.children.link(home)
    for each in list(hole.users_collection):
        each.objects.unlink(hole)
    home.objects.link(hole)
    home.hide_render = True


def exclude(scene: bpy.types.Scene, hole: bpy.types.Object) -> None:
    hide_with_collection(scene, hole)
    bpy.data.collections["Hidden"].hide_render = False
    scene.view_layers[0].layer_collection.children["Hidden"].exclude = True


def delete(_scene: bpy.types.Scene, hole: bpy.types.Object) -> None:
    bpy.ops.object.select_all(action="DESELECT")
    hole.select_set(True)
    bpy.context.view_layer.objects.active = hole
    bpy.ops.object.delete()


WAYS: dict[str, Callable[[bpy.types.Scene, bpy.types.Object], None]] = {
    "hidden": lambda _scene, hole: setattr(hole, "hide_render", True),
    "collection": hide_with_collection,
    "excluded": exclude,
    "deleted": delete,
    "removed": lambda _scene, hole: bpy.data.objects.remove(hole),
}


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("way", WAYS)
def test_an_absent_hole(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, plain: np.ndarray, output: str, way: str
) -> None:
    hole = add_hole(scene, sky=False)
    bpy.ops.umbra.set_output(output=output)
    if way == "hidden":
        bent = render(scene, tmp_path / "bent.exr", exr)
        assert np.abs(bent - plain).max() > 0.1
    before = scene.render.film_transparent, scene.camera.data.type, scene.world
    WAYS[way](scene, hole)
    same(render(scene, tmp_path / "absent.exr", exr), plain)
    assert (scene.render.film_transparent, scene.camera.data.type, scene.world) == before
    if way == "hidden":
        hole.hide_render = False
        np.testing.assert_array_equal(render(scene, tmp_path / "again.exr", exr), bent)


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("disk", [False, True])
def test_an_animated_visibility(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, plain: np.ndarray, output: str, disk: bool
) -> None:
    """Hidden in frame 2 alone; maps are baked for the others alone."""
    hole = add_hole(scene, sky=False)
    if disk and output != "WORLD":
        hole.umbra.disk.texture = environment_image()
        hole.umbra.disk.enabled = True
    bpy.ops.umbra.set_output(output=output)
    for frame in (1, 2, 3):
        hole.hide_render = frame == 2
        hole.keyframe_insert("hide_render", frame=frame)
    scene.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    one, two, three = (exr.read_exr(tmp_path / f"frame_{frame:04d}.exr")[0] for frame in (1, 2, 3))
    same(two, plain)
    assert np.abs(one - plain).max() > 0.1
    if not disk:  # which turns
        np.testing.assert_allclose(one, three, atol=1e-5)
    assert not list((tmp_path / "maps").glob("*_0002*.exr"))


def test_the_disk_and_its_light_are_hidden_too(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, plain: np.ndarray
) -> None:
    hole = add_hole(scene, sky=False)
    hole.umbra.disk.texture = environment_image()
    hole.umbra.disk.enabled = hole.umbra.disk.light = True
    hole.hide_render = True
    same(render(scene, tmp_path / "absent.exr", exr), plain)


def test_an_absent_hole_in_the_background(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """The process ends well; and a hole of several, none of them chosen, is no absent one."""
    add_hole(scene)
    scene.umbra.active_hole.hide_render = True
    scene.render.filepath = str(tmp_path / "picture.exr")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    script = f"""
import os
bpy.ops.wm.open_mainfile(filepath={str(tmp_path / "shot.blend")!r})
{{change}}
bpy.ops.render.render(write_still=True)
os._exit(0)
"""
    result = run_python(script.format(change=""))
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "picture.exr").is_file()
    several = (
        "from small_scene import add_hole; add_hole(bpy.context.scene); bpy.context.scene.umbra.active_hole = None"
    )
    assert refused(run_python(script.format(change=several)))


def test_the_panel_says_so(scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]) -> None:
    hole = add_hole(scene)
    hole.hide_render = True
    lines = addon_module("ui.status").lines(bpy.context)
    assert "hidden" in " ".join(line.text for line in lines)
