# SPDX-License-Identifier: GPL-3.0-or-later
"""Files hold the numbers of enum items: those of all enums are what they have always been."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest
from small_scene import add_hole

RECORDED = json.loads((Path(__file__).parents[1] / "data" / "saved_enums.json").read_text(encoding="utf-8"))
OWNERS = ("scene", "hole", "disk")


def owners() -> dict[str, bpy.types.bpy_struct]:
    hole = bpy.context.scene.umbra.active_hole
    return dict(zip(OWNERS, (bpy.context.scene.umbra, hole.umbra, hole.umbra.disk), strict=True))


def storage() -> dict[str, bpy.types.bpy_struct]:
    """Where Blender keeps the numbers, by owner."""
    blocks = (bpy.context.scene, bpy.context.scene.umbra.active_hole)
    if bpy.app.version >= (5, 0):
        blocks = [block.bl_system_properties_get(do_create=True) for block in blocks]
    scene, hole = (block["umbra"] for block in blocks)
    return dict(zip(OWNERS, (scene, hole, hole["disk"]), strict=True))


def enums(kind: bpy.types.Struct) -> Iterator[bpy.types.EnumProperty]:
    return (each for each in kind.properties if each.type == "ENUM" and not each.is_hidden)


def operators() -> Iterator[tuple[str, bpy.types.Struct]]:
    for name in dir(bpy.ops.umbra):
        yield f"umbra.{name}", getattr(bpy.ops.umbra, name).get_rna_type()


@pytest.fixture(autouse=True)
def _hole(scene: bpy.types.Scene) -> None:
    hole = add_hole(scene)
    hole.umbra.spin = 0.5  # so that there is something stored
    hole.umbra.disk.enabled = True


def test_all_enums_are_recorded() -> None:
    found = {f"{owner}.{each.identifier}" for owner, data in owners().items() for each in enums(data.bl_rna)}
    found |= {f"{operator}.{each.identifier}" for operator, kind in operators() for each in enums(kind)}
    assert found == set(RECORDED)


def test_items_have_the_recorded_numbers() -> None:
    """Of an enum whose items are worked out when they are asked for, Blender lists none here."""
    kinds = {owner: data.bl_rna for owner, data in owners().items()} | dict(operators())
    listed = {}
    for owner, kind in kinds.items():
        for each in enums(kind):
            listed[f"{owner}.{each.identifier}"] = {item.identifier: item.value for item in each.enum_items}
    assert {name: items for name, items in listed.items() if items} == {
        name: items for name, items in RECORDED.items() if listed[name]
    }


@pytest.mark.parametrize("name", [each for each in RECORDED if each.partition(".")[0] in OWNERS])
def test_a_stored_number_is_read_as_the_recorded_item(name: str) -> None:
    owner, _, identifier = name.partition(".")
    stored = storage()[owner]
    for item, number in RECORDED[name].items():
        stored[identifier] = number
        assert getattr(owners()[owner], identifier) == item
