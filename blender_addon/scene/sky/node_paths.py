# SPDX-License-Identifier: GPL-3.0-or-later
"""Follow the links of shader nodes back to where a value comes from, through reroutes, muted nodes and groups."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bpy

from ...core.blender_version import NODES_ARE_OPTIONAL

# Kinds of nodes that make light of a color and a strength; in a World, Emission shines as Background does.
SHINING = frozenset({"BACKGROUND", "EMISSION"})


@dataclass(frozen=True)
class Place:
    """A socket, and the group nodes that it is inside of, outermost first."""

    socket: bpy.types.NodeSocket
    groups: tuple[bpy.types.Node, ...] = ()

    @property
    def node(self) -> bpy.types.Node:
        """The socket's node."""
        return self.socket.node

    @property
    def is_output(self) -> bool:
        """Whether a node makes the value; else it is a number that the socket holds."""
        return self.socket.is_output

    @property
    def value(self) -> Any:
        """The number, vector or color that the socket holds."""
        return self.socket.default_value

    @property
    def owner(self) -> bpy.types.ID:
        """The datablock that holds the value: a group; of nodes that are in no group, their tree."""
        owner: bpy.types.ID = self.socket.id_data
        return owner

    @property
    def path(self) -> str:
        """The value's path from its owner."""
        return self.socket.path_from_id("default_value")

    def input(self, name: str) -> Place:
        """Where the value of one of the node's inputs comes from."""
        return source(Place(self.node.inputs[name], self.groups))


def world_output(scene: bpy.types.Scene, world: bpy.types.World) -> Any:
    """Return the node by which a World's nodes hand on what a scene's engine shows; None if there is none."""
    tree: Any = world.node_tree
    if tree is None or (NODES_ARE_OPTIONAL and not world.use_nodes):
        return None
    return tree.get_output_node("CYCLES" if scene.render.engine == "CYCLES" else "EEVEE")


def group_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """Return the node by which a group hands on its results."""
    outputs = [node for node in tree.nodes if node.type == "GROUP_OUTPUT"]
    return next((node for node in outputs if node.is_active_output), outputs[0] if outputs else None)


def _of_identifier(sockets: Any, identifier: str) -> bpy.types.NodeSocket | None:
    return next((each for each in sockets if each.identifier == identifier), None)


def source(place: Place) -> Place:
    """Return where the value of an input comes from: a node's output, or an input that holds it."""
    while True:
        following = _step(place)
        if following is None:
            return place
        place = following


def _step(place: Place) -> Place | None:
    socket, groups = place.socket, place.groups
    if not socket.is_output:
        link = next((each for each in socket.links if not each.is_muted), None)
        return None if link is None else Place(link.from_socket, groups)
    node = socket.node
    if node.mute:
        passed = next((each.from_socket for each in node.internal_links if each.to_socket == socket), None)
        return None if passed is None else Place(passed, groups)
    if node.type == "REROUTE":
        return Place(node.inputs[0], groups)
    if node.type == "GROUP" and node.node_tree is not None:
        end = group_output(node.node_tree)
        inner = None if end is None else _of_identifier(end.inputs, socket.identifier)
        return None if inner is None else Place(inner, (*groups, node))
    if node.type == "GROUP_INPUT" and groups:
        outer = _of_identifier(groups[-1].inputs, socket.identifier)
        return None if outer is None else Place(outer, groups[:-1])
    return None


def reachable(socket: bpy.types.NodeSocket) -> Iterator[bpy.types.Node]:
    """Yield the nodes that an input depends on, those inside of groups as well."""
    waiting, seen = [socket], set()
    while waiting:
        for link in waiting.pop().links:
            node = link.from_node
            if link.is_muted or node.as_pointer() in seen:
                continue
            seen.add(node.as_pointer())
            yield node
            waiting.extend(node.inputs)
            if node.type == "GROUP" and node.node_tree is not None and not node.mute:
                end = group_output(node.node_tree)
                waiting.extend(() if end is None else end.inputs)
