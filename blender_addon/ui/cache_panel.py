# SPDX-License-Identifier: GPL-3.0-or-later
"""Verify and clean the maps of a shot: two operators and their panel."""

import time
from dataclasses import dataclass

import bpy

from ..bake import cache
from ..bake.check import State
from ..core.session import SESSION, Life, scene_of
from ..outputs import frames, registry
from ..scene import frame_setup
from . import status
from .bake_operators import BakeOperator, Steps
from .sidebar import UmbraPanel


@dataclass(frozen=True)
class Told:
    """What the panel says of a scene's maps."""

    listing: cache.Listing | None
    when: str


# The last verification of each scene.
_told = SESSION.per_scene(lambda: Told(None, ""), Life.FILE)


class CacheOperator(BakeOperator):
    """Work on the maps of the frames that rendering the animation renders."""

    def frames(self, scene: bpy.types.Scene) -> list[int]:
        return list(frame_setup.frames_of(scene))


class UMBRA_OT_verify_maps(CacheOperator, bpy.types.Operator):
    bl_idname = "umbra.verify_maps"
    bl_label = "Verify Maps"
    bl_description = "Read every map of the animation whole: which are valid, missing, stale, foreign or damaged?"
    bl_options = {"REGISTER"}

    doing = "Verifying maps"
    stopped = "Verifying was stopped."

    def work(self, context: bpy.types.Context) -> Steps:
        self._uid = context.scene.session_uid
        return frames.examine(context.scene, self.frames(context.scene), context.view_layer.name)

    def _report(self, listing: cache.Listing) -> None:
        scene = scene_of(self._uid)
        if scene is not None:
            _told.put(scene, Told(listing, time.strftime("%H:%M")))
        self.report({"INFO"} if listing.complete else {"WARNING"}, listing.sentence())


class UMBRA_OT_clean_maps(CacheOperator, bpy.types.Operator):
    bl_idname = "umbra.clean_maps"
    bl_label = "Clean Maps"
    bl_description = (
        "Remove the animation's maps that are stale, foreign or damaged, and what bakes that were killed have left; "
        "valid maps stay"
    )
    bl_options = {"REGISTER"}

    doing = "Cleaning maps"
    stopped = "Cleaning was stopped; nothing was removed."

    everything: bpy.props.BoolProperty(
        name="All", description="Remove all maps of this black hole, valid ones too, of every frame, size and output"
    )
    _beside_interface = False

    def work(self, context: bpy.types.Context) -> Steps:
        scene = context.scene
        _told.drop(scene)
        return frames.clean(scene, self.frames(scene), context.view_layer.name, everything=self.everything)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self._beside_interface = True  # and execute() is called when it is confirmed
        what = "all maps of this black hole" if self.everything else "maps that are stale, foreign or damaged"
        return context.window_manager.invoke_confirm(
            self, event, title="Clean Maps", message=f"Remove {what}?", confirm_text="Remove"
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self._begin(context) if self._beside_interface else super().execute(context)

    def _report(self, cleaning: cache.Cleaning) -> None:
        self.report({"INFO"}, cleaning.sentence())


def lines(scene: bpy.types.Scene) -> list[status.Line]:
    """What is known of a scene's maps."""
    told = _told.find(scene)
    if told is None or told.listing is None:
        return [status.Line("Not verified yet", "QUESTION")]
    found = [status.Line(f"{len(told.listing.frames)} frames, {told.listing.size / 1e6:.1f} MB at {told.when}", "FILE")]
    icons: dict[str, str] = {State.VALID: "CHECKMARK", State.MISSING: "RADIOBUT_OFF", State.STALE: "FILE_REFRESH"}
    for state, count in told.listing.counts.items():
        if count:
            found.append(status.Line(f"{count} {state}", icons.get(state, "ERROR")))
    if told.listing.leftovers:
        found.append(status.Line(f"{len(told.listing.leftovers)} left by killed bakes", "ERROR"))
    return found


class VIEW3D_PT_umbra_cache(UmbraPanel, bpy.types.Panel):
    bl_label = "Verify and Clean"
    bl_parent_id = "VIEW3D_PT_umbra_maps"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return registry.of(context.scene).needs_maps(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        column = layout.column(align=True)
        for line in lines(context.scene):
            column.label(text=line.text, icon=line.icon)
        row = layout.row(align=True)
        row.operator("umbra.verify_maps", icon="VIEWZOOM")
        row.operator("umbra.clean_maps", icon="BRUSH_DATA")


CLASSES = (UMBRA_OT_verify_maps, UMBRA_OT_clean_maps, VIEW3D_PT_umbra_cache)
