# SPDX-License-Identifier: GPL-3.0-or-later
"""The shadow and the disk's edges as lines in the scene: what the viewport draws beside the horizon."""

from __future__ import annotations

import functools

import bpy
import numpy as np

from ..core.physics_api import physics
from ..settings.disk_properties import disk_of
from ..settings.hole_properties import MOTIONS
from . import frame_setup, rotations
from .rotations import Vector

# Points of each line.
POINTS = 128
# From so far away, units of M, rays are as good as parallel: where a view without perspective is drawn from. Farther
# eyes are taken to be there, along the same line.
FARTHEST = 1e5
# Places of the eye, units of M, are rounded to so many digits, so that an outline is worked out once for each.
DIGITS = 6

# The hole's frame, of which only the place of the eye matters.
_ANY_CAMERA = physics.PanoramaCamera(2, 1)


def lines(hole: bpy.types.Object, eye: Vector, *, is_far: bool = False) -> list[Vector]:
    """Return closed lines in the scene's coordinates: the shadow as it is seen from a place, and the disk's edges.

    Parameters
    ----------
    hole : Object
        The black hole, evaluated.
    eye : ndarray, shape (3,)
        A place in the scene.
    is_far : bool
        Whether the eye only says from which side the hole is seen, as in views without perspective.

    Returns
    -------
    list of ndarray, shape (n, 3)
        The shadow's outline is as far from the eye as the hole is. It lacks where the eye is inside the horizon.

    Raises
    ------
    physics.BlackHoleError
        The hole's scale, spin or disk are impossible.
    """
    settings = hole.umbra
    pose = frame_setup.pose(hole, "The black hole", keep_scale=True)
    length = settings.mass_scale * pose.scale
    spin = float(settings.spin)
    found = []
    place = rotations.times(pose.rotation.T, eye - pose.position) / length
    distance = float(np.linalg.norm(place))
    if distance > 0.0 and (is_far or distance > FARTHEST):
        place, distance = place * (FARTHEST / distance), FARTHEST
    if distance > physics.horizon_radius(spin):
        x, y, z = (float(f"{value:.{DIGITS}g}") for value in place)
        found.append(place + distance * _outline(spin, (x, y, z), MOTIONS[settings.motion]))
    disk = disk_of(settings.disk)
    if disk is not None:
        angles = np.linspace(0.0, 2.0 * np.pi, POINTS, endpoint=False)
        around = np.stack([np.cos(angles), np.sin(angles), np.zeros(POINTS)], axis=-1)
        found += [radius * around for radius in disk.radii(spin)]
    return [pose.position + length * rotations.times(pose.rotation, each.T).T for each in found]


@functools.lru_cache(maxsize=64)
def _outline(spin: float, place: frame_setup.Row, motion: str) -> Vector:
    """Directions along the shadow's edge in the hole's frame; for one carried by space where the motion is impossible.

    The camera's own animation has no speed here.
    """
    shot = physics.WarpMapParameters(
        spin=spin, camera=_ANY_CAMERA, camera_position=place, camera_to_hole=physics.IDENTITY, motion=motion
    )
    try:
        observer = shot.observer()
    except physics.BlackHoleError:
        r, theta, phi = np.linalg.norm(place), np.arctan2(np.hypot(place[0], place[1]), place[2]), 0.0
        phi = float(np.arctan2(place[1], place[0]))
        observer = physics.Observer.fido(float(r), float(theta), phi)
    outline: Vector = physics.shadow_outline(spin, observer, POINTS)
    return outline
