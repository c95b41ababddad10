# SPDX-License-Identifier: GPL-3.0-or-later
"""The shader node group "Umbra World Tint": a color of the sky, as it is seen through the lens.

It stands before each Background of a lensed World, where the color is known: so each color is shifted by its own
temperature (`physics.light.color`). What it needs of the ray comes from the group "Umbra World".
"""

from __future__ import annotations

from ..core.physics_api import physics
from .builder import TreeBuilder, Vector
from .redshift import redshift_gain
from .versioned_group import SocketSpec, Values, VersionedGroup

COLOR = SocketSpec("Color", "NodeSocketColor", "The sky's color, unshifted", default=(0.0, 0.0, 0.0, 1.0))
SHIFT = SocketSpec(
    "Shift",
    "NodeSocketVector",
    "1 + z; how much it changes the color; how much it changes the brightness",
    default=(1.0, 1.0, 1.0),
    hide_value=True,
)
LIGHT = SocketSpec(
    "Light",
    "NodeSocketVector",
    "Sky Temperature; what the brightness is multiplied by, 0 in the shadow; 1 without a valid map",
    default=(physics.DEFAULT_SKY_TEMPERATURE, 1.0, 0.0),
    hide_value=True,
)
SEEN = SocketSpec("Color", "NodeSocketColor", "The color that is seen", in_out="OUTPUT")


def _build(builder: TreeBuilder, values: Values) -> Values:
    color: Vector = values[COLOR.name]
    one_plus_z, color_amount, brightness_amount = values[SHIFT.name].separate()
    temperature, brightness, fault = values[LIGHT.name].separate()
    gain = redshift_gain(one_plus_z, color_amount, brightness_amount, temperature, color)
    seen = color * (gain * brightness) + fault * physics.INVALID_MAP_COLOR
    return {SEEN.name: seen.labeled("Seen")}


GROUP = VersionedGroup(
    "Umbra World Tint",
    1,
    "umbra_world_tint_version",
    (COLOR, SHIFT, LIGHT),
    (SEEN,),
    _build,
    tree_type="ShaderNodeTree",
    node_type="ShaderNodeGroup",
)
"""One group serves all Worlds of a file."""
