# SPDX-License-Identifier: GPL-3.0-or-later
"""The file format of footprints: like a warp map's, beside it, in half precision."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..images.exr import PathLike
from ..maps.footprint import LONGEST_AXIS, footprint
from ..maps.warp_map import WarpMap
from ..numerics.errors import WarpMapError
from ..shot.map_parameters import WarpMapParameters
from .companion import Companion, path_beside
from .map_file import MapFormat, advice

FORMAT = MapFormat(
    "umbra footprint",
    1,
    "a footprint",
    "R, G, B: major axis of the part of the sky that a pixel sees, in world axes (radians); A: log2 of the minor axis",
)


def footprint_path(map_path: PathLike) -> str:
    """Return where a map's footprints lie: beside it, with _footprint in its name.

    Parameters
    ----------
    map_path : path
        The map's; also one that only Blender understands, such as ``//maps/Scene_0001.exr``.

    Returns
    -------
    str
        ``Scene_footprint_0001.exr`` for ``Scene_0001.exr``; ``picture_footprint.exr`` for ``picture.exr``.
    """
    return path_beside(map_path, "footprint")


def write_footprint(path: PathLike, warp_map: WarpMap) -> None:
    """Write the footprints of a map's pixels to an EXR file in half precision, completely or not at all.

    Parameters
    ----------
    path : path
        Its folder is made if need be; an existing file is replaced.
    warp_map : WarpMap
        The map.

    Raises
    ------
    ImageFileError
        If the file cannot be written.
    """
    planes = np.moveaxis(footprint(warp_map), -1, 0)
    FORMAT.write(path, tuple(np.ascontiguousarray(plane) for plane in planes), warp_map.metadata)


def read_footprint(path: PathLike) -> NDArray[np.float16]:
    """Read footprints and check their format, their parameters, and the checksum and ranges of their pixels.

    Parameters
    ----------
    path : path

    Returns
    -------
    ndarray of float16, shape (height, width, 4)
        As of `footprint`.

    Raises
    ------
    WarpMapError
        If the file is missing, damaged, cut short, or has no footprints; the message names it and says which.
    """
    planes, _metadata = FORMAT.read(path)
    pixels: NDArray[np.float16] = np.stack(planes, axis=-1).astype(np.float16)
    if not np.isfinite(pixels).all() or np.abs(pixels[..., :3]).max(initial=0.0) > LONGEST_AXIS:
        raise WarpMapError(advice(f"{path} is damaged: it holds values that no footprint has."), code="map.damaged")
    return pixels


def _paths(map_path: PathLike, _parameters: WarpMapParameters) -> tuple[Path, ...]:
    return (Path(footprint_path(map_path)),)


def _write(path: PathLike, warp_map: WarpMap, _number: int) -> None:
    write_footprint(path, warp_map)


COMPANION = Companion(FORMAT, read_footprint, "footprint", _paths, _write, is_optional=True)
