# SPDX-License-Identifier: GPL-3.0-or-later
"""The group as a data-block: its sockets, its stamp, and repair without loss of what the artist set."""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from compositor_scene import (
    GroupRenderer,
    MapArrays,
    compositor_tree,
    empty_scene,
    full_sphere_map,
    image_node,
    render_pixels,
    smooth_environment,
    write_exr,
)

from physics.reference import reference_render

SIZE = (32, 18)
VALUES = {"Environment Strength": 1.75, "Exposure": -0.5, "Redshift Color": 0.25, "Sky Temperature": 5000.0}
ROTATION = (0.1, 0.2, 0.3)


@pytest.fixture
def node_group(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("nodes.black_hole_group")


def interface_sockets(tree: bpy.types.NodeTree, in_out: str) -> list[bpy.types.NodeTreeInterfaceSocket]:
    return [item for item in tree.interface.items_tree if item.item_type == "SOCKET" and item.in_out == in_out]


def test_sockets_are_complete_described_and_in_order(node_group: ModuleType) -> None:
    tree = node_group.ensure_group()
    assert tree.name == "Umbra Black Hole"
    inputs, outputs = interface_sockets(tree, "INPUT"), interface_sockets(tree, "OUTPUT")
    assert [item.name for item in inputs] == [
        "Render",
        "Environment",
        "Warp Map",
        "Environment Rotation",
        "Environment Strength",
        "Exposure",
        "Redshift Color",
        "Redshift Brightness",
        "Sky Temperature",
        "Disk",
        "Disk Exposure",
        "Disk Tint",
        "Disk Opacity",
        "Depth",
        "Hole Depth",
        "Hide Behind",
        "Sky Levels",
        "Footprint",
        "Stars",
        "Star Brightness",
    ]
    assert [item.name for item in outputs] == ["Image", "Sky", "Shadow", "Redshift"]
    assert all(len(item.description) > 20 for item in inputs + outputs)
    by_name = {item.name: item for item in inputs}
    assert by_name["Environment Rotation"].subtype == "EULER"
    assert by_name["Sky Temperature"].subtype == "COLOR_TEMPERATURE"
    for name in ("Redshift Color", "Redshift Brightness"):
        item = by_name[name]
        assert (item.subtype, item.min_value, item.max_value, item.default_value) == ("FACTOR", 0.0, 1.0, 1.0)


def test_built_once_and_found_again(node_group: ModuleType) -> None:
    tree = node_group.ensure_group()
    assert node_group.is_current(tree)
    nodes = [node.as_pointer() for node in tree.nodes]
    assert node_group.ensure_group() == tree
    assert [node.as_pointer() for node in tree.nodes] == nodes
    tree.name = "Renamed by the artist"
    assert node_group.ensure_group() == tree
    assert len([each for each in bpy.data.node_groups if node_group.is_group(each)]) == 1


def test_every_node_lies_in_a_labeled_frame_apart_from_the_ends(node_group: ModuleType) -> None:
    tree = node_group.ensure_group()
    ends = {"NodeGroupInput", "NodeGroupOutput", "NodeFrame"}
    assert all(node.parent is not None for node in tree.nodes if node.bl_idname not in ends)
    assert all(node.label for node in tree.nodes if node.bl_idname == "NodeFrame")
    assert all(link.is_valid for link in tree.links)


def test_a_group_of_the_same_name_but_not_ours_is_left_alone(node_group: ModuleType) -> None:
    other = bpy.data.node_groups.new(node_group.GROUP_NAME, "CompositorNodeTree")
    tree = node_group.ensure_group()
    assert tree != other
    assert len(other.nodes) == 0


def remove_nodes(tree: bpy.types.NodeTree) -> None:
    for node in list(tree.nodes)[::3]:
        tree.nodes.remove(node)


def change_a_value(tree: bpy.types.NodeTree) -> None:
    node = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeMath" and not node.inputs[1].is_linked)
    node.inputs[1].default_value += 1.0


def mute_a_node(tree: bpy.types.NodeTree) -> None:
    next(node for node in tree.nodes if node.bl_idname == "ShaderNodeMath").mute = True


def change_an_operation(tree: bpy.types.NodeTree) -> None:
    next(node for node in tree.nodes if node.bl_idname == "ShaderNodeMath").operation = "SQRT"


def cut_a_link(tree: bpy.types.NodeTree) -> None:
    tree.links.remove(tree.links[10])


def older_version(tree: bpy.types.NodeTree) -> None:
    """A file of an earlier version: other nodes, a socket that is gone today, one that was not there yet."""
    tree["umbra_version"] = 0
    tree.nodes.clear()
    interface = tree.interface
    former = interface.new_socket("Former Control", in_out="INPUT", socket_type="NodeSocketFloat")
    interface.move(former, 4)
    interface.remove(next(item for item in interface_sockets(tree, "INPUT") if item.name == "Redshift Brightness"))
    interface.move(interface_sockets(tree, "INPUT")[0], 6)


def socket_of_another_type(tree: bpy.types.NodeTree) -> None:
    item = next(item for item in interface_sockets(tree, "INPUT") if item.name == "Redshift Brightness")
    item.socket_type = "NodeSocketColor"


def another_blender(tree: bpy.types.NodeTree) -> None:
    tree["umbra_built_with_blender"] = "4.4"


DAMAGES = [
    remove_nodes,
    change_a_value,
    mute_a_node,
    change_an_operation,
    cut_a_link,
    older_version,
    socket_of_another_type,
    another_blender,
]


@pytest.mark.parametrize("damage", DAMAGES)
def test_repair_keeps_values_links_and_picture(
    node_group: ModuleType, tmp_path: Path, damage: Callable[[bpy.types.NodeTree], None]
) -> None:
    scene = empty_scene(*SIZE)
    tree, target = compositor_tree(scene)
    node = node_group.add_group_node(tree)
    warp_map, sky = full_sphere_map(*SIZE), smooth_environment(64, 32)
    for name, pixels in (("Warp Map", warp_map), ("Environment", sky)):
        source = image_node(tree, write_exr(tmp_path / f"{name}.exr", pixels))
        tree.links.new(source.outputs["Image"], node.inputs[name])
    tree.links.new(node.outputs["Image"], target)
    for name, value in VALUES.items():
        node.inputs[name].default_value = value
    node.inputs["Environment Rotation"].default_value = ROTATION

    group = node_group.ensure_group()
    damage(group)
    assert not node_group.is_current(group)
    assert node_group.ensure_group() == group
    assert node_group.is_current(group)

    assert node.node_tree == group
    for name, value in VALUES.items():
        assert node.inputs[name].default_value == pytest.approx(value, rel=1e-6), name
    assert tuple(node.inputs["Environment Rotation"].default_value) == pytest.approx(ROTATION)
    assert node.inputs["Redshift Brightness"].default_value == 1.0
    picture = render_pixels(scene, tmp_path / "picture.exr")
    expected = reference_render.render(
        MapArrays.of(warp_map),
        sky,
        rotation=[float(np.float32(angle)) for angle in ROTATION],
        strength=VALUES["Environment Strength"],
        exposure=VALUES["Exposure"],
        color_amount=VALUES["Redshift Color"],
        temperature=VALUES["Sky Temperature"],
    ).image
    np.testing.assert_allclose(picture, expected, rtol=0.0, atol=2e-6)


def test_group_saved_and_loaded_is_still_current(node_group: ModuleType, tmp_path: Path) -> None:
    tree, _ = compositor_tree(empty_scene(*SIZE))
    node_group.add_group_node(tree)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    group = node_group.find_group()
    assert group is not None
    assert node_group.is_current(group)


def test_group_nodes_are_found_in_a_tree(node_group: ModuleType) -> None:
    tree, _ = compositor_tree(empty_scene(*SIZE))
    assert node_group.group_nodes(tree) == []
    node = node_group.add_group_node(tree)
    assert node_group.group_nodes(tree) == [node]
    assert {socket.name for socket in node.inputs} >= {spec.name for spec in node_group.INPUTS}
    assert {socket.name for socket in node.outputs} >= {spec.name for spec in node_group.OUTPUTS}


def test_extreme_rotations_are_reduced(node_group: ModuleType, tmp_path: Path) -> None:
    # An animated sky may turn many times; the angle itself is only known to 4e-6 at 20 turns.
    renderer = GroupRenderer(node_group, tmp_path)
    warp_map, sky = full_sphere_map(*SIZE), smooth_environment(512, 256)
    angle = 40.0 * math.pi + 0.5
    picture = renderer.render(
        SIZE, warp_map=warp_map, environment=sky, values={"Environment Rotation": (0.0, 0.0, angle)}
    )
    exact = float(np.float32(angle))
    expected = reference_render.render(MapArrays.of(warp_map), sky, rotation=(0.0, 0.0, exact)).image
    np.testing.assert_allclose(picture, expected, rtol=0.0, atol=2e-6)
