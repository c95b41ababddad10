# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact the current frame's map is, in one click: an operator, and the panel that shows what it found."""

from collections.abc import Generator

import bpy

from ..bake import baking, maps
from ..core.errors import SceneError
from ..core.physics_api import accuracy, physics
from ..outputs.lens import lens_sync
from ..outputs.world import world_sync
from ..scene import environment, frame_setup
from .operators import BakeOperator
from .sidebar import HolePanel
from .status import wrapped

# The last report of each scene, by its number in this session, with its frame. Not saved: a map may change meanwhile.
_reports: dict[int, tuple[int, "accuracy.AccuracyReport"]] = {}


def report_of(scene: bpy.types.Scene) -> "tuple[int, accuracy.AccuracyReport] | None":
    """The frame and the report of the last check of a scene, if there was one."""
    return _reports.get(scene.session_uid)


def check_frame(
    scene_name: str, view_layer_name: str | None = None
) -> "Generator[baking.Progress, None, accuracy.AccuracyReport]":
    """Check the map of a scene's current frame.

    Raises
    ------
    physics.BlackHoleError
        There is no map that holds, or the frame is impossible.
    """
    scene = bpy.data.scenes[scene_name]
    if lens_sync.is_on(scene) and not lens_sync.uses_maps(scene):
        raise SceneError("The lens traces its rays itself (Rays: No Bake): there is no map to check.")
    if world_sync.is_on(scene):
        raise SceneError(
            "Check Accuracy knows no world maps: choose Output: Compositor or Cycles Lens, and bake this frame."
        )
    layer = scene.view_layers.get(view_layer_name) if view_layer_name else None
    frame_shot = frame_setup.read_at(scene, scene.frame_current, layer)
    parameters = baking.parameters_of(scene, frame_shot)
    path = baking.path_of(scene, frame_shot)
    fault = maps.fault_of(path, parameters)
    if fault is not None:
        raise SceneError(f"{fault}: press Bake This Frame first.")
    number = scene.session_uid  # the scene itself must not be kept while the work waits
    steps = accuracy.accuracy_steps(
        path, passes=maps.pass_paths(path, parameters), environment_width=_environment_width(scene)
    )
    while True:
        try:
            fraction = next(steps)
        except StopIteration as end:
            _reports[number] = (frame_shot.frame, end.value)
            return end.value
        yield baking.Progress(frame_shot.frame, fraction, f"Frame {frame_shot.frame}")


def _environment_width(scene: bpy.types.Scene) -> int:
    """The width of the sky's picture, in whose pixels errors are told; a common one where it is not known."""
    try:
        width = environment.read(scene).image.size[0]
    except physics.BlackHoleError:
        width = 0
    return width or accuracy.DEFAULT_ENVIRONMENT_WIDTH


class UMBRA_OT_check_accuracy(BakeOperator, bpy.types.Operator):
    bl_idname = "umbra.check_accuracy"
    bl_label = "Check Accuracy"
    bl_description = (
        "Trace pixels of this frame's baked map again by the reference method, and say how far the map is from them"
    )
    bl_options = {"REGISTER"}
    doing = "Checking accuracy"
    stopped = "The check was stopped."

    def _start(self, context: bpy.types.Context) -> Generator:
        frame_setup.active_hole(context.scene)
        return check_frame(context.scene.name, context.view_layer.name)

    def _report(self, report: "accuracy.AccuracyReport") -> None:
        level = "WARNING" if report.differing or report.unresolved else "INFO"
        self.report({level}, report.text())


class VIEW3D_PT_umbra_accuracy(HolePanel, bpy.types.Panel):
    bl_label = "Accuracy"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator("umbra.check_accuracy", icon="VIEWZOOM")
        found = report_of(context.scene)
        if found is None:
            return
        frame, report = found
        column = layout.column(align=True)
        column.label(text=f"Frame {frame}", icon="ERROR" if report.differing or report.unresolved else "CHECKMARK")
        for sentence in report.sentences():
            for line in wrapped(sentence, "DOT"):
                column.label(text=line.text, icon=line.icon)


CLASSES = (UMBRA_OT_check_accuracy, VIEW3D_PT_umbra_accuracy)
