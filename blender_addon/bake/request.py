# SPDX-License-Identifier: GPL-3.0-or-later
"""Map requests: which file holds which map. This is the one place that names map files.

A name tells scene, hole, size and frame, so that a test at half the resolution loses nothing that was baked. Blender
reads maps as an image sequence. The sequence is cyclic with a length of a million, because one fixed setting then gives
every frame a number of its own, negative frames too (file names have no minus signs): frame f is file f, and frame -5
is file 999995.
"""

import re
from collections.abc import Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..scene.frame_setup import FrameSetup
from .folder import MapFolder, check_path, folder

SEQUENCE_LENGTH = 1_000_000
# Frames that have a file of their own.
FIRST_FRAME, LAST_FRAME = -100_000, SEQUENCE_LENGTH - 100_001

# What stands between an exit map's frame and the beginning of its hash.
_HASH_CHARACTERS = 12

# What the maps of one bake or render have in common is kept here.
_baker = SESSION.value(physics.MapBaker, Life.RENDER)


def forget_shared_rays() -> None:
    """Free the memory of what maps have in common, when a bake or a render is over."""
    _baker.clear()


def _warp_map_steps(parameters: "physics.WarpMapParameters") -> "Generator[float, None, physics.WarpMap]":
    return (yield from _baker.now.steps(parameters))


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
    has_passes: bool = False
    """Whether a disk's passes lie beside the map."""

    @property
    def hash_mark(self) -> str:
        """What stands before the hash in a file's name."""
        return f"_{self.noun.partition(' ')[0]}_"


def _write_warp_map(path: Path, warp_map: "physics.WarpMap") -> None:
    """Write a map and its disk's passes; the map comes last, so that where it is valid they are there."""
    physics.write_disk_passes(path, warp_map.disk_passes)
    physics.write_warp_map(path, warp_map)


WARP_MAP = MapKind("warp map", physics.WARP_MAP_FORMAT, _warp_map_steps, _write_warp_map, has_passes=True)
EXIT_MAP = MapKind(
    "exit map", physics.EXIT_MAP_FORMAT, physics.bake_exit_map_steps, physics.write_exit_map, is_hashed=True
)
WORLD_MAP = MapKind(
    "world map", physics.WORLD_MAP_FORMAT, physics.bake_world_map_steps, physics.write_world_map, mark="world_"
)
KINDS = [WARP_MAP, EXIT_MAP, WORLD_MAP]

PASS_FORMAT = physics.DISK_PASS_FORMAT


@dataclass(frozen=True)
class MapRequest:
    """A map that a frame needs: where it lies, or will lie, and what it is made from."""

    frame: int
    path: Path
    kind: MapKind
    parameters: "physics.WarpMapParameters"
    folder: MapFolder

    @property
    def passes(self) -> tuple[Path, ...]:
        """Where the disk's passes lie; none if the map has no disk."""
        disk = self.parameters.disk if self.kind.has_passes else None
        return tuple(
            Path(physics.pass_path(self.path, number + 1)) for number in range(0 if disk is None else disk.crossings)
        )

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of the request, the map first."""
        return (self.path, *self.passes)

    @property
    def what(self) -> str:
        """The map for a sentence."""
        return f"the {self.kind.noun} of frame {self.frame}"


def request(
    scene: bpy.types.Scene, frame: FrameSetup, kind: MapKind, parameters: "physics.WarpMapParameters"
) -> MapRequest:
    """Return the request for a frame's map of one kind.

    Raises
    ------
    SceneError
        If the frame is beyond the numbers that file names have room for.
    MapFolderError
        If Blender would read another path.
    """
    where = folder(scene)
    name = file_name(scene, frame.hole_name, parameters.map_size, frame.frame, kind, parameters)
    check_path(where.path / name)
    return MapRequest(frame.frame, where.path / name, kind, parameters, where)


def sequence_path(scene: bpy.types.Scene, hole_name: str, size: tuple[int, int], kind: MapKind) -> str:
    """Return the path of an image sequence of maps as Blender's data carry it, relative to a saved .blend file.

    `size` is the map's own, supersampling included.
    """
    return folder(scene).blender_path + file_name(scene, hole_name, size, 1, kind)


def names_of(scene: bpy.types.Scene, hole_name: str) -> str:
    """Return what the names of all maps of a scene's hole begin with."""
    return "_".join(bpy.path.clean_name(name) for name in (scene.name, hole_name))


def file_name(
    scene: bpy.types.Scene,
    hole_name: str,
    size: tuple[int, int],
    frame: int,
    kind: MapKind,
    parameters: "physics.WarpMapParameters | None" = None,
) -> str:
    """Return a map's file name.

    Raises
    ------
    SceneError
        If the frame is beyond the numbers that file names have room for.
    """
    if not FIRST_FRAME <= frame <= LAST_FRAME:
        raise SceneError(
            f"Frame {frame} is outside {FIRST_FRAME} to {LAST_FRAME}, the frames that warp maps can be "
            "numbered by: move the animation.",
            code="map.frame-number",
        )
    end = f"{kind.mark}{frame % SEQUENCE_LENGTH:04d}"
    if kind.is_hashed and parameters is not None:
        end += kind.hash_mark + parameters.hash[:_HASH_CHARACTERS]
    return f"{names_of(scene, hole_name)}_{size[0]}x{size[1]}_{end}.exr"


def older_maps(wanted: MapRequest) -> list[Path]:
    """Return the maps of the same frame, size and kind that were made from other parameters."""
    if not wanted.kind.is_hashed:
        return []
    name, mark = wanted.path.name, wanted.kind.hash_mark
    beginning = name[: name.rindex(mark) + len(mark)]
    parent = wanted.path.parent
    others = parent.iterdir() if parent.is_dir() else ()
    return [
        each for each in others if each.name.startswith(beginning) and each.suffix == ".exr" and each != wanted.path
    ]


def name_pattern(scene: bpy.types.Scene, hole_name: str) -> re.Pattern[str]:
    """Return a pattern for the names of all files of a scene's hole.

    Its groups are `size`, `crossing` (of a pass), `mark`, `number` and `hash`, the last with what stands before it.
    """
    marks = "|".join(kind.mark for kind in KINDS if kind.mark)
    hashes = "|".join(kind.hash_mark for kind in KINDS if kind.is_hashed)
    return re.compile(
        re.escape(names_of(scene, hole_name))
        + rf"_(?P<size>\d+x\d+)_(?:disk(?P<crossing>\d+)_|(?P<mark>{marks}))?(?P<number>\d{{4,7}})"
        + rf"(?P<hash>(?:{hashes})[0-9a-f]+)?\.exr"
    )


def kind_of(match: re.Match[str]) -> MapKind:
    """Return the kind of map that a match of `name_pattern` names; a pass is part of its map."""
    return next(
        kind for kind in KINDS if kind.mark == (match["mark"] or "") and kind.is_hashed == (match["hash"] is not None)
    )
