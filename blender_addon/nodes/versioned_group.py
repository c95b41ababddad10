# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups built by code. Each has a version, and is rebuilt when it differs from what the code builds."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import bpy

from ..core.blender_version import SCENE_OWNS_COMPOSITOR, SERIES
from ..core.physics_api import physics
from .builder import TreeBuilder

BLENDER_KEY = "umbra_built_with_blender"
CONTENT_KEY = "umbra_content"

Values: TypeAlias = dict[str, Any]
"""Name of a socket -> its `Float` or `Vector`."""

TREE_TYPE = "CompositorNodeTree"
GROUP_NODE_TYPE = "CompositorNodeGroup"


@dataclass(frozen=True)
class SocketSpec:
    """A socket of a group as the artist sees it: its name, tooltip, default, range and unit."""

    name: str
    socket_type: str
    """"NodeSocketFloat", "NodeSocketVector" or "NodeSocketColor"."""
    description: str
    in_out: str = "INPUT"
    """"INPUT" or "OUTPUT"."""
    default: float | tuple[float, ...] | None = None
    minimum: float | None = None
    maximum: float | None = None
    subtype: str = "NONE"
    """Blender's unit or widget, such as "FACTOR"; colors have none."""
    hide_value: bool = False


def setting_socket(setting: physics.Setting) -> SocketSpec:
    """Return the input of a row of the table `physics.SKY_SETTINGS`."""
    return SocketSpec(
        setting.socket,
        "NodeSocketFloat",
        setting.sentence,
        default=float(setting.default),
        minimum=setting.low,
        maximum=setting.high,
        subtype=setting.subtype,
    )


@dataclass(frozen=True)
class VersionedGroup:
    """A kind of node group: its sockets, and the function that adds its nodes.

    A file has one group of the kind, unless `ensure` is given another. `is_current` and `ensure` compare the nodes
    themselves, so that changes by hand are found as well.
    """

    name: str
    version: int
    """Raised whenever the group's sockets or nodes change; groups with another number are rebuilt."""
    version_key: str
    """The group's custom property that holds its version, and tells it from other groups."""
    inputs: tuple[SocketSpec, ...]
    outputs: tuple[SocketSpec, ...]
    build: Callable[[TreeBuilder, Values], Values]
    """Adds all nodes between the group's inputs and its outputs, given and returned by socket name."""
    tree_type: str = TREE_TYPE
    node_type: str = GROUP_NODE_TYPE
    variant: tuple[tuple[str, int], ...] = ()
    """Further custom properties and their values, where several kinds have the same `version_key`; none counts as 0."""

    def owns(self, tree: bpy.types.NodeTree | None) -> bool:
        """Whether a node tree is of this kind, whatever its version and state."""
        if tree is None or tree.bl_idname != self.tree_type or self.version_key not in tree:
            return False
        return all(tree.get(key, 0) == value for key, value in self.variant)

    def is_current(self, tree: bpy.types.NodeTree) -> bool:
        """Whether a group is of this version, built by this version of Blender, and unchanged inside."""
        return bool(
            self.owns(tree)
            and tree.get(self.version_key) == self.version
            and tree.get(BLENDER_KEY) == SERIES
            and tree.get(CONTENT_KEY) == _fingerprint(tree)
        )

    def find(self) -> bpy.types.NodeTree | None:
        """The group in this file, or None. Groups linked from other files do not count: they cannot be rebuilt."""
        groups = [tree for tree in bpy.data.node_groups if self.owns(tree) and tree.library is None]
        return next((tree for tree in groups if tree.name == self.name), groups[0] if groups else None)

    def ensure(self, tree: bpy.types.NodeTree | None = None) -> bpy.types.NodeTree:
        """Return the group, and build or rebuild it if it is not current.

        Parameters
        ----------
        tree : bpy.types.NodeTree, optional
            A group of this kind, or an empty tree that becomes one. By default the file's group.

        Returns
        -------
        bpy.types.NodeTree
            The given group, the one found, or a new one. Rebuilding is done in place: nodes that use the group keep
            their values and links to sockets that still exist.
        """
        tree = tree or self.find()
        if tree is None:
            tree = bpy.data.node_groups.new(self.name, self.tree_type)
        if not self.is_current(tree):
            self._rebuild(tree)
        return tree

    def add_node(self, tree: bpy.types.NodeTree) -> bpy.types.Node:
        """Add a group node that uses the group to a tree."""
        node = tree.nodes.new(self.node_type)
        node.node_tree = self.ensure()
        node.name = node.label = self.name
        node.width = 220.0
        return node

    def _rebuild(self, tree: bpy.types.NodeTree) -> None:
        tree.nodes.clear()
        for spec in self._match_interface(tree):
            _set_default_in_users(tree, spec)
        builder = TreeBuilder(tree)
        sockets = {socket.name: socket for socket in builder.node("NodeGroupInput").outputs}
        results = self.build(builder, {spec.name: builder.value(sockets[spec.name]) for spec in self.inputs})
        targets = {socket.name: socket for socket in builder.node("NodeGroupOutput").inputs}
        for spec in self.outputs:
            builder.feed(targets[spec.name], results[spec.name])
        builder.arrange()
        tree[self.version_key] = self.version
        for key, value in self.variant:
            tree[key] = value
        tree[BLENDER_KEY] = SERIES
        tree[CONTENT_KEY] = _fingerprint(tree)

    def _match_interface(self, tree: bpy.types.NodeTree) -> list[SocketSpec]:
        """Make the sockets match their specifications, and return the inputs that did not exist before.

        Sockets that exist are kept, because the values and links of group nodes belong to them.
        """
        interface = tree.interface
        wanted = {(spec.in_out, spec.name): spec for spec in (*self.outputs, *self.inputs)}
        kept: dict[tuple[str, str], bpy.types.NodeTreeInterfaceSocket] = {}
        for item in list(interface.items_tree):
            if isinstance(item, bpy.types.NodeTreeInterfaceSocket):
                key = (item.in_out, item.name)
                if key in wanted and key not in kept and item.socket_type == wanted[key].socket_type:
                    kept[key] = item
        survivors = set(kept.values())
        for item in [item for item in interface.items_tree if item not in survivors]:
            interface.remove(item)
        added: list[SocketSpec] = []
        for position, (key, spec) in enumerate(wanted.items()):
            socket = kept.get(key)
            if socket is None:
                socket = interface.new_socket(spec.name, in_out=spec.in_out, socket_type=spec.socket_type)
                added.append(spec)
            _describe(socket, spec)
            interface.move(socket, position)
        return [spec for spec in added if spec.in_out == "INPUT"]


def _set_default_in_users(tree: bpy.types.NodeTree, spec: SocketSpec) -> None:
    """Give a new input its default in existing group nodes; Blender added it to them before it had one."""
    users = [*bpy.data.node_groups, *(world.node_tree for world in bpy.data.worlds if world.node_tree is not None)]
    if SCENE_OWNS_COMPOSITOR:
        users.extend(scene.node_tree for scene in bpy.data.scenes if scene.node_tree is not None)
    for user in users:
        for node in user.nodes:
            if getattr(node, "node_tree", None) == tree:
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
    """Hash of all that determines a group's result; positions and names of nodes do not count."""
    order = {node: index for index, node in enumerate(tree.nodes)}
    of_all = {each.identifier for each in bpy.types.Node.bl_rna.properties}
    names: dict[str, list[str]] = {}  # of the settings that are text or switches, by the nodes' type
    lines = [_interface_line(item) for item in tree.interface.items_tree]
    for node, index in order.items():
        if node.bl_idname not in names:
            own = {each.identifier for each in node.bl_rna.properties} - of_all
            names[node.bl_idname] = sorted(name for name in own if isinstance(getattr(node, name), str | bool))
        settings = [f"{name}={getattr(node, name)}" for name in names[node.bl_idname]]
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
        return str(item.item_type)
    details = [getattr(item, name, "") for name in ("description", "subtype", "min_value", "max_value", "hide_value")]
    return f"{item.in_out} {item.name} {item.identifier} {item.socket_type} {details}"


def _value_text(socket: bpy.types.NodeSocket) -> str:
    value = getattr(socket, "default_value", None)
    if value is None or isinstance(value, str | bool | int | float):
        return f"{socket.identifier}={value!r}"
    return f"{socket.identifier}={[float(component) for component in value]}"
