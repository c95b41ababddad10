# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in a lensed World: behind all objects, in front of the bent sky, in reflections too.

A Mix Shader before the World's output lays a Background of the disk's color over whatever was there.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ...bake.folder import folder
from ...bake.kinds import WORLD_LIGHT
from ...bake.names import sequence_path
from ...bake.request import MapRequest, request
from ...core.physics_api import physics
from ...nodes import world_disk, world_group
from ...nodes.world_nodes import map_nodes
from ...scene import frame_setup
from ...scene.frame_setup import FrameSetup
from ...scene.sky.node_paths import world_output
from ..shared import disk_sync
from ..shared.map_images import NO_MAP, SEQUENCE_SETTINGS, keep_as_data, map_image
from . import lensed_world
from .lensed_world import DISK_IMAGE as FILE_IMAGE
from .lensed_world import LIVE_DISK_IMAGES as LIVE_IMAGES

IMAGE_NAME, LIVE_NAME = "Umbra World Disk", "Umbra Live Disk"

# On nodes of a World: that they are the disk's.
_OURS = "umbra_world_disk_node"


# --- nodes ----------------------------------------------------------------------------------------


def node_of(world: bpy.types.World | None) -> Any:
    """Return the group's node in a World."""
    nodes = () if world is None or world.node_tree is None else world.node_tree.nodes
    return next((node for node in nodes if node.type == "GROUP" and world_disk.is_group(node.node_tree)), None)


def refresh(scene: bpy.types.Scene) -> None:
    """Put the disk into the lensed World, bring it up to date, or take it out."""
    world = lensed_world.lensed_world(scene)
    if world is None or world.library is not None:
        return
    hole = disk_sync.wanted_hole(scene)
    if hole is None:
        _take_out(world)
        return
    node = node_of(world) or _put_in(scene, world)
    if node is None:
        return
    if node.node_tree.users > 1:  # of a copy of the World
        node.node_tree = node.node_tree.copy()
    world_disk.mend(node.node_tree)
    disk_sync.follow(node, hole)
    if _shown_live(world) is None:
        point_at_files(scene)


def _put_in(scene: bpy.types.Scene, world: bpy.types.World) -> Any:
    tree, source = world.node_tree, lensed_world.group_node(world)
    output = world_output(scene, world)
    if source is None or output is None:
        return None
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = world_disk.new_group()
    group.name = group.label = group.node_tree.name
    background, over = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeMixShader")
    for each, shift in ((group, -640.0), (background, -420.0), (over, -200.0)):
        each[_OURS] = True
        each.location = (output.location.x + shift, output.location.y - 260.0)
    surface = output.inputs["Surface"]
    if surface.is_linked:
        tree.links.new(surface.links[0].from_socket, over.inputs[1])
    tree.links.new(source.outputs[world_group.PLACE.name], group.inputs[world_disk.PLACE.name])
    tree.links.new(group.outputs[world_disk.COLOR.name], background.inputs["Color"])
    tree.links.new(group.outputs[world_disk.COVERS.name], over.inputs[0])
    tree.links.new(background.outputs[0], over.inputs[2])
    tree.links.new(over.outputs[0], surface)
    return group


def _take_out(world: bpy.types.World) -> None:
    tree = world.node_tree
    ours = [node for node in tree.nodes if _OURS in node]
    for node in ours:
        if node.type == "MIX_SHADER":
            behind = node.inputs[1].links[0].from_socket if node.inputs[1].is_linked else None
            for target in [link.to_socket for link in node.outputs[0].links]:
                if behind is not None:
                    tree.links.new(behind, target)
    groups = [node.node_tree for node in ours if node.type == "GROUP" and node.node_tree is not None]
    for node in ours:
        disk_sync.remove_drivers(tree, node.path_from_id() + ".")
        tree.nodes.remove(node)
    remove_data(world, groups)


def remove_data(world: bpy.types.World, groups: list[bpy.types.NodeTree]) -> None:
    """Remove groups and images of a World's disk that nothing uses any more."""
    images = {world[key] for key in (FILE_IMAGE, *LIVE_IMAGES) if world.get(key) is not None}
    for key in (FILE_IMAGE, *LIVE_IMAGES):
        if key in world:
            del world[key]
    for group in groups:
        if group.users == 0:
            bpy.data.node_groups.remove(group)
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)


# --- layers ---------------------------------------------------------------------------------------


def request_of(scene: bpy.types.Scene, frame: FrameSetup) -> MapRequest | None:
    """Return the request for a frame's layer of light for all directions, or None if it has no disk."""
    if frame.light is None:
        return None
    return request(scene, frame, WORLD_LIGHT, physics.world_light_parameters(frame.light))


def point_at_files(scene: bpy.types.Scene) -> None:
    """Let the World read the layer of each frame from its file."""
    hole = frame_setup.find_active_hole(scene)
    if hole is not None:
        _point_at_path(scene, sequence_path(scene, hole.name, physics.WORLD_LIGHT_GRID, WORLD_LIGHT))


def point_at_nothing(scene: bpy.types.Scene) -> None:
    """Let the World read no layer: the disk is magenta."""
    _point_at_path(scene, folder(scene).blender_path + NO_MAP)


def forget_loaded_layer(scene: bpy.types.Scene) -> None:
    """Let Blender read the layers anew from their files."""
    world = lensed_world.lensed_world(scene)
    image = None if world is None else world.get(FILE_IMAGE)
    if image is not None:
        image.reload()


def _point_at_path(scene: bpy.types.Scene, path: str) -> None:
    world = lensed_world.lensed_world(scene)
    if world is None or node_of(world) is None:
        return
    image = _own(world, FILE_IMAGE)
    if image is None:
        image = map_image(IMAGE_NAME)
        world[FILE_IMAGE] = image
    keep_as_data(image, is_light=True)
    if image.filepath != path:
        image.filepath = path
    _point(world, image, physics.WORLD_LIGHT_GRID[1])


def _point(world: bpy.types.World, image: bpy.types.Image, rows: int) -> None:
    node = node_of(world)
    if node is None:
        return
    for each in map_nodes(node.node_tree):
        if each.image != image:
            each.image = image
        if image.source == "SEQUENCE":
            for name, value in SEQUENCE_SETTINGS.items():
                if getattr(each.image_user, name) != value:
                    setattr(each.image_user, name, value)
    if node.inputs[world_disk.ROWS.name].default_value != rows:
        node.inputs[world_disk.ROWS.name].default_value = rows


def _own(world: bpy.types.World, key: str) -> bpy.types.Image | None:
    """Return an image that a World remembers; not one that it shares with the World it is a copy of."""
    image = world.get(key)
    shared = any(each != world and each.get(key) == image for each in bpy.data.worlds)
    return None if shared else image


# --- the preview's layer --------------------------------------------------------------------------


def show_live(scene: bpy.types.Scene, layer: physics.LightLayer, in_turns: bool) -> None:
    """Let the World read a layer that is in memory; through the same image, or through two in turn."""
    world = lensed_world.lensed_world(scene)
    if world is None or node_of(world) is None:
        return
    first, second = LIVE_IMAGES
    shown = _shown_live(world)
    key = second if in_turns and shown is not None and shown == world.get(first) else first
    rows, columns = layer.transmittance.shape
    image = _own(world, key)
    if image is None or tuple(image.size) != (columns, rows):
        image = bpy.data.images.new(LIVE_NAME, columns, rows, alpha=True, float_buffer=True, is_data=True)
        image.alpha_mode = "CHANNEL_PACKED"
        image.use_half_precision = False
        world[key] = image
    pixels = np.stack(disk_sync.planes_of(layer), axis=-1)[::-1]
    image.pixels.foreach_set(np.ascontiguousarray(pixels, dtype=np.float32).ravel())
    image.update()
    _point(world, image, rows)


def _shown_live(world: bpy.types.World) -> bpy.types.Image | None:
    """Return the image of the preview's layer that the World reads now."""
    node = node_of(world)
    read = set() if node is None else {each.image for each in map_nodes(node.node_tree)}
    image = read.pop() if len(read) == 1 else None
    return image if image is not None and image in [world.get(key) for key in LIVE_IMAGES] else None


def drop_live(scene: bpy.types.Scene) -> None:
    """Let the World read its files again, and free the preview's layer."""
    world = lensed_world.lensed_world(scene)
    if world is None:
        return
    point_at_files(scene)
    images = [world[key] for key in LIVE_IMAGES if world.get(key) is not None]
    for key in LIVE_IMAGES:
        if key in world:
            del world[key]
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)
