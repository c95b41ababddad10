# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a map's file is what it should be, and if not, what is the matter with it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from ..images.exr import PathLike, read_exr_header
from ..images.exr_header import MAGIC
from ..numerics.errors import ImageFileError, WarpMapError
from . import exit_map_file, light_layer_file, star_file, warp_map_file, world_map_file
from .companions import COMPANIONS
from .map_file import ATTRIBUTE_FORMAT, MapFormat, MapOrigin

# Readers that check every pixel, by the format that they read.
READERS: dict[MapFormat, Callable[[PathLike], object]] = {
    warp_map_file.FORMAT: warp_map_file.read_warp_map,
    exit_map_file.FORMAT: exit_map_file.read_exit_map,
    world_map_file.FORMAT: world_map_file.read_world_map,
    star_file.FORMAT: star_file.read_stars,
    light_layer_file.FORMAT: light_layer_file.read_light_layer,
    **{each.format: each.read for each in COMPANIONS},
}


class State(StrEnum):
    """What a map's file is."""

    VALID = "valid"
    MISSING = "missing"
    STALE = "stale"
    """Intact, but made from other settings or by another version."""
    FOREIGN = "foreign"
    """Not a map, or a map of another kind."""
    DAMAGED = "damaged"
    """Cut short, or changed since it was written."""


@dataclass(frozen=True)
class Finding:
    """What was found out about a file."""

    state: State
    fault: str = ""
    """What is wrong, as the beginning of a sentence; empty if nothing is."""


def check_map(
    path: PathLike, kind: MapFormat, wanted: MapOrigin | str | None = None, *, thorough: bool = True
) -> Finding:
    """Find out what a map's file is.

    Parameters
    ----------
    path : path
    kind : MapFormat
        What the file should be.
    wanted : MapOrigin or str, optional
        `WarpMapParameters`, or what a layer is made from: it should be made from this, give or take the noise of
        single-precision arithmetic, or have exactly this hash. Without it, any parameters will do.
    thorough : bool
        Whether to read and check the pixels too (some 0.1 s in full HD), and not only the header.

    Returns
    -------
    Finding
        What is wrong with a file is returned, never raised.
    """
    path = Path(path)
    noun = kind.noun.partition(" ")[2]
    if not os.path.exists(path):  # also where the path is too long for a file
        return Finding(State.MISSING, f"The {noun} {path} is missing")
    try:
        with path.open("rb") as stream:
            magic = stream.read(len(MAGIC))
        if len(magic) == len(MAGIC) and magic != MAGIC:
            return Finding(State.FOREIGN, f"{path} is not an OpenEXR file")
        stamp = read_exr_header(path).get(ATTRIBUTE_FORMAT)
        if stamp_kind(stamp) is not kind:
            return Finding(State.FOREIGN, f"{path} is not {kind.noun}")
        if stamp != kind.stamp:
            return Finding(State.STALE, f"{path} is {kind.noun} of another version ({stamp})")
        metadata = kind.read_metadata(path)
        if isinstance(wanted, str):
            fits = metadata["hash"] == wanted
        else:
            fits = wanted is None or kind.is_made_from(metadata, wanted)
        if not fits:
            return Finding(State.STALE, f"The {noun} {path} is out of date")
        if thorough:
            READERS[kind](path)
    except (ImageFileError, WarpMapError) as error:
        return Finding(State.DAMAGED, str(error).removesuffix("; bake it again.").removesuffix("."))
    except IsADirectoryError:
        return Finding(State.FOREIGN, f"{path} is a folder")
    except OSError as error:
        return Finding(State.DAMAGED, f"Cannot read {path}: {(error.strerror or str(error)).lower()}")
    return Finding(State.VALID)


def stamp_kind(stamp: object) -> MapFormat | None:
    """Return the format that a header's stamp belongs to, whatever its version.

    Parameters
    ----------
    stamp : object
        The value of the attribute `umbraFormat`, or anything else.

    Returns
    -------
    MapFormat or None
        None if it is not a map's stamp.
    """
    if not isinstance(stamp, str):
        return None
    return next((kind for kind in READERS if stamp.startswith(kind.name + " ")), None)
