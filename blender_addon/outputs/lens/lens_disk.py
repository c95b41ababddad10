# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in front of what the Cycles Lens shows: a camera's shader cannot shine, so the compositor draws it.

All that the lens shows is behind the disk: a bent ray begins outside of the lens sphere, or ends in the hole. So the
picture of the render layer goes through the group "Umbra Disk Light" before it goes where it went.
"""

from collections.abc import Callable

import bpy
import numpy as np

from ...bake.folder import folder
from ...bake.kinds import LIGHT_LAYER
from ...bake.names import sequence_path
from ...bake.request import MapRequest
from ...nodes import disk_layer
from ...scene import cameras, frame_setup
from ..shared import disk_sync, tree_editing
from ..shared.compositor_tree import ROLE, find_node, find_tree, has_scene_tree, render_layers
from ..shared.map_images import NO_MAP, plain_layer
from . import lens_tree


def put_in(scene: bpy.types.Scene) -> bpy.types.Node:
    """Put the disk's nodes between the render and whatever its picture feeds, unless they are there.

    Raises
    ------
    SceneError
        The scene's compositor tree cannot be changed.
    """
    tree = lens_tree.claim(scene)
    node = find_node(tree, disk_sync.DISK)
    if node is None:
        node = tree.nodes.new("CompositorNodeGroup")
        node[ROLE] = disk_sync.DISK
        node.width = 220.0
    _use_group(node)
    disk_sync.ensure_layer(tree, node.inputs[disk_layer.DISK.name])
    if node.inputs[disk_layer.BEHIND].is_linked:
        return node
    output = tree_editing.output_node(tree)
    layers = render_layers(tree, scene)
    layer = tree_editing.background_layer(output.inputs[0], layers, set()) if output is not None else None
    if layer is None:
        layer = layers[0] if layers else tree_editing.add_render_layer(tree, scene)
    picture = layer.outputs["Image"]
    fed = [link.to_socket for link in picture.links if tree_editing.leads_to_picture(link.to_node)]
    tree.links.new(picture, node.inputs[disk_layer.BEHIND])
    for socket in fed:
        tree.links.new(node.outputs[disk_layer.IMAGE], socket)
    node.location = (layer.location.x + 300, layer.location.y)
    if output is not None and not output.inputs[0].is_linked:
        tree.links.new(node.outputs[disk_layer.IMAGE], output.inputs[0])
        node[tree_editing.OUTPUT_LINK] = True
    return node


def _use_group(node: bpy.types.Node) -> None:
    """Let a node use the group, in place of one of version 0.1, whose picture goes in and out at sockets of the same
    names."""
    former, group = node.node_tree, disk_layer.GROUP.ensure()
    node.name = node.label = disk_layer.GROUP.name
    if former == group:
        return
    tree = node.id_data
    behind = node.inputs.get(disk_layer.BEHIND)
    origin = behind.links[0].from_socket if behind is not None and behind.is_linked else None
    picture = node.outputs.get(disk_layer.IMAGE)
    targets = [] if picture is None else [link.to_socket for link in picture.links]
    disk_sync.remove_drivers(tree, node.path_from_id() + ".")
    for link in [link for socket in node.inputs for link in socket.links]:
        tree.links.remove(link)  # kept, they would go by the order of the sockets
    node.node_tree = group
    if origin is not None:
        tree.links.new(origin, node.inputs[disk_layer.BEHIND])
    for target in targets:
        tree.links.new(node.outputs[disk_layer.IMAGE], target)
    disk_sync.remove_former(tree)


def take_out(scene: bpy.types.Scene) -> None:
    """Give the render's picture back to whatever the disk's feeds, and remove the disk's nodes."""
    tree = find_tree(scene)
    node = find_node(tree, disk_sync.DISK) if tree is not None else None
    if tree is not None and node is not None:
        tree_editing.give_back(tree, node, disk_layer.BEHIND)
        disk_sync.remove(tree)
    lens_tree.release(scene)


def stand_aside(scene: bpy.types.Scene) -> Callable[[], None]:
    """Let the disk's node read a layer of a disk that is nowhere; return what undoes that."""
    tree = find_tree(scene)
    if tree is not None:
        disk_sync.point_at(tree, plain_layer(scene.frame_current))
    return lambda: point_at_layers(scene)


def refresh(scene: bpy.types.Scene) -> None:
    """Put the disk's nodes into the compositor, bring them up to date, or take them out.

    Raises
    ------
    SceneError
        If the compositor tree belongs to another file or scene.
    """
    if scene.library is not None:
        return
    hole = disk_sync.wanted_hole(scene)
    if hole is None:
        take_out(scene)
        return
    disk_sync.follow(put_in(scene), hole)
    point_at_layers(scene)


def is_in_use(scene: bpy.types.Scene) -> bool:
    """Whether rendering the scene draws the disk over the lens's picture."""
    if not scene.render.use_compositing or (has_scene_tree() and not scene.use_nodes):
        return False
    tree = find_tree(scene)
    node = find_node(tree, disk_sync.DISK) if tree is not None else None
    return node is not None and not node.mute and node.outputs[disk_layer.IMAGE].is_linked


# --- layers ---------------------------------------------------------------------------------------


def request_of(scene: bpy.types.Scene, frame: frame_setup.FrameSetup) -> MapRequest | None:
    """Return the request for the layer of a frame, or of the part of it that is rendered; None without a disk."""
    return disk_sync.request_of(scene, frame, _part(scene))


def point_at_layers(scene: bpy.types.Scene) -> None:
    """Let the disk's node read the layers of the current resolution, and of the part that is rendered."""
    tree, hole = find_tree(scene), frame_setup.find_active_hole(scene)
    if tree is not None and hole is not None:
        part = _part(scene)
        size = cameras.render_size(scene.render) if part is None else part[2:]
        disk_sync.point_at(tree, sequence_path(scene, hole.name, size, LIGHT_LAYER))


def point_at_nothing(scene: bpy.types.Scene) -> None:
    """Let it read nothing: the picture is magenta until a valid layer is in place."""
    tree = find_tree(scene)
    if tree is not None:
        disk_sync.point_at(tree, folder(scene).blender_path + NO_MAP)


def forget_loaded_layers(scene: bpy.types.Scene) -> None:
    """Let Blender read the layers from their files again."""
    tree = find_tree(scene)
    node = None if tree is None else find_node(tree, disk_sync.LAYER)
    if node is not None and node.image is not None:
        node.image.reload()


def _part(scene: bpy.types.Scene) -> tuple[int, int, int, int] | None:
    """Column, row, width and height, in pixels from the top left, of what is rendered with Crop to Render Region."""
    render = scene.render
    if not (render.use_border and render.use_crop_to_border):
        return None
    width, height = cameras.render_size(render)
    # Blender multiplies in single precision, and cuts off.
    left, right = (int(np.float32(each) * np.float32(width)) for each in (render.border_min_x, render.border_max_x))
    low, high = (int(np.float32(each) * np.float32(height)) for each in (render.border_min_y, render.border_max_y))
    return left, height - high, max(right - left, 1), max(high - low, 1)
