# SPDX-License-Identifier: GPL-3.0-or-later
"""The velocity of an animated camera: in the scene, and as it is measured at its place beside the hole.

Steps the scene to neighboring frames and back.
"""

import bpy
import numpy as np

from ..core.errors import SceneError
from ..core.physics_api import physics
from .rotations import Vector
from .stepping import frame_kept

# Share by which velocities over one frame and over two can differ on a smooth way; on a circle of 4 frames it is 0.3.
LEAP = 0.5

Row = tuple[float, float, float]


def camera_velocity(
    scene: bpy.types.Scene, hole: bpy.types.Object, camera: bpy.types.Object, view_layer: bpy.types.ViewLayer
) -> Vector:
    """Velocity of the camera relative to the hole's center at the current frame, scene units a second.

    Along the scene's world axes, which are those of the stars: a hole that turns does not move the camera.

    Central differences over one frame and over two, extrapolated to none (Richardson). On a circle that takes n frames
    the error is (2 pi / n)^4 / 480 of the speed, 1e-5 for n = 24; over one frame alone it would be 0.3 %. Steps shorter
    than a frame would take a motion in steps of whole frames for a leap. Where a leap lies within the two frames, the
    one frame counts alone.
    """
    frame = scene.frame_current
    rate = scene.render.fps / scene.render.fps_base

    def separation(whole: int, part: float) -> Vector:
        scene.frame_set(whole, subframe=part)
        depsgraph = view_layer.depsgraph
        places = [np.array(each.evaluated_get(depsgraph).matrix_world.translation) for each in (camera, hole)]
        difference: Vector = np.subtract(places[0], places[1], dtype=np.float64)
        return difference

    with frame_kept(scene):
        earlier, early = separation(frame - 1, 0.0), separation(frame - 1, 0.5)
        late, later = separation(frame, 0.5), separation(frame + 1, 0.0)
    over_one, over_two = late - early, 0.5 * (later - earlier)
    change = over_one - over_two
    largest = max(np.linalg.norm(over_one), np.linalg.norm(over_two))
    is_smooth = np.linalg.norm(change) < LEAP * largest
    velocity: Vector = (over_one + change / 3.0 if is_smooth else over_one) * rate
    return velocity


def local_velocity(
    spin: float, position: Row, velocity: Row, frame: int, camera: bpy.types.Object
) -> tuple[float, float, float]:
    """Return the camera's velocity as the local FIDO measures it, or refuse one that is impossible.

    Parameters
    ----------
    spin : float
        The hole's.
    position, velocity : tuple of float, shape (3,)
        In the hole's frame, units of M and of c.
    frame : int
        For the message.
    camera : Object
        For the message.

    Raises
    ------
    SceneError
        If it is not slower than light.
    """
    local = physics.local_velocity(spin, position, velocity)
    speed = float(np.linalg.norm(local))
    if speed < 1.0:
        return local
    r = float(np.linalg.norm(position))
    limit = physics.ergosphere_radius(spin, float(np.arctan2(np.hypot(*position[:2]), position[2])))
    if r <= limit:
        raise SceneError(
            f'Frame {frame}: camera "{camera.name}" is inside the ergosphere (at {r:.4g} M; here it reaches to '
            f"{limit:.4g} M), where everything must turn with the hole, and its animation does not carry it round at a "
            "possible speed; move it out, or choose another Camera Motion.",
            code="camera.ergosphere",
        )
    raise SceneError(
        f'Frame {frame}: camera "{camera.name}" moves at {speed:.3g} times the speed of light, as it is measured at '
        "its place beside the hole; slow its animation down, or raise the black hole's Speed of Light.",
        code="camera.too-fast",
    )
