# SPDX-License-Identifier: GPL-3.0-or-later
"""The shader node group "Umbra World": its sockets and its version.

Its Vector replaces Texture Coordinate > Generated as the input of the World's sky; the sky's color passes by the group
"Umbra World Tint" (`world_tint`), which its Shift and Light feed. Each lensed World has a group of its own, because the
map is read inside the group.
"""

from __future__ import annotations

from dataclasses import replace

import bpy

from . import black_hole_group, world_disk, world_nodes, world_tint
from .builder import TreeBuilder
from .versioned_group import SocketSpec, Values, VersionedGroup

GROUP_NAME = "Umbra World"
GROUP_VERSION = 5
VERSION_KEY = "umbra_world_version"

LENSING = SocketSpec(
    "Lensing",
    "NodeSocketFloat",
    "1 bends the sky's light around the hole, 0 shows the sky as it is",
    default=1.0,
    minimum=0.0,
    maximum=1.0,
    subtype="FACTOR",
)
OTHER_RAYS = SocketSpec(
    "Lensed Light",
    "NodeSocketFloat",
    "1: light and reflections come from the lensed sky, as it is at the camera's place. 0: only the camera sees it, "
    "and the scene is lit by the plain sky",
    default=1.0,
    minimum=0.0,
    maximum=1.0,
    subtype="FACTOR",
)
VECTOR = SocketSpec(
    "Vector", "NodeSocketVector", "Where the light comes from: in place of Generated coordinates", in_out="OUTPUT"
)
SHIFT = replace(world_tint.SHIFT, default=None, hide_value=False, in_out="OUTPUT")
LIGHT = replace(world_tint.LIGHT, default=None, hide_value=False, in_out="OUTPUT")

PLACE = replace(world_disk.PLACE, default=None, hide_value=False, in_out="OUTPUT")

FORMER_OUTPUTS = {"Tint": SHIFT.name, "Fault": LIGHT.name}
"""Names of the outputs of versions 1 to 3 that fed what stands before a Background -> those of now."""

INPUTS = (
    LENSING,
    OTHER_RAYS,
    black_hole_group.EXPOSURE,
    black_hole_group.REDSHIFT_COLOR,
    black_hole_group.REDSHIFT_BRIGHTNESS,
    black_hole_group.TEMPERATURE,
)
OUTPUTS = (VECTOR, SHIFT, LIGHT, black_hole_group.SHADOW, black_hole_group.REDSHIFT, PLACE)


def _build(builder: TreeBuilder, values: Values) -> Values:
    inputs = world_nodes.WorldInputs(
        lensing=values[LENSING.name],
        other_rays=values[OTHER_RAYS.name],
        exposure=values[black_hole_group.EXPOSURE.name],
        redshift_color=values[black_hole_group.REDSHIFT_COLOR.name],
        redshift_brightness=values[black_hole_group.REDSHIFT_BRIGHTNESS.name],
        temperature=values[black_hole_group.TEMPERATURE.name],
    )
    results = world_nodes.build(builder, inputs)
    return {
        VECTOR.name: results.vector,
        SHIFT.name: results.shift,
        LIGHT.name: results.light,
        black_hole_group.SHADOW.name: results.shadow,
        black_hole_group.REDSHIFT.name: results.redshift,
        PLACE.name: results.place,
    }


_GROUP = VersionedGroup(
    GROUP_NAME,
    GROUP_VERSION,
    VERSION_KEY,
    INPUTS,
    OUTPUTS,
    _build,
    tree_type="ShaderNodeTree",
    node_type="ShaderNodeGroup",
)

is_group = _GROUP.owns
is_current = _GROUP.is_current


def new_group() -> bpy.types.NodeTree:
    """Add a group of this kind to the file, whether or not it has others."""
    return _GROUP.ensure(bpy.data.node_groups.new(GROUP_NAME, _GROUP.tree_type))


def mend(tree: bpy.types.NodeTree) -> bpy.types.NodeTree:
    """Return the group, rebuilt in place unless it is current; image nodes of a rebuilt group have no map."""
    return _GROUP.ensure(tree)
