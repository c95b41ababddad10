# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects stand behind the hole, where the compositor draws them unbent. Cheap enough for drawing."""

import bpy
import numpy as np

from ...scene import cameras, frame_setup
from ...scene.rotations import Matrix

# Types that a camera sees.
VISIBLE_TYPES = {"MESH", "CURVE", "CURVES", "SURFACE", "META", "FONT", "VOLUME", "POINTCLOUD", "GREASEPENCIL"}
# Names that the panel lists before it counts the rest.
MOST_NAMES = 3


def find(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[str]:
    """Return the names of objects whose bounding boxes reach deeper than the hole and into the frame, in order.

    Instances do not count: a scene may have millions.
    """
    camera = cameras.active_camera(scene).evaluated_get(depsgraph)
    hole = frame_setup.active_hole(scene).evaluated_get(depsgraph)
    to_camera = np.array(camera.matrix_world.normalized().inverted())
    place = (to_camera @ np.array([*hole.matrix_world.translation, 1.0]))[:3]
    sides = None if camera.data.type == "PANO" else _sides(camera.data, scene)
    found = []
    for each in depsgraph.objects:
        if each.type not in VISIBLE_TYPES or each.hide_render or not each.visible_camera:
            continue
        corners = np.column_stack([np.array(each.bound_box), np.ones(8)])
        corners = (to_camera @ np.array(each.matrix_world) @ corners.T)[:3].T
        if sides is None:
            is_behind = bool(np.linalg.norm(corners, axis=1).max() > np.linalg.norm(place))
        else:
            is_behind = bool((-corners[:, 2]).max() > max(-place[2], 0.0)) and not _is_outside(corners, sides)
        if is_behind:
            found.append(each.original.name)
    return sorted(found)


def sentence(names: list[str]) -> str:
    """Return what the panel says about them."""
    shown = ", ".join(f'"{name}"' for name in names[:MOST_NAMES])
    rest = len(names) - MOST_NAMES
    verb = "reaches" if len(names) == 1 else "reach"
    return (
        f"{shown}{f' and {rest} more' if rest > 0 else ''} {verb} behind the hole: drawn unbent there; Output: Cycles "
        "Lens bends objects."
    )


def _sides(camera: bpy.types.Camera, scene: bpy.types.Scene) -> Matrix:
    """Normals of the planes through the camera and the frame's sides, pointing inward, in the camera's axes."""
    corners = np.array(camera.view_frame(scene=scene))
    normals = np.cross(corners, np.roll(corners, -1, axis=0))
    inward: Matrix = normals * np.sign(normals @ corners.mean(axis=0))[:, None]
    return inward


def _is_outside(corners: Matrix, sides: Matrix) -> bool:
    """Whether a box lies wholly beyond one side of the frame."""
    return bool(np.any(np.all(corners @ sides.T < 0.0, axis=0)))
