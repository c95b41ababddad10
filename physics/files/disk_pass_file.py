# SPDX-License-Identifier: GPL-3.0-or-later
"""The file format of a disk's passes: like a warp map's, one file for each crossing. See docs/disk.md."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..disk_passes.disk_pass import DiskPass
from ..images.exr import PathLike
from ..maps.warp_map import WarpMap
from ..numerics.errors import BlackHoleError, WarpMapError
from ..shot.map_parameters import WarpMapParameters
from .companion import Companion, path_beside
from .map_file import MapFormat, advice

FORMAT = MapFormat(
    "umbra disk pass",
    1,
    "a disk pass",
    "R: radius on the disk (M); G: azimuth in the hole's frame (radians); B: g; A: coverage",
    attributes=("umbraCrossing",),
)


def pass_path(map_path: PathLike, crossing: int) -> str:
    """Return where a disk's pass lies: beside its map, with _disk1 in its name for the first crossing.

    Parameters
    ----------
    map_path : path
        The map's; also one that only Blender understands, such as ``//maps/Scene_0001.exr``.
    crossing : int
        1 for the direct image.

    Returns
    -------
    str
        ``Scene_disk1_0001.exr`` for ``Scene_0001.exr``, so that the passes of an animation are an image sequence too;
        ``picture_disk1.exr`` for ``picture.exr``, which has no frame number.
    """
    return path_beside(map_path, f"disk{crossing}")


def find_pass(map_path: PathLike, crossing: int) -> Path:
    """Return where a disk's pass is to be read from.

    Parameters
    ----------
    map_path : path
    crossing : int
        1 for the direct image.

    Returns
    -------
    Path
        That of `pass_path`, unless only a file named ``Scene_0001_disk1.exr`` is there, the older rule of
        ``python -m physics bake``.
    """
    path, map_path = Path(pass_path(map_path, crossing)), Path(map_path)
    former = map_path.with_name(f"{map_path.stem}_disk{crossing}{map_path.suffix}")
    return former if os.path.isfile(former) and not os.path.isfile(path) else path


def write_disk_passes(map_path: PathLike, passes: Iterable[DiskPass]) -> list[Path]:
    """Write the passes of a map's disk beside the map.

    Parameters
    ----------
    map_path : path
        The map's.
    passes : iterable of DiskPass
        `WarpMap.disk_passes`.

    Returns
    -------
    list of Path
        Where the passes lie, in their order.

    Raises
    ------
    ImageFileError
        If a file cannot be written.
    """
    paths = []
    for one in passes:
        paths.append(Path(pass_path(map_path, one.metadata["crossing"])))
        write_disk_pass(paths[-1], one)
    return paths


def read_disk_passes(map_path: PathLike, warp_map: WarpMap) -> list[DiskPass]:
    """Read the passes that were baked along with a map.

    Parameters
    ----------
    map_path : path
        Where the map lies.
    warp_map : WarpMap
        The map.

    Returns
    -------
    list of DiskPass
        The first crossing first.

    Raises
    ------
    BlackHoleError
        If the map was baked without a disk.
    WarpMapError
        If a pass is missing or damaged, or belongs to another map.
    """
    disk = warp_map.metadata["parameters"].get("disk")
    if not disk:
        raise BlackHoleError(f"{map_path} was baked without a disk; bake it again with --disk.", code="map.no-disk")
    passes = []
    for crossing in range(1, disk["crossings"] + 1):
        path = find_pass(map_path, crossing)
        one = read_disk_pass(path)
        if one.metadata["hash"] != warp_map.metadata["hash"] or one.metadata["crossing"] != crossing:
            raise WarpMapError(f"{path} does not belong to {map_path}; bake it again.", code="map.passes-mixed")
        passes.append(one)
    return passes


def write_disk_pass(path: PathLike, disk_pass: DiskPass) -> None:
    """Write a pass to an EXR file, whole or not at all: R, G, B, A are radius, phi, g and coverage.

    Parameters
    ----------
    path : path
        Its folder is made if need be; a file that is there is replaced.
    disk_pass : DiskPass

    Raises
    ------
    ImageFileError
        When the file cannot be written.
    """
    planes = (disk_pass.radius, disk_pass.phi, disk_pass.g, disk_pass.coverage)
    FORMAT.write(path, planes, disk_pass.metadata, (str(disk_pass.metadata["crossing"]),))


def read_disk_pass(path: PathLike) -> DiskPass:
    """Read a pass and check its format, its parameters, and the checksum and ranges of its pixels.

    Parameters
    ----------
    path : path

    Returns
    -------
    DiskPass
        float32 images of shape (height, width), row 0 at the top, and the metadata.

    Raises
    ------
    WarpMapError
        If the file is missing, damaged, cut short, or not a disk pass; the message names it and says which.
    """
    (radius, phi, g, coverage), metadata = FORMAT.read(path)
    disk = metadata["parameters"].get("disk")
    crossing = metadata.pop("umbraCrossing")
    seen = coverage > 0.0
    fits = (
        ((coverage >= 0.0) & (coverage <= 1.0)).all()
        and ((phi >= 0.0) & (phi < np.float32(2.0 * math.pi))).all()
        and (np.isfinite(radius) & np.isfinite(g)).all()
        and (radius[seen] > 0.0).all()
        and (g[seen] > 0.0).all()
    )
    if not (fits and disk and crossing.isdigit() and 1 <= int(crossing) <= disk["crossings"]):
        raise WarpMapError(advice(f"{path} is damaged: it holds values that no disk pass has."), code="map.damaged")
    return DiskPass(radius, phi, g, coverage, {**metadata, "crossing": int(crossing)})


def _paths(map_path: PathLike, parameters: WarpMapParameters) -> tuple[Path, ...]:
    count = 0 if parameters.disk is None else parameters.disk.crossings
    return tuple(Path(pass_path(map_path, crossing)) for crossing in range(1, count + 1))


def _write(path: PathLike, warp_map: WarpMap, number: int) -> None:
    write_disk_pass(path, warp_map.disk_passes[number])


COMPANION = Companion(FORMAT, read_disk_pass, r"disk\d+", _paths, _write)
