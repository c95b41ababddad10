# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that version 0.1 saved: values, keyframes, strips, drivers and sockets of its files; and scripts with them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from saved_scene import FOLLOWER, IN_STRIPS, LENS_SCENE, UNUSED, WORLD_SCENE, build, compositor_of
from small_scene import add_hole, render

from physics.images import exr

SAVED = Path(__file__).resolve().parents[1] / "data" / "saved_files"
FILES = [SAVED / "animated_4.5.blend"]
if bpy.app.version >= (5, 0):
    FILES.append(SAVED / "animated_5.2.blend")
LARGEST_FILE = 400_000

REDSHIFT, DOPPLER, VARIATION = "umbra.redshift_color", "umbra.disk.doppler_color", "umbra.disk.color_variation"


@pytest.fixture(params=FILES, ids=lambda path: path.stem)
def opened(request: pytest.FixtureRequest, tmp_path: Path) -> bpy.types.Scene:
    """The first scene of a file of version 0.1, with maps of its own folder."""
    bpy.ops.wm.open_mainfile(filepath=str(request.param))
    for scene in bpy.data.scenes:
        scene.umbra.map_folder = str(tmp_path / "maps")
    return bpy.context.scene


def curves_of(action: bpy.types.Action) -> list[bpy.types.FCurve]:
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags for curve in bag.fcurves]


def targets_of(animation: bpy.types.AnimData) -> dict[tuple[str, int], list[str]]:
    return {
        (curve.data_path, curve.array_index): [each.targets[0].data_path for each in curve.driver.variables]
        for curve in animation.drivers
    }


def node_of(tree: bpy.types.NodeTree, role: str) -> bpy.types.Node:
    (node,) = [each for each in tree.nodes if each.get("umbra_role") == role]
    return node


def world_node(scene: bpy.types.Scene) -> bpy.types.Node:
    (node,) = [each for each in scene.world.node_tree.nodes if "Lensed Light" in each.inputs]
    return node


def evaluated(block: bpy.types.ID) -> bpy.types.ID:
    return block.evaluated_get(bpy.context.evaluated_depsgraph_get())


def texts() -> str:
    """Everything in the file that is a name or a path."""
    found = [str(each.name) for each in bpy.data.images]
    trees = [*bpy.data.node_groups, *(world.node_tree for world in bpy.data.worlds if world.node_tree)]
    if bpy.app.version < (5, 0):
        trees.extend(scene.node_tree for scene in bpy.data.scenes if scene.node_tree)
    for tree in trees:
        for node in tree.nodes:
            found.extend((node.name, node.label, str(node.get("umbra_role"))))
            found.extend(socket.name for socket in (*node.inputs, *node.outputs))
    for action in bpy.data.actions:
        found.extend(curve.data_path for curve in curves_of(action))
    for block in (*bpy.data.scenes, *bpy.data.objects, *trees):
        if block.animation_data is not None:
            found.append(str(targets_of(block.animation_data)))
        found.append(str({key: block[key] for key in block.keys() if key != "umbra" and key.startswith("umbra")}))  # noqa: SIM118
    for scene in bpy.data.scenes:
        found.append(str(scene["umbra_lens_before"].to_dict()) if "umbra_lens_before" in scene else "")
        found.append(str(list(scene.camera.data.cycles_custom.keys())))
    return "\n".join(found)


# --- files ----------------------------------------------------------------------------------------


def test_nothing_keeps_a_former_name(opened: bpy.types.Scene, tmp_path: Path) -> None:
    assert "olour" not in texts()
    assert "Redshift Color" in texts()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "again.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "again.blend"))
    assert "olour" not in texts()
    storage = opened_storage(bpy.context.scene)
    assert "redshift_color" in storage
    assert "redshift_colour" not in storage


def opened_storage(block: bpy.types.ID) -> bpy.types.bpy_struct:
    """Where Blender keeps the values of `block.umbra`."""
    return (block if bpy.app.version < (5, 0) else block.bl_system_properties_get())["umbra"]


def test_files_are_small() -> None:
    assert all(path.stat().st_size < LARGEST_FILE for path in SAVED.glob("animated_*.blend"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_files_really_have_former_names(addon_module: Callable[[str], ModuleType], path: Path) -> None:
    """Without this the test above might test nothing: what the file itself holds, without its handlers."""
    handlers, saved_names = addon_module("render.handlers"), addon_module("settings.saved_names")
    handlers.unregister()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path))
        found = texts()
    finally:
        handlers.register()
    former = [*saved_names.SOCKETS, *saved_names.ROLES, *saved_names.LABELS, *saved_names.SCENE, *saved_names.DISK]
    assert not [name for name in former if name not in found]
    assert "redshift_colour" in opened_storage(bpy.context.scene)


def test_values_are_kept(opened: bpy.types.Scene) -> None:
    hole = opened.umbra.active_hole
    opened.frame_set(1)
    assert opened.umbra.redshift_color == pytest.approx(0.25)
    assert hole.umbra.disk.doppler_color == pytest.approx(0.25)
    assert hole.umbra.disk.texture_use == "COLOR"
    for name in (WORLD_SCENE, LENS_SCENE):
        assert bpy.data.scenes[name].umbra.redshift_color == pytest.approx(0.75)


def test_keyframes_move_the_settings(opened: bpy.types.Scene) -> None:
    hole, other = opened.umbra.active_hole, bpy.data.objects[IN_STRIPS]
    assert [curve.data_path for curve in curves_of(opened.animation_data.action)] == [REDSHIFT]
    assert [curve.data_path for curve in curves_of(hole.animation_data.action)] == [DOPPLER]
    assert [curve.data_path for curve in curves_of(bpy.data.actions[UNUSED])] == [DOPPLER]
    (track,) = other.animation_data.nla_tracks
    assert [curve.data_path for curve in curves_of(track.strips[0].action)] == [DOPPLER]
    for frame, value in ((1, 0.25), (2, 0.5), (3, 0.75)):
        opened.frame_set(frame)
        assert opened.umbra.redshift_color == pytest.approx(value)
        assert hole.umbra.disk.doppler_color == pytest.approx(value)
        assert other.umbra.disk.doppler_color == pytest.approx(value)


def test_drivers_follow_settings_and_sockets(opened: bpy.types.Scene) -> None:
    hole = opened.umbra.active_hole
    group = node_of(compositor_of(opened), "group")
    assert targets_of(hole.animation_data) == {(VARIATION, 0): [REDSHIFT]}
    socket = group.inputs["Redshift Color"].path_from_id("default_value")
    assert targets_of(compositor_of(opened).animation_data)[socket, 0] == [REDSHIFT]
    opened.frame_set(2)
    assert hole.umbra.disk.color_variation == pytest.approx(0.5)
    assert group.inputs["Redshift Color"].default_value == pytest.approx(0.5)
    other = bpy.data.scenes[WORLD_SCENE]
    bpy.context.window.scene = other
    node, follower = world_node(other), bpy.data.objects[FOLLOWER]
    (by_name,) = targets_of(follower.animation_data)["location", 1]
    assert by_name == f'node_tree.nodes["{node.name}"].inputs["Redshift Color"].default_value'
    assert all(curve.driver.is_valid for curve in follower.animation_data.drivers)
    other.frame_set(2)
    moved = evaluated(other.world).node_tree.nodes[node.name]
    assert moved.inputs["Redshift Color"].default_value == pytest.approx(0.5)
    assert tuple(evaluated(follower).location) == pytest.approx((0.5, 0.5, 0.5))


def test_the_layer_takes_the_place_of_what_drew_the_disk(opened: bpy.types.Scene) -> None:
    tree = compositor_of(opened)
    (link,) = node_of(tree, "group").inputs["Disk"].links
    assert link.from_node == node_of(tree, "disk_layer")
    roles = [node.get("umbra_role", "") for node in tree.nodes]
    assert not [each for each in roles if each == "disk" or each.startswith(("disk_pass", "disk_colors"))]
    assert not [image.name for image in bpy.data.images if "Disk Color" in image.name]
    assert not [group.name for group in bpy.data.node_groups if group.name.startswith("Umbra Disk ")] or (
        [group.name for group in bpy.data.node_groups if group.name.startswith("Umbra Disk")] == ["Umbra Disk Light"]
    )


def test_the_disks_former_settings_are_what_comes_nearest(opened: bpy.types.Scene) -> None:
    """Streaks of 0.25 were saved, and clumps of 0.4, the default: the most streaked preset had 0.85."""
    disk = opened.umbra.active_hole.umbra.disk
    assert disk.temperature == pytest.approx(7000.0)
    assert disk.smoke == pytest.approx(0.4 / 0.85)
    assert disk.strands == pytest.approx(0.12 * 0.4 / 0.85)


def test_exposures_are_counted_as_today(scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]) -> None:
    hole = add_hole(scene)
    disk = hole.umbra.disk
    disk.exposure = 2.0
    disk.keyframe_insert("exposure", frame=1)
    former = addon_module("settings.former_disks")
    former.bring_up_to_date()
    assert disk.exposure == pytest.approx(2.0), "it is of this version"
    disk.look_version = 0
    for _ in range(2):
        former.bring_up_to_date()
        assert disk.exposure == pytest.approx(-0.5)
        (curve,) = curves_of(hole.animation_data.action)
        assert curve.keyframe_points[0].co.y == pytest.approx(-0.5)


def test_all_groups_are_of_this_version(opened: bpy.types.Scene, addon_module: Callable[[str], ModuleType]) -> None:
    black_hole, world = addon_module("nodes.black_hole_group"), addon_module("nodes.world_group")
    assert black_hole.is_current(node_of(compositor_of(opened), "group").node_tree)
    assert world.is_current(world_node(bpy.data.scenes[WORLD_SCENE]).node_tree)


def test_the_other_outputs_work_and_give_back_what_they_remember(opened: bpy.types.Scene) -> None:
    lens = bpy.data.scenes[LENS_SCENE]
    assert lens.camera.data.type == "CUSTOM"
    assert lens.camera.data.cycles_custom["redshift_color"] == pytest.approx(0.75)
    assert "Redshift Color" in lens["umbra_lens_before"]["look"]
    lens.umbra.output = "COMPOSITOR"
    assert lens.umbra.output == "COMPOSITOR"
    group = node_of(compositor_of(lens), "group")
    assert group.inputs["Exposure"].default_value == pytest.approx(0.5)
    assert group.inputs["Redshift Color"].default_value == pytest.approx(0.75)


def test_it_renders_as_the_same_scene_does_that_is_new(opened: bpy.types.Scene, tmp_path: Path) -> None:
    opened.frame_set(2)
    old = render(opened, tmp_path / "old.exr", exr)
    scene = build(disk=True, animated=True)
    scene.umbra.map_folder = str(tmp_path / "new maps")
    scene.umbra.sky_filter = "OFF"  # as in files from before there was one
    scene.frame_set(2)
    new = render(scene, tmp_path / "new.exr", exr)
    np.testing.assert_allclose(old[..., :3], new[..., :3], rtol=1e-5, atol=1e-5)
    assert np.ptp(old[..., 0]) > 0.1


@pytest.mark.parametrize("link", [False, True], ids=["appended", "linked"])
def test_data_of_another_file_is_brought_up_to_date(link: bool) -> None:
    with bpy.data.libraries.load(str(FILES[-1]), link=link) as (source, target):
        target.objects = [name for name in source.objects if name == IN_STRIPS]
    (hole,) = target.objects
    assert hole.umbra.disk.doppler_color == pytest.approx(0.25)  # as animated at the frame that was saved
    (track,) = hole.animation_data.nla_tracks
    assert [curve.data_path for curve in curves_of(track.strips[0].action)] == [DOPPLER]


def test_inputs_of_the_artists_own_groups_keep_their_names(
    opened: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    own = bpy.data.node_groups.new("Artist's Group", "ShaderNodeTree")
    own.interface.new_socket("Redshift Colour", in_out="INPUT", socket_type="NodeSocketFloat")
    tree = bpy.data.scenes[WORLD_SCENE].world.node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree, node.name = own, "Artist's Node"
    follower = bpy.data.objects[FOLLOWER]
    target = follower.animation_data.drivers.find("location", index=1).driver.variables[0].targets[0]
    target.data_path = """node_tree.nodes["Artist's Node"].inputs["Redshift Colour"].default_value"""
    addon_module("settings.saved_names").migrate()
    assert target.data_path == """node_tree.nodes["Artist's Node"].inputs["Redshift Colour"].default_value"""
    assert node.inputs[0].name == "Redshift Colour"


# --- scripts --------------------------------------------------------------------------------------


def test_scripts_can_use_former_names(scene: bpy.types.Scene) -> None:
    disk = add_hole(scene).umbra.disk
    disk.enabled = True
    for settings, former, name in (
        (scene.umbra, "redshift_colour", "redshift_color"),
        (disk, "doppler_colour", "doppler_color"),
        (disk, "colour_variation", "color_variation"),
    ):
        setattr(settings, former, 0.375)
        assert getattr(settings, name) == 0.375
        setattr(settings, name, 0.625)
        assert getattr(settings, former) == 0.625
        setattr(settings, former, 7.0)
        assert getattr(settings, name) == 1.0
        property_ = settings.bl_rna.properties[former]
        assert property_.is_hidden
        assert property_.is_skip_save
    disk.texture_use = "COLOUR"
    assert disk.texture_use == "COLOR"
    with pytest.raises(TypeError):
        disk.texture_use = "COULEUR"


def test_a_change_by_a_former_name_is_carried_on(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    hole = add_hole(scene)
    hole.umbra.disk.enabled = True
    hole.umbra.disk.doppler_colour = 0.375
    light = addon_module("outputs.frames").read_at(scene, 1).light
    assert light.look.doppler_color == 0.375


def test_keyframes_by_former_names_work_and_are_renamed(scene: bpy.types.Scene, tmp_path: Path) -> None:
    hole = add_hole(scene)
    disk = hole.umbra.disk
    disk.enabled = True
    for frame, value in ((1, 0.0), (3, 1.0)):
        disk.doppler_colour = value
        assert disk.keyframe_insert("doppler_colour", frame=frame)
    scene.frame_set(2)
    assert disk.doppler_color == pytest.approx(0.5)
    render(scene, tmp_path / "picture.exr", exr)
    assert [curve.data_path for curve in curves_of(hole.animation_data.action)] == [DOPPLER]
