# SPDX-License-Identifier: GPL-3.0-or-later
"""The declared types of the settings are those of Blender's properties."""

import typing
from collections.abc import Callable
from types import ModuleType

import bpy

KINDS = {"BOOLEAN": bool, "INT": int, "FLOAT": float, "STRING": str, "ENUM": str}


def types_of(group: bpy.types.PropertyGroup) -> dict[str, object]:
    """The types that the values of a group's properties have in Python; groups in it are left out."""
    found: dict[str, object] = {}
    for prop in group.bl_rna.properties:
        if prop.is_hidden:
            continue  # a former name
        if prop.type != "POINTER":
            kind = KINDS[prop.type]
            is_array = getattr(prop, "is_array", False)
            found[prop.identifier] = tuple[(kind,) * prop.array_length] if is_array else kind
        elif hasattr(bpy.types, prop.fixed_type.identifier):
            found[prop.identifier] = getattr(bpy.types, prop.fixed_type.identifier) | None
    return {name: kind for name, kind in found.items() if name not in {"rna_type", "name"}}


def test_declarations_are_those_of_blenders_properties(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    hole = bpy.data.objects.new("Hole", None).umbra
    declared = addon_module("settings.typed")
    hole_types = types_of(hole) | {"disk": declared.DiskSettings}
    assert typing.get_type_hints(declared.HoleSettings) == hole_types
    rows = addon_module("core.physics_api").physics.MATTER_SETTINGS
    row_types = {name: kind for name, kind in types_of(hole.disk).items() if name in rows}
    assert row_types.keys() == rows.keys()
    hidden = {"look_version": int}
    assert typing.get_type_hints(declared.DiskSettings) | row_types == types_of(hole.disk) | hidden
    assert typing.get_type_hints(declared.SceneSettings) == types_of(scene.umbra) | {"map_names": str}  # hidden
