# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that lie beside a warp map and are one with it, such as its disk's passes.

A further kind of pass is a module with a `Companion`, and its line in `COMPANIONS`: whatever writes, checks, lists,
shares or cleans warp maps goes by these.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..images.exr import PathLike
from ..maps.warp_map import WarpMap
from ..shot.map_parameters import WarpMapParameters
from . import disk_pass_file, footprint_file
from .companion import Companion
from .map_file import MapFormat
from .warp_map_file import write_warp_map

COMPANIONS: tuple[Companion, ...] = (disk_pass_file.COMPANION, footprint_file.COMPANION)

COMPANION_MARKS = "|".join(each.mark for each in COMPANIONS)
"""Regular expression of what stands before the frame's number in the names of such files."""


def _kinds(optional: bool) -> list[Companion]:
    return [each for each in COMPANIONS if optional or not each.is_optional]


def files_beside(
    map_path: PathLike, parameters: WarpMapParameters, *, optional: bool = True
) -> tuple[tuple[Path, MapFormat], ...]:
    """Return the files that lie beside a warp map, and their formats.

    Parameters
    ----------
    map_path : path
        The map's.
    parameters : WarpMapParameters
        What it is made from.
    optional : bool
        Whether those count that can be made from the map at any time.
    """
    return tuple((path, each.format) for each in _kinds(optional) for path in each.paths(map_path, parameters))


def write_companions(
    map_path: PathLike, warp_map: WarpMap, place: Callable[[Path], Path] = Path, *, optional: bool = True
) -> None:
    """Write the files beside a warp map.

    Parameters
    ----------
    map_path : path
        The map's.
    warp_map : WarpMap
        What was baked.
    place : callable, optional
        Returns where to write the file of a path; by default there.
    optional : bool
        Whether to write those that can be made from the map at any time.

    Raises
    ------
    ImageFileError
        If a file cannot be written.
    """
    parameters = WarpMapParameters.from_metadata(warp_map.metadata["parameters"])
    for each in _kinds(optional):
        for number, path in enumerate(each.paths(map_path, parameters)):
            each.write(place(path), warp_map, number)


def write_map_files(map_path: PathLike, warp_map: WarpMap, *, optional: bool = True) -> None:
    """Write a warp map with the files beside it; the map comes last, so that where it is valid they are there.

    Parameters
    ----------
    map_path : path
        The map's.
    warp_map : WarpMap
        What was baked.
    optional : bool
        Whether to write those that can be made from the map at any time.

    Raises
    ------
    ImageFileError
        If a file cannot be written.
    """
    write_companions(map_path, warp_map, optional=optional)
    write_warp_map(map_path, warp_map)
