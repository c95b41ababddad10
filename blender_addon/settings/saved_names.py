# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that version 0.1 saved in .blend files, and the names that replaced them.

`migrate` brings a file up to date: values, nodes, sockets, keyframes, and drivers. Scripts can use the former names of
properties until version 0.3, when `accept` goes; `migrate` stays for as long as files of version 0.1 are to be opened.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import bpy

from ..core.blender_version import PROPERTIES_ARE_APART

SCENE = {"redshift_colour": "redshift_color"}
"""Properties of `scene.umbra`."""

DISK = {"doppler_colour": "doppler_color", "colour_variation": "color_variation"}
"""Properties of `object.umbra.disk`."""

DISK_CHOICES = {"texture_use": {"COLOUR": "COLOR"}}
"""Identifiers of enum items of `object.umbra.disk`. Files hold their numbers, so only scripts notice."""

SOCKETS = {
    "Redshift Colour": "Redshift Color",
    "Doppler Colour": "Doppler Color",
    "Colour Variation": "Color Variation",
    "Colours": "Colors",
}
"""Inputs of the node groups."""

ROLES = {"disk_colours": "disk_colors"}
"""Values of the nodes' custom property `umbra_role`."""

LABELS = {"Umbra Disk Colours": "Umbra Disk Colors", "Disk Colours": "Disk Colors"}
"""Names and labels of nodes and images."""

# The custom property by which a node group is known to be the add-on's begins with one of these.
_STAMPS = ("umbra_version", "umbra_world_version", "umbra_disk_version")

# On a scene whose output is not the compositor: what to restore, among it the values of sockets under "look".
_REMEMBERED, _LOOK = "umbra_lens_before", "look"

_PATHS = {
    **{f"umbra.{former}": f"umbra.{name}" for former, name in SCENE.items()},
    **{f"umbra.disk.{former}": f"umbra.disk.{name}" for former, name in DISK.items()},
}
_SOCKET_PATH = re.compile(rf'\.inputs\["({"|".join(SOCKETS)})"\]')


# --- scripts --------------------------------------------------------------------------------------


def accept(kind: type, names: Mapping[str, str]) -> None:
    """Let a group of properties that is not registered yet be read and set under former names, too.

    An alias is hidden, is not saved, and announces a change as the property itself does. It can be animated; `migrate`
    gives such keyframes the present name.
    """
    for former, name in names.items():
        deferred = kind.__annotations__[name]
        keywords = {key: value for key, value in deferred.keywords.items() if key != "default"}
        keywords["options"] = keywords.get("options", {"ANIMATABLE"}) | {"HIDDEN", "SKIP_SAVE"}
        kind.__annotations__[former] = deferred.function(get=_getter(name), set=_setter(name), **keywords)


def _getter(name: str) -> Any:
    return lambda settings: getattr(settings, name)


def _setter(name: str) -> Any:
    def store(settings: bpy.types.PropertyGroup, value: float) -> None:
        # Not by the property: its update function must not run where Blender evaluates an animated alias.
        limits = settings.bl_rna.properties[name]
        storage_of(settings, create=True)[name] = min(max(value, limits.hard_min), limits.hard_max)

    return store


class AcceptsFormerChoices:
    """A mixin for a group of properties: sets enums by former identifiers of their items, too."""

    FORMER_CHOICES: Mapping[str, Mapping[str, str]] = {}

    def __setattr__(self, name: str, value: object) -> None:
        former = self.FORMER_CHOICES.get(name, {})
        super().__setattr__(name, former.get(value, value) if isinstance(value, str) else value)


# --- files ----------------------------------------------------------------------------------------


def migrate() -> None:
    """Replace former names wherever the file that is open has them; linked data in memory only."""
    for scene in bpy.data.scenes:
        _rename_keys(group_in(storage_of(scene), "umbra"), SCENE)
        _rename_keys(group_in(scene.get(_REMEMBERED), _LOOK), SOCKETS)
    for each in bpy.data.objects:
        _rename_keys(group_in(group_in(storage_of(each), "umbra"), "disk"), DISK)
    for tree in bpy.data.node_groups:
        if any(key.startswith(_STAMPS) for key in tree.keys()):  # noqa: SIM118  a tree has no iterator of its own
            _rename_sockets(tree)
    blocks = list(_datablocks())
    for block in blocks:
        if isinstance(block, bpy.types.NodeTree):
            _rename_nodes(block)
    for image in bpy.data.images:
        if image.library is None:
            _rename(image, "name")
    for action in bpy.data.actions:
        for layer in action.layers:
            for strip in layer.strips:
                for bag in strip.channelbags:
                    _rename_paths(bag.fcurves, None)
    for block in blocks:
        animation = getattr(block, "animation_data", None)
        if animation is not None:
            _rename_animation(animation, block)


def storage_of(owner: Any, *, create: bool = False) -> Any:
    """Return where Blender keeps the values of an owner's registered properties, by name; None where it has none."""
    return owner.bl_system_properties_get(do_create=create) if PROPERTIES_ARE_APART else owner


def group_in(parent: Any, key: str) -> Any:
    """Return the group of values under a key; None where there is none."""
    found = None if parent is None else parent.get(key)
    return found if hasattr(found, "keys") else None


def _rename_keys(group: Any, names: Mapping[str, str]) -> None:
    for former, name in names.items():
        if group is not None and former in group:
            if name not in group:
                group[name] = group[former]
            del group[former]


def _datablocks() -> Iterator[bpy.types.ID]:
    """All data-blocks of the file, and the node trees that lie inside of others."""
    for collection in bpy.data.bl_rna.properties:
        if collection.type == "COLLECTION" and collection.identifier != "all_ids":
            for block in getattr(bpy.data, collection.identifier):
                yield block
                tree = getattr(block, "node_tree", None)
                if tree is not None:
                    yield tree


def _rename_sockets(tree: bpy.types.NodeTree) -> None:
    for item in tree.interface.items_tree:
        if item.item_type == "SOCKET" and item.name in SOCKETS:
            item.name = SOCKETS[item.name]


def _rename_nodes(tree: bpy.types.NodeTree) -> None:
    for node in tree.nodes:
        role = node.get("umbra_role")
        if isinstance(role, str) and role in ROLES:
            node["umbra_role"] = ROLES[role]
            for attribute in ("name", "label"):
                _rename(node, attribute)


def _rename(owner: Any, attribute: str) -> None:
    text = getattr(owner, attribute)
    for former, name in LABELS.items():
        if text.startswith(former):  # a number, or more, may follow
            setattr(owner, attribute, name + text.removeprefix(former))


# --- keyframes and drivers ------------------------------------------------------------------------


def _rename_animation(animation: bpy.types.AnimData, owner: bpy.types.ID) -> None:
    """Rename in a data-block's keyframes, also those in strips, and in its drivers."""
    users: list[Any] = [animation, *(strip for track in animation.nla_tracks for strip in track.strips)]
    for user in users:
        if user.action is not None and user.action_slot is not None:
            for layer in user.action.layers:
                for strip in layer.strips:
                    bag = strip.channelbag(user.action_slot)
                    if bag is not None:
                        _rename_paths(bag.fcurves, owner)
    _rename_paths(animation.drivers, owner)
    for curve in animation.drivers:
        for variable in curve.driver.variables:
            for target in variable.targets:
                path = _current_path(target.data_path, target.id)
                if path != target.data_path:
                    target.data_path = path
                    curve.driver.is_valid = True


def _rename_paths(curves: Any, owner: bpy.types.ID | None) -> None:
    for curve in curves:
        path = _current_path(curve.data_path, owner)
        if path != curve.data_path:
            curve.data_path = path
            curve.is_valid = True


def _current_path(path: str, owner: bpy.types.ID | None) -> str:
    """Return a data path with present names; a socket only where the owner has none of the former name."""
    for former, name in _PATHS.items():
        if path == former or path.endswith(f".{former}"):
            return path.removesuffix(former) + name
    match = _SOCKET_PATH.search(path)
    if match is None or owner is None or _resolves(owner, path):
        return path
    return path[: match.start(1)] + SOCKETS[match[1]] + path[match.end(1) :]


def _resolves(owner: bpy.types.ID, path: str) -> bool:
    try:
        owner.path_resolve(path)
    except ValueError:
        return False
    return True
