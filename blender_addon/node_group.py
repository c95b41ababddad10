# SPDX-License-Identifier: GPL-3.0-or-later
"""The compositor node group "Umbra Black Hole": its sockets, its version, and keeping it whole.

What is outside must provide
----------------------------
Render
    The render with a transparent film (`scene.render.film_transparent = True`), that is the Image output of
    a Render Layers node: premultiplied, of the render's size. May be left unlinked: then there is sky only.
Environment
    An Image node with an equirectangular picture of any size, row by row as Blender shows it (zenith at the
    top), in the colour space the file was made in (it is converted to scene-linear by Blender). Its alpha
    is ignored. Unlinked the socket's own colour is the sky, the same in all directions: a World with a
    plain background colour.
Warp Map
    An Image node with the baked EXR, a single image or a sequence. The image must be Non-Color
    (`image.colorspace_settings.name`) and Channel Packed (`image.alpha_mode = "CHANNEL_PACKED"`). Its
    size is the render's, or 2 or 4 times that. No other node may lie in between.
Environment Rotation, Environment Strength
    What the World's Mapping node (type Point) and its Background node say.

The scene's compositor must work in full precision (`scene.render.compositor_precision = "FULL"`): half floats
cannot hold texture coordinates. In background it must work on the CPU (`compositor_device = "CPU"`).

Everything in here works on Blender's data alone, without operators or context.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields

import bpy

from . import compositor_nodes
from ._physics import colour
from .node_helpers import SETTINGS_ARE_SOCKETS, TreeBuilder

GROUP_NAME = "Umbra Black Hole"
GROUP_VERSION = 1
"""Raised whenever the group's sockets or nodes change; `ensure_group` migrates files with another number."""

VERSION_KEY = "umbra_version"
BLENDER_KEY = "umbra_built_with_blender"
CONTENT_KEY = "umbra_content"

TREE_TYPE = "CompositorNodeTree"
GROUP_NODE_TYPE = "CompositorNodeGroup"

FORMER_NAMES: dict[tuple[str, str], str] = {}
"""(in_out, former name) -> present name of sockets renamed since version 1; migration keeps their links."""


@dataclass(frozen=True)
class SocketSpec:
    """A socket of the group as the artist sees it."""

    name: str
    socket_type: str
    description: str
    in_out: str = "INPUT"
    default: float | tuple[float, ...] | None = None
    minimum: float | None = None
    maximum: float | None = None
    subtype: str = "NONE"
    hide_value: bool = False


RENDER = SocketSpec(
    "Render",
    "NodeSocketColor",
    "The rendered scene with a transparent film; it is laid over the sky",
    default=(0.0, 0.0, 0.0, 0.0),
    hide_value=True,
)
ENVIRONMENT = SocketSpec(
    "Environment",
    "NodeSocketColor",
    "Equirectangular picture of the sky, of any size, or one colour for all of the sky",
    default=(0.0, 0.0, 0.0, 1.0),
)
WARP_MAP = SocketSpec(
    "Warp Map",
    "NodeSocketColor",
    "The baked map of where the light comes from (Non-Color). Magenta in the picture means that it is "
    "missing or is not a warp map",
    default=(0.0, 0.0, 0.0, 0.0),
    hide_value=True,
)
ROTATION = SocketSpec(
    "Environment Rotation",
    "NodeSocketVector",
    "Rotation of the sky, the same as in the Mapping node of the World",
    default=(0.0, 0.0, 0.0),
    subtype="EULER",
)
STRENGTH = SocketSpec(
    "Environment Strength",
    "NodeSocketFloat",
    "Brightness factor of the sky, the same as the strength of the World's background",
    default=1.0,
    minimum=0.0,
    maximum=1.0e6,
)
EXPOSURE = SocketSpec(
    "Exposure",
    "NodeSocketFloat",
    "Brightens the sky by this many stops, without touching the rendered scene",
    default=0.0,
    minimum=-32.0,
    maximum=32.0,
)
REDSHIFT_COLOUR = SocketSpec(
    "Redshift Colour",
    "NodeSocketFloat",
    "How much the frequency shift changes the colour of the sky: 0 is off, 1 is physical",
    default=1.0,
    minimum=0.0,
    maximum=1.0,
    subtype="FACTOR",
)
REDSHIFT_BRIGHTNESS = SocketSpec(
    "Redshift Brightness",
    "NodeSocketFloat",
    "How much the frequency shift changes the brightness of the sky: 0 is off, 1 is physical, "
    "(1 + z) to the power of -4",
    default=1.0,
    minimum=0.0,
    maximum=1.0,
    subtype="FACTOR",
)
TEMPERATURE = SocketSpec(
    "Sky Temperature",
    "NodeSocketFloat",
    "Colour temperature of the sky's light (kelvin) from which the shift of its colour is computed",
    default=colour.DEFAULT_TEMPERATURE,
    minimum=1000.0,
    maximum=40000.0,
    subtype="COLOR_TEMPERATURE",
)
IMAGE = SocketSpec("Image", "NodeSocketColor", "The scene in front of the black hole and the sky", in_out="OUTPUT")
SKY = SocketSpec("Sky", "NodeSocketColor", "The black hole and the sky without the scene", in_out="OUTPUT")
SHADOW = SocketSpec(
    "Shadow", "NodeSocketFloat", "Mask of the black hole's shadow: 1 inside, 0 outside", in_out="OUTPUT"
)
REDSHIFT = SocketSpec(
    "Redshift",
    "NodeSocketFloat",
    "Frequency ratio 1 + z: above 1 is redshift, below 1 blueshift",
    in_out="OUTPUT",
)

INPUTS = (
    RENDER,
    ENVIRONMENT,
    WARP_MAP,
    ROTATION,
    STRENGTH,
    EXPOSURE,
    REDSHIFT_COLOUR,
    REDSHIFT_BRIGHTNESS,
    TEMPERATURE,
)
OUTPUTS = (IMAGE, SKY, SHADOW, REDSHIFT)


def is_group(tree: bpy.types.NodeTree | None) -> bool:
    """Whether a node tree is this group, of whatever version, whole or damaged."""
    return tree is not None and tree.bl_idname == TREE_TYPE and VERSION_KEY in tree


def is_current(tree: bpy.types.NodeTree) -> bool:
    """Whether a group is of this version, built by this version of Blender, and unchanged inside."""
    return (
        tree.get(VERSION_KEY) == GROUP_VERSION
        and tree.get(BLENDER_KEY) == _blender_series()
        and tree.get(CONTENT_KEY) == _fingerprint(tree)
    )


def find_group() -> bpy.types.NodeTree | None:
    """The group in this file, or None. One linked from another file is left out: it cannot be repaired."""
    groups = [tree for tree in bpy.data.node_groups if is_group(tree) and tree.library is None]
    return next((tree for tree in groups if tree.name == GROUP_NAME), groups[0] if groups else None)


def ensure_group() -> bpy.types.NodeTree:
    """The group, whole and of this version.

    Returns
    -------
    bpy.types.NodeTree
        Built anew if the file has none. One of another version, from another version of Blender, or with
        changes inside is rebuilt in place: group nodes that use it keep their values and links, as far as
        their sockets still exist.
    """
    tree = find_group()
    if tree is None:
        tree = bpy.data.node_groups.new(GROUP_NAME, TREE_TYPE)
    if not is_current(tree):
        _rebuild(tree)
    return tree


def add_group_node(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """Add a group node that uses the group to a compositor tree; `INPUTS` and `OUTPUTS` name its sockets."""
    node = tree.nodes.new(GROUP_NODE_TYPE)
    node.node_tree = ensure_group()
    node.name = node.label = GROUP_NAME
    node.width = 220.0
    return node


def group_nodes(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    """All group nodes in a compositor tree (not in groups inside of it) that use the group."""
    return [node for node in tree.nodes if node.bl_idname == GROUP_NODE_TYPE and is_group(node.node_tree)]


def _blender_series() -> str:
    """Nodes are written differently by each series, and Blender converts old files upward only."""
    return f"{bpy.app.version[0]}.{bpy.app.version[1]}"


def _rebuild(tree: bpy.types.NodeTree) -> None:
    tree.nodes.clear()
    for spec in _match_interface(tree):
        _set_default_in_users(tree, spec)
    builder = TreeBuilder(tree)
    group_input = builder.node("NodeGroupInput")
    sockets = {socket.name: socket for socket in group_input.outputs}
    inputs = compositor_nodes.GroupInputs(
        render=sockets[RENDER.name],
        environment=sockets[ENVIRONMENT.name],
        warp_map=sockets[WARP_MAP.name],
        rotation=sockets[ROTATION.name],
        strength=sockets[STRENGTH.name],
        exposure=sockets[EXPOSURE.name],
        redshift_colour=sockets[REDSHIFT_COLOUR.name],
        redshift_brightness=sockets[REDSHIFT_BRIGHTNESS.name],
        temperature=sockets[TEMPERATURE.name],
    )
    results = compositor_nodes.build(builder, inputs)
    group_output = builder.node("NodeGroupOutput")
    targets = {socket.name: socket for socket in group_output.inputs}
    for spec, field in zip(OUTPUTS, fields(results), strict=True):
        tree.links.new(getattr(results, field.name), targets[spec.name])
    tree[VERSION_KEY] = GROUP_VERSION
    tree[BLENDER_KEY] = _blender_series()
    tree[CONTENT_KEY] = _fingerprint(tree)


def _match_interface(tree: bpy.types.NodeTree) -> list[SocketSpec]:
    """Make the sockets what they should be, keeping those that exist: values and links hang on them.

    Returns the inputs that did not exist before.
    """
    interface = tree.interface
    wanted = {(spec.in_out, spec.name): spec for spec in (*OUTPUTS, *INPUTS)}
    kept: dict[tuple[str, str], bpy.types.NodeTreeInterfaceSocket] = {}
    for item in list(interface.items_tree):
        if item.item_type == "SOCKET":
            key = (item.in_out, FORMER_NAMES.get((item.in_out, item.name), item.name))
            if key in wanted and key not in kept and item.socket_type == wanted[key].socket_type:
                kept[key] = item
    survivors = set(kept.values())
    for item in [item for item in interface.items_tree if item not in survivors]:
        interface.remove(item)
    added = []
    for position, (key, spec) in enumerate(wanted.items()):
        item = kept.get(key)
        if item is None:
            item = interface.new_socket(spec.name, in_out=spec.in_out, socket_type=spec.socket_type)
            added.append(spec)
        _describe(item, spec)
        interface.move(item, position)
    return [spec for spec in added if spec.in_out == "INPUT"]


def _set_default_in_users(tree: bpy.types.NodeTree, spec: SocketSpec) -> None:
    """Give a new input its default in existing group nodes, where Blender made it before it had one."""
    users = list(bpy.data.node_groups)
    if not SETTINGS_ARE_SOCKETS:
        users.extend(scene.node_tree for scene in bpy.data.scenes if scene.node_tree is not None)
    for user in users:
        for node in user.nodes:
            if node.bl_idname == GROUP_NODE_TYPE and node.node_tree == tree:
                node.inputs[spec.name].default_value = spec.default


def _describe(item: bpy.types.NodeTreeInterfaceSocket, spec: SocketSpec) -> None:
    item.name = spec.name
    item.description = spec.description
    item.hide_value = spec.hide_value
    if spec.socket_type != "NodeSocketColor" and item.subtype != spec.subtype:
        item.subtype = spec.subtype
    if spec.minimum is not None:
        item.min_value = spec.minimum
    if spec.maximum is not None:
        item.max_value = spec.maximum
    if spec.default is not None:
        item.default_value = spec.default


def _fingerprint(tree: bpy.types.NodeTree) -> str:
    """Hash of all that decides what the group does; the places and names of nodes are left out."""
    order = {node: index for index, node in enumerate(tree.nodes)}
    lines = [_interface_line(item) for item in tree.interface.items_tree]
    for node, index in order.items():
        settings = [
            f"{name}={getattr(node, name)}"
            for name in sorted(property_.identifier for property_ in node.bl_rna.properties)
            if name not in bpy.types.Node.bl_rna.properties and isinstance(getattr(node, name), str | bool)
        ]
        values = [_value_text(socket) for socket in node.inputs if not socket.is_linked]
        lines.append(f"{index} {node.bl_idname} mute={node.mute} {settings} {values}")
    lines.extend(
        sorted(
            f"{order[link.from_node]}:{link.from_socket.identifier}>{order[link.to_node]}:{link.to_socket.identifier}"
            for link in tree.links
        )
    )
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def _interface_line(item: bpy.types.NodeTreeInterfaceItem) -> str:
    if item.item_type != "SOCKET":
        return item.item_type
    details = [getattr(item, name, "") for name in ("description", "subtype", "min_value", "max_value", "hide_value")]
    return f"{item.in_out} {item.name} {item.identifier} {item.socket_type} {details}"


def _value_text(socket: bpy.types.NodeSocket) -> str:
    value = getattr(socket, "default_value", None)
    if value is None or isinstance(value, str | bool | int | float):
        return f"{socket.identifier}={value!r}"
    return f"{socket.identifier}={[float(component) for component in value]}"
