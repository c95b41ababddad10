# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a scene's maps: where it is, whether it can be written to, and what stands in it half-written."""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy

from ..core.errors import MapFolderError
from ..core.physics_api import physics
from ..core.session import SESSION, Life, Value

BYTES_PER_PIXEL = 32  # eight float32, before compression: an upper bound for the size of a map of any kind

DEFAULT_FOLDER = "//umbra_maps/"
_TEMPORARY_FOLDER = "umbra_maps"

# What file systems answer that have no second names for files, or where the two are on different ones.
_NO_LINKS = (errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EXDEV, errno.EMLINK)

# Maps that are taken over from other names are hidden under such a name while they are copied.
_PART = re.compile(r"\.(?P<target>.+\.exr)\.[0-9a-f]+\.part")

# Bytes that Blender keeps of a path, and those by which the name of a file beside a map may be longer than the map's.
LONGEST_PATH, _LONGEST_PASS = 1023, 10

# What the open file is being saved as, while it is.
_saved_as: Value[Path | None] = SESSION.value(lambda: None, Life.FILE)


@dataclass(frozen=True)
class MapFolder:
    """A folder of warp maps: as Blender's data refer to it, and where it is."""

    blender_path: str
    path: Path
    is_temporary: bool


def blend_file(scene: bpy.types.Scene) -> Path | None:
    """Return the .blend file that a scene belongs to, its own one for a linked scene; None while there is none."""
    if scene.library is not None:
        return Path(bpy.path.abspath(scene.library.filepath))
    if _saved_as.now is not None:
        return _saved_as.now
    return Path(bpy.data.filepath) if bpy.data.filepath else None


@contextmanager
def being_saved_as(blend: Path) -> Iterator[None]:
    """Take the open file, for as long as the block lasts, as the one that it is about to be saved as."""
    _saved_as.now = blend
    try:
        yield
    finally:
        _saved_as.now = None


def folder(scene: bpy.types.Scene) -> MapFolder:
    """The folder of a scene's maps; a temporary one if it should be beside a file not saved yet."""
    chosen, blend = _chosen_folder(scene), blend_file(scene)
    if not chosen.startswith("//"):
        return MapFolder(chosen, Path(chosen), False)
    if blend is None:
        path = Path(bpy.app.tempdir or tempfile.gettempdir()) / _TEMPORARY_FOLDER
        return MapFolder(str(path) + os.sep, path, True)
    path = blend.parent / chosen.removeprefix("//")
    if scene.library is not None:
        return MapFolder(chosen, path, False)
    return MapFolder(_as_blender_keeps_it(chosen, path), path, False)


def _as_blender_keeps_it(chosen: str, path: Path) -> str:
    """How Blender's data refer to a folder beside the .blend file.

    While a file is saved into another directory, paths are still those of the old one; Blender adapts them.
    """
    if _saved_as.now is None or not bpy.data.filepath:
        return chosen
    old = Path(bpy.data.filepath).parent
    if old == _saved_as.now.parent:
        return chosen
    return bpy.path.relpath(str(path), start=str(old)).rstrip("/") + "/"


def _chosen_folder(scene: bpy.types.Scene) -> str:
    """What the artist chose, ending in a slash; what is not absolute is meant beside the .blend file."""
    chosen = scene.umbra.map_folder.strip() or DEFAULT_FOLDER
    if os.sep == "/":  # a file dialog on Windows has stored its own separators
        chosen = chosen.replace("\\", "/")
    if not chosen.startswith("//") and not Path(chosen).is_absolute():
        chosen = f"//{chosen}"
    beside, rest = ("//", chosen[2:]) if chosen.startswith("//") else ("", chosen)
    rest = rest.rstrip("/\\")
    return beside + (f"{rest}/" if rest or not beside else "")


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
        if target is None and (match := _PART.fullmatch(name)):
            target = match["target"]
        if target is not None:
            found.setdefault(target, []).append(directory / name)
    return found


def link(source: Path, target: Path, *, copy: bool) -> bool:
    """Give a file a second name, replacing what has that name; return whether it has it now.

    Maps are replaced and never changed in place, so that a second name costs no space and keeps its content.

    Parameters
    ----------
    source, target : Path
        The file, and its second name.
    copy : bool
        Copy the file where the file system has no second names; otherwise that is given up.

    Raises
    ------
    OSError
        If neither is possible.
    """
    if target.exists() and target.samefile(source):
        return True
    partial = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    try:
        try:
            os.link(source, partial)
        except OSError as error:
            if not copy:
                if error.errno in _NO_LINKS:
                    return False
                raise
            shutil.copyfile(source, partial)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return True


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
