# SPDX-License-Identifier: GPL-3.0-or-later
"""The maps in memory that the compositor reads while the 3D viewport shows its picture."""

import bpy
import numpy as np

from ...core.errors import SceneError
from ...core.physics_api import physics
from ..shared import disk_sync
from ..shared.compositor_tree import FOOTPRINT, STARS, Setup, find_node, find_setup, has_scene_tree
from ..shared.map_images import drop_live, give_back, is_live, pixels_of, show_live, show_live_again
from . import compositor_sync, stars


class CompositorViewportMaps:
    """The warp map, and the layer of light of the disk, each in an image of its own in place of the files."""

    def can_show(self, scene: bpy.types.Scene) -> bool:
        """Return whether the group is in the scene's compositor, switched on, and can be changed."""
        return _setup(scene) is not None

    def is_shown(self, scene: bpy.types.Scene) -> bool:
        """Return whether the group reads a map in memory."""
        setup = _setup(scene)
        return setup is not None and setup.map is not None and is_live(setup.map)

    def show(self, scene: bpy.types.Scene, made: "physics.WarpMap") -> None:
        """Let the group read a map."""
        setup = _setup(scene)
        if setup is None or setup.map is None:
            return
        show_live(setup.map, pixels_of(made.theta, made.phi, made.one_plus_z, made.visibility))
        footprint = find_node(setup.tree, FOOTPRINT)
        if footprint is not None:
            show_live(footprint, pixels_of(*np.moveaxis(physics.footprint(made).astype(np.float32), -1, 0)))
        layer = find_node(setup.tree, STARS)
        if layer is not None:  # those of the files are of another view
            show_live(layer, stars.none_at_all())

    def show_light(self, scene: bpy.types.Scene, layer: "physics.LightLayer") -> None:
        """Let the group read a layer of light."""
        node = _layer_node(scene)
        if node is not None:
            show_live(node, pixels_of(*disk_sync.planes_of(layer)))

    def has_light(self, scene: bpy.types.Scene) -> bool:
        """Return whether a layer of light that the group reads is in memory."""
        node = _layer_node(scene)
        return node is None or is_live(node)

    def show_again(self, scene: bpy.types.Scene) -> bool:
        """Let the nodes read the maps in memory that they had; return whether the group has one."""
        for node in compositor_sync.map_nodes(scene):
            show_live_again(node)
        return self.is_shown(scene)

    def show_files(self, scene: bpy.types.Scene) -> None:
        """Let the nodes read the files of the scene's settings."""
        for node in compositor_sync.map_nodes(scene):
            give_back(node)
        try:
            compositor_sync.point_at_maps(scene)
        except SceneError:
            compositor_sync.point_at_nothing(scene)

    def show_nothing(self, scene: bpy.types.Scene) -> None:
        """Let the group read no map: the picture is magenta."""
        compositor_sync.point_at_nothing(scene)

    def drop(self, scene: bpy.types.Scene) -> None:
        """Let the nodes read files, and free the images in memory."""
        for node in compositor_sync.map_nodes(scene):
            drop_live(node)


def _layer_node(scene: bpy.types.Scene) -> bpy.types.Node | None:
    setup = _setup(scene)
    return None if setup is None else find_node(setup.tree, disk_sync.LAYER)


def _setup(scene: bpy.types.Scene) -> Setup | None:
    setup = find_setup(scene)
    if setup is None or setup.map is None or setup.group.mute or setup.tree.library is not None:
        return None
    if has_scene_tree() and not scene.use_nodes:
        return None
    return setup
