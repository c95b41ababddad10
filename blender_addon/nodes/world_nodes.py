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

from ..core.physics_api import reference_render, world_map
from .black_hole_nodes import redshift_gain
from .builder import Socket, TreeBuilder, Value

MAP_ROLE = "umbra_world_map"
"""Custom property of the image nodes that read the map."""

# Of the texture's height; within row 0 of any map.
_HEADER_HEIGHT = 1e-4
_LEAST_DISTANCE = 1e-9  # radians
_STAMP_SLACK = 1e-3
ON = 0.5  # switches are floats, so that drivers and keyframes are at hand


@dataclass(frozen=True)
class WorldInputs:
    """Output sockets of the Group Input node."""

    lensing: Socket
    other_rays: Socket
    exposure: Socket
    redshift_color: Socket
    redshift_brightness: Socket
    temperature: Socket


@dataclass(frozen=True)
class WorldOutputs:
    """What goes into the Group Output node."""

    vector: Socket
    tint: Socket
    fault: Socket
    shadow: Socket
    redshift: Socket


@dataclass(frozen=True)
class _Header:
    outward: Socket
    offset: Socket
    polar: Socket
    slope: Socket
    motion: Socket
    beta: Socket
    shift: Socket
    constant: Socket
    lowest: Socket
    stamp: Socket
    width: Socket
    height: Socket


def map_nodes(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    """The image nodes of a group that read the map."""
    return [node for node in tree.nodes if MAP_ROLE in node]


def build(builder: TreeBuilder, inputs: WorldInputs) -> WorldOutputs:
    """Add all nodes between the group's inputs and its outputs."""
    with builder.frame("Which rays are bent"):
        camera = builder.node("ShaderNodeLightPath").outputs["Is Camera Ray"]
        others = builder.math("GREATER_THAN", inputs.other_rays, ON)
        lensed = builder.math("GREATER_THAN", inputs.lensing, ON)
        lensed = builder.math("MULTIPLY", lensed, builder.math("MAXIMUM", camera, others), label="Bent?")
    with builder.frame("Direction of the ray"):
        generated = builder.node("ShaderNodeTexCoord").outputs["Generated"]
        looking = builder.vector_math("NORMALIZE", generated)
    with builder.frame("The map's header"):
        header = _read_header(builder)
        stamped = builder.math("COMPARE", header.stamp, world_map.STAMP, _STAMP_SLACK, label="A map?")
    with builder.frame("Aberration (Eq. 5)"):
        seen = _seen_by_fido(builder, looking, header)
    with builder.frame("Angles about the hole"):
        aside = builder.dot(seen, header.polar)
        up = builder.dot(seen, builder.vector_math("CROSS_PRODUCT", header.outward, header.polar))
        ahead = builder.math("MULTIPLY", builder.dot(seen, header.outward), -1.0)
        squares = builder.math("MULTIPLY_ADD", aside, aside, builder.math("MULTIPLY", up, up))
        away = builder.math("ARCTAN2", builder.math("SQRT", squares), ahead, label="From the hole")
        across = builder.math("MULTIPLY", builder.math("ARCTAN2", up, aside), 0.5 / math.pi)
        column = builder.math("MULTIPLY_ADD", across, header.width, -0.5)
        left = builder.math("FLOOR", column)
        share_x = builder.math("SUBTRACT", column, left)
        columns = [builder.math("DIVIDE", builder.math("ADD", left, shift), header.width) for shift in (0.5, 1.5)]
    with builder.frame("The shadow's edge"):
        edges = [_texel(builder, each, 0.5)[1] for each in columns]
        delta = builder.math("SUBTRACT", away, builder.select(share_x, *edges), label="From the edge")
        visible = builder.math("GREATER_THAN", delta, 0.0, label="Sky?")
    with builder.frame("Where the light comes from"):
        origin = _origin(builder, header, columns, share_x, delta)
        found = builder.math("GREATER_THAN", builder.length(origin), world_map.SHORTEST, label="Resolved?")
        origin = builder.vector_math("NORMALIZE", origin)
        vector = builder.select_vector(lensed, looking, origin, "Bent or plain")
    with builder.frame("Redshift"):
        one_plus_z = builder.math("ADD", header.constant, builder.dot(looking, header.shift))
        # what is no map must not make numbers that are none
        one_plus_z = builder.math("MAXIMUM", reference_render.SMALLEST_ONE_PLUS_Z, one_plus_z)
        gain = redshift_gain(builder, one_plus_z, inputs.redshift_color, inputs.redshift_brightness, inputs.temperature)
    with builder.frame("Results"):
        shown = builder.math("MULTIPLY", visible, builder.math("MULTIPLY", stamped, found))
        tint = builder.select_vector(shown, (0.0, 0.0, 0.0), gain)
        tint = builder.select_vector(lensed, (1.0, 1.0, 1.0), tint)
        tint = builder.vector_scale(tint, builder.math("POWER", 2.0, inputs.exposure))
        # no map at all, or sky whose ray was not resolved
        whole = builder.math("MULTIPLY", stamped, builder.select(visible, 1.0, found))
        broken = builder.math("MULTIPLY", lensed, builder.math("SUBTRACT", 1.0, whole), label="Magenta if invalid")
        fault = builder.vector_scale(reference_render.MAGENTA, broken)
        shadow = builder.math("MULTIPLY", lensed, builder.math("SUBTRACT", 1.0, visible))
        redshift = builder.select(lensed, 1.0, one_plus_z)
    return WorldOutputs(vector, tint, fault, shadow, redshift)


def _texel(builder: TreeBuilder, across: Value, height: Value) -> tuple[Socket, Socket]:
    """Color and alpha of the texel at texture coordinates; round and round across."""
    place = builder.combine(across, height, 0.0)
    node = builder.node("ShaderNodeTexImage")
    node.interpolation = "Closest"
    node.projection = "FLAT"
    node.extension = "REPEAT"
    node[MAP_ROLE] = True
    builder.feed(node.inputs["Vector"], place)
    return node.outputs["Color"], node.outputs["Alpha"]


def _read_header(builder: TreeBuilder) -> _Header:
    parts: list[Socket] = []
    for part in range(4):
        parts.extend(_texel(builder, (part + 0.5) / world_map.HEADER_PARTS, _HEADER_HEIGHT))
    last, height = _texel(builder, 4.5 / world_map.HEADER_PARTS, _HEADER_HEIGHT)
    lowest, stamp, width = builder.separate(last)
    return _Header(*parts, lowest, stamp, builder.math("MAXIMUM", 1.0, width), builder.math("MAXIMUM", 1.0, height))


def _seen_by_fido(builder: TreeBuilder, looking: Socket, header: _Header) -> Socket:
    """Where the local FIDO looks to see what the camera sees; not of unit length."""
    less, more = builder.math("SUBTRACT", 1.0, header.beta), builder.math("ADD", 1.0, header.beta)
    contraction = builder.math("SQRT", builder.math("MAXIMUM", 0.0, builder.math("MULTIPLY", less, more)))
    along = builder.dot(looking, header.motion)
    factor = builder.math("MULTIPLY", builder.math("SUBTRACT", 1.0, contraction), along)
    factor = builder.math("SUBTRACT", factor, header.beta)
    contracted = builder.vector_scale(looking, contraction)
    return builder.vector_math("ADD", contracted, builder.vector_scale(header.motion, factor))


def _origin(builder: TreeBuilder, header: _Header, columns: list[Socket], share_x: Socket, delta: Socket) -> Socket:
    """The vector towards the light's origin, mixed of four texels; shorter than 1."""
    positive = builder.math("MAXIMUM", delta, _LEAST_DISTANCE)
    place = builder.math("ADD", builder.math("LOGARITHM", positive, math.e), positive)
    height = builder.math("MULTIPLY_ADD", place, header.slope, header.offset)
    highest = builder.math("SUBTRACT", 1.0, builder.math("DIVIDE", 0.5, header.height))
    height = builder.math("MINIMUM", highest, builder.math("MAXIMUM", header.lowest, height))
    row = builder.math("MULTIPLY_ADD", height, header.height, -0.5)
    below = builder.math("FLOOR", row)
    share_y = builder.math("SUBTRACT", row, below)
    last = builder.math("SUBTRACT", header.height, 0.5)
    mixed = []
    for shift in (0.5, 1.5):
        at = builder.math("MINIMUM", last, builder.math("ADD", below, shift))
        at = builder.math("DIVIDE", at, header.height)
        texels = [_texel(builder, column, at)[0] for column in columns]
        mixed.append(builder.select_vector(share_x, *texels))
    return builder.select_vector(share_y, *mixed)
