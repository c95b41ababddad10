# SPDX-License-Identifier: GPL-3.0-or-later
"""The hole's depth in the picture, as the depth pass measures it, follows camera and hole by drivers.

What a handler wrote into the compositor while a frame is rendered would show one frame late; and with drivers of
Blender's own kind the file renders the same without the add-on.

Before Blender 5.0 the compositor's drivers know a frame's objects, and still the camera of the frame before where a
marker changes it. There each of the markers' cameras has drivers of its own, which count in its own frames.
"""

from typing import Literal

import bpy

from ...core.blender_version import SCENE_OWNS_COMPOSITOR
from ...nodes import black_hole_group
from ..shared.compositor_tree import Setup

HOLE_DEPTH = black_hole_group.HOLE_DEPTH.name
# On the group's node: what each driver of a marker's camera adds to the depth.
PARTS = "umbra_hole_depths"

# Variables of a driver: a camera's place and third axis, from its matrix, whose first index is the column; the type of
# its lens (2 is a panorama, whose depth is a distance); and the hole's place. The matrix of a new camera is 0 at first.
_CAMERA = {name: f"matrix_world[3][{row}]" for row, name in enumerate("abc")}
_CAMERA |= {name: f"matrix_world[2][{row}]" for row, name in enumerate("uvw")} | {"t": "data.type"}
_HOLE: tuple[tuple[str, Literal["LOC_X", "LOC_Y", "LOC_Z"]], ...] = (("x", "LOC_X"), ("y", "LOC_Y"), ("z", "LOC_Z"))
_DEPTH = "((a-x)*u+(b-y)*v+(c-z)*w)/sqrt(u*u+v*v+w*w+1e-30) if t<1.5 else sqrt((a-x)*(a-x)+(b-y)*(b-y)+(c-z)*(c-z))"

# A driver's expression has 255 characters at most.
MOST_SPANS = 4

# A driver: its camera, None for the scene's at any frame, and its expression.
_Part = tuple[bpy.types.Object | None, str]


def follow(scene: bpy.types.Scene, setup: Setup, hole: bpy.types.Object | None) -> None:
    """Let the group's socket follow the scene's camera and the hole; without a hole, nothing."""
    node, socket = setup.group, setup.group.inputs[HOLE_DEPTH]
    parts = [] if hole is None or socket.is_linked else _parts(scene)
    if hole is None or not parts:
        _remove(setup)
    elif not _are_there(setup, hole, parts):
        _remove(setup)
        _add(setup, node, socket, hole, parts)


def _parts(scene: bpy.types.Scene) -> list[_Part]:
    spans = _spans(scene) if SCENE_OWNS_COMPOSITOR else {}
    if len(spans) < 2:
        return [(None, _DEPTH)]
    return [
        (camera, f"({_DEPTH})*({'+'.join(found[first : first + MOST_SPANS])})")
        for camera, found in spans.items()
        for first in range(0, len(found), MOST_SPANS)
    ]


def _spans(scene: bpy.types.Scene) -> dict[bpy.types.Object, list[str]]:
    """For each camera that markers choose, expressions that are 1 in its frames and 0 in others."""
    cameras: dict[int, bpy.types.Object] = {}
    for marker in scene.timeline_markers:
        if marker.camera is not None and not marker.camera.hide_render:
            cameras.setdefault(marker.frame, marker.camera)
    spans: dict[bpy.types.Object, list[str]] = {}
    starts = sorted(cameras)
    for index, start in enumerate(starts):
        # the first camera is that of the frames before its marker as well
        conditions = [f"(frame>={start})"] if index else []
        conditions += [f"(frame<{end})" for end in starts[index + 1 : index + 2]]
        spans.setdefault(cameras[start], []).append("*".join(conditions))
    return spans


def _add(
    setup: Setup, node: bpy.types.Node, socket: bpy.types.NodeSocket, hole: bpy.types.Object, parts: list[_Part]
) -> None:
    if len(parts) == 1:
        _write(socket.driver_add("default_value").driver, hole, *parts[0])
        return
    node[PARTS] = [0.0] * len(parts)
    total = socket.driver_add("default_value").driver
    total.type = "SUM"
    for index, part in enumerate(parts):
        _write(setup.tree.driver_add(_parts_path(node), index).driver, hole, *part)
        target = total.variables.new().targets[0]
        target.id_type, target.id, target.data_path = "NODETREE", setup.tree, f"{_parts_path(node)}[{index}]"


def _write(driver: bpy.types.Driver, hole: bpy.types.Object, camera: bpy.types.Object | None, expression: str) -> None:
    driver.type = "SCRIPTED"
    for name, path in _CAMERA.items():
        variable = driver.variables.new()
        variable.name = name
        if camera is None:
            variable.type = "CONTEXT_PROP"
            variable.targets[0].context_property = "ACTIVE_SCENE"
            variable.targets[0].data_path = f"camera.{path}"
        else:
            variable.targets[0].id = camera
            variable.targets[0].data_path = path
    for name, channel in _HOLE:
        variable = driver.variables.new()
        variable.name, variable.type = name, "TRANSFORMS"
        variable.targets[0].id = hole
        variable.targets[0].transform_type = channel
        variable.targets[0].transform_space = "WORLD_SPACE"
    driver.expression = expression


def _parts_path(node: bpy.types.Node) -> str:
    return f'{node.path_from_id()}["{PARTS}"]'


def _present(setup: Setup) -> tuple[list[bpy.types.FCurve], list[bpy.types.FCurve]]:
    """The driver of the socket, and those of the cameras in their order."""
    animation = setup.tree.animation_data
    every = [] if animation is None else list(animation.drivers)
    path = setup.group.inputs[HOLE_DEPTH].path_from_id("default_value")
    parts = [each for each in every if each.data_path == _parts_path(setup.group)]
    parts.sort(key=lambda each: each.array_index)
    return [each for each in every if each.data_path == path], parts


def _are_there(setup: Setup, hole: bpy.types.Object, wanted: list[_Part]) -> bool:
    total, parts = _present(setup)
    if len(total) != 1 or not all(each.driver.is_valid for each in total + parts):
        return False
    if len(wanted) > 1 and len(total[0].driver.variables) != len(wanted):
        return False
    drivers = [each.driver for each in (parts if len(wanted) > 1 else total)]
    return [_read(each) for each in drivers] == [(*part, hole) for part in wanted]


def _read(driver: bpy.types.Driver) -> tuple[bpy.types.ID | None, str, bpy.types.ID | None] | None:
    """What `_write` was given."""
    kinds = [each.type for each in driver.variables]
    if len(kinds) != len(_CAMERA) + len(_HOLE):
        return None
    ids = [None if each.type == "CONTEXT_PROP" else each.targets[0].id for each in driver.variables]
    return ids[0], driver.expression, ids[-1]


def _remove(setup: Setup) -> None:
    total, parts = _present(setup)
    for each in total + parts:
        if setup.tree.animation_data is not None:
            setup.tree.animation_data.drivers.remove(each)
    if PARTS in setup.group:
        del setup.group[PARTS]
