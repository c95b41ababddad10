# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in the 3D viewport's sidebar, and the hole's settings in Object Properties. It only draws."""

import bpy

from ..outputs import registry
from ..scene import frame_setup
from ..settings.hole_properties import CAMERA_ANIMATION
from . import bake_operators, render_operators, status, viewport_operators
from .sidebar import HolePanel, UmbraPanel


def _hole(context: bpy.types.Context) -> bpy.types.Object | None:
    return frame_setup.find_active_hole(context.scene)


def _draw_hole(layout: bpy.types.UILayout, hole: bpy.types.Object) -> None:
    settings = hole.umbra
    layout.prop(settings, "spin", slider=True)
    layout.prop(settings, "mass_scale")
    layout.prop(settings, "motion", text="Motion")
    if settings.motion == CAMERA_ANIMATION:
        layout.prop(settings, "speed_of_light")


def _draw_outputs(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """The choice of the output: buttons, because a property could not report what it has switched."""
    split = layout.split(factor=0.4)
    label = split.row()
    label.alignment = "RIGHT"
    label.label(text="Output")
    column = split.column(align=True)
    now = registry.of(scene)
    for output in registry.every():
        button = column.operator("umbra.set_output", text=output.label, depress=output is now)
        button.output = output.identifier


def _draw_lines(layout: bpy.types.UILayout, lines: tuple[status.Line, ...]) -> None:
    column = layout.column(align=True)
    for line in lines:
        if line.operator:
            column.operator(line.operator)
        else:
            column.label(text=line.text, icon=line.icon)


class VIEW3D_PT_umbra(UmbraPanel, bpy.types.Panel):
    bl_idname = "VIEW3D_PT_umbra"
    bl_label = "Black Hole"

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        scene = context.scene
        hole = _hole(context)
        if hole is None and scene.umbra.active_hole is None and not frame_setup.holes(scene):
            layout.operator("umbra.add_black_hole", text="Add Black Hole", icon="ADD")
        else:
            layout.prop(scene.umbra, "active_hole")
            _draw_outputs(layout, scene)
        _draw_lines(layout, status.lines(context))

        progress = bake_operators.running()
        if progress is not None:
            layout.progress(factor=progress.fraction, text=f"{progress.text}  {progress.fraction:.0%}")
            layout.operator("umbra.stop_baking", icon="CANCEL")
            return
        if hole is None or not registry.of(scene).needs_maps(scene):
            return
        row = layout.row(align=True)
        row.operator("umbra.bake_frame", icon="RENDER_STILL")
        row.operator("umbra.bake_animation", icon="RENDER_ANIMATION")
        if registry.of(scene).viewport is not None:
            is_shown = viewport_operators.is_shown(context)
            layout.operator("umbra.show_in_viewport", icon="VIEW_CAMERA", depress=is_shown)
        if render_operators.may_bake(scene):
            row = layout.row(align=True)
            row.operator("umbra.render_frame", text="Render Image")
            row.operator("umbra.render_animation", text="Render Animation")


class VIEW3D_PT_umbra_hole(UmbraPanel, bpy.types.Panel):
    bl_label = "Hole and Camera"
    bl_parent_id = "VIEW3D_PT_umbra"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _hole(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        _draw_hole(self.layout, frame_setup.active_hole(context.scene))


class VIEW3D_PT_umbra_output(HolePanel, bpy.types.Panel):
    bl_label = ""  # that of the output is drawn

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.label(text=registry.of(context.scene).settings_label)

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        registry.of(context.scene).draw_settings(self.layout, context.scene)


class VIEW3D_PT_umbra_maps(UmbraPanel, bpy.types.Panel):
    bl_label = "Warp Maps"
    bl_parent_id = "VIEW3D_PT_umbra"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        settings = context.scene.umbra
        layout.prop(settings, "map_folder")
        row = layout.row()
        row.use_property_split = False  # the name is too long beside an empty half
        row.prop(settings, "auto_bake")
        layout.prop(settings, "supersampling")
        layout.prop(settings, "quality")
        if settings.quality == "CUSTOM":
            layout.prop(settings, "tolerance")
            layout.prop(settings, "interpolation")
        layout.prop(settings, "method")


class OBJECT_PT_umbra(bpy.types.Panel):
    bl_label = "Black Hole"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and (context.object.type == "EMPTY" or context.object.umbra.is_black_hole)

    def draw_header(self, context: bpy.types.Context) -> None:
        if context.object is not None:
            self.layout.prop(context.object.umbra, "is_black_hole", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, hole = self.layout, context.object
        if hole is None:
            return
        layout.use_property_split = True
        layout.active = hole.umbra.is_black_hole
        _draw_hole(layout, hole)
        if hole.umbra.is_black_hole and _hole(context) != hole:
            layout.operator("umbra.make_active")


CLASSES = (
    VIEW3D_PT_umbra,
    VIEW3D_PT_umbra_hole,
    VIEW3D_PT_umbra_output,
    VIEW3D_PT_umbra_maps,
    OBJECT_PT_umbra,
)
