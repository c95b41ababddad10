# SPDX-License-Identifier: GPL-3.0-or-later
"""Where warp maps lie, and whether they still hold.

A map's name tells scene, hole, size and frame, so that a test at half the resolution loses nothing that was
baked. Blender reads the maps as an image sequence. The sequence is cyclic with a length of a million, because
that is how one fixed setting gives every frame a number of its own, negative frames too (file names have no
minus signs): frame f is file f, and frame -5 is file 999995.
"""

import errno
import os
import re
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy

from ..core.errors import MapFolderError, SceneError
from ..core.physics_api import (
    disk_pass_file,
    exit_map_file,
    exr,
    map_check,
    map_file,
    physics,
    warp_map_file,
    world_map_file,
)

SEQUENCE_LENGTH = 1_000_000
# Frames that have a file of their own.
FIRST_FRAME, LAST_FRAME = -100_000, SEQUENCE_LENGTH - 100_001

BYTES_PER_PIXEL = 32  # eight float32, before compression: an upper bound for the size of a map of either kind

DEFAULT_FOLDER = "//umbra_maps/"
_TEMPORARY_FOLDER = "umbra_maps"


@dataclass(frozen=True)
class MapKind:
    """What a file is read as: the map of the compositor, of the camera that bends its rays, or of the World."""

    noun: str
    format: map_file.MapFormat


WARP_MAP = MapKind("warp map", warp_map_file.FORMAT)
EXIT_MAP = MapKind("exit map", exit_map_file.FORMAT)
WORLD_MAP = MapKind("world map", world_map_file.FORMAT)

# The ending of copies that are being made while a file is saved for the first time.
_PART = ".part"

# What stands before a world map's frame.
_WORLD_MARK = "world_"
# What stands between an exit map's frame and the beginning of its hash.
_EXIT_MARK = "_exit_"
_HASH_CHARACTERS = 12


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
    if not chosen.startswith("//") and not Path(chosen).is_absolute():
        chosen = f"//{chosen}"
    return chosen.rstrip("/\\") + "/"


def stem(scene: bpy.types.Scene, hole_name: str, size: tuple[int, int]) -> str:
    """A map's file name up to the frame's number; `size` is the map's own, supersampling included."""
    return f"{names_of(scene, hole_name)}_{size[0]}x{size[1]}_"


def names_of(scene: bpy.types.Scene, hole_name: str) -> str:
    """What all maps of a scene's hole begin with."""
    return "_".join(bpy.path.clean_name(name) for name in (scene.name, hole_name))


def file_name(scene: bpy.types.Scene, hole_name: str, size: tuple[int, int], frame: int) -> str:
    """A map's file name.

    Raises
    ------
    SceneError
        The frame is beyond the numbers that file names have room for.
    """
    if not FIRST_FRAME <= frame <= LAST_FRAME:
        raise SceneError(
            f"Frame {frame} is outside {FIRST_FRAME} to {LAST_FRAME}, the frames that warp maps can be "
            "numbered by: move the animation."
        )
    return f"{stem(scene, hole_name, size)}{frame % SEQUENCE_LENGTH:04d}.exr"


def map_path(scene: bpy.types.Scene, hole_name: str, size: tuple[int, int], frame: int) -> Path:
    """Where the map of a frame lies, or will lie."""
    return folder(scene).path / file_name(scene, hole_name, size, frame)


def exit_map_path(scene: bpy.types.Scene, hole_name: str, parameters: "physics.WarpMapParameters", frame: int) -> Path:
    """Where the exit map of a frame lies, or will lie.

    Its name contains the hash of what it is made from: Cycles keeps textures by their names, and a map that is baked
    anew must not be taken for the one before.
    """
    name = file_name(scene, hole_name, parameters.map_size, frame)
    hashed = f"{_EXIT_MARK}{parameters.hash[:_HASH_CHARACTERS]}.exr"
    return folder(scene).path / (name.removesuffix(".exr") + hashed)


def world_map_name(scene: bpy.types.Scene, hole_name: str, size: tuple[int, int], frame: int) -> str:
    """The file name of a frame's world map.

    Raises
    ------
    SceneError
        See `file_name`.
    """
    beginning, _, end = file_name(scene, hole_name, size, frame).rpartition("_")
    return f"{beginning}_{_WORLD_MARK}{end}"


def older_exit_maps(path: Path) -> list[Path]:
    """The exit maps of the same frame and size that were made from other parameters."""
    beginning = path.name[: path.name.rindex(_EXIT_MARK) + len(_EXIT_MARK)]
    others = path.parent.iterdir() if path.parent.is_dir() else ()
    return [each for each in others if each.name.startswith(beginning) and each.suffix == ".exr" and each != path]


def kind_of(path: Path) -> MapKind:
    """What a file of the folder is read as, by its name."""
    if re.search(rf"_{_WORLD_MARK}\d+\.exr$", path.name):
        return WORLD_MAP
    return EXIT_MAP if re.search(rf"{_EXIT_MARK}[0-9a-f]+\.exr$", path.name) else WARP_MAP


def blender_map_path(scene: bpy.types.Scene, hole_name: str, size: tuple[int, int], frame: int) -> str:
    """The same path as Blender's data should carry it: relative to the .blend file once that is saved."""
    return folder(scene).blender_path + file_name(scene, hole_name, size, frame)


def pass_path(path: "Path | str", crossing: int) -> str:
    """Where a disk's pass lies: beside its map, _disk1 before the frame's number for the first crossing."""
    beginning, _, end = str(path).rpartition("_")
    return f"{beginning}_disk{crossing}_{end}"


def pass_paths(path: Path, parameters: "physics.WarpMapParameters") -> list[Path]:
    """Where all passes of a map lie; none if it has no disk."""
    crossings = 0 if parameters.disk is None else parameters.disk.crossings
    return [Path(pass_path(path, crossing)) for crossing in range(1, crossings + 1)]


def is_fresh(path: Path, parameters: "physics.WarpMapParameters", *, thorough: bool = True) -> bool:
    """Whether a map exists and was made by exactly these parameters; a damaged or foreign one is not."""
    return fault_of(path, parameters, thorough=thorough) is None


def fault_of(path: Path, parameters: "physics.WarpMapParameters", *, thorough: bool = True) -> str | None:
    """What is wrong with a map or a disk's pass as the beginning of a sentence, or None if all hold; see `check`."""
    return check(path, parameters, thorough=thorough).fault or None


def check(path: Path, parameters: "physics.WarpMapParameters", *, thorough: bool = True) -> map_check.Finding:
    """What a map is, its disk's passes counted in: the first thing that is the matter with any of them.

    Thorough: its pixels are read and checked too (some 0.1 s in full HD); otherwise the header is taken at its word.
    """
    kind = kind_of(path)
    found = map_check.check_map(path, kind.format, parameters.hash, thorough=thorough)
    if found.state is map_check.State.MISSING and kind is EXIT_MAP and older_exit_maps(path):
        return map_check.Finding(map_check.State.STALE, f"The {kind.noun} {path} is out of date")
    for one in pass_paths(path, parameters):
        if found.state is not map_check.State.VALID:
            break
        found = map_check.check_map(one, disk_pass_file.FORMAT, parameters.hash, thorough=thorough)
    return found


def count_baked(
    scene: bpy.types.Scene, hole_name: str, size: tuple[int, int], frames: range, kind: MapKind = WARP_MAP
) -> int:
    """Number of the frames that have a map, up to date or not."""
    ending = rf"{_EXIT_MARK}[0-9a-f]+\.exr" if kind is EXIT_MAP else r"\.exr"
    mark = _WORLD_MARK if kind is WORLD_MAP else ""
    pattern = re.compile(re.escape(stem(scene, hole_name, size)) + mark + r"(\d+)" + ending)
    try:
        with os.scandir(folder(scene).path) as entries:
            matches = [pattern.fullmatch(entry.name) for entry in entries]
            numbers = {int(match[1]) for match in matches if match is not None}
    except OSError:
        return 0
    return sum(frame % SEQUENCE_LENGTH in numbers for frame in frames)


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
            f"to {needed / 1e6:.0f} MB; free some space or choose another folder."
        )


def half_files(directory: Path) -> dict[str, list[Path]]:
    """Files that are being written, or were when their process was killed, by the name that they were to have."""
    found: dict[str, list[Path]] = {}
    try:
        names = sorted(os.listdir(directory))
    except OSError:
        return found
    for name in names:
        target = exr.target_of(name)
        if target is None and name.startswith(".") and name.endswith(_PART):
            target = name.removeprefix(".").removesuffix(_PART)
        if target is not None:
            found.setdefault(target, []).append(directory / name)
    return found


def explain(error: OSError, place: Path) -> MapFolderError:
    """The sentence for a failure of the file system."""
    if error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC)):
        return MapFolderError(
            f"The disk of the warp map folder {place} is full: free some space or choose another folder."
        )
    reason = error.strerror or str(error)
    return MapFolderError(
        f"The warp map folder {place} cannot be written to ({reason}): choose another folder in the Umbra "
        "panel, or change its permissions."
    )


def explain_reading(error: OSError, place: Path) -> MapFolderError:
    """The sentence for a folder that cannot be listed."""
    reason = error.strerror or str(error)
    return MapFolderError(
        f"The warp map folder {place} cannot be read ({reason}): choose another folder in the Umbra panel, or change "
        "its permissions."
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


def frames_of(scene: bpy.types.Scene) -> range:
    """The frames that rendering the scene's animation renders."""
    return range(scene.frame_start, scene.frame_end + 1, max(scene.frame_step, 1))
