# SPDX-License-Identifier: GPL-3.0-or-later
"""Which map a lensed World reads: the files of the frames, none at all, or the one that the preview keeps."""

import bpy
import numpy as np

from ...bake.folder import folder
from ...bake.kinds import WORLD_MAP
from ...bake.names import sequence_path
from ...core import messages
from ...core.errors import SceneError
from ...core.physics_api import physics
from ...nodes.world_nodes import map_nodes
from ...scene import frame_setup
from ..shared.look import look_of_group, write_to_group
from ..shared.map_images import NO_MAP
from . import lensed_world, world_images
from .world_images import MAPS


def refresh(scene: bpy.types.Scene) -> None:
    """Carry the scene's settings into its lensed World: another sky, another folder of maps."""
    world = lensed_world.lensed_world(scene)
    shows_image = scene.umbra.environment_source == "IMAGE"
    if world is not None and scene.get(lensed_world.IS_BENT) and _is_stale(scene, world, shows_image=shows_image):
        node = lensed_world.group_node(world)
        values = {} if node is None else look_of_group(node)
        before = scene.get(lensed_world.BEFORE)
        try:
            lensed_world.remove(scene)
            write_to_group(lensed_world.install(scene), values)
        except SceneError as error:
            messages.warn(error.for_user())
            scene.world = before
            return
    if not shows_live(scene):
        point_at_files(scene)


def _is_stale(scene: bpy.types.Scene, world: bpy.types.World, *, shows_image: bool) -> bool:
    """Whether the World was made for another sky than the one that is chosen."""
    made_of_image = world.get(lensed_world.LENSED) == lensed_world.OF_IMAGE
    if made_of_image != shows_image:
        return True
    if not shows_image:
        return False
    texture = next((node for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT"), None)
    return texture is not None and texture.image != scene.umbra.environment_image


# --- which map is read ----------------------------------------------------------------------------


def _group(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """The group in the scene's lensed World, whole, and its own: a copy of the World shares it at first."""
    world = lensed_world.lensed_world(scene)
    node = lensed_world.group_node(world)
    if world is None or node is None or node.node_tree is None:
        return None
    if node.node_tree.library is None:
        if node.node_tree.users > 1:
            node.node_tree = node.node_tree.copy()
        lensed_world.renew(world)
    return node.node_tree


def _point(scene: bpy.types.Scene, image: bpy.types.Image) -> None:
    group = _group(scene)
    if group is not None:
        world_images.read(map_nodes(group), image)


def _file_image(scene: bpy.types.Scene) -> bpy.types.Image | None:
    """The image that reads the scene's maps: the one in use, or another; None without a lensed World."""
    world = lensed_world.lensed_world(scene)
    return None if world is None else MAPS.file_image(world)


def _point_at_path(scene: bpy.types.Scene, path: str) -> None:
    world = lensed_world.lensed_world(scene)
    if world is not None:
        _point(scene, MAPS.at_path(world, path))


def point_at_files(scene: bpy.types.Scene) -> None:
    """Let the World read the map of each frame from its file; no map where there is no hole."""
    hole = frame_setup.find_active_hole(scene)
    if hole is None:
        point_at_nothing(scene)
        return
    columns, rows = physics.WORLD_MAP_GRID
    _point_at_path(scene, sequence_path(scene, hole.name, (columns, rows + 1), WORLD_MAP))


def point_at_nothing(scene: bpy.types.Scene) -> None:
    """Let the World read no map: it is magenta."""
    _point_at_path(scene, folder(scene).blender_path + NO_MAP)


def forget_loaded_map(scene: bpy.types.Scene) -> None:
    """Let Blender read the maps anew from their files."""
    image = _file_image(scene)
    if image is not None:
        image.reload()


# --- the preview's map ----------------------------------------------------------------------------


def shows_live(scene: bpy.types.Scene) -> bool:
    """Whether the World reads the preview's map."""
    return _shown_live(scene) is not None


def _shown_live(scene: bpy.types.Scene) -> bpy.types.Image | None:
    """The image of the preview's map that the World reads now."""
    world = lensed_world.lensed_world(scene)
    group = lensed_world.group_of(world)
    return None if world is None or group is None else MAPS.shown_live(world, map_nodes(group))


def show_live(scene: bpy.types.Scene, made: "physics.WorldMap") -> None:
    """Let the World read a map that is in memory; always through the same image, or through two in turn."""
    world = lensed_world.lensed_world(scene)
    tree = lensed_world.group_of(world)
    if world is None or tree is None:
        return
    shown = _shown_live(scene)
    image = MAPS.write_live(world, shown, made.texture, in_turns=needs_turns(scene))
    if shown is None or tree.users > 1:
        _point(scene, image)
    elif shown != image:  # looking after the group, too, would take longer than the map
        for node in map_nodes(tree):
            node.image = image


def needs_turns(scene: bpy.types.Scene) -> bool:
    """Whether a map that has changed must come as another image to be seen."""
    return scene.render.engine == "CYCLES"


def show_again(scene: bpy.types.Scene) -> None:
    """Let Cycles see the map once more: of two changes between two of its looks it has seen neither."""
    shown = _shown_live(scene)
    if shown is None:
        return
    rows, columns = shown.size[1], shown.size[0]
    texture = np.empty(rows * columns * 4, np.float32)
    shown.pixels.foreach_get(texture)
    show_live(scene, physics.WorldMap(texture.reshape(rows, columns, 4), {}))


def drop_live(scene: bpy.types.Scene) -> None:
    """Let the World read its files again, and free the preview's map."""
    world = lensed_world.lensed_world(scene)
    if world is None:
        return
    point_at_files(scene)
    MAPS.drop_live(world)
