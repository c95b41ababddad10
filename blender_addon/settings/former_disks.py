# SPDX-License-Identifier: GPL-3.0-or-later
"""Disks of files that version 0.1 saved, whose light was made in another way: what their settings are today.

Settings that both versions have keep their values. The others are taken for what comes nearest. Brightness was counted
in another way: the same exposure would be some 2.5 stops brighter today, going by the presets of both versions.
"""

from __future__ import annotations

from typing import Any

import bpy

from .saved_names import group_in, storage_of

CURRENT = 1
"""Value of `look_version` of a disk whose settings are of this version."""

BRIGHTER = 2.5
"""Stops by which an exposure of version 0.1 is brighter today."""

# How much the densest streaks and clumps of the most streaked preset of version 0.1 thinned the disk out.
_MOST_STREAKED = 0.85
# Defaults of version 0.1.
_STREAKS, _CLUMPS = 0.7, 0.4
_SMOKE, _STRANDS = 1.0, 0.12

_EXPOSURE = "umbra.disk.exposure"


def bring_up_to_date() -> None:
    """Convert the disks of all objects that no version since 0.1 has changed; those of linked files in memory only."""
    for each in bpy.data.objects:
        disk = group_in(group_in(storage_of(each), "umbra"), "disk")
        if disk is None or disk.get("look_version") == CURRENT:
            continue
        if not each.umbra.is_black_hole:
            continue
        _convert(disk)
        for curve in _exposure_curves(each):
            for point in curve.keyframe_points:
                point.co.y -= BRIGHTER
                point.handle_left.y -= BRIGHTER
                point.handle_right.y -= BRIGHTER
            curve.update()
        disk["look_version"] = CURRENT


def _convert(disk: Any) -> None:
    """Convert stored values."""
    if "exposure" in disk:
        disk["exposure"] = disk["exposure"] - BRIGHTER
    if "beaming" in disk and "band" not in disk:
        disk["band"] = disk["beaming"] + 1  # all light or one color, after visible light
    if "streaks" in disk or "clumps" in disk:
        streaked = max(disk.get("streaks", _STREAKS), disk.get("clumps", _CLUMPS)) / _MOST_STREAKED
        disk["smoke"], disk["strands"] = (min(streaked, 1.0) * most for most in (_SMOKE, _STRANDS))
    for former in ("beaming", "streaks", "clumps", "gain"):
        if former in disk:
            del disk[former]


def _exposure_curves(hole: bpy.types.Object) -> list[bpy.types.FCurve]:
    animation = hole.animation_data
    actions = set() if animation is None else {animation.action}
    for track in () if animation is None else animation.nla_tracks:
        actions |= {strip.action for strip in track.strips}
    bags = [
        bag
        for action in actions
        if action is not None
        for layer in action.layers
        for strip in layer.strips
        for bag in strip.channelbags
    ]
    return [curve for bag in bags for curve in bag.fcurves if curve.data_path == _EXPOSURE]
