# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties and sockets are what the tables of settings say."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import bpy
import pytest


@pytest.fixture
def physics(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api").physics


def interface(tree: bpy.types.NodeTree) -> dict[str, bpy.types.NodeTreeInterfaceSocket]:
    items = [item for item in tree.interface.items_tree if item.item_type == "SOCKET" and item.in_out == "INPUT"]
    return {item.name: item for item in items}


def check_property(owner: bpy.types.PropertyGroup, name: str, row: object) -> None:
    found = owner.bl_rna.properties[name]
    assert found.name == row.label
    if row.choices:
        items = [(item.identifier, item.name, item.description, item.value) for item in found.enum_items]
        assert items == [(each.identifier, each.label, each.description, each.number) for each in row.choices]
        return
    assert found.description == row.sentence
    assert (found.hard_min, found.hard_max) == pytest.approx((row.low, row.high))
    assert found.subtype == row.subtype
    assert found.is_animatable


def check_socket(item: bpy.types.NodeTreeInterfaceSocket, row: object) -> None:
    assert (item.min_value, item.max_value) == pytest.approx((row.low, row.high))
    assert item.default_value == pytest.approx(row.default)
    assert item.description.startswith(row.sentence)


def test_the_disks_properties_are_the_tables_rows(
    physics: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    disk = bpy.data.objects.new("Hole", None).umbra.disk
    for name, row in physics.MATTER_SETTINGS.items():
        check_property(disk, name, row)
    look = addon_module("settings.disk_properties").look_of(disk)
    default = physics.MATTER_PRESETS["gargantua"]
    assert vars(look) | {"exposure": disk.exposure} == pytest.approx(vars(default))


def test_the_skys_properties_and_sockets_are_the_tables_rows(
    physics: ModuleType, addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene
) -> None:
    groups = [addon_module("nodes.black_hole_group").ensure_group(), addon_module("nodes.world_group").new_group()]
    for name, row in physics.SKY_SETTINGS.items():
        for tree in groups:
            check_socket(interface(tree)[row.socket], row)
        if name != "exposure":
            check_property(scene.umbra, name, row)
            assert getattr(scene.umbra, name) == pytest.approx(row.default)


def test_an_output_keeps_temperatures_that_another_allows(scene: bpy.types.Scene) -> None:
    scene.umbra.sky_temperature = 600.0
    assert bpy.ops.umbra.add_black_hole() == {"FINISHED"}
    tree = scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group
    (group,) = [node for node in tree.nodes if node.get("umbra_role") == "group"]
    group.inputs["Sky Temperature"].default_value = 900_000.0
    scene.umbra.output = "CYCLES_LENS"
    assert scene.umbra.sky_temperature == pytest.approx(900_000.0)
