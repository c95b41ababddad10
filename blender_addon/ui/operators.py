# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist can do. The work is done by plain functions elsewhere; operators report."""

from collections.abc import Callable, Generator
from functools import wraps

import bpy

from ..bake import baking, maps
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..outputs import switching as output
from ..outputs.compositor import compositing, compositor_sync
from ..outputs.lens import foreground, lens_sync
from ..outputs.shared.compositor_tree import find_setup
from ..outputs.world import world_sync
from ..scene import environment, frame_setup
from ..settings.hole_properties import DEFAULT_MASS_SCALE, LARGEST_SPIN
from ..settings.scene_properties import COMPOSITOR, CYCLES_LENS, WORLD

TIMER_INTERVAL = 0.02  # seconds between steps of a bake that runs beside the interface

HOLE_NAME = "Black Hole"

# What the panel shows of the bake that is running, and the artist's wish to end it.
running: baking.Progress | None = None
_stop_asked = False


def reporting(execute: Callable) -> Callable:
    """Turn the sentences of errors into the operator's report."""

    @wraps(execute)
    def guarded(self: bpy.types.Operator, context: bpy.types.Context) -> set[str]:
        try:
            return execute(self, context)
        except physics.BlackHoleError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}

    return guarded


def _report_notes(operator: bpy.types.Operator, notes: list[str]) -> None:
    for note in notes:
        operator.report({"WARNING"}, note)


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
        if hole.name not in context.view_layer.objects:  # that collection is excluded here
            context.collection.objects.unlink(hole)
            scene.collection.objects.link(hole)
        for each in context.selected_objects:
            each.select_set(False)
        hole.select_set(True)
        context.view_layer.objects.active = hole

        settings = scene.umbra
        settings.active_hole = hole
        if lens_sync.is_on(scene):
            lens_sync.show_live(scene)
        if scene.umbra.output != COMPOSITOR:
            world_sync.refresh(scene)
            return {"FINISHED"}
        stars = False
        if settings.environment_source == "WORLD":
            try:
                environment.read_world(scene)
            except SceneError:
                stars = settings.environment_image is None
                settings.environment_image = settings.environment_image or environment.load_star_sky()
                settings.environment_source = "IMAGE"
        _report_notes(self, compositing.set_up(scene))
        if stars:
            _expose_for_stars(scene)
        if len(frame_setup.holes(scene)) > 1:
            self.report({"WARNING"}, _only_one_is_rendered(scene))
        if scene.camera is None:
            self.report({"WARNING"}, "The scene has no camera yet: add one to render the black hole.")
        return {"FINISHED"}


def _expose_for_stars(scene: bpy.types.Scene) -> None:
    """Brighten the star sky, unless the artist has set an exposure."""
    setup = find_setup(scene)
    exposure = None if setup is None else setup.group.inputs.get("Exposure")
    if exposure is not None and exposure.default_value == 0.0:
        exposure.default_value = environment.STAR_SKY_EXPOSURE


def _only_one_is_rendered(scene: bpy.types.Scene) -> str:
    return (
        f'The scene contains {len(frame_setup.holes(scene))} black holes, and one can be rendered: "'
        f'{scene.umbra.active_hole.name}". Choose another one in the Umbra panel.'
    )


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
        context.scene.umbra.active_hole = context.object  # which refreshes the other outputs
        compositor_sync.refresh(context.scene)
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
        if context.scene.umbra.output != COMPOSITOR:
            raise SceneError("This scene's output is another one: choose Output: Compositor first.")
        _report_notes(self, compositing.set_up(context.scene))
        return {"FINISHED"}


class UMBRA_OT_remove_compositor(bpy.types.Operator):
    bl_idname = "umbra.remove_compositor"
    bl_label = "Remove from Compositor"
    bl_description = "Take the black hole out of the compositor again; links and settings are as they were before"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return find_setup(context.scene) is not None or compositing.BEFORE in context.scene

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        compositing.remove(context.scene)
        return {"FINISHED"}


class UMBRA_OT_use_star_sky(bpy.types.Operator):
    bl_idname = "umbra.use_star_sky"
    bl_label = "Sky of Real Stars"
    bl_description = "Use the built-in sky: the real stars and the glow of the Milky Way, packed into this file"
    bl_options = {"REGISTER", "UNDO"}

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.umbra
        settings.environment_image = environment.load_star_sky()
        settings.environment_source = "IMAGE"
        _expose_for_stars(context.scene)
        return {"FINISHED"}


class UMBRA_OT_set_output(bpy.types.Operator):
    bl_idname = "umbra.set_output"
    bl_label = "Set Output"
    bl_description = "Choose how the black hole comes into the picture, and set the scene up for it"
    bl_options = {"REGISTER", "UNDO"}

    output: bpy.props.EnumProperty(
        name="Output",
        items=((COMPOSITOR, "Compositor", ""), (CYCLES_LENS, "Cycles Lens", ""), (WORLD, "World", "")),
        default=CYCLES_LENS,
    )

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        _report_notes(self, output.switch(context.scene, self.output))
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
        return lens_sync.is_on(context.scene)

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
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
        foreground.remove(context.scene)
        return {"FINISHED"}


# --- baking ---------------------------------------------------------------------------------------


class BakeOperator:
    """Run a bake, or other work on maps: at once in background and from scripts, in a window beside the interface."""

    doing = "Baking warp maps"
    stopped = "Baking was stopped; the maps that are finished stay."
    _steps: Generator | None = None
    _timer: bpy.types.Timer | None = None

    def frames(self, scene: bpy.types.Scene) -> list[int]:
        """The frames to bake."""
        raise NotImplementedError

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        if running is not None:
            cls.poll_message_set("Warp maps are being baked already")
            return False
        return True

    def _start(self, context: bpy.types.Context) -> Generator:
        scene = context.scene
        frame_setup.active_hole(scene)
        if not baking.needs_maps(scene):
            raise SceneError("The lens traces its rays itself (Rays: No Bake): there is nothing to bake.")
        if len(frame_setup.holes(scene)) > 1 and scene.umbra.active_hole is not None:
            self.report({"WARNING"}, _only_one_is_rendered(scene))
        return self.work(context)

    def work(self, context: bpy.types.Context) -> Generator:
        """The steps of the work; what the generator returns is reported."""
        scene = context.scene
        return baking.bake_frames(scene.name, self.frames(scene), context.view_layer.name)

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        summary = baking.drain(self._start(context), announce=bpy.app.background, doing=self.doing)
        self._report(summary)
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self._begin(context)

    @reporting
    def _begin(self, context: bpy.types.Context) -> set[str]:
        global _stop_asked
        _stop_asked = False
        self._steps = self._start(context)
        manager = context.window_manager
        manager.progress_begin(0.0, 1.0)
        self._timer = manager.event_timer_add(TIMER_INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        self._show(context, baking.Progress(context.scene.frame_current, 0.0, "Starting"))
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if (event.type == "ESC" and event.value == "PRESS") or _stop_asked:
            self.report({"INFO"}, self.stopped)
            return self._end(context, {"CANCELLED"})
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            progress = next(self._steps)
        except StopIteration as end:
            self._report(end.value)
            return self._end(context, {"FINISHED"})
        except physics.BlackHoleError as error:
            self.report({"ERROR"}, str(error))
            return self._end(context, {"CANCELLED"})
        except Exception:
            self._end(context, {"CANCELLED"})
            raise
        self._show(context, progress)
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._end(context, {"CANCELLED"})

    def _show(self, context: bpy.types.Context, progress: baking.Progress) -> None:
        global running
        running = progress
        context.window_manager.progress_update(progress.fraction)
        context.workspace.status_text_set(f"{self.doing}: {progress.text}, {progress.fraction:.0%} done.  Esc stops.")
        _redraw(context)

    def _end(self, context: bpy.types.Context, result: set[str]) -> set[str]:
        global running
        running = None
        if self._steps is not None:
            self._steps.close()
            self._steps = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        _redraw(context)
        return result

    def _report(self, summary: baking.Summary) -> None:
        self.report({"INFO"}, summary.sentence())
        if summary.unresolved:
            self.report(
                {"WARNING"},
                f"{summary.unresolved} rays could not be resolved; choose another Method under Warp Maps.",
            )


def _redraw(context: bpy.types.Context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES"}:
                area.tag_redraw()


class UMBRA_OT_bake_frame(BakeOperator, bpy.types.Operator):
    bl_idname = "umbra.bake_frame"
    bl_label = "Bake This Frame"
    bl_description = "Bake the warp map of the current frame, unless the one there still holds"
    bl_options = {"REGISTER"}

    def frames(self, scene: bpy.types.Scene) -> list[int]:
        return [scene.frame_current]


class UMBRA_OT_bake_animation(BakeOperator, bpy.types.Operator):
    bl_idname = "umbra.bake_animation"
    bl_label = "Bake Animation"
    bl_description = "Bake the warp maps of all frames of the scene, except those that still hold. Esc stops"
    bl_options = {"REGISTER"}

    def frames(self, scene: bpy.types.Scene) -> list[int]:
        return list(maps.frames_of(scene))


class UMBRA_OT_stop_baking(bpy.types.Operator):
    bl_idname = "umbra.stop_baking"
    bl_label = "Stop Baking"
    bl_description = "Stop baking; the maps that are finished stay"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return running is not None

    def execute(self, _context: bpy.types.Context) -> set[str]:
        global _stop_asked
        _stop_asked = True
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
    UMBRA_OT_foreground,
    UMBRA_OT_remove_foreground,
    UMBRA_OT_bake_frame,
    UMBRA_OT_bake_animation,
    UMBRA_OT_stop_baking,
)


def register() -> None:
    """Add the entry to the Add menu."""
    bpy.types.VIEW3D_MT_add.append(draw_add_menu)


def unregister() -> None:
    """Remove the entry from the Add menu."""
    bpy.types.VIEW3D_MT_add.remove(draw_add_menu)
