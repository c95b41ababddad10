# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether camera or hole move while the shutter is open, so that motion blur should blur sky and shadow."""

import enum
import math
from collections.abc import Iterator

import bpy
import numpy as np

from .placement import with_causes
from .stepping import frame_kept

# Change of a matrix, of its places in units of the largest, that is no motion: Blender's matrices are float32.
STILL = 1e-5

# Data paths of what moves an object.
_PLACING = ("location", "rotation", "scale", "delta_", "constraints", "pose", "parent")


class Motion(enum.Enum):
    """What is known of the motion within a frame."""

    NONE = enum.auto()
    UNKNOWN = enum.auto()
    """Something can move it that only evaluating other moments would tell."""
    MOVES = enum.auto()


def is_blurred(scene: bpy.types.Scene) -> bool:
    """Return whether motion blur is on, in a view layer that is rendered."""
    layers = [layer for layer in scene.view_layers if layer.use]
    return scene.render.use_motion_blur and any(layer.use_motion_blur for layer in layers)


def interval(scene: bpy.types.Scene) -> tuple[float, float]:
    """Return the moments at which the shutter opens and closes for the current frame, in frames."""
    render = scene.render
    before = {"START": 0.0, "CENTER": 0.5, "END": 1.0}[render.motion_blur_position]
    start = scene.frame_current_final - before * render.motion_blur_shutter
    return start, start + render.motion_blur_shutter


def motion_of(scene: bpy.types.Scene, each: bpy.types.Object) -> Motion:
    """Return what an object's keyframes, and those of its parents and constraints, say of it within the current frame.

    This evaluates nothing, and is cheap enough for drawing.
    """
    start, end = interval(scene)
    found = Motion.NONE
    for cause in with_causes([each]):
        data = None if isinstance(cause.data, bpy.types.Camera) else cause.data
        for owner in (cause, data):
            animation = None if owner is None else owner.animation_data
            if owner is None or animation is None:
                continue
            for curve in _curves(animation):
                is_placing = owner is not cause or curve.data_path.startswith(_PLACING)
                if is_placing and abs(curve.evaluate(end) - curve.evaluate(start)) > STILL * max(
                    abs(curve.evaluate(start)), 1e-3
                ):
                    return Motion.MOVES
            drivers = [one for one in animation.drivers if owner is not cause or one.data_path.startswith(_PLACING)]
            if drivers or any(not track.mute for track in animation.nla_tracks):
                found = Motion.UNKNOWN
        if cause.rigid_body is not None or cause.parent_type in {"VERTEX", "VERTEX_3"}:
            found = Motion.UNKNOWN
    return found


def moves(scene: bpy.types.Scene, each: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> bool:
    """Return whether an object is elsewhere, or turned, when the shutter opens, half-way, and when it closes.

    Steps the scene to those moments and back.
    """
    start, end = interval(scene)
    matrices = []
    with frame_kept(scene):
        for moment in (start, 0.5 * (start + end), end):
            whole = math.floor(moment)
            scene.frame_set(whole, subframe=moment - whole)
            matrices.append(np.array(each.evaluated_get(view_layer.depsgraph).matrix_world, dtype=np.float64))
    largest = max(1.0, float(np.abs(matrices[0]).max()))
    return any(np.abs(matrix - matrices[0]).max() > STILL * largest for matrix in matrices[1:])


def _curves(animation: bpy.types.AnimData) -> Iterator[bpy.types.FCurve]:
    if animation.action is None or animation.action_slot is None:
        return
    for layer in animation.action.layers:
        for strip in layer.strips:
            bag = strip.channelbag(animation.action_slot)
            yield from () if bag is None else (curve for curve in bag.fcurves if not curve.mute)
