# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands before each Background of a lensed World: a node of the group "Umbra World Tint"."""

from __future__ import annotations

from typing import Any

import bpy

from ...nodes import world_group, world_tint

NAME = "Umbra Tint"

PASSED = "Umbra "
"""Before the names of the inputs by which a group inside of a World takes the results of the group "Umbra World"."""

_PASSED_FORMER = {PASSED + former: PASSED + name for former, name in world_group.FORMER_OUTPUTS.items()}
_FORMER = world_group.FORMER_OUTPUTS | _PASSED_FORMER


is_group = world_tint.GROUP.owns


def add(
    tree: bpy.types.NodeTree, background: bpy.types.Node, shift: bpy.types.NodeSocket, light: bpy.types.NodeSocket
) -> None:
    """Let a Background's color pass by a node of the group."""
    color = background.inputs["Color"]
    node = _new_node(tree, shift, light)
    node.location = (background.location.x - 60.0, background.location.y - 180.0)
    if color.is_linked:
        tree.links.new(color.links[0].from_socket, node.inputs[world_tint.COLOR.name])
    else:
        node.inputs[world_tint.COLOR.name].default_value = color.default_value
    tree.links.new(node.outputs[world_tint.SEEN.name], color)


def _new_node(tree: bpy.types.NodeTree, shift: bpy.types.NodeSocket, light: bpy.types.NodeSocket) -> Any:
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = world_tint.GROUP.ensure()
    node.name = node.label = NAME
    tree.links.new(shift, node.inputs[world_tint.SHIFT.name])
    tree.links.new(light, node.inputs[world_tint.LIGHT.name])
    return node


def renew(group: bpy.types.NodeTree, trees: list[bpy.types.NodeTree]) -> None:
    """Bring up to date what stands before the Backgrounds.

    Until version 3 of the group "Umbra World" that was a Multiply Add node, by its outputs Tint and Fault.

    Parameters
    ----------
    group : bpy.types.NodeTree
        The group "Umbra World" of a lensed World, not yet rebuilt.
    trees : list of bpy.types.NodeTree
        The World's tree, and the groups inside of it.
    """
    if any(item.name in _FORMER for item in group.interface.items_tree):
        for tree in (group, *trees):
            _rename(tree)
        for tree in trees:
            for node in list(tree.nodes):
                _replace(tree, node)
    used = {node.node_tree for tree in trees for node in tree.nodes if node.type == "GROUP"}
    for each in used:
        if each is not None and each.library is None and is_group(each):
            world_tint.GROUP.ensure(each)


def _rename(tree: bpy.types.NodeTree) -> None:
    """Give the sockets their names of now; what is linked to them stays."""
    for item in tree.interface.items_tree:
        if item.item_type == "SOCKET" and item.name in _FORMER and item.socket_type == "NodeSocketVector":
            item.name = _FORMER[item.name]


def _replace(tree: bpy.types.NodeTree, node: Any) -> None:
    """Put a node of the group in the place of a Multiply Add node that did this."""
    if node.type != "VECT_MATH" or node.operation != "MULTIPLY_ADD":
        return
    sources = [socket.links[0].from_socket if socket.is_linked else None for socket in node.inputs]
    color, shift, light = sources[:3]
    names = {each.removeprefix(PASSED) for each in (_name(shift), _name(light))}
    if shift is None or light is None or names != {world_tint.SHIFT.name, world_tint.LIGHT.name}:
        return
    made = _new_node(tree, shift, light)
    made.location, made.mute, made.parent = node.location, node.mute, node.parent
    if color is not None:
        tree.links.new(color, made.inputs[world_tint.COLOR.name])
    else:
        made.inputs[world_tint.COLOR.name].default_value = (*node.inputs[0].default_value, 1.0)
    for target in [link.to_socket for link in node.outputs["Vector"].links]:
        tree.links.new(made.outputs[world_tint.SEEN.name], target)
    tree.nodes.remove(node)


def _name(socket: bpy.types.NodeSocket | None) -> str:
    return "" if socket is None else socket.name


def remove_unused() -> None:
    """Remove the group where no World uses it."""
    for tree in list(bpy.data.node_groups):
        if tree.users == 0 and tree.library is None and world_tint.GROUP.owns(tree):
            bpy.data.node_groups.remove(tree)
