# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a scene's black hole is rendered at a frame, as Blender decides it for its own objects."""

import bpy

from . import disk_animation, frame_setup, instanced_hole
from .enabled import is_enabled

# What a curve of a switch is above where Blender takes it for on.
_TRUE = 1.0 - 1.2e-7


def is_absent(scene: bpy.types.Scene, frame: int | None = None) -> bool:
    """Return whether a frame, the current one by default, is rendered without a black hole.

    The scene has none (any more), or it is hidden in renders: by itself, which can be animated, or with its collections
    in every view layer that is rendered. Where there are several and none is chosen, or one is in a collection
    instance, the scene is not without one.
    """
    hole = frame_setup.find_active_hole(scene)
    if hole is None:
        return not frame_setup.holes(scene) and instanced_hole.find(scene) is None
    if _is_hidden(hole, scene.frame_current if frame is None else frame):
        return True
    layers = [layer.layer_collection for layer in scene.view_layers if layer.use]
    return bool(layers) and not any(is_enabled(hole, layer, "hide_render") for layer in layers)


def _is_hidden(hole: bpy.types.Object, frame: int) -> bool:
    curve = disk_animation.keyframes(hole).get("hide_render")
    return hole.hide_render if curve is None else curve.evaluate(frame) > _TRUE
