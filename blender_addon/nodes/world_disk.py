# SPDX-License-Identifier: GPL-3.0-or-later
"""The shader node group "Umbra World Disk": the disk's light, baked for all directions, behind all objects.

The layer is an EXR of `physics.HolePanorama`: position angles about the hole's direction run across, the distance from
it runs down. Texels are read one by one and mixed here, as in `world_nodes`. Each lensed World has a group of its own,
because the layer is read inside the group.
"""

from __future__ import annotations

import bpy

from ..core.physics_api import physics
from . import disk_layer
from .arithmetic import floor, maximum, minimum, mix, multiply_add
from .builder import Float, TreeBuilder, Vector
from .versioned_group import SocketSpec, Values, VersionedGroup
from .world_nodes import texel

LEAST_COVER = 1e-4
"""Where the disk hides less than this, its light is that much too dim."""

PLACE = SocketSpec(
    "Place",
    "NodeSocketVector",
    "Of the ray in the layer: turns about the hole's direction, from above down, and 1 if it is bent",
    default=(0.0, 0.0, 0.0),
    hide_value=True,
)
ROWS = SocketSpec("Rows", "NodeSocketFloat", "Height of the layer in pixels", default=1024.0, minimum=1.0)
COLOR = SocketSpec("Color", "NodeSocketColor", "Light of the disk where it is opaque", in_out="OUTPUT")
COVERS = SocketSpec("Covers", "NodeSocketFloat", "Share of the sky behind that does not pass", in_out="OUTPUT")

_LIVE = (disk_layer.EXPOSURE, disk_layer.TINT, disk_layer.OPACITY)
_COLUMNS, _ROWS = physics.WORLD_LIGHT_GRID


def _build(builder: TreeBuilder, values: Values) -> Values:
    across, down, bent = values[PLACE.name].separate()
    rows = values[ROWS.name]
    columns = rows * (_COLUMNS / _ROWS)
    exposure, tint, opacity = (values[each.name] for each in _LIVE)
    with builder.frame("Place in the layer"):
        column, row = multiply_add(across, columns, -0.5), multiply_add(down, rows, -0.5)
        left, above = floor(column), floor(row)
        share_x, share_y = column - left, row - above
        last = rows - 0.5
        places_x = [(left + shift) / columns for shift in (0.5, 1.5)]
        # Blender counts from below.
        places_y = [1.0 - minimum(last, maximum(0.5, above + shift)) / rows for shift in (0.5, 1.5)]
    with builder.frame("Texels"):
        lights: list[Vector] = []
        shares: list[Float] = []
        for y in places_y:
            texels = [texel(builder, x, y) for x in places_x]
            lights.append(mix(share_x, *(light for light, _ in texels)))
            shares.append(mix(share_x, *(share for _, share in texels)))
        light, passes = mix(share_y, *lights), mix(share_y, *shares)
    with builder.frame("What is seen"):
        hides = 1.0 - passes
        color = light * tint * (2.0**exposure / maximum(LEAST_COVER, hides))
        covers = hides * opacity * bent
    return {COLOR.name: color, COVERS.name: covers}


_GROUP = VersionedGroup(
    "Umbra World Disk",
    1,
    "umbra_world_disk_version",
    (PLACE, ROWS, *_LIVE),
    (COLOR, COVERS),
    _build,
    tree_type="ShaderNodeTree",
    node_type="ShaderNodeGroup",
)

is_group = _GROUP.owns


def new_group() -> bpy.types.NodeTree:
    """Add a group of this kind to the file, whether or not it has others."""
    return _GROUP.ensure(bpy.data.node_groups.new(_GROUP.name, _GROUP.tree_type))


def mend(tree: bpy.types.NodeTree) -> bpy.types.NodeTree:
    """Return the group, rebuilt in place unless it is current; image nodes of a rebuilt group have no layer."""
    return _GROUP.ensure(tree)
