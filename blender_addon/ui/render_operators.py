# SPDX-License-Identifier: GPL-3.0-or-later
"""Render from the window: bake first what the render would have to bake, beside the interface, then start Blender's.

A render that bakes by itself shows no progress meanwhile, and nothing can end it. Blender's own menu entries still do
that; F12 and Ctrl F12 come here first, and go on to Blender's own where there is nothing to bake.
"""

import time

import bpy

from ..bake import baking
from ..bake.check import is_valid
from ..core.physics_api import physics
from ..outputs import frames as frame_maps
from ..outputs import registry
from . import bake_operators
from .bake_operators import BakeOperator, Steps, UMBRA_OT_bake_animation, UMBRA_OT_bake_frame
from .reporting import SLICE

# Where Blender has its own F12.
KEYMAP = "Screen"


def may_bake(scene: bpy.types.Scene) -> bool:
    """Return whether a render of the scene would bake what is missing."""
    output = registry.of(scene)
    return scene.umbra.auto_bake and output.is_in_use(scene) and output.needs_maps(scene)


class RenderOperator(BakeOperator):
    """Bake what is missing, and then render."""

    doing = "Baking warp maps for the render"
    stopped = "The render was not started; the maps that are finished stay."
    animation = False
    by_key: bpy.props.BoolProperty(
        name="By Key",
        description="Leave a scene without anything to bake to the next use of the key",
        options={"HIDDEN"},
    )
    _uid = 0
    """The scene's number in the session; the window may show another one when the maps are done."""

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return True  # a key that is refused here would go on to Blender's own render

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        if self._is_baking():
            return {"CANCELLED"}
        if not bpy.app.is_job_running("RENDER") and may_bake(context.scene) and not self._has_maps(context.scene):
            return self._begin(context)
        if self.by_key:
            return {"PASS_THROUGH"}
        return self._render(beside_interface=True)

    def _has_maps(self, scene: bpy.types.Scene) -> bool:
        """Whether all maps are found valid within a slice of time; then the render starts without a detour."""
        until = time.perf_counter() + SLICE
        try:
            for frame in self.frames(scene):
                needed = frame_maps.requests_at(scene, frame)
                if time.perf_counter() > until or not all(is_valid(wanted) for wanted in needed):
                    return False
        except physics.BlackHoleError:  # the bake says what is wrong
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        if self._is_baking():
            return {"CANCELLED"}
        if may_bake(context.scene):
            return super().execute(context)
        return self._render(beside_interface=False)

    def work(self, context: bpy.types.Context) -> Steps:
        scene = context.scene
        self._uid = scene.session_uid
        return frame_maps.bake(scene, self.frames(scene))  # in the view layer that the render looks at

    def after(self, context: bpy.types.Context, *, beside_interface: bool) -> None:
        if context.scene.session_uid != self._uid:
            self.report({"WARNING"}, "The maps are there, but the window shows another scene now: render again.")
            return
        self._render(beside_interface=beside_interface)

    def _render(self, *, beside_interface: bool) -> set[str]:
        try:
            start_render(animation=self.animation, beside_interface=beside_interface)
        except RuntimeError as error:  # what Blender's own operator reports
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        return {"FINISHED"}

    def _is_baking(self) -> bool:
        if bake_operators.running() is None:
            return False
        self.report({"WARNING"}, "Maps are being baked: render when they are done, or end that by Esc.")
        return True

    def _report(self, summary: baking.Summary) -> None:
        if summary.baked:
            super()._report(summary)


def start_render(*, animation: bool, beside_interface: bool) -> None:
    """Start Blender's own render, as its menu does."""
    how = "INVOKE_DEFAULT" if beside_interface else "EXEC_DEFAULT"
    bpy.ops.render.render(how, animation=animation, use_viewport=True)


class UMBRA_OT_render_frame(RenderOperator, bpy.types.Operator):
    bl_idname = "umbra.render_frame"
    bl_label = "Bake and Render Image"
    bl_description = "Bake the maps of the current frame that are missing, with progress, and then render it. Esc stops"
    bl_options = {"REGISTER"}

    frames = UMBRA_OT_bake_frame.frames


class UMBRA_OT_render_animation(RenderOperator, bpy.types.Operator):
    bl_idname = "umbra.render_animation"
    bl_label = "Bake and Render Animation"
    bl_description = (
        "Bake the maps of the animation that are missing, with progress, and then render all frames. Esc stops"
    )
    bl_options = {"REGISTER"}

    animation = True
    frames = UMBRA_OT_bake_animation.frames


def draw_render_menu(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """The entries at the top of the Render menu, for scenes whose render may bake."""
    if may_bake(context.scene):
        self.layout.operator(UMBRA_OT_render_frame.bl_idname, icon="RENDER_STILL")
        self.layout.operator(UMBRA_OT_render_animation.bl_idname, icon="RENDER_ANIMATION")
        self.layout.separator()


CLASSES = (UMBRA_OT_render_frame, UMBRA_OT_render_animation)


def register() -> None:
    """Put the operators into the Render menu and before Blender's keys."""
    bpy.types.TOPBAR_MT_render.prepend(draw_render_menu)
    keyconfig = bpy.context.window_manager.keyconfigs.addon
    if keyconfig is None:
        return
    items = keyconfig.keymaps.new(name=KEYMAP, space_type="EMPTY").keymap_items
    for operator in CLASSES:
        item = items.new(operator.bl_idname, "F12", "PRESS", ctrl=operator.animation)
        item.properties.by_key = True


def unregister() -> None:
    """Take the operators out of the menu and the keymap."""
    bpy.types.TOPBAR_MT_render.remove(draw_render_menu)
    keyconfig = bpy.context.window_manager.keyconfigs.addon
    keymap = None if keyconfig is None else keyconfig.keymaps.get(KEYMAP)
    if keymap is None:
        return
    ours = {operator.bl_idname for operator in CLASSES}
    for item in [each for each in keymap.keymap_items if each.idname in ours]:
        keymap.keymap_items.remove(item)
