# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Render Farm and its operators: job templates, and copies of a file that render without this add-on."""

from collections.abc import Generator
from pathlib import Path
from time import perf_counter

import bpy

from ..core.physics_api import physics
from ..farm import farm_copy, farm_templates
from .reporting import TIMER_INTERVAL, reporting
from .sidebar import HolePanel


class UMBRA_OT_save_farm_copy(bpy.types.Operator):
    bl_idname = "umbra.save_farm_copy"
    bl_label = "Save Farm Copy"
    bl_description = (
        "Save a copy beside this file whose frames render without this add-on, with what it does in each frame as "
        "keyframes. Needed for the Cycles Lens and for a disk whose settings are animated"
    )
    bl_options = {"REGISTER"}

    _steps: Generator[float, None, Path] | None = None
    _timer: bpy.types.Timer | None = None

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        steps = farm_copy.save(scene, farm_copy.frames_of(scene))
        while self._go_on(steps) is None:
            pass
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        manager = context.window_manager
        self._steps = farm_copy.save(context.scene, farm_copy.frames_of(context.scene))
        manager.progress_begin(0.0, 1.0)
        self._timer = manager.event_timer_add(TIMER_INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Work for a moment. All events but Esc are swallowed, so that the file stays as it is."""
        if event.type == "ESC" and event.value == "PRESS":
            self.report({"INFO"}, "The farm copy was not written.")
            return self._end(context, {"CANCELLED"})
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        until = perf_counter() + TIMER_INTERVAL
        while self._steps is not None and perf_counter() < until:
            try:
                result = self._go_on(self._steps, context)
            except physics.BlackHoleError as error:
                self.report({"ERROR"}, error.for_user())
                return self._end(context, {"CANCELLED"})
            except Exception:
                self._end(context, {"CANCELLED"})
                raise
            if result is not None:
                return self._end(context, {"FINISHED"})
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._end(context, {"CANCELLED"})

    def _go_on(self, steps: Generator[float, None, Path], context: bpy.types.Context | None = None) -> Path | None:
        """Take a step and report progress; return the path of the copy once it is written."""
        try:
            share = next(steps)
        except StopIteration as end:
            path: Path = end.value
            self.report({"INFO"}, f"Wrote {path.name}.")
            return path
        if context is not None:
            context.window_manager.progress_update(share)
            context.workspace.status_text_set(f"Saving the farm copy: {share:.0%} done.  Esc stops.")
        return None

    def _end(self, context: bpy.types.Context, result: set[str]) -> set[str]:
        if self._steps is not None:
            self._steps.close()
            self._steps = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        return result


class UMBRA_OT_save_farm_templates(bpy.types.Operator):
    bl_idname = "umbra.save_farm_templates"
    bl_label = "Save Farm Templates..."
    bl_description = (
        "Write job templates for render farms (Open Job Description, Flamenco) and their script to a folder; and a "
        "farm copy of this file where it needs one"
    )
    bl_options = {"REGISTER"}

    directory: bpy.props.StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        written = farm_templates.save(scene, Path(bpy.path.abspath(self.directory)))
        self.report({"INFO"}, f"Wrote {', '.join(path.name for path in written)}.")
        if farm_copy.needs_copy(scene):
            try:
                context_of_call = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
                bpy.ops.umbra.save_farm_copy(context_of_call)  # type: ignore[attr-defined]  # registered by the add-on
            except RuntimeError as error:  # what the other operator has reported, with its code
                self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
                return {"CANCELLED"}
        return {"FINISHED"}


class VIEW3D_PT_umbra_farm(HolePanel, bpy.types.Panel):
    bl_label = "Render Farm"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        column.enabled = bool(bpy.data.filepath)
        column.operator("umbra.save_farm_templates", icon="FILE_FOLDER")
        column.operator("umbra.save_farm_copy", icon="DUPLICATE")
        if not bpy.data.filepath:
            self.layout.label(text="Save this file first.", icon="INFO")


CLASSES = (UMBRA_OT_save_farm_copy, UMBRA_OT_save_farm_templates, VIEW3D_PT_umbra_farm)
