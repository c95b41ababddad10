# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview and the lensed World in the sidebar, and the one click that shows the sky plain."""

import bpy

from ..core.errors import SceneError
from ..nodes import world_nodes
from ..outputs.world.panel import lensing
from ..preview import live_preview, thumbnail
from . import status
from .reporting import reporting
from .sidebar import HolePanel

# Of the thumbnail, in units of the interface.
SCALE = 9.0


class UMBRA_OT_toggle_lensing(bpy.types.Operator):
    bl_idname = "umbra.toggle_lensing"
    bl_label = "Lensing"
    bl_description = "Show the World bent by the black hole, or as it is without it"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return lensing(context.scene) is not None

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        socket = lensing(context.scene)
        if socket is None or socket.is_linked:
            raise SceneError(
                "The input Lensing of the World's group is linked: switch it there.", code="sky.lensing-linked"
            )
        socket.default_value = 0.0 if socket.default_value > world_nodes.ON else 1.0
        return {"FINISHED"}


def draw_header(self: bpy.types.Header, context: bpy.types.Context) -> None:
    """The button in the 3D viewport's header."""
    socket = lensing(context.scene)
    if socket is not None:
        bent = socket.default_value > world_nodes.ON
        self.layout.operator(UMBRA_OT_toggle_lensing.bl_idname, icon="SHADING_SOLID", depress=bent)


class VIEW3D_PT_umbra_preview(HolePanel, bpy.types.Panel):
    bl_label = "Live Preview"

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.umbra, "live_preview", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        layout.active = scene.umbra.live_preview
        icon = thumbnail.icon(scene)
        if icon:
            layout.template_icon(icon, scale=SCALE)
        if live_preview.is_on(scene) and live_preview.state(scene).problem:
            for line in status.wrapped(live_preview.state(scene).problem, "ERROR"):
                layout.label(text=line.text, icon=line.icon)


CLASSES = (UMBRA_OT_toggle_lensing, VIEW3D_PT_umbra_preview)


def register() -> None:
    """Add the button to the header."""
    bpy.types.VIEW3D_HT_header.append(draw_header)


def unregister() -> None:
    """Remove the button."""
    bpy.types.VIEW3D_HT_header.remove(draw_header)
