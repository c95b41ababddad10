# SPDX-License-Identifier: GPL-3.0-or-later
"""Stars as points in a scene's compositor: whether there are any, what their layer is made from, and its node."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...bake import star_sky
from ...bake.kinds import STAR_LAYER
from ...bake.request import MapRequest, request
from ...core.physics_api import physics
from ...core.session import SESSION, Life
from ...nodes import black_hole_group
from ...scene.frame_setup import FrameSetup
from ...scene.sky import environment
from ...settings.scene_properties import ALWAYS, NEVER, NO_LIMIT
from ..shared.compositor_tree import ROLE, STARS, Setup, find_node, find_nodes, find_setup, takes_sky_from_settings
from ..shared.map_images import drop_live, read_sequence

STARS_IMAGE_NAME = "Umbra Stars"

SOCKET = black_hole_group.STARS.name
_ROTATION = black_hole_group.ROTATION.name
_COLOR, _BRIGHTNESS = black_hole_group.REDSHIFT_COLOR.name, black_hole_group.REDSHIFT_BRIGHTNESS.name
_READ = (_ROTATION, _COLOR, _BRIGHTNESS)

# Path, size and time of catalogs -> digests of their content.
_digests = SESSION.value(dict[tuple[object, ...], str], Life.FILE)


def are_on(scene: bpy.types.Scene, setup: Setup | None) -> bool:
    """Return whether stars are drawn as points: where the artist wants them, by default with the built-in sky."""
    if setup is None or SOCKET not in setup.group.inputs or scene.umbra.stars == NEVER:
        return False  # a group of before that was linked cannot show them
    return scene.umbra.stars == ALWAYS or _has_built_in_sky(scene, setup)


def _has_built_in_sky(scene: bpy.types.Scene, setup: Setup) -> bool:
    if not takes_sky_from_settings(setup):
        return False
    if scene.umbra.environment_source == "IMAGE":
        return environment.is_star_sky(scene.umbra.environment_image)
    try:
        return environment.is_star_sky(environment.read_world(scene).image)
    except physics.BlackHoleError:
        return False


def texture(scene: bpy.types.Scene, setup: Setup, image: bpy.types.Image) -> bpy.types.Image:
    """Return what the group shows as the sky: of the built-in one, without the stars that are drawn as points.

    Raises
    ------
    physics.BlackHoleError
        If that is not there and cannot be written.
    """
    if environment.is_star_sky(image) and are_on(scene, setup):
        return star_sky.load_milky_way(scene)
    return image


# --- what a layer is made from --------------------------------------------------------------------


def settings_at(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> physics.StarSettings | None:
    """Return how stars are drawn at the frame at which the dependency graph stands; None where they are not points.

    The sky's rotation and the amounts of redshift are inputs of the group, which may be animated, or follow the World.
    """
    setup = find_setup(scene)
    if setup is None or not are_on(scene, setup):
        return None
    inputs: Any = setup.tree.evaluated_get(depsgraph).nodes[setup.group.name].inputs
    if any(name not in inputs for name in _READ):
        return None
    limit = scene.umbra.star_limit
    return physics.StarSettings(
        rotation=tuple(inputs[_ROTATION].default_value),
        magnitude_limit=math.inf if limit >= NO_LIMIT else round(limit, 4),
        color_amount=inputs[_COLOR].default_value,
        brightness_amount=inputs[_BRIGHTNESS].default_value,
    )


def request_of(scene: bpy.types.Scene, frame: FrameSetup) -> MapRequest | None:
    """Return the request for the layer of a frame; None where stars are not points.

    Raises
    ------
    physics.BlackHoleError
        If the catalog cannot be read.
    """
    if frame.star_settings is None:
        return None
    table = catalog(scene)
    settings = frame.star_settings
    if table is not None:
        settings = settings.with_catalog(table.name, _digest(table))
    view = physics.star_view(frame.parameters)
    return request(scene, frame, STAR_LAYER, physics.StarParameters(view, settings, table))


def catalog(scene: bpy.types.Scene) -> Path | None:
    """Return the table of stars that the artist has chosen; None for the built-in catalog."""
    path = scene.umbra.star_catalog
    return Path(bpy.path.abspath(path, library=scene.library)) if path else None


def _digest(table: Path) -> str:
    try:
        stat = table.stat()
    except OSError:
        return physics.catalog_digest(table)  # which says why
    key = (str(table), stat.st_size, stat.st_mtime_ns)
    if key not in _digests.now:
        _digests.now[key] = physics.catalog_digest(table)
    return _digests.now[key]


# --- the node -------------------------------------------------------------------------------------


def refresh_node(scene: bpy.types.Scene, setup: Setup) -> None:
    """Give the group the node that reads the layers, or take it out where stars are not points."""
    if not are_on(scene, setup):
        remove(setup.tree)
        return
    node = find_node(setup.tree, STARS)
    if node is None:
        node = setup.tree.nodes.new("CompositorNodeImage")
        node[ROLE] = STARS
        node.name, node.label = "Umbra Stars", "Stars"
        node.location = (setup.group.location.x - 600, setup.group.location.y - 1100)
    if not any(link.from_node == node for link in setup.group.inputs[SOCKET].links):
        setup.tree.links.new(node.outputs["Image"], setup.group.inputs[SOCKET])


def point_at(tree: bpy.types.NodeTree, path: str) -> None:
    """Let the node read the layers of a path."""
    node = find_node(tree, STARS)
    if node is not None:
        read_sequence(node, STARS_IMAGE_NAME, path)


def none_at_all() -> np.ndarray[Any, np.dtype[np.float32]]:
    """Return the pixels of a layer without stars, for an image in memory."""
    return np.array([[[0.0, 0.0, 0.0, 1.0]]], np.float32)


def remove(tree: bpy.types.NodeTree) -> None:
    """Take the node and its image out of a compositor."""
    for node in find_nodes(tree, STARS):
        drop_live(node)
        image = node.image
        tree.nodes.remove(node)
        if image is not None and image.users == 0:
            bpy.data.images.remove(image)


def unresolved(wanted: MapRequest) -> list[str]:
    """Return a warning where images of stars are missing in a layer that is baked."""
    count = wanted.kind.format.read_metadata(wanted.path)["counts"]["unresolved"]
    text = (
        f"Frame {wanted.frame}: images of stars are missing in {count} cells of the search beside the shadow, which "
        "are too coarse for so fast a hole."
    )
    return [text] if count else []


def notice(scene: bpy.types.Scene, setup: Setup) -> str | None:
    """Return what in the compositor the stars cannot follow, if anything."""
    if not are_on(scene, setup):
        return None
    linked = [name for name in _READ if name in setup.group.inputs and setup.group.inputs[name].is_linked]
    if not linked:
        return None
    return f'The stars do not follow "{linked[0]}", which comes from other nodes: give it a value or keyframes.'
