# SPDX-License-Identifier: GPL-3.0-or-later
"""The accretion disk in the sidebar, and the operator that sets one of its looks."""

import bpy

from ..core.physics_api import physics
from ..scene import frame_setup
from ..settings import disk_properties
from ..settings.typed import DiskSettings
from .sidebar import HolePanel, UmbraPanel

# Identifiers as scripts write them -> names of the presets.
PRESET_NAMES = {name.upper().replace(" ", "_"): name for name in physics.MATTER_PRESET_TABLE}


def _preset_items() -> tuple[tuple[str, str, str, int], ...]:
    presets = {identifier: physics.MATTER_PRESET_TABLE[name] for identifier, name in PRESET_NAMES.items()}
    return tuple((identifier, each.label, each.description, each.number) for identifier, each in presets.items())


class UMBRA_OT_disk_preset(bpy.types.Operator):
    bl_idname = "umbra.disk_preset"
    bl_label = "Look"
    bl_description = "Set the look of the black hole's disk; its edges and its texture stay"
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
        disk_properties.use_look(hole.umbra.disk, physics.MATTER_PRESETS[PRESET_NAMES[self.preset]])
        return {"FINISHED"}


def _settings(context: bpy.types.Context, layout: bpy.types.UILayout) -> DiskSettings:
    """Return the settings of the scene's disk; names stand inside the fields, as some are too long to stand beside."""
    settings: DiskSettings = frame_setup.active_hole(context.scene).umbra.disk
    layout.active = settings.enabled
    return settings


def _draw(layout: bpy.types.UILayout, settings: DiskSettings, names: tuple[str, ...]) -> None:
    column = layout.column(align=True)
    for name in names:
        column.prop(settings, name)


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
        layout.prop(settings, "turning_speed")
        _draw(layout, settings, ("exposure", "opacity", "tint", "temperature", "thickness"))
        column = layout.column(align=True)
        column.use_property_split = False  # the names are too long to stand beside their fields
        column.prop(settings, "doppler_color")
        column.prop(settings, "doppler_brightness")
        layout.prop(settings, "light")
        if settings.light:
            layout.prop(settings, "light_strength")
        if context.scene.umbra.output == "COMPOSITOR":
            layout.prop(context.scene.umbra, "disk_passes")


class VIEW3D_PT_umbra_disk_profile(UmbraPanel, bpy.types.Panel):
    bl_label = "Profile and Light"
    bl_parent_id = "VIEW3D_PT_umbra_disk"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings = _settings(context, self.layout)
        power = ("exponent",) if settings.profile == "power_law" else ()
        _draw(self.layout, settings, ("profile", *power, "falloff", "color_variation"))
        _draw(self.layout, settings, ("band", "limb_darkening", "light_travel", "infall"))


class VIEW3D_PT_umbra_disk_shape(UmbraPanel, bpy.types.Panel):
    bl_label = "Shape and Density"
    bl_parent_id = "VIEW3D_PT_umbra_disk"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings = _settings(context, self.layout)
        _draw(self.layout, settings, ("depth", "depth_power", "inner_softness", "outer_softness"))
        if settings.thickness > 0.0:
            _draw(self.layout, settings, ("flare", "puff"))


class VIEW3D_PT_umbra_disk_detail(UmbraPanel, bpy.types.Panel):
    bl_label = "Turbulence"
    bl_parent_id = "VIEW3D_PT_umbra_disk"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings = _settings(context, self.layout)
        self.layout.template_ID(settings, "texture", open="image.open", text="Texture")
        if settings.texture is not None:
            self.layout.prop(settings, "texture_use")
            if settings.texture_use != disk_properties.RAMP:
                return  # it is in place of the turbulence
        _draw(self.layout, settings, ("strands", "smoke", "large_scale", "waves", "stretch", "pitch"))
        _draw(self.layout, settings, ("ridges", "warp", "seed"))


class VIEW3D_PT_umbra_disk_features(UmbraPanel, bpy.types.Panel):
    bl_label = "Gap and Hot Spots"
    bl_parent_id = "VIEW3D_PT_umbra_disk"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings = _settings(context, self.layout)
        gap = ("gap_radius", "gap_width") if settings.gap_depth > 0.0 else ()
        _draw(self.layout, settings, ("gap_depth", *gap))
        spots = ("spot_radius", "spot_size", "spot_heat") if settings.spots > 0 else ()
        _draw(self.layout, settings, ("spots", *spots))


CLASSES = (
    UMBRA_OT_disk_preset,
    VIEW3D_PT_umbra_disk,
    VIEW3D_PT_umbra_disk_profile,
    VIEW3D_PT_umbra_disk_shape,
    VIEW3D_PT_umbra_disk_detail,
    VIEW3D_PT_umbra_disk_features,
)
