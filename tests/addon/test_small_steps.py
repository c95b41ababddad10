# SPDX-License-Identifier: GPL-3.0-or-later
"""Small steps of a day: adding, deleting, hiding, and the artist's own nodes beside the set-up."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from small_scene import add_hole, compositor

Places = Callable[[], list[tuple[float, ...]]]


@pytest.fixture
def camera_places(addon_module: Callable[[str], ModuleType], tmp_path: Path) -> Places:
    """A function that says where, in the hole's frame, the camera of each baked map is."""
    physics = addon_module("core.physics_api").physics

    def places() -> list[tuple[float, ...]]:
        maps = sorted((tmp_path / "maps").glob("*.exr"))
        return [tuple(physics.read_warp_map_metadata(each)["parameters"]["camera_position"]) for each in maps]

    return places


def test_the_hole_is_added_to_the_active_collection(scene: bpy.types.Scene) -> None:
    active = bpy.context.collection
    if active == scene.collection:
        pytest.fail("The active collection is the scene's own.")
    hole = add_hole(scene)
    assert list(hole.users_collection) == [active]


def test_the_disk_light_goes_with_its_hole(scene: bpy.types.Scene) -> None:
    hole = add_hole(scene)
    before = set(scene.objects) - {hole}
    hole.umbra.disk.texture = scene.umbra.environment_image  # the built-in one takes long to make
    hole.umbra.disk.enabled = hole.umbra.disk.light = True
    light = set(scene.objects) - before - {hole}
    if len(light) != 1:
        pytest.fail("The disk has no light.")
    bpy.ops.object.select_all(action="DESELECT")
    hole.select_set(True)
    bpy.context.view_layer.objects.active = hole
    bpy.ops.object.delete()
    bpy.context.view_layer.update()
    assert set(scene.objects) == before


def test_a_file_output_of_the_raw_render_stays_raw(scene: bpy.types.Scene) -> None:
    """The artist links it beside the set-up; another output and back again must not move that link."""
    add_hole(scene)
    tree = compositor(scene)
    layer = next(node for node in tree.nodes if node.type == "R_LAYERS")
    raw = tree.nodes.new("CompositorNodeOutputFile")
    if bpy.app.version >= (5, 0):
        raw.file_output_items.new("RGBA", "Image")
    tree.links.new(layer.outputs["Image"], raw.inputs[0])
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    bpy.ops.umbra.set_output(output="COMPOSITOR")
    (link,) = raw.inputs[0].links
    assert link.from_node.type == "R_LAYERS"


def hide_with_collection(scene: bpy.types.Scene, setting: str) -> None:
    """Let a new hole move along x, and disable the collection that it is in."""
    hole = add_hole(scene)
    for frame in (1, 3):
        hole.location.x = frame
        hole.keyframe_insert("location", frame=frame)
    home = bpy.data.collections.new("Hidden")
    scene.collection.children.link(home)
    for each in list(hole.users_collection):
        each.objects.unlink(hole)
    home.objects.link(hole)
    setattr(home, setting, True)


def all_differ(places: list[tuple[float, ...]]) -> bool:
    """Whether there are three maps, each of another place."""
    return len(places) == len(set(places)) == 3


def test_baking_with_a_hole_in_a_disabled_collection(scene: bpy.types.Scene, camera_places: Places) -> None:
    """The hole is followed, or refused like one that is disabled itself."""
    hide_with_collection(scene, "hide_viewport")
    reason = ""
    try:
        bpy.ops.umbra.bake_animation()
    except RuntimeError as error:
        reason = str(error)
    assert "viewports" in reason or all_differ(camera_places())
