# SPDX-License-Identifier: GPL-3.0-or-later
"""A hole's settings at any frame, from their keyframes: known before Blender has evaluated the frame."""

from typing import Any

import bpy
import numpy as np

from ..core.physics_api import physics
from ..settings.disk_properties import value_of

SPIN, INNER, OUTER = "umbra.spin", "umbra.disk.inner_radius", "umbra.disk.outer_radius"


def keyframes(hole: bpy.types.Object) -> dict[str, bpy.types.FCurve]:
    """The curves of the hole's action by their data paths; strips of other actions are left out."""
    animation = hole.animation_data
    if animation is None or animation.action is None:
        return {}
    bags = [
        strip.channelbag(animation.action_slot)
        for layer in animation.action.layers
        for strip in layer.strips
        if animation.action_slot is not None
    ]
    return {curve.data_path: curve for bag in bags if bag is not None for curve in bag.fcurves if not curve.mute}


def in_strips(hole: bpy.types.Object) -> set[str]:
    """Data paths that strips of the Nonlinear Animation move."""
    if hole.animation_data is None:
        return set()
    tracks = hole.animation_data.nla_tracks
    actions = [each.action for track in tracks if not track.mute for each in track.strips if not each.mute]
    return {
        curve.data_path
        for action in actions
        if action is not None
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
        for curve in bag.fcurves
    }


def driven(hole: bpy.types.Object) -> set[str]:
    """Data paths of the hole's properties that have drivers."""
    return set() if hole.animation_data is None else {curve.data_path for curve in hole.animation_data.drivers}


def value_at(hole: bpy.types.Object, path: str, frame: float) -> float:
    """A number among the hole's settings at a frame; without keyframes, as it stands."""
    curve = keyframes(hole).get(path)
    return float(hole.path_resolve(path)) if curve is None else _limited(hole, path, curve.evaluate(frame))


def _limited(hole: bpy.types.Object, path: str, value: float) -> float:
    """What Blender makes of a curve's value: single precision, within the property's range."""
    owner, _, name = path.rpartition(".")
    limits = (hole.path_resolve(owner) if owner else hole).bl_rna.properties[name]
    return float(np.float32(np.clip(value, limits.hard_min, limits.hard_max)))


def disk_at(hole: bpy.types.Object, frame: float) -> "tuple[float, physics.Disk]":
    """The hole's spin, and its disk, at a frame."""
    settings = hole.umbra.disk
    disk = physics.Disk(
        crossings=int(settings.crossings),
        inner_radius=None if settings.inner_at_isco else value_at(hole, INNER, frame),
        outer_radius=value_at(hole, OUTER, frame),
        retrograde=bool(settings.retrograde),
    )
    return value_at(hole, SPIN, frame), disk


def look_at(hole: bpy.types.Object, frame: float) -> "physics.MatterLook":
    """How the hole's disk looks at a frame; its exposure is not a part of that, see `disk_properties.look_of`."""
    values: dict[str, Any] = {
        name: value_of(hole.umbra.disk, name) if setting.choices else value_at(hole, f"umbra.disk.{name}", frame)
        for name, setting in physics.MATTER_SETTINGS.items()
    }
    return physics.MatterLook(**{**values, "exposure": 0.0})


def animated_paths(hole: bpy.types.Object) -> set[str]:
    """Return the hole's properties that have keyframes, drivers, or strips."""
    return driven(hole) | keyframes(hole).keys() | in_strips(hole)
