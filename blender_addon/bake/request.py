# SPDX-License-Identifier: GPL-3.0-or-later
"""Map requests: the map that a frame needs, the file that holds it, and what it is made from."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ..core.physics_api import physics
from ..scene.frame_setup import FrameSetup
from ..settings.scene_properties import looks_of
from .folder import MapFolder, check_path, folder
from .kinds import MapKind
from .names import file_name


@dataclass(frozen=True)
class MapRequest:
    """A map that a frame needs: where it lies, or will lie, and what it is made from."""

    frame: int
    path: Path
    kind: MapKind
    parameters: "physics.MapOrigin"
    folder: MapFolder
    with_optional: bool = False
    """Whether files lie beside the map that can be made from it at any time, such as its footprints."""

    def formats(self, path: Path | None = None) -> dict[Path, "physics.MapFormat"]:
        """Return all files of the request, the map first, with their formats; if wanted, of a map at another path."""
        place = self.path if path is None else path
        beside: tuple[tuple[Path, physics.MapFormat], ...] = ()
        if self.kind.has_companions and isinstance(self.parameters, physics.WarpMapParameters):
            beside = physics.files_beside(place, self.parameters, optional=self.with_optional)
        return {place: self.kind.format, **dict(beside)}

    def write(self, baked: Any) -> None:
        """Write a map that was baked for the request, and what lies beside it.

        Raises
        ------
        physics.ImageFileError
            If a file cannot be written.
        """
        if self.kind.has_companions:
            physics.write_map_files(self.path, baked, optional=self.with_optional)
        else:
            self.kind.write(self.path, baked)

    def lies_at(self, path: Path) -> bool:
        """Whether the map, with the files beside it, is at a path, by its headers."""
        return all(
            physics.check_map(each, form, self.parameters, thorough=False).state is physics.MapState.VALID
            for each, form in self.formats(path).items()
        )

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of the request, the map first."""
        return tuple(self.formats())

    @property
    def passes(self) -> tuple[Path, ...]:
        """Where the disk's passes lie; none if the map has no disk."""
        return tuple(path for path, form in self.formats().items() if form is physics.DISK_PASS_FORMAT)

    @property
    def what(self) -> str:
        """The map for a sentence."""
        return f"the {self.kind.noun} of frame {self.frame}"


def request(scene: bpy.types.Scene, frame: FrameSetup, kind: MapKind, parameters: "physics.MapOrigin") -> MapRequest:
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
    path = where.path / name
    check_path(path)
    wanted = MapRequest(frame.frame, path, kind, parameters, where, looks_of(scene.umbra) > 0)
    if kind.is_hashed and not path.exists():
        # It may have been baked where the last digits of its parameters, and so its name, were others.
        path = next((each for each in older_maps(wanted) if wanted.lies_at(each)), path)
    return replace(wanted, path=path)


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
