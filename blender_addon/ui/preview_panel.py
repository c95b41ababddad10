# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview and the lensed World in the sidebar, and the one click that shows the sky plain."""

import bpy

from ..core.errors import SceneError
from ..nodes import world_group, world_nodes
from ..outputs.world import lensed_world, world_sync
from ..preview import live_preview, thumbnail
from . import status
from .operators import reporting
from .sidebar import HolePanel, UmbraPanel

# Of the thumbnail, in units of the interface.
SCALE = 9.0

CONTROLS = ("Exposure", "Redshift Color", "Redshift Brightness", "Sky Temperature")


class UMBRA_OT_toggle_lensing(bpy.types.Operator):
    bl_idname = "umbra.toggle_lensing"
    bl_label = "Lensing"
    bl_description = "Show the World bent by the black hole, or as it is without it"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return lensed_world.lensed_world(context.scene) is not None

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        socket = lensing(context.scene)
        if socket is None or socket.is_linked:
            raise SceneError("The input Lensing of the World's group is linked: switch it there.")
        socket.default_value = 0.0 if socket.default_value > world_nodes.ON else 1.0
        return {"FINISHED"}


def lensing(scene: bpy.types.Scene) -> bpy.types.NodeSocket | None:
    """The switch of the scene's lensed World."""
    node = lensed_world.group_node(lensed_world.lensed_world(scene))
    return None if node is None else node.inputs.get(world_group.LENSING.name)


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


class VIEW3D_PT_umbra_world(UmbraPanel, bpy.types.Panel):
    bl_label = "World"
    bl_parent_id = "VIEW3D_PT_umbra"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return world_sync.is_on(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        node = lensed_world.group_node(lensed_world.lensed_world(scene))
        if node is None:
            for line in status.wrapped("Another World was chosen since: set Output: World again.", "ERROR"):
                layout.label(text=line.text, icon=line.icon)
            layout.operator("umbra.set_output", text="Bend This World").output = scene.umbra.output
            return
        row = layout.row()
        row.prop(scene.umbra, "environment_source", expand=True)
        if scene.umbra.environment_source == "IMAGE":
            layout.template_ID(scene.umbra, "environment_image", open="image.open")
        layout.operator(UMBRA_OT_toggle_lensing.bl_idname, depress=lensing(scene).default_value > world_nodes.ON)
        for name in (world_group.OTHER_RAYS.name, *CONTROLS):
            socket = node.inputs.get(name)
            if socket is not None and not socket.is_linked:
                layout.prop(socket, "default_value", text=name)


CLASSES = (UMBRA_OT_toggle_lensing, VIEW3D_PT_umbra_preview, VIEW3D_PT_umbra_world)


def register() -> None:
    """Add the button to the header."""
    bpy.types.VIEW3D_HT_header.append(draw_header)


def unregister() -> None:
    """Remove the button; drop the preview: nobody would point the Worlds that show it at their files later."""
    bpy.types.VIEW3D_HT_header.remove(draw_header)
    live_preview.drop_live()
    live_preview.forget()
