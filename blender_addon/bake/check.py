# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether map files are what their requests ask for."""

import os
from pathlib import Path

import bpy

from ..core.physics_api import physics
from .folder import folder
from .names import SEQUENCE_LENGTH, kind_of, name_pattern, shot_name
from .request import MapRequest, older_maps

State = physics.MapState

# What a bake would replace.
FAULTY = (State.STALE, State.FOREIGN, State.DAMAGED)


def check(wanted: MapRequest, *, thorough: bool = True) -> physics.MapFinding:
    """Return what a map is, with its disk's passes: the first thing that is wrong with any of the files.

    Parameters
    ----------
    wanted : MapRequest
        The map.
    thorough : bool
        Read and check the pixels too, 0.1 s in full HD; otherwise headers are trusted.
    """
    kind = wanted.kind
    found = physics.check_map(wanted.path, kind.format, wanted.parameters, thorough=thorough)
    if found.state is State.MISSING and older_maps(wanted):
        return physics.MapFinding(State.STALE, f"The {kind.noun} {wanted.path} is out of date")
    for path, form in list(wanted.formats().items())[1:]:
        if found.state is not State.VALID:
            break
        found = physics.check_map(path, form, wanted.parameters, thorough=thorough)
    return found


def fault_of(wanted: MapRequest, *, thorough: bool = True) -> str | None:
    """Return what is wrong with a map as the beginning of a sentence, or None if it is valid; see `check`."""
    return check(wanted, thorough=thorough).fault or None


def is_valid(wanted: MapRequest, *, thorough: bool = True) -> bool:
    """Return whether a map exists and was made from exactly these parameters."""
    return fault_of(wanted, thorough=thorough) is None


def stamp(path: Path) -> object:
    """Return what differs once another file is in this one's place; None where there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def stamps(wanted: MapRequest) -> dict[Path, object]:
    """Return the stamps of all files of a request."""
    return {path: stamp(path) for path in wanted.files}


def count_baked(scene: bpy.types.Scene, hole_name: str, like: MapRequest, frames: range) -> int:
    """Return how many of the frames have a map of the same kind and size, up to date or not."""
    pattern = name_pattern(shot_name(scene, hole_name))
    size = "x".join(map(str, like.parameters.map_size))
    try:
        with os.scandir(folder(scene).path) as entries:
            matches = [match for entry in entries if (match := pattern.fullmatch(entry.name))]
    except OSError:
        return 0
    numbers = {
        int(match["number"])
        for match in matches
        if match["size"] == size and match["beside"] is None and kind_of(match) is like.kind
    }
    return sum(frame % SEQUENCE_LENGTH in numbers for frame in frames)
