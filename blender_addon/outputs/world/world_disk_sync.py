# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in a lensed World: behind all objects, in front of the bent sky, in reflections too.

A Mix Shader before the World's output lays a Background of the disk's color over whatever was there.
"""

from __future__ import annotations

from typing import Any

import bpy

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
from ..shared.map_images import NO_MAP, pixels_of
from . import lensed_world, world_images
from .world_images import DISKS

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
    for group in groups:
        if group.users == 0:
            bpy.data.node_groups.remove(group)
    DISKS.drop(world)


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
    image = None if world is None else world.get(DISKS.file_key)
    if image is not None:
        image.reload()


def _point_at_path(scene: bpy.types.Scene, path: str) -> None:
    world = lensed_world.lensed_world(scene)
    if world is not None and node_of(world) is not None:
        _point(world, DISKS.at_path(world, path), physics.WORLD_LIGHT_GRID[1])


def _point(world: bpy.types.World, image: bpy.types.Image, rows: int) -> None:
    node = node_of(world)
    world_images.read(map_nodes(node.node_tree), image)
    if node.inputs[world_disk.ROWS.name].default_value != rows:
        node.inputs[world_disk.ROWS.name].default_value = rows


# --- the preview's layer --------------------------------------------------------------------------


def show_live(scene: bpy.types.Scene, layer: physics.LightLayer, in_turns: bool) -> None:
    """Let the World read a layer that is in memory; through the same image, or through two in turn."""
    world = lensed_world.lensed_world(scene)
    if world is not None and node_of(world) is not None:
        pixels = pixels_of(*disk_sync.planes_of(layer))
        image = DISKS.write_live(world, _shown_live(world), pixels, in_turns=in_turns)
        _point(world, image, len(pixels))


def _shown_live(world: bpy.types.World) -> bpy.types.Image | None:
    """Return the image of the preview's layer that the World reads now."""
    node = node_of(world)
    return None if node is None else DISKS.shown_live(world, map_nodes(node.node_tree))


def drop_live(scene: bpy.types.Scene) -> None:
    """Let the World read its files again, and free the preview's layer."""
    world = lensed_world.lensed_world(scene)
    if world is not None:
        point_at_files(scene)
        DISKS.drop_live(world)
