# SPDX-License-Identifier: GPL-3.0-or-later
"""The filtered sky in a scene's compositor: the nodes that read what the group filters by, and their files."""

import bpy

from ...bake import sky_levels
from ...core.errors import SceneError
from ...core.physics_api import physics
from ...nodes import black_hole_group
from ...scene.sky import environment, sky_frames
from ...settings.scene_properties import looks_of
from ..shared.compositor_tree import FOOTPRINT, LEVELS, ROLE, Setup, find_node, find_nodes, takes_sky_from_settings
from ..shared.map_images import read_sequence

FOOTPRINT_IMAGE_NAME, LEVELS_IMAGE_NAME = "Umbra Footprint", "Umbra Sky Levels"

_SOCKETS = {FOOTPRINT: black_hole_group.FOOTPRINT.name, LEVELS: black_hole_group.LEVELS.name}


def refresh_nodes(scene: bpy.types.Scene, setup: Setup) -> None:
    """Give the group the nodes that it filters by, or take them out where it does not."""
    if looks_of(scene.umbra) == 0:
        remove(setup.tree)
        return
    for index, (role, name) in enumerate(_SOCKETS.items()):
        node = find_node(setup.tree, role)
        if node is None:
            node = setup.tree.nodes.new("CompositorNodeImage")
            node[ROLE] = role
            node.name, node.label = f"Umbra {name}", name
            node.location = (setup.group.location.x - 600, setup.group.location.y - 420 - 340 * index)
        socket = setup.group.inputs[name]
        if not any(link.from_node == node for link in socket.links):
            setup.tree.links.new(node.outputs["Image"], socket)


def point_at_footprints(tree: bpy.types.NodeTree, map_path: str) -> None:
    """Let the group read the footprints beside a map."""
    node = find_node(tree, FOOTPRINT)
    if node is not None:
        read_sequence(node, FOOTPRINT_IMAGE_NAME, physics.footprint_path(map_path))


def sync(scene: bpy.types.Scene, setup: Setup, sky: bpy.types.Image) -> None:
    """Let the group read the levels of a sky, none if it is not filtered."""
    node = find_node(setup.tree, LEVELS)
    if node is None:
        return
    if looks_of(scene.umbra) == 0 or sky_levels.problem(sky) is not None:
        _forget(node)
        return
    path = sky_levels.path_of(scene, sky)
    if node.image is None:
        node.image = bpy.data.images.new(LEVELS_IMAGE_NAME, 1, 1, float_buffer=True)
        node.image.filepath = path
    moves = sky_frames.moves(sky)
    if node.image.source != ("SEQUENCE" if moves else "FILE"):
        node.image.source = "SEQUENCE" if moves else "FILE"
    if node.image.filepath != path:
        node.image.filepath = path
    sky_levels.mark(node.image, sky)
    if moves:
        sky_frames.copy_settings(setup.sky, node)


def ensure_files(scene: bpy.types.Scene, setup: Setup, *, may_bake: bool) -> None:
    """Make the levels that the scene's sky needs at its frame.

    Raises
    ------
    physics.BlackHoleError
        They are not there and cannot be made.
    """
    node = find_node(setup.tree, LEVELS)
    if node is None or node.image is None or setup.sky is None or setup.sky.image is None:
        return
    if not takes_sky_from_settings(setup):
        return
    before = min(node.image.size)
    sky_levels.ensure(scene, setup.sky.image, may_bake=may_bake, settings=setup.sky)
    if before == 0 or node.image.source == "SEQUENCE":
        node.image.reload()


def notice(scene: bpy.types.Scene, setup: Setup) -> str | None:
    """Return why the sky is not filtered, where the artist wants it to be."""
    if looks_of(scene.umbra) == 0:
        return None
    if not takes_sky_from_settings(setup):
        return "The sky is not filtered, because it comes from other nodes: choose more Samples if it flickers."
    try:
        return sky_levels.problem(environment.read(scene).image)
    except SceneError:
        return None  # which the panel says elsewhere


def remove(tree: bpy.types.NodeTree) -> None:
    """Take the nodes and their images out of a compositor."""
    for role in _SOCKETS:
        for node in find_nodes(tree, role):
            _forget(node)
            tree.nodes.remove(node)


def _forget(node: bpy.types.Node) -> None:
    image, node.image = node.image, None
    if image is not None and image.users == 0:
        bpy.data.images.remove(image)
