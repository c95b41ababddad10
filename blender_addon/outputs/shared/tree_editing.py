# SPDX-License-Identifier: GPL-3.0-or-later
"""Change a scene's compositor tree so that it can be changed back: what the artist's own nodes fed stays known."""

import bpy

from ...core.errors import SceneError
from .compositor_tree import OUTPUT, RENDER_LAYER, ROLE, has_scene_tree

OUTPUT_LINK = "umbra_output_link"  # on a node of ours: the compositor's output was not connected before


def output_node(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """The node whose first input is the picture that is given out."""
    kind = "COMPOSITE" if has_scene_tree() else "GROUP_OUTPUT"
    outputs = [node for node in tree.nodes if node.type == kind]
    if not has_scene_tree():
        outputs.sort(key=lambda node: not node.is_active_output)
    return outputs[0] if outputs else None


def leads_to_picture(node: bpy.types.Node, seen: set[str] | None = None) -> bool:
    """Whether what goes into a node comes out as the picture, or is looked at: not if it only goes into files."""
    seen = set() if seen is None else seen
    if node.type in {"COMPOSITE", "GROUP_OUTPUT", "VIEWER"}:
        return True
    seen.add(node.name)
    after = {link.to_node for socket in node.outputs for link in socket.links if link.to_node.name not in seen}
    return any(leads_to_picture(each, seen) for each in after)


def background_layer(
    socket: bpy.types.NodeSocket, layers: list[bpy.types.Node], seen: set[str]
) -> bpy.types.Node | None:
    """The render layer that lies farthest back in what feeds a socket: the one the sky belongs behind."""
    for link in socket.links:
        node = link.from_node
        if node in layers:
            return node
        if node.name in seen:
            continue
        seen.add(node.name)
        inputs = [each for each in node.inputs if each.is_linked]
        if node.type == "ALPHAOVER":
            # its first picture is the one behind, called Background in newer versions
            pictures = [each for each in node.inputs if each.type == "RGBA"]
            behind = node.inputs.get("Background") or pictures[0]
            inputs.sort(key=lambda each: each != behind)
        else:
            inputs.sort(key=lambda each: each.type != "RGBA")
        for each in inputs:
            found = background_layer(each, layers, seen)
            if found is not None:
                return found
    return None


def make_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """A compositor tree that passes the render on, for a scene that has none."""
    if has_scene_tree():
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    else:
        tree = bpy.data.node_groups.new("Compositor Nodes", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        output = tree.nodes.new("NodeGroupOutput")
    output[ROLE] = OUTPUT
    output.location = (500, 0)
    add_render_layer(tree, scene)
    return tree


def add_render_layer(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> bpy.types.Node:
    """A Render Layers node of the scene."""
    layer = tree.nodes.new("CompositorNodeRLayers")
    layer.scene = scene
    layer[ROLE] = RENDER_LAYER
    layer.location = (-400, 0)
    return layer


def check_shared(scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> None:
    """Refuse a tree that is not the scene's alone.

    Raises
    ------
    SceneError
        It belongs to another file or scene.
    """
    if has_scene_tree():
        return
    if tree.library is not None:
        raise SceneError(
            f'The compositor tree "{tree.name}" is linked from another file: make it local first.',
            code="settings.linked",
        )
    others = [each.name for each in bpy.data.scenes if each != scene and each.compositing_node_group == tree]
    if others:
        raise SceneError(
            f'The compositor tree "{tree.name}" also belongs to scene "{others[0]}", which has no part in '
            "this black hole: make it single-user in the Compositor first.",
            code="compositor.shared",
        )


def give_back(tree: bpy.types.NodeTree, group: bpy.types.Node, behind: str) -> None:
    """Link what a group feeds to the render layer at its input `behind`, except what was not linked at all before."""
    into, out = group.inputs.get(behind), group.outputs.get("Image")
    if into is None or out is None or not into.is_linked:
        return
    picture = into.links[0].from_socket
    output = output_node(tree)
    for link in list(out.links):
        if group.get(OUTPUT_LINK) and output is not None and link.to_socket == output.inputs[0]:
            continue
        tree.links.new(picture, link.to_socket)


def remove_tree(scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> None:
    """Remove a tree that the set-up made and nobody added to."""
    if has_scene_tree():
        for node in tree.nodes:  # the tree itself is part of the scene and cannot go
            if ROLE in node:
                del node[ROLE]
    else:
        scene.compositing_node_group = None
        bpy.data.node_groups.remove(tree)
