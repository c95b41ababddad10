# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact the current frame's map is, in one click: an operator, and the panel that shows what it found."""

from collections.abc import Generator

import bpy

from ..bake import baking
from ..bake.check import fault_of
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import SESSION, Life, scene_of
from ..outputs import frames, registry
from ..scene import frame_setup
from ..scene.sky import environment
from .bake_operators import BakeOperator, Steps
from .sidebar import HolePanel
from .status import wrapped

Report = tuple[int, "physics.AccuracyReport"]


def _no_report() -> Report | None:
    return None


# The last report of each scene, with its frame. Not saved: a map may change meanwhile.
_reports = SESSION.per_scene(_no_report, Life.FILE)


def report_of(scene: bpy.types.Scene) -> Report | None:
    """Return the frame and the report of the last check of a scene, if there was one."""
    return _reports.find(scene)


def check_frame(
    scene: bpy.types.Scene, view_layer_name: str | None = None
) -> "Generator[baking.Progress, None, physics.AccuracyReport]":
    """Check the map of a scene's current frame.

    Raises
    ------
    physics.BlackHoleError
        If there is no valid map, or the frame is impossible.
    """
    layer = scene.view_layers.get(view_layer_name) if view_layer_name else None
    frame = frames.read_at(scene, scene.frame_current, layer)
    wanted = registry.of(scene).request_to_check(scene, frame)
    fault = fault_of(wanted)
    if fault is not None:
        raise SceneError(f"{fault}: press Bake This Frame first.", code="map.out-of-date")
    steps = physics.accuracy_steps(wanted.path, passes=list(wanted.passes), environment_width=_environment_width(scene))
    return _progress(scene.session_uid, frame.frame, steps)


def _progress(
    uid: int, frame: int, steps: "Generator[float, None, physics.AccuracyReport]"
) -> "Generator[baking.Progress, None, physics.AccuracyReport]":
    """Tell of each step, and keep the report; the scene itself must not be kept while the work waits."""
    while True:
        try:
            fraction = next(steps)
        except StopIteration as end:
            report: physics.AccuracyReport = end.value
            scene = scene_of(uid)
            if scene is not None:
                _reports.put(scene, (frame, report))
            return report
        yield baking.Progress(frame, fraction, f"Frame {frame}")


def _environment_width(scene: bpy.types.Scene) -> int:
    """The width of the sky's picture, in whose pixels errors are told; a common one where it is not known."""
    try:
        width = environment.read(scene).image.size[0]
    except physics.BlackHoleError:
        width = 0
    return width or physics.DEFAULT_ENVIRONMENT_WIDTH


class UMBRA_OT_check_accuracy(BakeOperator, bpy.types.Operator):
    bl_idname = "umbra.check_accuracy"
    bl_label = "Check Accuracy"
    bl_description = (
        "Trace pixels of this frame's baked map again by the reference method, and say how far the map is from them"
    )
    bl_options = {"REGISTER"}
    doing = "Checking accuracy"
    stopped = "The check was stopped."

    def _start(self, context: bpy.types.Context) -> Steps:
        frame_setup.active_hole(context.scene)
        return check_frame(context.scene, context.view_layer.name)

    def _report(self, report: "physics.AccuracyReport") -> None:
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
