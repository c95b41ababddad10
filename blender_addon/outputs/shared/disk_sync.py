# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in a compositor: the node that reads its layers of light, and the live controls of a node of a group."""

from __future__ import annotations

import math
from dataclasses import replace

import bpy
import numpy as np
from numpy.typing import NDArray

from ...bake.kinds import LIGHT_LAYER
from ...bake.request import MapRequest, request
from ...core import color_spaces
from ...core.physics_api import physics
from ...nodes import disk_layer
from ...scene import disk_animation, frame_setup
from .compositor_tree import ROLE, find_node
from .map_images import drop_live, read_sequence

LAYER = "disk_layer"
"""Role of the node that reads the layers."""
LAYER_IMAGE_NAME = "Umbra Disk Light"

DISK = "disk"
"""Role of the node that lays the disk over a picture; in files of version 0.1 of the one that drew it."""
FORMER_ROLES = ("disk_profile", "disk_colors", "disk_texture", *(f"disk_pass_{number}" for number in range(1, 9)))

_SOCKETS = {"exposure": disk_layer.EXPOSURE.name, "opacity": disk_layer.OPACITY.name, "tint": disk_layer.TINT.name}
"""Property of the disk -> the input that follows it."""


def wanted_hole(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the scene's hole if its disk is switched on."""
    hole = frame_setup.find_active_hole(scene)
    return hole if hole is not None and hole.umbra.disk.enabled else None


# --- maps -----------------------------------------------------------------------------------------


def request_of(
    scene: bpy.types.Scene, frame: frame_setup.FrameSetup, part: tuple[int, int, int, int] | None = None
) -> MapRequest | None:
    """Return the request for a frame's layer of light, or None if it has no disk.

    Parameters
    ----------
    scene : Scene
    frame : FrameSetup
    part : tuple of int, shape (4,), optional
        Column, row, width and height of what is rendered of the picture.
    """
    light = frame.light
    if light is None:
        return None
    if part is not None:
        light = replace(light, view=replace(light.view, camera=light.view.camera.cropped(*part)))
    return request(scene, frame, LIGHT_LAYER, light)


def unresolved(wanted: MapRequest) -> list[str]:
    """Return a warning where light is missing in a layer that is baked."""
    count = wanted.kind.format.read_metadata(wanted.path)["counts"]["unresolved"]
    text = f"Frame {wanted.frame}: light of the disk is missing in {count} pixels, whose rays could not be resolved."
    return [text] if count else []


def point_at(tree: bpy.types.NodeTree, path: str) -> None:
    """Let the disk be read from a sequence of layers."""
    node = find_node(tree, LAYER)
    if node is not None:
        read_sequence(node, LAYER_IMAGE_NAME, path, is_light=True)


# --- nodes ----------------------------------------------------------------------------------------


def ensure_layer(tree: bpy.types.NodeTree, target: bpy.types.NodeSocket) -> None:
    """Have a node that reads the layers, linked to an input."""
    node = find_node(tree, LAYER)
    if node is None:
        node = tree.nodes.new("CompositorNodeImage")
        node[ROLE] = LAYER
        node.name, node.label = "Umbra Disk Layer", "Disk"
        node.location = (target.node.location.x - 300, target.node.location.y - 1100)
    if not any(link.from_node == node for link in target.links):
        tree.links.new(node.outputs["Image"], target)


def remove(tree: bpy.types.NodeTree) -> None:
    """Take the disk's nodes, and those of former versions, out of a compositor."""
    node = find_node(tree, LAYER)
    if node is not None:
        drop_live(node)
        image = node.image
        tree.nodes.remove(node)
        if image is not None and image.users == 0:
            bpy.data.images.remove(image)
    node = find_node(tree, DISK)
    if node is not None:
        remove_drivers(tree, node.path_from_id() + ".")
        tree.nodes.remove(node)
    remove_former(tree)


def has_former(tree: bpy.types.NodeTree) -> bool:
    """Return whether version 0.1 drew the disk in a compositor."""
    node = find_node(tree, DISK)
    return node is not None and disk_layer.is_former(getattr(node, "node_tree", None))


def remove_former(tree: bpy.types.NodeTree) -> None:
    """Take out what version 0.1 drew the disk from."""
    for role in FORMER_ROLES:
        node = find_node(tree, role)
        if node is not None:
            image = getattr(node, "image", None)
            tree.nodes.remove(node)
            if image is not None and image.users == 0 and role.startswith("disk_pass_"):
                bpy.data.images.remove(image)
    disk_layer.remove_unused()


def remove_drivers(tree: bpy.types.NodeTree, prefix: str) -> None:
    """Remove a tree's drivers whose paths begin like this."""
    if tree.animation_data is not None:
        for curve in [each for each in tree.animation_data.drivers if each.data_path.startswith(prefix)]:
            tree.animation_data.drivers.remove(curve)


# --- live controls --------------------------------------------------------------------------------


def follow(node: bpy.types.Node, hole: bpy.types.Object) -> None:
    """Let the live controls of a group's node be those of a hole's disk: values, and drivers where they are animated.

    What is written to a compositor's nodes while Blender renders would show a frame late; drivers are in time.
    """
    animated = disk_animation.animated_paths(hole)
    settings = hole.umbra.disk
    for name, socket_name in _SOCKETS.items():
        value, path = getattr(settings, name), f"umbra.disk.{name}"
        socket, source = node.inputs[socket_name], path if path in animated else None
        if isinstance(value, float):
            _follow(socket, -1, value, hole, source)
        else:
            for index, part in enumerate(value):
                _follow(socket, index, part, hole, None if source is None else f"{source}[{index}]")


def _follow(socket: bpy.types.NodeSocket, index: int, value: float, hole: bpy.types.Object, source: str | None) -> None:
    """Give an input, or one channel of its color, a value or a driver."""
    tree = socket.id_data
    path, place = socket.path_from_id("default_value"), max(index, 0)
    animation = tree.animation_data
    drivers = () if animation is None else animation.drivers
    present = next((each for each in drivers if each.data_path == path and each.array_index == place), None)
    if present is not None and not (source is not None and _reads(present, hole, source)):
        tree.animation_data.drivers.remove(present)
        present = None
    if present is None and source is not None:
        driver = socket.driver_add("default_value", index).driver
        driver.type = "SUM"
        target = driver.variables.new().targets[0]
        target.id, target.data_path = hole, source
    now = socket.default_value if index < 0 else socket.default_value[index]
    if not math.isclose(now, value, rel_tol=1e-6, abs_tol=1e-9):
        if index < 0:
            socket.default_value = value
        else:
            socket.default_value[index] = value


def _reads(curve: bpy.types.FCurve, hole: bpy.types.Object, source: str) -> bool:
    variables = curve.driver.variables
    found = [(each.targets[0].id, each.targets[0].data_path) for each in variables]
    return bool(curve.driver.is_valid) and curve.driver.type == "SUM" and found == [(hole, source)]


# --- in memory ------------------------------------------------------------------------------------


def planes_of(layer: physics.LightLayer) -> tuple[NDArray[np.float32], ...]:
    """Return a layer's planes as an image in memory has them: in the space that Blender renders in."""
    light = color_spaces.to_scene_linear(layer.light.astype(np.float64))
    return (*np.moveaxis(light.astype(np.float32), -1, 0), layer.transmittance)
