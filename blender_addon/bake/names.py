# SPDX-License-Identifier: GPL-3.0-or-later
"""The names of map files. This is the one place that makes and reads them.

A name begins with .blend file, scene and hole, shortened for the eye, and a digest of all three, so that two shots
never share a file. Size and frame follow, so that a test at half the resolution loses nothing that was baked:

    shot_v001_Scene_Black_Hole_3f1c09ab_1920x1080_0042.exr

Blender reads maps as an image sequence. The sequence is cyclic with a length of a million, because one fixed setting
then gives every frame a number of its own, negative frames too (file names have no minus signs): frame f is file f, and
frame -5 is file 999995.
"""

import hashlib
import json
import os
import re
import secrets
import unicodedata
from pathlib import Path

import bpy

from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from .folder import blend_file, folder
from .kinds import KINDS, MapKind

SEQUENCE_LENGTH = 1_000_000
# Frames that have a file of their own.
FIRST_FRAME, LAST_FRAME = -100_000, SEQUENCE_LENGTH - 100_001

# A copy for render farms is the shot that it was made from: its file's name ends like this, and its scene has this
# property, the first and last frame that the copy is for.
FARM_SUFFIX, FARM_FRAMES = "_farm", "umbra_farm_frames"

_DIGEST_CHARACTERS = 8
_HASH_CHARACTERS = 12

# Of the readable part of a name. With all that follows, and what names of unfinished files add, a name stays below the
# 255 bytes that file systems allow.
_READABLE_BYTES = 120

# Stands for the .blend file while there is none: another one for each new file.
_unsaved = SESSION.value(lambda: secrets.token_hex(8), Life.FILE)


def shot_name(scene: bpy.types.Scene, hole_name: str) -> str:
    """Return what the names of all maps of a scene's hole begin with.

    The .blend file counts by its name and its place relative to the map folder, so that a project can be moved.
    """
    blend = blend_file(scene)
    stem = "" if blend is None else unicodedata.normalize("NFC", blend.stem)
    if FARM_FRAMES in scene:
        stem = stem.removesuffix(FARM_SUFFIX)
    identity = [_unsaved.now if blend is None else _place(blend, folder(scene).path), stem, scene.name, hole_name]
    digest = hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:_DIGEST_CHARACTERS]
    readable = "_".join(bpy.path.clean_name(each) for each in (stem, scene.name, hole_name) if each)
    return f"{_shortened(readable)}_{digest}"


def _place(blend: Path, map_folder: Path) -> str:
    try:
        place = os.path.relpath(blend.parent, map_folder)
    except ValueError:  # another drive
        place = str(blend.parent)
    return unicodedata.normalize("NFC", Path(place).as_posix())


def _shortened(text: str) -> str:
    return text.encode()[:_READABLE_BYTES].decode(errors="ignore")


def former_shot_name(scene: bpy.types.Scene, hole_name: str) -> str:
    """Return what version 0.1.0 let the names of maps begin with."""
    return "_".join(bpy.path.clean_name(name) for name in (scene.name, hole_name))


def sequence_path(scene: bpy.types.Scene, hole_name: str, size: tuple[int, int], kind: MapKind) -> str:
    """Return the path of an image sequence of maps as Blender's data carry it, relative to a saved .blend file.

    `size` is the map's own, supersampling included.
    """
    return folder(scene).blender_path + file_name(scene, hole_name, size, 1, kind)


def file_name(
    scene: bpy.types.Scene,
    hole_name: str,
    size: tuple[int, int],
    frame: int,
    kind: MapKind,
    parameters: "physics.MapOrigin | None" = None,
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
    return f"{shot_name(scene, hole_name)}_{size[0]}x{size[1]}_{end}.exr"


def name_pattern(shot: str | None = None) -> re.Pattern[str]:
    """Return a pattern for the names of all files of a shot, by what they begin with, or of all shots.

    Its groups are `shot`, `size`, `beside` (of a file beside a map: what tells it from the map), `mark`, `number` and
    `hash`, the last with what stands before it.
    """
    marks = "|".join(kind.mark for kind in KINDS if kind.mark)
    hashes = "|".join(kind.hash_mark for kind in KINDS if kind.is_hashed)
    return re.compile(
        rf"(?P<shot>{'.+' if shot is None else re.escape(shot)})"
        rf"_(?P<size>\d+x\d+)_(?:(?P<beside>{physics.COMPANION_MARKS})_|(?P<mark>{marks}))?(?P<number>\d{{4,7}})"
        rf"(?P<hash>(?:{hashes})[0-9a-f]+)?\.exr"
    )


def kind_of(match: re.Match[str]) -> MapKind:
    """Return the kind of map that a match of `name_pattern` names; a pass is part of its map."""
    return next(
        kind for kind in KINDS if kind.mark == (match["mark"] or "") and kind.is_hashed == (match["hash"] is not None)
    )
