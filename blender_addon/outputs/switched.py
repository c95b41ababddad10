# SPDX-License-Identifier: GPL-3.0-or-later
"""What the settings of a scene were changed to by a set-up, found by comparing them before and after."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

# The name of a setting and its value, as the interface shows them, by where the setting is.
State = dict[str, tuple[str, str]]

# Where the names that properties have by themselves are not those of the interface.
_NAMES = {
    "render.engine": "Render Engine",
    "render.film_transparent": "Film > Transparent",
    "view_settings.view_transform": "View Transform",
    "display_settings.display_device": "Display Device",
}
# Of the add-on's own settings, those that a set-up may change and the artist has not just chosen.
_OWN = ("environment_source", "live_preview")
_KINDS = frozenset({"BOOLEAN", "ENUM", "INT", "FLOAT"})


def state(scene: bpy.types.Scene) -> State:
    """Return all settings of a scene that a set-up could have a part in."""
    found: State = {}
    for part in ("render", "view_settings", "display_settings", "cycles", "eevee"):
        owner = getattr(scene, part, None)
        if owner is not None:
            found |= _values(part, owner, (each.identifier for each in owner.bl_rna.properties))
    found |= _values("umbra", scene.umbra, _OWN)
    if hasattr(scene, "node_tree"):  # before 5.0; after that the setting is always on
        found |= _values("scene", scene, ("use_nodes",))
    for layer in scene.view_layers:
        found[f"pass {layer.name}"] = (f'Depth pass of view layer "{layer.name}"', "on" if layer.use_pass_z else "off")
    found["world"] = ("World", "none" if scene.world is None else f'"{scene.world.name}"')
    found["camera"] = ("Camera", "none" if scene.camera is None else f'"{scene.camera.name}"')
    for camera in _cameras(scene):
        found |= {
            f"{key} {camera.session_uid}": (f'Camera "{camera.name}" > Type', value)
            for key, (_name, value) in _values("camera", camera, ("type",)).items()
        }
    return found


def sentence(before: State, after: State) -> str:
    """Return what is different, in one line; nothing if nothing is."""
    changed = [after[key] for key in after if key in before and after[key] != before[key]]
    return "" if not changed else f"Switched: {', '.join(f'{name} {value}' for name, value in changed)}."


def _cameras(scene: bpy.types.Scene) -> list[bpy.types.Camera]:
    objects = [scene.camera, *(marker.camera for marker in scene.timeline_markers)]
    return [each.data for each in objects if each is not None and isinstance(each.data, bpy.types.Camera)]


def _values(part: str, owner: Any, names: Any) -> State:
    properties = owner.bl_rna.properties
    return {f"{part}.{name}": _shown(f"{part}.{name}", owner, properties[name]) for name in _plain(properties, names)}


def _plain(properties: Any, names: Any) -> Iterator[str]:
    for name in names:
        each = properties[name]
        if not each.is_readonly and each.type in _KINDS and not getattr(each, "is_array", False):
            yield name


def _shown(path: str, owner: Any, setting: Any) -> tuple[str, str]:
    value = getattr(owner, setting.identifier)
    name = _NAMES.get(path, setting.name)
    if setting.type == "BOOLEAN":
        return name, "on" if value else "off"
    if setting.type == "ENUM" and isinstance(value, str):
        item = setting.enum_items.get(value)  # none where a script makes the list of items
        return name, value.replace("_", " ").title() if item is None else item.name
    return name, f"{value:.6g}" if isinstance(value, float) else str(value)
