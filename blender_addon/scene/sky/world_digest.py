# SPDX-License-Identifier: GPL-3.0-or-later
"""A digest of all that a World's sky is made of, by which a picture of it is known.

It is of values, not of memory: the same in another Blender and on another machine. So values that a property has by
itself are left out (a later Blender has more properties), and an image counts by its name and its file's name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import bpy

from . import sky_frames
from .followed import Followed
from .node_paths import group_output, reachable

_LENGTH = 16

# What a node has that its result does not depend on.
_NOT_MEANT = frozenset(
    (
        *("rna_type", "name", "type", "location", "location_absolute", "width", "width_hidden", "height", "dimensions"),
        *(
            "label",
            "parent",
            "select",
            "color",
            "color_tag",
            "use_custom_color",
            "hide",
            "show_options",
            "show_texture",
        ),
        *("show_preview", "warning_propagation", "inputs", "outputs", "internal_links", "image_user", "node_tree"),
        *("is_active_output", "target", "interface", "id_data"),
    )
)


def of_world(output: bpy.types.Node, parts: Followed) -> str:
    """Return the digest of what feeds a World's output, without what is followed."""
    return _digest(_shader(output.inputs["Surface"], parts))


def of_image(image: bpy.types.Image) -> str:
    """Return the digest of an image as a sky."""
    return _digest(["image", *_image(image)])


def _digest(lines: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:_LENGTH]


def _shader(socket: bpy.types.NodeSocket, parts: Followed) -> list[str]:
    nodes = list(reachable(socket))
    trees = {node.id_data.as_pointer(): node.id_data for node in nodes}
    lines = [_link(link) for link in socket.links]
    for node in sorted(nodes, key=lambda each: (each.id_data.name, each.name)):
        lines.append(f"{node.id_data.name}/{node.name} {node.bl_idname} {node.mute}")
        lines += _properties(node)
        if node.type == "GROUP" and node.node_tree is not None:
            lines.append(f"group {node.node_tree.name}")
        for each in node.inputs:
            if not parts.has(each):
                lines += _input(each)
    for tree in sorted(trees.values(), key=lambda each: each.name):
        end = group_output(tree)
        for each in () if end is None else end.inputs:
            lines += _input(each)
    return lines


def _link(link: bpy.types.NodeLink) -> str:
    return f"{link.from_node.name}/{link.from_socket.identifier} to {link.to_socket.identifier} {link.is_muted}"


def _input(socket: bpy.types.NodeSocket) -> list[str]:
    if socket.is_linked:
        return [_link(link) for link in socket.links]
    if hasattr(socket, "default_value"):
        return [f"{socket.identifier}={_plain(socket.default_value)}"]
    return []


def _plain(value: Any) -> str:
    """A value as text, with the digits that single precision has."""
    if isinstance(value, float):
        return f"{value:.7g}"
    if isinstance(value, (str, int)):
        return str(value)
    if isinstance(value, Iterable):
        return " ".join(_plain(each) for each in value)
    return str(getattr(value, "name", value))


def _properties(struct: Any) -> list[str]:
    """What a node, or a part of one such as a color ramp, is set to."""
    lines = []
    for each in struct.bl_rna.properties:
        if each.identifier in _NOT_MEANT or each.identifier.startswith("bl_"):
            continue
        value = getattr(struct, each.identifier)
        if each.type == "COLLECTION":
            for index, part in enumerate(value):
                lines += [f"{each.identifier}[{index}].{line}" for line in _properties(part)]
        elif each.type == "POINTER":
            lines += [f"{each.identifier}.{line}" for line in _pointed(value)]
        elif not each.is_readonly:
            default = getattr(each, "default_array", None) if getattr(each, "is_array", False) else each.default
            if _plain(value) != _plain(default):
                lines.append(f"{each.identifier}={_plain(value)}")
    return lines


def _pointed(value: Any) -> list[str]:
    if value is None:
        return []
    if isinstance(value, bpy.types.Image):
        return _image(value)
    if isinstance(value, bpy.types.Object):
        return [f"{value.name} {_plain([part for row in value.matrix_world for part in row])}"]
    if isinstance(value, bpy.types.Text):
        return [value.as_string()]
    if isinstance(value, bpy.types.ID):
        return [value.name]
    return _properties(value)


def _image(image: bpy.types.Image) -> list[str]:
    settings = image.colorspace_settings
    lines = [image.name, image.source, image.alpha_mode, settings.name, sky_frames.path_of(image).name]
    if image.source == "GENERATED":
        lines.append(f"{image.generated_type} {_plain(image.generated_color)} {_plain(image.size)}")
    return lines
