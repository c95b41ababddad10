# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake maps from the window: work that runs beside the interface, with progress, and that Esc ends."""

import time
from collections.abc import Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy

from ..bake import baking
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..outputs import frames as frame_maps
from ..outputs import registry
from ..scene import frame_setup
from .reporting import SLICE, TIMER_INTERVAL, only_one_is_rendered, reporting

if TYPE_CHECKING:
    from bpy.types import Operator as _Operator
else:
    _Operator = object  # Blender registers the operators themselves only

# What an operator reports in the end is the result of its steps.
Steps = Generator[baking.Progress, None, Any]


@dataclass
class Job:
    """The work that runs beside the interface; one at a time."""

    progress: baking.Progress | None = None
    stop_asked: bool = False


JOB = SESSION.value(Job, Life.REGISTRATION)


def running() -> baking.Progress | None:
    """Return how far the work is, or None if there is none."""
    return JOB.now.progress


class BakeOperator(_Operator):
    """Run a bake, or other work on maps: at once in background and from scripts, in a window beside the interface."""

    doing = "Baking warp maps"
    stopped = "Baking was stopped; the maps that are finished stay."
    _steps: Steps | None = None
    _timer: bpy.types.Timer | None = None

    def frames(self, scene: bpy.types.Scene) -> list[int]:
        """The frames to bake."""
        raise NotImplementedError

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        if running() is not None:
            cls.poll_message_set("Warp maps are being baked already")
            return False
        return True

    def _start(self, context: bpy.types.Context) -> Steps:
        scene = context.scene
        frame_setup.active_hole(scene)
        if not registry.of(scene).needs_maps(scene):
            raise SceneError(
                "The lens traces its rays itself (Rays: No Bake): there is nothing to bake.", code="lens.no-maps"
            )
        if len(frame_setup.holes(scene)) > 1 and scene.umbra.active_hole is not None:
            self.report({"WARNING"}, only_one_is_rendered(scene))
        return self.work(context)

    def work(self, context: bpy.types.Context) -> Steps:
        """The steps of the work; what the generator returns is reported."""
        scene = context.scene
        return frame_maps.bake(scene, self.frames(scene), context.view_layer.name)

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        summary = baking.drain(self._start(context), announce=bpy.app.background, doing=self.doing)
        self._report(summary)
        self.after(context, beside_interface=False)
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        return self._begin(context)

    @reporting
    def _begin(self, context: bpy.types.Context) -> set[str]:
        JOB.clear()
        self._steps = self._start(context)
        manager = context.window_manager
        manager.progress_begin(0.0, 1.0)
        self._timer = manager.event_timer_add(TIMER_INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        self._show(context, baking.Progress(context.scene.frame_current, 0.0, "Starting"))
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if (event.type == "ESC" and event.value == "PRESS") or JOB.now.stop_asked:
            self.report({"INFO"}, self.stopped)
            return self._end(context, {"CANCELLED"})
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._steps is None:
            return {"CANCELLED"}
        until = time.perf_counter() + SLICE
        try:
            progress = next(self._steps)
            while time.perf_counter() < until and not JOB.now.stop_asked:
                progress = next(self._steps)
        except StopIteration as end:
            self._report(end.value)
            self._end(context, {"FINISHED"})
            self.after(context, beside_interface=True)
            return {"FINISHED"}
        except physics.BlackHoleError as error:
            self.report({"ERROR"}, error.for_user())
            return self._end(context, {"CANCELLED"})
        except Exception:
            self._end(context, {"CANCELLED"})
            raise
        self._show(context, progress)
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._end(context, {"CANCELLED"})

    def _show(self, context: bpy.types.Context, progress: baking.Progress) -> None:
        JOB.now.progress = progress
        context.window_manager.progress_update(progress.fraction)
        context.workspace.status_text_set(f"{self.doing}: {progress.text}, {progress.fraction:.0%} done.  Esc stops.")
        _redraw(context)

    def _end(self, context: bpy.types.Context, result: set[str]) -> set[str]:
        JOB.clear()
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

    def after(self, context: bpy.types.Context, *, beside_interface: bool) -> None:
        """Do what comes after the work, if anything; beside the interface, or at once."""

    def _report(self, summary: Any) -> None:
        """Report the result of the steps."""
        self.report({"INFO"}, summary.sentence())
        if summary.unresolved:
            self.report(
                {"WARNING"},
                f"{summary.unresolved} rays could not be resolved; choose another Method under Warp Maps.",
            )


def _redraw(context: bpy.types.Context) -> None:
    """Draw the sidebars, where the panel is; what the views show does not change, and may take long to draw."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if area.type == "VIEW_3D" and region.type == "UI":
                    region.tag_redraw()


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
        return list(frame_setup.frames_of(scene))


class UMBRA_OT_stop_baking(bpy.types.Operator):
    bl_idname = "umbra.stop_baking"
    bl_label = "Stop Baking"
    bl_description = "Stop baking; the maps that are finished stay"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return running() is not None

    def execute(self, _context: bpy.types.Context) -> set[str]:
        JOB.now.stop_asked = True
        return {"FINISHED"}


CLASSES = (UMBRA_OT_bake_frame, UMBRA_OT_bake_animation, UMBRA_OT_stop_baking)
