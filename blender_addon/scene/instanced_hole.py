# SPDX-License-Identifier: GPL-3.0-or-later
"""Black holes in collection instances: a scene shows them, and they are not among its objects."""

from __future__ import annotations

import bpy

from ..core.errors import SceneError


def find(scene: bpy.types.Scene) -> tuple[bpy.types.Object, bpy.types.Object] | None:
    """Return a collection instance that renders show and a black hole in it; None if there is none."""
    seen: dict[bpy.types.Collection, bpy.types.Object | None] = {}
    for each in scene.objects:
        hole = _hole_of(each, seen)
        if hole is not None:
            return each, hole
    return None


def _hole_of(
    instance: bpy.types.Object, seen: dict[bpy.types.Collection, bpy.types.Object | None]
) -> bpy.types.Object | None:
    """The first black hole that an object instances, directly or by instances in its collection."""
    collection = instance.instance_collection if instance.instance_type == "COLLECTION" else None
    if collection is None or instance.hide_render:
        return None
    if collection not in seen:
        seen[collection] = None  # for the collections in it: Blender allows no circles, but a damaged file may have one
        for each in collection.all_objects:
            hole = each if each.umbra.is_black_hole and not each.hide_render else _hole_of(each, seen)
            if hole is not None:
                seen[collection] = hole
                break
    return seen[collection]


def check(scene: bpy.types.Scene) -> None:
    """Refuse a scene that has a black hole in a collection instance.

    Raises
    ------
    SceneError
        The sentence names the instance.
    """
    found = find(scene)
    if found is None:
        return
    instance, hole = found
    collection = instance.instance_collection
    raise SceneError(
        f'The black hole "{hole.name}" is in the collection instance "{instance.name}", and an instance is not '
        f'rendered as a black hole: select "{instance.name}" and use Object > Apply > Make Instances Real, or link '
        f'the collection "{"" if collection is None else collection.name}" without Instance Collections.',
        code="hole.instanced",
    )
