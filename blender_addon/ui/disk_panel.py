# SPDX-License-Identifier: GPL-3.0-or-later
"""The accretion disk in the sidebar, and the operator that sets one of its looks."""

import bpy

from ..core.physics_api import physics
from ..scene import frame_setup
from ..settings import disk_properties
from .sidebar import HolePanel, UmbraPanel

# Identifiers as scripts write them -> names of the presets.
PRESET_NAMES = {name.upper().replace(" ", "_"): name for name in physics.DISK_PRESET_TABLE}

# Settings of the look in the panel Disk, and those that a picture replaces; the others are in Profile and Streaks.
IN_FRONT = ("temperature", "exposure", "opacity", "beaming", "doppler_color", "doppler_brightness")
OF_STREAKS = ("streaks", "clumps", "gain")


def _preset_items() -> tuple[tuple[str, str, str, int], ...]:
    presets = {identifier: physics.DISK_PRESET_TABLE[name] for identifier, name in PRESET_NAMES.items()}
    return tuple((identifier, each.label, each.description, each.number) for identifier, each in presets.items())


class UMBRA_OT_disk_preset(bpy.types.Operator):
    bl_idname = "umbra.disk_preset"
    bl_label = "Look"
    bl_description = "Set the look of the black hole's disk; its edges and its texture stay, and nothing is baked anew"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.EnumProperty(
        name="Look",
        items=_preset_items(),
        default=disk_properties.DEFAULT_LOOK.upper(),
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return frame_setup.find_active_hole(context.scene) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        hole = frame_setup.active_hole(context.scene)
        disk_properties.use_look(hole.umbra.disk, physics.DISK_PRESETS[PRESET_NAMES[self.preset]])
        return {"FINISHED"}


class VIEW3D_PT_umbra_disk(HolePanel, bpy.types.Panel):
    bl_label = "Disk"
    bl_order = 1

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(frame_setup.active_hole(context.scene).umbra.disk, "enabled", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        hole = frame_setup.active_hole(context.scene)
        settings = hole.umbra.disk
        layout.active = settings.enabled
        layout.operator_menu_enum("umbra.disk_preset", "preset", icon="PRESET")
        column = layout.column(align=True)
        column.prop(settings, "inner_at_isco")
        if settings.inner_at_isco:
            column.label(text=f"Begins at {settings.innermost_orbit:.3g} M")
        else:
            column.prop(settings, "inner_radius")
        column.prop(settings, "outer_radius")
        layout.prop(settings, "retrograde")
        layout.prop(settings, "crossings")
        column = layout.column(align=True)
        column.prop(settings, "temperature")
        column.prop(settings, "exposure")
        column.prop(settings, "opacity")
        layout.prop(settings, "beaming")
        column = layout.column(align=True)
        column.use_property_split = False  # the names are too long to stand beside their fields
        column.prop(settings, "doppler_color")
        column.prop(settings, "doppler_brightness")
        layout.prop(settings, "light")
        if settings.light:
            layout.prop(settings, "light_strength")


class VIEW3D_PT_umbra_disk_detail(UmbraPanel, bpy.types.Panel):
    bl_label = "Profile and Streaks"
    bl_parent_id = "VIEW3D_PT_umbra_disk"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        settings = frame_setup.active_hole(context.scene).umbra.disk
        layout.active = settings.enabled
        for name in physics.DISK_SETTINGS:
            if name not in (*IN_FRONT, *OF_STREAKS) and (name != "exponent" or settings.profile == "power_law"):
                layout.prop(settings, name)  # its name inside: some are too long to stand beside their fields
        layout.separator()
        layout.template_ID(settings, "texture", open="image.open", text="Texture")
        if settings.texture is not None:
            layout.prop(settings, "texture_use")
        if not disk_properties.shows_picture(settings):
            for name in OF_STREAKS:
                layout.prop(settings, name)
        layout.prop(settings, "turning_speed")


CLASSES = (UMBRA_OT_disk_preset, VIEW3D_PT_umbra_disk, VIEW3D_PT_umbra_disk_detail)
