# SPDX-License-Identifier: GPL-3.0-or-later
"""The lensed World's settings in the sidebar, and its switch. It only draws."""

import bpy

from ...nodes import world_group, world_nodes
from ..shared.drawing import draw_inputs, draw_problem, draw_sky_choice
from ..shared.look import EXPOSURE, SHARED
from . import lensed_world

CONTROLS = (EXPOSURE, *SHARED.values())


def draw(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Draw which World is bent, and how."""
    node = lensed_world.group_node(lensed_world.lensed_world(scene))
    if node is None:
        draw_problem(layout, "Another World was chosen since: set Output: World again.")
        layout.operator("umbra.set_output", text="Bend This World").output = scene.umbra.output
        return
    draw_sky_choice(layout, scene.umbra)
    switch = lensing(scene)
    if switch is not None:
        layout.operator("umbra.toggle_lensing", depress=switch.default_value > world_nodes.ON)
    layout.use_property_split = False
    draw_inputs(layout, node, (world_group.OTHER_RAYS.name, *CONTROLS))


def lensing(scene: bpy.types.Scene) -> bpy.types.NodeSocket | None:
    """Return the switch of the scene's lensed World."""
    node = lensed_world.group_node(lensed_world.lensed_world(scene))
    return None if node is None else node.inputs.get(world_group.LENSING.name)
