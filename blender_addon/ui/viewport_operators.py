# SPDX-License-Identifier: GPL-3.0-or-later
"""The one click that shows the hole in the 3D viewport, and gives the viewport back."""

import bpy

from ..core.errors import SceneError
from ..outputs import registry
from ..preview import viewport, views
from ..scene import cameras
from .reporting import reporting


class UMBRA_OT_show_in_viewport(bpy.types.Operator):
    bl_idname = "umbra.show_in_viewport"
    bl_label = "Show in Viewport"
    bl_description = (
        "Look through the camera with the viewport's compositor: the whole picture, which follows the camera, the hole "
        "and the settings. Pressed again it gives the viewport back as it was"
    )
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return registry.of(context.scene).viewport is not None and bool(_areas(context))

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, areas = context.scene, _areas(context)
        if is_shown(context):
            for area in areas:
                views.give_back(area)
            viewport.wake()  # nobody may look any more
            return {"FINISHED"}
        maps = registry.of(scene).viewport
        if maps is None or not maps.can_show(scene):
            raise SceneError(
                f'The compositor of scene "{scene.name}" contains no black hole that the viewport could show: run Set '
                "Up Compositor, and switch its node on.",
                code="compositor.not-linked",
            )
        cameras.active_camera(scene)
        for area in areas:
            if not views.shows_composite(area.spaces.active):
                views.show(area)
        viewport.notice(scene)
        return {"FINISHED"}


def _areas(context: bpy.types.Context) -> list[bpy.types.Area]:
    """The viewport in which the button is, or all of the screen."""
    if context.area is not None and context.area.type == "VIEW_3D":
        return [context.area]
    return [] if context.screen is None else [each for each in context.screen.areas if each.type == "VIEW_3D"]


def is_shown(context: bpy.types.Context) -> bool:
    """Return whether the viewports that the button is for show the compositor's picture."""
    areas = _areas(context)
    return bool(areas) and all(views.shows_composite(area.spaces.active) for area in areas)


CLASSES = (UMBRA_OT_show_in_viewport,)
