# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in front of what the Cycles Lens shows: a camera's shader cannot shine, so the compositor draws it.

All that the lens shows is behind the disk: a bent ray begins outside of the lens sphere, or ends in the hole. So the
picture of the render layer goes through the group "Umbra Disk" before it goes where it went.
"""

from collections.abc import Callable
from dataclasses import replace

import bpy
import numpy as np

from ...bake.folder import folder
from ...bake.kinds import WARP_MAP
from ...bake.names import sequence_path
from ...bake.request import MapRequest, request
from ...core.physics_api import physics
from ...nodes import disk_group
from ...scene import cameras, frame_setup
from ..shared import disk_sync, tree_editing
from ..shared.compositor_tree import find_node, find_tree, has_scene_tree, render_layers
from ..shared.map_images import NO_MAP, plain_map
from . import lens_tree


def put_in(scene: bpy.types.Scene) -> bpy.types.Node:
    """Put the disk's nodes between the render and whatever its picture feeds, unless they are there.

    Raises
    ------
    SceneError
        The scene's compositor tree cannot be changed.
    """
    tree = lens_tree.claim(scene)
    node = disk_sync.ensure_node(scene, tree)
    if node.inputs[disk_group.BEHIND].is_linked:
        return node
    output = tree_editing.output_node(tree)
    layers = render_layers(tree, scene)
    layer = tree_editing.background_layer(output.inputs[0], layers, set()) if output is not None else None
    if layer is None:
        layer = layers[0] if layers else tree_editing.add_render_layer(tree, scene)
    picture = layer.outputs["Image"]
    fed = [link.to_socket for link in picture.links if tree_editing.leads_to_picture(link.to_node)]
    tree.links.new(picture, node.inputs[disk_group.BEHIND])
    for socket in fed:
        tree.links.new(node.outputs[disk_group.IMAGE], socket)
    node.location = (layer.location.x + 300, layer.location.y)
    disk_sync.arrange(tree, node)
    if output is not None and not output.inputs[0].is_linked:
        tree.links.new(node.outputs[disk_group.IMAGE], output.inputs[0])
        node[tree_editing.OUTPUT_LINK] = True
    return node


def take_out(scene: bpy.types.Scene) -> None:
    """Give the render's picture back to whatever the disk's feeds, and remove the disk's nodes."""
    tree = find_tree(scene)
    node = find_node(tree, disk_sync.DISK) if tree is not None else None
    if tree is not None and node is not None:
        tree_editing.give_back(tree, node, disk_group.BEHIND)
        disk_sync.remove(tree)
    lens_tree.release(scene)


def stand_aside(scene: bpy.types.Scene) -> Callable[[], None]:
    """Let the disk's nodes read passes of a disk that is nowhere; return what undoes that."""
    tree = find_tree(scene)
    if tree is not None:
        disk_sync.point_passes(tree, plain_map(scene.frame_current))
    return lambda: point_at_passes(scene)


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
    disk_sync.update(scene, hole, put_in(scene))
    point_at_passes(scene)


def is_in_use(scene: bpy.types.Scene) -> bool:
    """Whether rendering the scene draws the disk over the lens's picture."""
    if not scene.render.use_compositing or (has_scene_tree() and not scene.use_nodes):
        return False
    tree = find_tree(scene)
    node = find_node(tree, disk_sync.DISK) if tree is not None else None
    return node is not None and not node.mute and node.outputs[disk_group.IMAGE].is_linked


# --- passes ---------------------------------------------------------------------------------------


def parameters_of(scene: bpy.types.Scene, frame: frame_setup.FrameSetup) -> "physics.WarpMapParameters":
    """What the map is made from whose passes are drawn: the frame's own, or of the part that is rendered."""
    part = _part(scene)
    if part is None:
        return frame.parameters
    return replace(frame.parameters, camera=frame.parameters.camera.cropped(*part))


def request_of(scene: bpy.types.Scene, frame: frame_setup.FrameSetup) -> MapRequest:
    """Return the request for that map; its passes are beside it."""
    return request(scene, frame, WARP_MAP, parameters_of(scene, frame))


def point_at_passes(scene: bpy.types.Scene) -> None:
    """Let the disk's nodes read the passes of the current resolution, and of the part that is rendered."""
    tree, hole = find_tree(scene), frame_setup.find_active_hole(scene)
    if tree is None or hole is None:
        return
    samples = int(scene.umbra.supersampling)
    part = _part(scene)
    width, height = cameras.render_size(scene.render) if part is None else part[2:]
    size = (width * samples, height * samples)
    disk_sync.point_passes(tree, sequence_path(scene, hole.name, size, WARP_MAP))


def point_at_nothing(scene: bpy.types.Scene) -> None:
    """Let them read nothing: the picture is magenta until valid passes are in place."""
    tree = find_tree(scene)
    if tree is not None:
        disk_sync.point_passes(tree, folder(scene).blender_path + NO_MAP)


def forget_loaded_passes(scene: bpy.types.Scene) -> None:
    """Let Blender read the passes from their files again."""
    tree = find_tree(scene)
    for node, _crossing in disk_sync.passes_of(tree) if tree is not None else ():
        if node.image is not None:
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
