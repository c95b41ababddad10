# SPDX-License-Identifier: GPL-3.0-or-later
"""What places a frame's hole and camera, as the datablocks themselves say it, whatever has been evaluated."""

from collections.abc import Iterable, Iterator

import bpy

# Of cameras and holes: what has a say in a map.
_CAMERA = ("lens", "sensor_width", "sensor_height", "sensor_fit", "shift_x", "shift_y", "type")
_HOLE = ("spin", "mass_scale", "motion", "speed_of_light")


def with_causes(objects: Iterable[bpy.types.Object]) -> Iterator[bpy.types.Object]:
    """Objects, their parents, and the targets of their constraints."""
    waiting, seen = list(objects), set[bpy.types.Object]()
    while waiting:
        each = waiting.pop(0)
        if each in seen:
            continue
        seen.add(each)
        yield each
        causes = [each.parent, *(getattr(one, "target", None) for one in each.constraints if not one.mute)]
        waiting += [one for one in causes if one is not None]


def placement(objects: Iterable[bpy.types.Object]) -> object:
    """Return values that differ if anything has placed these objects, or changed their settings, since."""
    found: list[object] = []
    for each in with_causes(objects):
        found += [each.session_uid, *(tuple(row) for row in each.matrix_basis)]
        if isinstance(each.data, bpy.types.Camera):
            found += [getattr(each.data, name) for name in _CAMERA]
        if each.umbra.is_black_hole:
            found += [getattr(each.umbra, name) for name in _HOLE]
    return tuple(found)
