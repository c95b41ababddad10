# SPDX-License-Identifier: GPL-3.0-or-later
"""The sky's settings in the sidebar, and what sets the compositor up. It only draws."""

from typing import Any

import bpy

from ...nodes import black_hole_group
from ..shared.compositor_tree import find_setup
from ..shared.drawing import draw_inputs, draw_problem, draw_sky_choice
from ..shared.look import EXPOSURE, PLACEMENT, SHARED
from . import stars

LOOK_CONTROLS = (EXPOSURE, *SHARED.values())
PLACEMENT_CONTROLS = tuple(PLACEMENT.values())


def draw(layout: bpy.types.UILayout, scene: bpy.types.Scene, problem: str | None) -> None:
    """Draw which sky there is, how it is placed and how it looks."""
    setup = find_setup(scene)
    if setup is None:
        return
    settings = scene.umbra
    draw_sky_choice(layout, settings)
    if settings.environment_source == "IMAGE":
        layout.operator("umbra.use_star_sky", icon="OUTLINER_OB_LIGHT")
    if problem is not None:
        draw_problem(layout, problem)
    layout.prop(settings, "sky_filter", text="Filter")
    layout.prop(settings, "glare")
    layout.use_property_split = False  # the names are too long to stand beside their fields
    column = layout.column()
    column.active = settings.environment_source == "IMAGE"
    draw_inputs(column, setup.group, PLACEMENT_CONTROLS)
    draw_inputs(layout, setup.group, LOOK_CONTROLS)
    _draw_stars(layout, settings, setup.group, stars.are_on(scene, setup))
    layout.prop(settings, "hide_behind")
    layout.operator("umbra.setup_compositor", text="Update Compositor", icon="FILE_REFRESH")
    layout.operator("umbra.remove_compositor", icon="X")


def _draw_stars(layout: bpy.types.UILayout, settings: Any, group: bpy.types.Node, are_on: bool) -> None:
    column = layout.column()
    column.prop(settings, "stars")
    column = column.column()
    column.active = are_on
    draw_inputs(column, group, (black_hole_group.STAR_BRIGHTNESS.name,))
    column.prop(settings, "star_limit")
    column.prop(settings, "star_catalog")
