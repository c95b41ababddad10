# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the add-on's nodes in a scene's compositor."""

from dataclasses import dataclass

import bpy

from ...core.blender_version import SCENE_OWNS_COMPOSITOR
from ...core.errors import SceneError

# The node's custom property that says what it is for, and its values.
ROLE = "umbra_role"
GROUP, MAP, SKY, RENDER_LAYER, OUTPUT = "group", "map", "sky", "render_layer", "output"
FOOTPRINT, LEVELS, STARS = "footprint", "levels", "stars"
# What a node of a role is: one of another type was given the role by hand.
TYPES = {
    GROUP: "GROUP",
    MAP: "IMAGE",
    SKY: "IMAGE",
    FOOTPRINT: "IMAGE",
    LEVELS: "IMAGE",
    STARS: "IMAGE",
    RENDER_LAYER: "R_LAYERS",
}


@dataclass(frozen=True)
class Setup:
    """The nodes of a scene's set-up."""

    tree: bpy.types.NodeTree
    group: bpy.types.Node
    map: bpy.types.Node | None
    sky: bpy.types.Node | None


def has_scene_tree() -> bool:
    """Whether this Blender keeps the compositor's tree inside the scene (before 5.0)."""
    return SCENE_OWNS_COMPOSITOR


def find_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """The scene's compositor tree, if it has one."""
    return scene.node_tree if has_scene_tree() else scene.compositing_node_group


def find_node(tree: bpy.types.NodeTree, role: str) -> bpy.types.Node | None:
    """The add-on's node of that role in a tree."""
    return next(iter(find_nodes(tree, role)), None)


def find_nodes(tree: bpy.types.NodeTree, role: str) -> list[bpy.types.Node]:
    """All nodes that play a role in a tree: one, unless somebody made copies."""
    return [node for node in tree.nodes if node.get(ROLE) == role and TYPES.get(role, node.type) == node.type]


def find_setup(scene: bpy.types.Scene) -> Setup | None:
    """The nodes of the set-up; None where the group is not in the scene's compositor."""
    tree = find_tree(scene)
    if tree is None:
        return None
    group = find_node(tree, GROUP)
    if group is None:
        return None
    return Setup(tree, group, find_node(tree, MAP), find_node(tree, SKY))


def takes_sky_from_settings(setup: Setup) -> bool:
    """Whether the sky comes from the add-on's own image node, and not from nodes of the artist's."""
    socket = setup.group.inputs.get("Environment")
    if socket is None or setup.sky is None:
        return False
    if not socket.is_linked and setup.sky.image is not None and setup.sky.image.type == "MULTILAYER":
        return True  # Blender 4.5 drops the links of a file of layers while that is missing
    return any(link.from_node == setup.sky for link in socket.links)


def is_in_use(scene: bpy.types.Scene) -> bool:
    """Whether rendering the scene runs the group."""
    if not scene.render.use_compositing or (has_scene_tree() and not scene.use_nodes):
        return False
    setup = find_setup(scene)
    return setup is not None and not setup.group.mute and any(each.is_linked for each in setup.group.outputs)


def check_rendered(scene: bpy.types.Scene) -> None:
    """Refuse a compositor that would run the group without rendering the scene.

    Blender evaluates the scene at a frame only to render it; without that no map could be made for the frame.

    Raises
    ------
    SceneError
        No Render Layers node of the scene belongs to a view layer that is rendered.
    """
    tree = find_tree(scene)
    layers = [node.layer for node in render_layers(tree, scene)] if tree is not None else []
    if not layers:
        raise SceneError(
            f'The compositor of scene "{scene.name}" has no Render Layers node, so nothing is rendered: add one, or '
            "run Set Up Compositor.",
            code="compositor.no-render-layers",
        )
    if not any(scene.view_layers[name].use for name in layers if name in scene.view_layers):
        raise SceneError(
            f'View layer "{layers[0]}" is not rendered: switch on Use for Rendering in its View Layer Properties.',
            code="compositor.layer-off",
        )


def check_linked(scene: bpy.types.Scene) -> None:
    """Refuse a set-up in which the group does not get the maps: its picture would be magenta without a word.

    Raises
    ------
    SceneError
        The warp map's node is gone, or not connected to the group.
    """
    setup = find_setup(scene)
    if setup is None:
        return
    socket = setup.group.inputs.get("Warp Map")
    origins = [link.from_node for link in socket.links] if socket is not None else []
    if setup.map is None or setup.map not in origins:
        raise SceneError(
            f'The compositor of scene "{scene.name}" does not give the warp maps to the node "{setup.group.name}": run '
            "Set Up Compositor.",
            code="compositor.not-linked",
        )


def check_unmuted(scene: bpy.types.Scene) -> None:
    """Refuse a compositor in which our nodes, or links between them, are muted: they hand on something else.

    A group that is muted itself is switched off, which `is_in_use` knows.

    Raises
    ------
    SceneError
        The sentence names the node.
    """
    tree = find_tree(scene)
    ours = (
        [node for node in tree.nodes if node.get(ROLE) not in (None, RENDER_LAYER, OUTPUT)] if tree is not None else []
    )
    for node in ours:
        fed = any(socket.is_linked for socket in node.outputs)
        origins = [link for socket in node.inputs for link in socket.links if link.from_node in ours]
        if (node.mute and fed) or any(link.is_muted for link in origins):
            raise SceneError(
                f'The node "{node.name}" in the compositor of scene "{scene.name}", or a link to it, is muted: unmute '
                "it (M over a node, Ctrl Alt and the right mouse button across a link).",
                code="compositor.muted",
            )


def render_layers(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> list[bpy.types.Node]:
    """The Render Layers nodes of a scene in a compositor tree."""
    return [node for node in tree.nodes if node.type == "R_LAYERS" and node.scene in (None, scene)]
