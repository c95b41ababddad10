# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of map files: what each is read as, and how it is made."""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.physics_api import physics
from ..core.session import SESSION, Life

# What the maps of one bake or render have in common is kept here.
_baker = SESSION.value(physics.MapBaker, Life.RENDER)
_light_baker = SESSION.value(physics.LightBaker, Life.RENDER)
_star_baker = SESSION.value(physics.StarBaker, Life.RENDER)


def forget_shared_rays() -> None:
    """Free the memory of what maps have in common, when a bake or a render is over."""
    _baker.clear()
    _light_baker.clear()
    _star_baker.clear()


def _warp_map_steps(parameters: "physics.WarpMapParameters") -> "Generator[float, None, physics.WarpMap]":
    return (yield from _baker.now.steps(parameters))


def _star_layer_steps(parameters: "physics.StarParameters") -> "Generator[float, None, physics.StarLayer]":
    return (yield from _star_baker.now.steps(parameters))


@dataclass(frozen=True)
class MapKind:
    """What a file is read as, and how it is made."""

    noun: str
    format: "physics.MapFormat"
    steps: Callable[..., Generator[float, None, Any]]
    """Bakes a map: yields the fraction done, returns the map."""
    write: Callable[[Path, Any], None]
    mark: str = ""
    """Stands before the frame's number in a file's name."""
    is_hashed: bool = False
    """Whether the name ends in the hash of what the map is made from.

    Cycles keeps textures by their names, and a map that is baked again must not be taken for the one before.
    """
    has_companions: bool = False
    """Whether other files lie beside the map and are one with it, such as a disk's passes."""

    is_layer: bool = False
    """Whether it is laid over the picture of another map: without a request for it, it is not needed any more."""

    @property
    def hash_mark(self) -> str:
        """What stands before the hash in a file's name."""
        return f"_{self.noun.partition(' ')[0]}_"


def _light_steps(parameters: "physics.LightParameters") -> "Generator[float, None, physics.LightLayer]":
    return (yield from _light_baker.now.steps(parameters))


WARP_MAP = MapKind("warp map", physics.WARP_MAP_FORMAT, _warp_map_steps, physics.write_map_files, has_companions=True)
EXIT_MAP = MapKind(
    "exit map", physics.EXIT_MAP_FORMAT, physics.bake_exit_map_steps, physics.write_exit_map, is_hashed=True
)
WORLD_MAP = MapKind(
    "world map", physics.WORLD_MAP_FORMAT, physics.bake_world_map_steps, physics.write_world_map, mark="world_"
)
LIGHT_LAYER = MapKind(
    "layer of light", physics.LIGHT_LAYER_FORMAT, _light_steps, physics.write_light_layer, mark="light_", is_layer=True
)
WORLD_LIGHT = MapKind(
    "world light",
    physics.LIGHT_LAYER_FORMAT,
    _light_steps,
    physics.write_light_layer,
    mark="world_light_",
    is_layer=True,
)
STAR_LAYER = MapKind("layer of stars", physics.STARS_FORMAT, _star_layer_steps, physics.write_stars, mark="stars_")
KINDS = [WARP_MAP, EXIT_MAP, WORLD_MAP, LIGHT_LAYER, WORLD_LIGHT, STAR_LAYER]
