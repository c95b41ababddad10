# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a scene's maps: where it is, whether it can be written to, and what stands in it half-written."""

import errno
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy

from ..core.errors import MapFolderError
from ..core.physics_api import physics

BYTES_PER_PIXEL = 32  # eight float32, before compression: an upper bound for the size of a map of any kind

DEFAULT_FOLDER = "//umbra_maps/"
_TEMPORARY_FOLDER = "umbra_maps"

# Bytes that Blender keeps of a path, and those by which the name of a disk's pass may be longer than its map's.
LONGEST_PATH, _LONGEST_PASS = 1023, 8

# The ending of copies that are being made while a file is saved for the first time.
_PART = ".part"


@dataclass(frozen=True)
class MapFolder:
    """A folder of warp maps: as Blender's data refer to it, and where it is."""

    blender_path: str
    path: Path
    is_temporary: bool


def folder(scene: bpy.types.Scene) -> MapFolder:
    """The folder of a scene's maps; a temporary one if it should be beside a file not saved yet."""
    chosen = _chosen_folder(scene)
    if chosen.startswith("//") and not bpy.data.filepath:
        path = Path(bpy.app.tempdir or tempfile.gettempdir()) / _TEMPORARY_FOLDER
        return MapFolder(str(path) + os.sep, path, True)
    # what a linked scene calls beside the file is beside its own file
    return MapFolder(chosen, Path(bpy.path.abspath(chosen, library=scene.library)), False)


def _chosen_folder(scene: bpy.types.Scene) -> str:
    """What the artist chose, ending in a slash; what is not absolute is meant beside the .blend file."""
    chosen = scene.umbra.map_folder.strip() or DEFAULT_FOLDER
    if os.sep == "/":  # a file dialog on Windows has stored its own separators
        chosen = chosen.replace("\\", "/")
    if not chosen.startswith("//") and not Path(chosen).is_absolute():
        chosen = f"//{chosen}"
    return chosen.rstrip("/\\") + "/"


def check_path(path: Path) -> None:
    """Refuse a path that Blender would read as another one.

    Raises
    ------
    MapFolderError
        It is too long, or has a backslash in it that is no separator.
    """
    length = len(os.fsencode(path)) + _LONGEST_PASS
    if length > LONGEST_PATH:
        raise MapFolderError(
            f"The path of the warp maps has {length} bytes, and Blender reads {LONGEST_PATH} at most: choose a folder "
            f"with a shorter path than {path.parent} in the Umbra panel.",
            code="folder.path",
        )
    if os.sep == "/" and "\\" in str(path):
        raise MapFolderError(
            f"The path of the warp maps {path.parent} contains a backslash, which Blender takes for a separator: "
            "rename the folder, or choose another one in the Umbra panel.",
            code="folder.path",
        )


def prepare(path: Path, size: tuple[int, int], files: int = 1) -> None:
    """Make sure, before any work is done, that a map of this size can be written there, with its passes.

    Raises
    ------
    MapFolderError
        The folder cannot be made or written to, or the disk is full.
    """
    parent = path.parent
    try:
        parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=parent):
            pass
        free = shutil.disk_usage(parent).free
    except OSError as error:
        raise explain(error, parent) from error
    needed = size[0] * size[1] * BYTES_PER_PIXEL * files
    if free < needed:
        raise MapFolderError(
            f"The disk of the warp map folder {parent} is full: {free / 1e6:.0f} MB are free, a map needs up "
            f"to {needed / 1e6:.0f} MB; free some space or choose another folder.",
            code="folder.full",
        )


def half_files(directory: Path) -> dict[str, list[Path]]:
    """Files that are being written, or were when their process was killed, by the name that they were to have."""
    found: dict[str, list[Path]] = {}
    try:
        names = sorted(os.listdir(directory))
    except OSError:
        return found
    for name in names:
        target = physics.temporary_target(name)
        if target is None and name.startswith(".") and name.endswith(_PART):
            target = name.removeprefix(".").removesuffix(_PART)
        if target is not None:
            found.setdefault(target, []).append(directory / name)
    return found


def explain(error: OSError, place: Path) -> MapFolderError:
    """The sentence for a failure of the file system."""
    if error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC)):
        return MapFolderError(
            f"The disk of the warp map folder {place} is full: free some space or choose another folder.",
            code="folder.full",
        )
    reason = error.strerror or str(error)
    return MapFolderError(
        f"The warp map folder {place} cannot be written to ({reason}): choose another folder in the Umbra "
        "panel, or change its permissions.",
        code="folder.not-writable",
    )


def explain_reading(error: OSError, place: Path) -> MapFolderError:
    """The sentence for a folder that cannot be listed."""
    reason = error.strerror or str(error)
    return MapFolderError(
        f"The warp map folder {place} cannot be read ({reason}): choose another folder in the Umbra panel, or change "
        "its permissions.",
        code="folder.not-readable",
    )


def adopt(scene: bpy.types.Scene, blend_file: Path) -> str | None:
    """Bring a scene's maps from the temporary folder beside a file that is being saved for the first time.

    Maps that are there already are kept.

    Parameters
    ----------
    scene : Scene
        Its maps are looked for.
    blend_file : Path
        Where the file will be.

    Returns
    -------
    str or None
        The folder as Blender's data should refer to it; None if the scene's folder is not a temporary one.

    Raises
    ------
    MapFolderError
        The folder cannot be written to.
    """
    source = folder(scene)
    if not source.is_temporary:
        return None
    blender_path = _chosen_folder(scene)
    target = blend_file.parent / blender_path.removeprefix("//")
    try:
        for path in sorted(source.path.glob(f"{bpy.path.clean_name(scene.name)}_*.exr")):
            destination = target / path.name
            if not destination.exists():
                target.mkdir(parents=True, exist_ok=True)
                partial = destination.with_name(f".{destination.name}{_PART}")
                shutil.copyfile(path, partial)
                os.replace(partial, destination)
    except OSError as error:
        raise explain(error, target) from error
    return blender_path
