# SPDX-License-Identifier: GPL-3.0-or-later
"""A World that shows an equirectangular image, as Blender itself would."""

from typing import Any

import bpy

from ...core.blender_version import NODES_ARE_OPTIONAL
from . import sky_frames

# Kinds of the chain's nodes, the socket by which each feeds the next, and the socket of that.
_KINDS = ("TexCoord", "Mapping", "TexEnvironment", "Background", "OutputWorld")
_LINKS = (("Generated", "Vector"), ("Vector", "Vector"), ("Color", "Color"), ("Background", "Surface"))


def make(name: str, image: bpy.types.Image) -> bpy.types.World:
    """Return a new World: coordinates, Mapping, Environment Texture, Background."""
    made = bpy.data.worlds.new(name)
    if NODES_ARE_OPTIONAL:
        made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    nodes = [tree.nodes.new(f"ShaderNode{kind}") for kind in _KINDS]
    for index, node in enumerate(nodes):
        node.location = (220.0 * index, 0.0)
    for one, other, (source, target) in zip(nodes, nodes[1:], _LINKS, strict=False):
        tree.links.new(one.outputs[source], other.inputs[target])
    show(made, image)
    return made


def texture(world: bpy.types.World) -> Any:
    """Return a World's Environment Texture."""
    return next(node for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT")


def show(world: bpy.types.World, image: bpy.types.Image) -> None:
    """Let such a World show an image."""
    node = texture(world)
    if node.image != image:
        node.image = image
        if sky_frames.moves(image):
            sky_frames.set_defaults(image, node.image_user)


def placement(world: bpy.types.World) -> dict[str, Any]:
    """Return the sockets that hold rotation and strength."""
    names = {"MAPPING": "Rotation", "BACKGROUND": "Strength"}
    nodes = [node for node in world.node_tree.nodes if node.type in names]
    return {names[node.type]: node.inputs[names[node.type]] for node in nodes}
