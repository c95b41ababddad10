# SPDX-License-Identifier: GPL-3.0-or-later
"""What is inside the node group "Umbra World": from the direction of a ray to where its light comes from.

The same as `physics.world_map.WorldMap.look_up` in float64, term by term. Texels are read one by one and mixed here:
filters of graphics cards have eight bits for the place between two texels, and use smaller copies of the picture
where its coordinates jump, which draws lines around the circle's seam and the shadow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy

from ..core.physics_api import physics
from .arithmetic import atan2, clamp, combine, floor, log, maximum, minimum, mix, multiply_add, sqrt, where
from .builder import Float, Number, TreeBuilder, Vector

MAP_ROLE = "umbra_world_map"
"""Custom property of the image nodes that read the map."""

# Of the texture's height; within row 0 of any map.
_HEADER_HEIGHT = 1e-4
_LEAST_DISTANCE = 1e-9  # radians
_STAMP_SLACK = 1e-3
ON = 0.5  # switches are floats, so that drivers and keyframes are at hand


@dataclass(frozen=True)
class WorldInputs:
    """Values of the Group Input node; `world_group` describes them."""

    lensing: Float
    other_rays: Float
    exposure: Float
    redshift_color: Float
    redshift_brightness: Float
    temperature: Float


@dataclass(frozen=True)
class WorldOutputs:
    """Values for the Group Output node; `world_group` describes them."""

    vector: Vector
    shift: Vector
    light: Vector
    shadow: Float
    redshift: Float
    place: Vector


@dataclass(frozen=True)
class _Header:
    """Row 0 of the map; see `physics.maps.world_map` for what the values mean."""

    outward: Vector
    offset: Float
    polar: Vector
    slope: Float
    motion: Vector
    beta: Float
    shift: Vector
    constant: Float
    lowest: Float
    stamp: Float
    width: Float
    height: Float


def map_nodes(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    """The image nodes of a group that read the map."""
    return [node for node in tree.nodes if MAP_ROLE in node]


def build(builder: TreeBuilder, inputs: WorldInputs) -> WorldOutputs:
    """Add all nodes between the group's inputs and its outputs.

    Parameters
    ----------
    builder : TreeBuilder
        Of a shader tree in which there is only the Group Input node.
    inputs : WorldInputs
        That node's values.

    Returns
    -------
    WorldOutputs
        Values to link to the Group Output node.
    """
    with builder.frame("Which rays are bent"):
        camera = Float(builder, builder.node("ShaderNodeLightPath").outputs["Is Camera Ray"])
        others = inputs.other_rays.greater_than(ON)
        lensed = (inputs.lensing.greater_than(ON) * maximum(camera, others)).labeled("Bent?")
    with builder.frame("Direction of the ray"):
        looking = Vector(builder, builder.node("ShaderNodeTexCoord").outputs["Generated"]).normalized()
    with builder.frame("The map's header"):
        header = _read_header(builder)
        is_map = header.stamp.near(physics.WORLD_MAP_STAMP, _STAMP_SLACK).labeled("A map?")
    with builder.frame("Aberration (Eq. 5)"):
        seen = _seen_by_fido(looking, header)
    with builder.frame("Angles about the hole"):
        away, across = _about_hole(seen, header)
        column = multiply_add(across, header.width, -0.5)
        left = floor(column)
        share_x = column - left
        columns = [(left + shift) / header.width for shift in (0.5, 1.5)]
    with builder.frame("Place in a panorama about the hole"):
        place = _place(looking, header, lensed)
    with builder.frame("The shadow's edge"):
        edges = [texel(builder, each, 0.5)[1] for each in columns]
        delta = (away - mix(share_x, *edges)).labeled("From the edge")
        visible = delta.greater_than(0.0).labeled("Sky?")
    with builder.frame("Where the light comes from"):
        origin = _origin(builder, header, columns, share_x, delta)
        resolved = origin.length().greater_than(physics.WORLD_MAP_SHORTEST).labeled("Resolved?")
        vector = where(lensed, origin.normalized(), looking).labeled("Bent or plain")
    with builder.frame("Redshift"):
        one_plus_z = header.constant + looking.dot(header.shift)
        # A picture that is not a map must not lead to NaN.
        one_plus_z = maximum(physics.SMALLEST_ONE_PLUS_Z, one_plus_z)
        redshift = where(lensed, one_plus_z, 1.0)
    with builder.frame("Results"):
        shown = where(lensed, visible * (is_map * resolved), 1.0)
        brightness = shown * 2.0**inputs.exposure
        # Magenta without a map, and in sky whose ray was not resolved.
        correct = is_map * where(visible, resolved, 1.0)
        fault = (lensed * (1.0 - correct)).labeled("Magenta if invalid")
        shift = combine(redshift, inputs.redshift_color, inputs.redshift_brightness)
        light = combine(inputs.temperature, brightness, fault)
        shadow = lensed * (1.0 - visible)
    return WorldOutputs(vector, shift, light, shadow, redshift, place)


def _about_hole(direction: Vector, header: _Header) -> tuple[Float, Float]:
    """Angle of a direction from that of the hole, radians, and its position angle about that, in turns."""
    aside = direction.dot(header.polar)
    up = direction.dot(header.outward.cross(header.polar))
    ahead = -direction.dot(header.outward)
    away = atan2(sqrt(multiply_add(aside, aside, up * up)), ahead).labeled("From the hole")
    return away, atan2(up, aside) * (0.5 / math.pi)


def _place(looking: Vector, header: _Header, lensed: Float) -> Vector:
    """Where `physics.HolePanorama` sees a direction: turns about the hole's direction, from above down; and if bent."""
    away, across = _about_hole(looking, header)
    focus, rate = physics.HolePanorama.FOCUS, physics.HolePanorama.RATE
    down = log(multiply_add(away, 1.0 / focus, 1.0)) * (1.0 / rate)
    return combine(across, down, lensed)


def texel(builder: TreeBuilder, across: Number, height: Number) -> tuple[Vector, Float]:
    """Color and alpha of the texel at texture coordinates; `across` repeats with period 1."""
    place = builder.combine(across, height, 0.0)
    node = builder.node("ShaderNodeTexImage")
    node.interpolation = "Closest"
    node.projection = "FLAT"
    node.extension = "REPEAT"
    node[MAP_ROLE] = True
    builder.feed(node.inputs["Vector"], place)
    return Vector(builder, node.outputs["Color"]), Float(builder, node.outputs["Alpha"])


def _read_header(builder: TreeBuilder) -> _Header:
    (outward, offset), (polar, slope), (motion, beta), (shift, constant), (last, height) = (
        texel(builder, (part + 0.5) / physics.WORLD_MAP_HEADER_PARTS, _HEADER_HEIGHT) for part in range(5)
    )
    lowest, stamp, width = last.separate()
    width, height = maximum(1.0, width), maximum(1.0, height)
    return _Header(outward, offset, polar, slope, motion, beta, shift, constant, lowest, stamp, width, height)


def _seen_by_fido(looking: Vector, header: _Header) -> Vector:
    """Where the local FIDO looks to see what the camera sees; not of unit length."""
    contraction = sqrt(maximum(0.0, (1.0 - header.beta) * (1.0 + header.beta)))
    along = looking.dot(header.motion)
    factor = (1.0 - contraction) * along - header.beta
    return looking * contraction + header.motion * factor


def _origin(builder: TreeBuilder, header: _Header, columns: list[Float], share_x: Float, delta: Float) -> Vector:
    """The vector towards the light's origin, mixed of four texels; shorter than 1."""
    positive = maximum(delta, _LEAST_DISTANCE)
    height = multiply_add(log(positive) + positive, header.slope, header.offset)
    highest = 1.0 - 0.5 / header.height
    height = clamp(height, header.lowest, highest)
    row = multiply_add(height, header.height, -0.5)
    below = floor(row)
    share_y = row - below
    last = header.height - 0.5
    mixed = []
    for shift in (0.5, 1.5):
        at = minimum(last, below + shift) / header.height
        texels = [texel(builder, column, at)[0] for column in columns]
        mixed.append(mix(share_x, *texels))
    return mix(share_y, *mixed)
