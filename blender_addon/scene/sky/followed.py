# SPDX-License-Identifier: GPL-3.0-or-later
"""What turns and brightens the sky of a World as a whole: left out of its panorama, and followed, animated as well."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .node_paths import SHINING, Place, reachable, source

# Kinds of nodes whose results depend on the ray's direction by their inputs alone, beside textures.
_PLAIN = frozenset(
    (
        *("MAPPING", "TEX_COORD", "REROUTE", "RGB", "VALUE", "LIGHT_PATH", "BLACKBODY", "WAVELENGTH"),
        *("HUE_SAT", "GAMMA", "BRIGHTCONTRAST", "INVERT", "CURVE_RGB", "CURVE_VEC", "CURVE_FLOAT", "VALTORGB"),
        *("MIX", "MIX_RGB", "MATH", "VECT_MATH", "VECTOR_ROTATE", "MAP_RANGE", "CLAMP", "RGBTOBW"),
        *("SEPARATE_COLOR", "COMBINE_COLOR", "SEPXYZ", "COMBXYZ"),
    )
)


@dataclass(frozen=True)
class Followed:
    """Values in a World's own nodes that are followed; neither of them where nothing can be."""

    rotation: Place | None = None
    """Of a Mapping node that all of the sky's directions go through."""
    strength: Place | None = None
    """Of the one Background, or Emission."""

    @property
    def places(self) -> list[Place]:
        """Both, as far as there are any."""
        return [each for each in (self.rotation, self.strength) if each is not None]

    def has(self, socket: bpy.types.NodeSocket) -> bool:
        """Return whether a socket holds one of them."""
        return any(each.socket == socket for each in self.places)

    def make_neutral(self, copy: bpy.types.World) -> None:
        """Turn and brighten the sky of a World's copy no more."""
        copy.animation_data_clear()
        copy.node_tree.animation_data_clear()
        for each in self.places:
            socket = copy.node_tree.nodes[each.node.name].inputs[each.socket.name]
            socket.default_value = (0.0, 0.0, 0.0) if each is self.rotation else 1.0


def of(world: bpy.types.World, output: bpy.types.Node) -> Followed:
    """Return what is followed of a World that needs a panorama."""
    background = source(Place(output.inputs["Surface"]))
    if not background.is_output or background.node.type not in SHINING or background.owner != world.node_tree:
        return Followed()
    strength = background.input("Strength")
    is_plain = not strength.is_output and strength.node == background.node
    return Followed(_rotation(world, background.node), strength if is_plain else None)


def _rotation(world: bpy.types.World, background: bpy.types.Node) -> Place | None:
    """Where the whole sky is turned, if it is turned in one place."""
    nodes = list(reachable(background.inputs["Color"]))
    if background.inputs["Strength"].is_linked or any(each.id_data != world.node_tree for each in nodes):
        return None
    mappings = [each for each in nodes if each.type == "MAPPING"]
    if len(mappings) != 1 or not all(_goes_through(each, mappings[0]) for each in nodes):
        return None
    return _turns_only(mappings[0])


def _goes_through(node: bpy.types.Node, mapping: bpy.types.Node) -> bool:
    """Whether a node knows the ray's direction by the Mapping node alone."""
    if node.type == "TEX_COORD":
        linked = [each for each in node.outputs if each.is_linked]
        targets = [link.to_node for each in linked for link in each.links]
        return all(each.name == "Generated" for each in linked) and all(each == mapping for each in targets)
    if node.type.startswith("TEX_"):
        return node.inputs.get("Vector") is not None and node.inputs["Vector"].is_linked
    return node.type in _PLAIN


def _turns_only(mapping: bpy.types.Node) -> Place | None:
    if mapping.mute or mapping.vector_type == "TEXTURE" or not mapping.inputs["Vector"].is_linked:
        return None
    rotation, scale, location = (mapping.inputs[name] for name in ("Rotation", "Scale", "Location"))
    if any(each.is_linked for each in (rotation, scale, location)) or tuple(scale.default_value) != (1.0, 1.0, 1.0):
        return None
    moves = mapping.vector_type == "POINT" and any(location.default_value)
    return None if moves else Place(rotation)


def animated(owner: bpy.types.ID) -> set[str]:
    """Return the data paths of a datablock that are animated: by keyframes, drivers, and strips."""
    found = owner.animation_data
    if found is None:
        return set()
    strips = [each.action for track in found.nla_tracks for each in track.strips]
    actions = [each for each in (found.action, *strips) if each is not None]
    curves = [
        curve
        for action in actions
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        for curve in bag.fcurves
    ]
    return {curve.data_path for curve in (*curves, *found.drivers)}
