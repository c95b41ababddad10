# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do with the hole and its output. The work is done by plain functions elsewhere."""

import bpy

from ..bake import star_sky
from ..core.physics_api import physics
from ..outputs import registry, switching
from ..outputs.compositor.output import CompositorOutput
from ..outputs.lens import foreground
from ..scene import frame_setup
from ..settings import output_choice
from ..settings.hole_properties import DEFAULT_MASS_SCALE, LARGEST_SPIN
from . import engines
from .reporting import (
    only_one_is_rendered,
    report_missing_camera,
    report_notes,
    reporting,
    reporting_sky,
    reporting_switches,
)

HOLE_NAME = "Black Hole"


def compositor() -> CompositorOutput:
    """Return the output that the compositor's operators work on."""
    found = registry.get(CompositorOutput.identifier)
    assert isinstance(found, CompositorOutput)
    return found


class UMBRA_OT_add_black_hole(bpy.types.Operator):
    bl_idname = "umbra.add_black_hole"
    bl_label = "Black Hole"
    bl_description = "Add a black hole at the 3D cursor and set up the scene to render it"
    bl_options = {"REGISTER", "UNDO"}

    spin: bpy.props.FloatProperty(name="Spin", default=0.9, min=0.0, max=LARGEST_SPIN, precision=4)
    mass_scale: bpy.props.FloatProperty(
        name="Size of 1 M", default=DEFAULT_MASS_SCALE, min=1e-9, soft_min=0.001, precision=4, unit="LENGTH"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.mode == "OBJECT"

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        hole = bpy.data.objects.new(HOLE_NAME, None)
        hole.empty_display_type = "SPHERE"
        hole.show_axis = True
        hole.location = scene.cursor.location
        hole.umbra.is_black_hole = True
        hole.umbra.spin = self.spin
        hole.umbra.mass_scale = self.mass_scale
        context.collection.objects.link(hole)
        context.view_layer.update()  # which finds the new object
        if hole.name not in context.view_layer.objects:  # that collection is excluded here
            context.collection.objects.unlink(hole)
            scene.collection.objects.link(hole)
        former = scene.umbra.active_hole, scene.umbra.hide_behind
        scene.umbra.active_hole = hole
        if frame_setup.holes(scene) == [hole]:  # a scene that has another one keeps its picture
            scene.umbra.hide_behind = True
        try:
            with reporting_switches(self, scene), reporting_sky(self, scene):
                report_notes(self, registry.of(scene).on_hole_added(scene))
        except physics.BlackHoleError:  # which leaves the scene as it was
            scene.umbra.active_hole, scene.umbra.hide_behind = former
            bpy.data.objects.remove(hole)
            raise
        for each in context.selected_objects:
            each.select_set(False)
        hole.select_set(True)
        context.view_layer.objects.active = hole
        if len(frame_setup.holes(scene)) > 1:
            self.report({"WARNING"}, only_one_is_rendered(scene))
        report_missing_camera(self, scene)
        return {"FINISHED"}


class UMBRA_OT_make_active(bpy.types.Operator):
    bl_idname = "umbra.make_active"
    bl_label = "Render This Black Hole"
    bl_description = "Render the active object as the scene's black hole"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.umbra.is_black_hole

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.umbra.active_hole = context.object  # which refreshes the output
        return {"FINISHED"}


class UMBRA_OT_setup_compositor(bpy.types.Operator):
    bl_idname = "umbra.setup_compositor"
    bl_label = "Set Up Compositor"
    bl_description = (
        "Put the black hole and its sky behind the render. Your own nodes stay; running it again brings the "
        "set-up up to date"
    )
    bl_options = {"REGISTER", "UNDO"}

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        with reporting_switches(self, scene), reporting_sky(self, scene):
            report_notes(self, compositor().set_up(scene))
        if frame_setup.holes(scene):
            report_missing_camera(self, scene)
        return {"FINISHED"}


class UMBRA_OT_remove_compositor(bpy.types.Operator):
    bl_idname = "umbra.remove_compositor"
    bl_label = "Remove from Compositor"
    bl_description = "Take the black hole out of the compositor again; links and settings are as they were before"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return compositor().can_be_removed(context.scene)

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        with reporting_switches(self, context.scene):
            compositor().take_out(context.scene)
        return {"FINISHED"}


class UMBRA_OT_use_star_sky(bpy.types.Operator):
    bl_idname = "umbra.use_star_sky"
    bl_label = "Sky of Real Stars"
    bl_description = "Use the built-in sky: the real stars and the Milky Way, in a file beside the warp maps"
    bl_options = {"REGISTER", "UNDO"}

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.umbra
        settings.environment_image = star_sky.load(context.scene)
        settings.environment_source = "IMAGE"
        registry.of(context.scene).brighten_stars(context.scene)
        return {"FINISHED"}


class UMBRA_OT_set_output(bpy.types.Operator):
    bl_idname = "umbra.set_output"
    bl_label = "Set Output"
    bl_description = "Choose how the black hole comes into the picture, and set the scene up for it"
    bl_options = {"REGISTER", "UNDO"}

    output: bpy.props.EnumProperty(
        name="Output",
        description="How the black hole comes into the picture",
        items=output_choice.items,
        default=1,
    )

    @classmethod
    def description(cls, _context: bpy.types.Context | None, properties: bpy.types.OperatorProperties | None) -> str:
        return cls.bl_description if properties is None else registry.get(properties.output).description

    switch_engine: bpy.props.BoolProperty(
        name="Switch Render Engine",
        description="Choose the render engine as well that the output needs",
        default=False,
        options={"SKIP_SAVE"},
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        wanted = registry.get(self.output)
        if wanted.engine in (None, context.scene.render.engine):
            return self.execute(context)
        self.switch_engine = True  # and execute() is called when it is confirmed
        return context.window_manager.invoke_confirm(
            self,
            event,
            title=f"Output: {wanted.label}",
            message="It needs the render engine Cycles. Objects may look different there.",
            confirm_text="Switch to Cycles",
        )

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        engine = registry.get(self.output).engine
        with reporting_switches(self, scene):
            if self.switch_engine and engine not in (None, scene.render.engine):
                with engines.switched(scene, engine):
                    notes = switching.switch(scene, self.output)
            else:
                notes = switching.switch(scene, self.output)
            report_notes(self, notes)
        return {"FINISHED"}


class UMBRA_OT_use_cycles(bpy.types.Operator):
    bl_idname = "umbra.use_cycles"
    bl_label = "Switch to Cycles"
    bl_description = "Choose the render engine Cycles, which the output Cycles Lens needs"
    bl_options = {"REGISTER", "UNDO"}

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        with reporting_switches(self, scene), engines.switched(scene, "CYCLES"):
            registry.of(scene).refresh(scene)
        return {"FINISHED"}


class UMBRA_OT_foreground(bpy.types.Operator):
    bl_idname = "umbra.set_up_foreground"
    bl_label = "Unlensed Foreground"
    bl_description = (
        "Have objects nearer than the hole unlensed in front: they go into the collection Umbra Foreground, which a "
        "second scene renders with the unbent camera. Running it again adds new ones"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return foreground.can_set_up(context.scene)

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        with reporting_switches(self, context.scene):
            added = foreground.set_up(context.scene, context.evaluated_depsgraph_get())
        self.report({"INFO"}, f"In front of the hole: {', '.join(added) or 'nothing new'}.")
        return {"FINISHED"}


class UMBRA_OT_remove_foreground(bpy.types.Operator):
    bl_idname = "umbra.remove_foreground"
    bl_label = "Remove Foreground"
    bl_description = "Take the unlensed foreground out again: its scene, its collection and its compositor nodes"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene.umbra.foreground is not None

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        with reporting_switches(self, context.scene):
            foreground.remove(context.scene)
        return {"FINISHED"}


def draw_add_menu(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """The entry in the 3D viewport's Add menu."""
    self.layout.operator(UMBRA_OT_add_black_hole.bl_idname, icon="SHADING_SOLID")


CLASSES = (
    UMBRA_OT_add_black_hole,
    UMBRA_OT_make_active,
    UMBRA_OT_setup_compositor,
    UMBRA_OT_remove_compositor,
    UMBRA_OT_use_star_sky,
    UMBRA_OT_set_output,
    UMBRA_OT_use_cycles,
    UMBRA_OT_foreground,
    UMBRA_OT_remove_foreground,
)


def register() -> None:
    """Add the entry to the Add menu."""
    bpy.types.VIEW3D_MT_add.append(draw_add_menu)


def unregister() -> None:
    """Remove the entry from the Add menu."""
    bpy.types.VIEW3D_MT_add.remove(draw_add_menu)
