# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the shadow's outline and the disk's edges in 3D viewports, beside the Empty, which shows the horizon."""

from __future__ import annotations

import bpy
import gpu
import numpy as np

from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..scene import frame_setup, hole_outline

LINE_WIDTH = 1.5  # pixels at an interface scale of 1

_handles = SESSION.value(list[object], Life.REGISTRATION)


def shown_hole(context: bpy.types.Context) -> bpy.types.Object | None:
    """Return the hole whose lines a 3D viewport draws: none where overlays or extras are off, or it is hidden there."""
    space = context.space_data
    if not isinstance(space, bpy.types.SpaceView3D) or not (space.overlay.show_overlays and space.overlay.show_extras):
        return None
    hole = frame_setup.find_active_hole(context.scene)
    if hole is None or not hole.visible_get(view_layer=context.view_layer, viewport=space):
        return None
    return hole


def _draw() -> None:
    context = bpy.context
    hole, view = shown_hole(context), context.region_data
    if hole is None or view is None:
        return
    to_scene = np.array(view.view_matrix.inverted(), np.float64)
    eye = to_scene[:3, 3]
    if not view.is_perspective:  # from the hole against the line of sight
        eye = np.array(hole.matrix_world.translation, np.float64) + to_scene[:3, 2]
    try:
        lines = hole_outline.lines(hole, eye, is_far=not view.is_perspective)
    except physics.BlackHoleError:  # the panel says why
        return
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    scale = context.preferences.system.ui_scale
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", LINE_WIDTH * scale)
    shader.uniform_float("color", (*_color(context, hole), 1.0))
    for line in lines:
        closed = [*line.tolist(), line[0].tolist()]
        points = gpu.types.GPUVertBuf(shader.format_calc(), len(closed))
        points.attr_fill("pos", closed)
        gpu.types.GPUBatch(type="LINE_STRIP", buf=points).draw(shader)
    gpu.state.blend_set("NONE")
    gpu.state.depth_test_set("NONE")


def _color(context: bpy.types.Context, hole: bpy.types.Object) -> tuple[float, ...]:
    """The theme's color of the Empty as it is selected."""
    theme = context.preferences.themes[0].view_3d
    if not hole.select_get(view_layer=context.view_layer):
        return tuple(theme.empty)[:3]
    is_active = context.view_layer is not None and context.view_layer.objects.active == hole
    return tuple(theme.object_active if is_active else theme.object_selected)[:3]


def register() -> None:
    """Draw in all 3D viewports, of which there are none in the background."""
    if not bpy.app.background:
        _handles.now.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))


def unregister() -> None:
    """Draw no more."""
    for handle in _handles.now:
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
    _handles.clear()
