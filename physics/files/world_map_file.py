# SPDX-License-Identifier: GPL-3.0-or-later
"""The world map's file format: its texture as a float32 OpenEXR file. `docs/world.md` documents it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..images.exr import PathLike
from ..maps.world_map import HEADER_PARTS, STAMP, WorldMap
from ..numerics.errors import WarpMapError
from .map_file import MapFormat, advice

FORMAT = MapFormat(
    "umbra world map",
    1,
    "a world map",
    "Bottom row: header. Others: R, G, B: unit vector towards the light's origin, world axes, 0 if unresolved; A: "
    "angle from the hole's direction to the shadow's edge, radians. Across: position angle; up: ln(d) + d from it",
)

# Lengths of vectors in single precision.
UNIT_TOLERANCE = 1e-4


def write_world_map(path: PathLike, world_map: WorldMap) -> None:
    """Write a world map to an EXR file, completely or not at all.

    Parameters
    ----------
    path : path
        Its folder is made if need be; an existing file is replaced.
    world_map : WorldMap

    Raises
    ------
    ImageFileError
        If the file cannot be written.
    """
    downwards = world_map.texture[::-1]
    FORMAT.write(path, [np.ascontiguousarray(downwards[..., i]) for i in range(4)], world_map.metadata)


def read_world_map(path: PathLike) -> WorldMap:
    """Read a world map and check its format, its parameters, and the checksum and ranges of its pixels.

    Parameters
    ----------
    path : path

    Returns
    -------
    WorldMap

    Raises
    ------
    WarpMapError
        If the file is missing, damaged, cut short, or not a world map; the message names it and says which.
    """
    planes, metadata = FORMAT.read(path)
    texture: NDArray[np.float32] = np.ascontiguousarray(np.dstack(planes)[::-1])
    length = np.linalg.norm(texture[1:, :, :3], axis=-1)
    parts = texture.shape[1] % HEADER_PARTS == 0
    fits = (
        parts
        and np.isfinite(texture).all()
        and ((np.abs(length - 1.0) < UNIT_TOLERANCE) | (length == 0.0)).all()
        and texture[0, 4 * (texture.shape[1] // HEADER_PARTS), 1] == STAMP
    )
    if not fits:
        raise WarpMapError(advice(f"{path} is damaged: it holds values that no world map has."), code="map.damaged")
    return WorldMap(texture, metadata)


def read_world_map_metadata(path: PathLike) -> dict[str, Any]:
    """Read a world map's metadata from its header, without its pixels.

    Parameters
    ----------
    path : path

    Returns
    -------
    dict
        ``format``, ``hash``, ``counts`` and ``parameters``.

    Raises
    ------
    WarpMapError
        If the file is missing, its header is damaged, or it is not a world map.
    """
    return FORMAT.read_metadata(path)
