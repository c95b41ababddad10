# SPDX-License-Identifier: GPL-3.0-or-later
"""Small steps of a day: adding, deleting, hiding, and the artist's own nodes beside the set-up."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from small_scene import add_hole, compositor, links_of

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


def test_a_file_output_that_was_there_stays_raw(scene: bpy.types.Scene) -> None:
    """The render feeds a file, directly and through a node, and the picture: only the picture gets the hole."""
    tree = compositor(scene)
    layer = next(node for node in tree.nodes if node.type == "R_LAYERS")
    blur, raw = tree.nodes.new("CompositorNodeBlur"), tree.nodes.new("CompositorNodeOutputFile")
    if bpy.app.version >= (5, 0):
        for name in ("Raw", "Blurred"):
            raw.file_output_items.new("RGBA", name)
    else:
        raw.file_slots.new("Blurred")
    tree.links.new(layer.outputs["Image"], raw.inputs[0])
    tree.links.new(layer.outputs["Image"], blur.inputs["Image"])
    tree.links.new(blur.outputs["Image"], raw.inputs[1])
    before = links_of(tree)
    add_hole(scene)
    added, gone = links_of(tree) - before, before - links_of(tree)
    assert len(gone) == 1  # to the picture
    assert raw.inputs[0].links[0].from_node == layer
    assert blur.inputs["Image"].links[0].from_node == layer
    assert not any(target in {raw.name, blur.name} for _, _, target, _ in added)
    bpy.ops.umbra.remove_compositor()
    assert links_of(tree) == before


# --- what is switched -----------------------------------------------------------------------------


def said(capfd: pytest.CaptureFixture[str]) -> str:
    """What was reported as switched since the last time, of what any machine switches."""
    (line,) = (each for each in capfd.readouterr().out.splitlines() if "Switched: " in each)
    return line.split("Switched: ")[1]


def test_what_is_switched_is_said_in_one_line(
    scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """By Add, by each change of the output, by a script's as well; and what was so already is not mentioned."""
    render = scene.render
    render.use_lock_interface = True
    capfd.readouterr()
    add_hole(scene)
    line = said(capfd)
    assert "Film > Transparent on" in line
    assert "Compositor Precision Full" in line
    assert "Lock Interface" not in line
    assert "View Transform" not in line
    assert 'Depth pass of view layer "ViewLayer" on' in line
    assert ("Use Nodes on" in line) == (bpy.app.version < (5, 0))
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    line = said(capfd)
    assert "Film > Transparent off" in line
    assert 'Camera "Camera" > Type Custom' in line
    assert 'World "Test Sky (sky)"' in line
    scene.umbra.output = "COMPOSITOR"
    line = said(capfd)
    assert 'World "World"' in line
    assert 'Camera "Camera" > Type Perspective' in line
    bpy.ops.umbra.setup_compositor()  # there already
    assert "Switched" not in capfd.readouterr().out
    bpy.ops.umbra.remove_compositor()
    assert "Film > Transparent off" in said(capfd)


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
