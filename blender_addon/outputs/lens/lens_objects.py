# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of a scene's objects stand where the bent rays do not show them: inside the sphere, or nearer than the hole."""

from dataclasses import dataclass

import bpy
import numpy as np

from ...scene import cameras, frame_setup
from ...scene.rotations import Matrix, Vector
from . import lens_disk

# Types that a camera sees.
VISIBLE_TYPES = {"MESH", "CURVE", "CURVES", "SURFACE", "META", "FONT", "VOLUME", "POINTCLOUD", "GREASEPENCIL"}
# Names that a message lists before it counts the rest.
MOST_NAMES = 5


@dataclass(frozen=True)
class Placement:
    """Names of objects by where they stand, each in order."""

    inside: tuple[str, ...]
    """Those that reach into the sphere where bent rays begin."""
    nearer: tuple[str, ...]
    """Those that reach nearer to the camera than the hole, and not into the sphere."""
    amid: tuple[str, ...]
    """Those beside or behind the hole that are nearer to it than the disk's outer edge."""


def place(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: frame_setup.FrameSetup) -> Placement:
    """Sort the objects that are rendered by their bounding boxes; instances count for the objects that make them.

    A bent ray begins where it passes the hole. Of a straight ray from the camera that is where it enters the half of
    space behind the hole, seen along itself: on the ball that has the line from camera to hole as a diameter. What
    reaches into this ball is nearer than the hole.
    """
    inside: set[str] = set()
    nearer: set[str] = set()
    amid: set[str] = set()
    hole = frame_setup.pose(frame_setup.active_hole(scene).evaluated_get(depsgraph), "The black hole", keep_scale=True)
    middle = np.array(cameras.active_camera(scene).evaluated_get(depsgraph).matrix_world.translation)
    middle = 0.5 * (middle + hole.position)
    half = float(np.linalg.norm(middle - hole.position))
    sphere = scene.umbra.sphere_radius * frame.length_of_m
    disk = frame.parameters.disk
    reach = 0.0 if disk is None else disk.outer_radius * frame.length_of_m
    for instance in depsgraph.object_instances:
        source = instance.object
        if source.type not in VISIBLE_TYPES or not source.visible_camera or source.hide_render:
            continue
        owner = instance.parent if instance.is_instance and instance.parent is not None else source
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        corners = np.array([tuple(corner) for corner in source.bound_box])
        low, high = corners.min(axis=0), corners.max(axis=0)
        distance = _distance(matrix, low, high, hole.position)
        if distance < sphere:
            inside.add(owner.original.name)
        elif _distance(matrix, low, high, middle) < half:
            nearer.add(owner.original.name)
        elif distance < reach:
            amid.add(owner.original.name)
    return Placement(*(tuple(sorted(each)) for each in (inside, nearer - inside, amid - nearer - inside)))


def _distance(matrix: Matrix, low: Vector, high: Vector, point: Vector) -> float:
    """Distance of a point from a transformed box, or a little less where the transformation is not a rotation."""
    axes, origin = matrix[:3, :3], matrix[:3, 3]
    lengths = np.maximum(np.linalg.norm(axes, axis=0), 1e-12)
    local = (axes / lengths).T @ (point - origin)
    return float(np.linalg.norm(local - np.clip(local, low * lengths, high * lengths)))


def warnings(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: frame_setup.FrameSetup) -> list[str]:
    """Sentences about what the picture lacks."""
    found = place(scene, depsgraph, frame)
    sentences = []
    if frame.parameters.disk is not None and not lens_disk.is_in_use(scene):
        sentences.append(
            f'The disk of "{frame.hole_name}" is not drawn: switch Compositing on in Output Properties, and connect '
            "the Image of the node Umbra Disk Light in the Compositor."
        )
    if found.inside:
        radius = scene.umbra.sphere_radius
        sentences.append(
            f"{listed(found.inside)} reach{'es' if len(found.inside) == 1 else ''} into the lens sphere ({radius:g} M "
            "around the hole), inside of which the camera sees nothing: move away from the hole, or make Lens Sphere "
            "smaller."
        )
    if found.amid:
        sentences.append(
            f"{listed(found.amid)} stand{'s' if len(found.amid) == 1 else ''} beyond the lens sphere and within the "
            "disk's outer edge: the disk is drawn in front everywhere. Make the disk smaller, or move away from it."
        )
    missing = tuple(name for name in found.nearer if not in_foreground(scene, name))
    if missing:
        sentences.append(
            f"{listed(missing)} reach{'es' if len(missing) == 1 else ''} nearer than the hole, where the bent rays "
            "do not show anything: press Unlensed Foreground to have such objects in front."
        )
    return sentences


def in_foreground(scene: bpy.types.Scene, name: str) -> bool:
    """Whether an object is shown by the scene's unlensed foreground."""
    collection = scene.umbra.foreground
    return collection is not None and name in collection.all_objects


def listed(names: tuple[str, ...]) -> str:
    """Names for a sentence."""
    shown = ", ".join(f'"{name}"' for name in names[:MOST_NAMES])
    rest = len(names) - MOST_NAMES
    return f"{shown} and {rest} more" if rest > 0 else shown
