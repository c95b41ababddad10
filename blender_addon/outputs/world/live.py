# SPDX-License-Identifier: GPL-3.0-or-later
"""The world map that the live preview shows."""

from collections.abc import Generator

import bpy

from ...core.physics_api import physics
from . import lensed_world, world_disk_sync, world_sync


class WorldLiveMap:
    """A small world map in memory, read by the lensed World in place of its files."""

    def parameters(self, draft: "physics.WarpMapParameters") -> "physics.WarpMapParameters":
        """Return what the map is made from."""
        return physics.world_map_parameters(draft, physics.WORLD_MAP_PREVIEW_GRID)

    def steps(self, parameters: "physics.WarpMapParameters") -> "Generator[float, None, physics.WorldMap]":
        """Make the map step by step."""
        return physics.bake_world_map_steps(parameters)

    def light_parameters(self, light: "physics.LightParameters") -> "physics.LightParameters":
        """Return what the layer of light is made from."""
        return physics.world_light_parameters(light, physics.WORLD_LIGHT_PREVIEW_GRID)

    def show_light(self, scene: bpy.types.Scene, layer: "physics.LightLayer") -> bool:
        """Let the World read a layer of light; Cycles must be made to look once more."""
        world_disk_sync.show_live(scene, layer, world_sync.needs_turns(scene))
        return world_sync.needs_turns(scene)

    def can_show(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene's World is the lensed one."""
        return lensed_world.lensed_world(scene) is not None

    def is_shown(self, scene: bpy.types.Scene) -> bool:
        """Return whether the World reads a map in memory."""
        return world_sync.shows_live(scene)

    def show(self, scene: bpy.types.Scene, made: "physics.WorldMap") -> bool:
        """Let the World read a map; Cycles must be made to look once more."""
        world_sync.show_live(scene, made)
        return world_sync.needs_turns(scene)

    def show_again(self, scene: bpy.types.Scene) -> None:
        """Let Cycles look once more."""
        world_sync.show_again(scene)

    def drop(self, scene: bpy.types.Scene) -> None:
        """Let the World read its files again."""
        world_sync.drop_live(scene)
        world_disk_sync.drop_live(scene)
