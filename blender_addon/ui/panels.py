# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in the 3D viewport's sidebar, and the hole's settings in Object Properties. It only draws."""

import bpy

from ..outputs.lens import lens_disk, lens_sync
from ..outputs.shared.compositor_tree import find_setup
from ..scene import frame_setup
from ..settings.hole_properties import CAMERA_ANIMATION
from ..settings.scene_properties import COMPOSITOR
from . import operators, status
from .sidebar import UmbraPanel

LOOK_CONTROLS = ("Exposure", "Redshift Color", "Redshift Brightness", "Sky Temperature")
PLACEMENT_CONTROLS = ("Environment Rotation", "Environment Strength")


def _hole(context: bpy.types.Context) -> bpy.types.Object | None:
    return frame_setup.find_active_hole(context.scene)


def _draw_hole(layout: bpy.types.UILayout, hole: bpy.types.Object) -> None:
    settings = hole.umbra
    layout.prop(settings, "spin", slider=True)
    layout.prop(settings, "mass_scale")
    layout.prop(settings, "motion", text="Motion")
    if settings.motion == CAMERA_ANIMATION:
        layout.prop(settings, "speed_of_light")


def _draw_lines(layout: bpy.types.UILayout, lines: tuple[status.Line, ...]) -> None:
    column = layout.column(align=True)
    for line in lines:
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
        if hole is None and scene.umbra.active_hole is None:
            layout.operator("umbra.add_black_hole", text="Add Black Hole", icon="ADD")
        else:
            layout.prop(scene.umbra, "active_hole")
            layout.column(align=True).prop(scene.umbra, "output", expand=True)
        _draw_lines(layout, status.lines(context))

        if operators.running is not None:
            progress = operators.running
            layout.progress(factor=progress.fraction, text=f"{progress.text}  {progress.fraction:.0%}")
            layout.operator("umbra.stop_baking", icon="CANCEL")
            return
        if hole is None:
            return
        lensed = lens_sync.is_on(scene)
        if scene.umbra.output == COMPOSITOR and find_setup(scene) is None:
            layout.operator("umbra.setup_compositor", icon="NODE_COMPOSITING")
        if lensed and not lens_sync.uses_maps(scene) and not lens_disk.is_in_use(scene):
            return
        row = layout.row(align=True)
        row.operator("umbra.bake_frame", icon="RENDER_STILL")
        row.operator("umbra.bake_animation", icon="RENDER_ANIMATION")


class VIEW3D_PT_umbra_hole(UmbraPanel, bpy.types.Panel):
    bl_label = "Hole and Camera"
    bl_parent_id = "VIEW3D_PT_umbra"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _hole(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        _draw_hole(self.layout, _hole(context))


class VIEW3D_PT_umbra_sky(UmbraPanel, bpy.types.Panel):
    bl_label = "Sky"
    bl_parent_id = "VIEW3D_PT_umbra"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return find_setup(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        settings = context.scene.umbra
        row = layout.row()
        row.prop(settings, "environment_source", expand=True)
        if settings.environment_source == "IMAGE":
            layout.template_ID(settings, "environment_image", open="image.open")
            layout.operator("umbra.use_star_sky", icon="OUTLINER_OB_LIGHT")
        problem = status.sky_problem(context.scene)
        if problem is not None:
            _draw_lines(layout, status.wrapped(problem, "ERROR"))
        group = find_setup(context.scene).group
        layout.use_property_split = False  # the names are too long to stand beside their fields
        column = layout.column()
        column.active = settings.environment_source == "IMAGE"
        _draw_inputs(column, group, PLACEMENT_CONTROLS)
        _draw_inputs(layout, group, LOOK_CONTROLS)


def _draw_inputs(layout: bpy.types.UILayout, group: bpy.types.Node, names: tuple[str, ...]) -> None:
    for name in names:
        socket = group.inputs.get(name)
        if socket is not None and not socket.is_linked:
            layout.prop(socket, "default_value", text=name)


class VIEW3D_PT_umbra_lens(UmbraPanel, bpy.types.Panel):
    bl_label = "Lens"
    bl_parent_id = "VIEW3D_PT_umbra"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return lens_sync.is_on(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        settings = context.scene.umbra
        layout.prop(settings, "lens_rays")
        layout.prop(settings, "sphere_radius")
        layout.prop(settings, "redshift_color")
        layout.prop(settings, "redshift_brightness")
        layout.prop(settings, "sky_temperature")
        layout.prop(settings, "cpu_fallback")
        layout.operator("umbra.set_up_foreground", icon="OUTLINER_COLLECTION")
        if settings.foreground is not None:
            layout.operator("umbra.remove_foreground", icon="X")


class VIEW3D_PT_umbra_maps(UmbraPanel, bpy.types.Panel):
    bl_label = "Warp Maps"
    bl_parent_id = "VIEW3D_PT_umbra"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        settings = context.scene.umbra
        layout.prop(settings, "map_folder")
        layout.prop(settings, "auto_bake")
        layout.prop(settings, "supersampling")
        layout.prop(settings, "quality")
        if settings.quality == "CUSTOM":
            layout.prop(settings, "tolerance")
            layout.prop(settings, "interpolation")
        layout.prop(settings, "method")
        if find_setup(context.scene) is not None:
            layout.operator("umbra.setup_compositor", text="Update Compositor", icon="FILE_REFRESH")
            layout.operator("umbra.remove_compositor", icon="X")


class OBJECT_PT_umbra(bpy.types.Panel):
    bl_label = "Black Hole"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and (context.object.type == "EMPTY" or context.object.umbra.is_black_hole)

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.object.umbra, "is_black_hole", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.active = context.object.umbra.is_black_hole
        _draw_hole(layout, context.object)
        if context.object.umbra.is_black_hole and _hole(context) != context.object:
            layout.operator("umbra.make_active")


CLASSES = (
    VIEW3D_PT_umbra,
    VIEW3D_PT_umbra_hole,
    VIEW3D_PT_umbra_sky,
    VIEW3D_PT_umbra_lens,
    VIEW3D_PT_umbra_maps,
    OBJECT_PT_umbra,
)
