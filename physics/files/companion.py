# SPDX-License-Identifier: GPL-3.0-or-later
"""What a kind of file beside a warp map says of itself; see `companions`."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..images.exr import PathLike
from ..maps.warp_map import WarpMap
from ..shot.map_parameters import WarpMapParameters
from .map_file import MapFormat

# The number of the frame at the end of a map's name.
_FRAME = re.compile(r"_\d+$")


def path_beside(map_path: PathLike, mark: str) -> str:
    """Return where a file beside a map lies: like the map, with a mark before the number of the frame.

    Parameters
    ----------
    map_path : path
        The map's; also one that only Blender understands, such as ``//maps/Scene_0001.exr``.
    mark : str
        What tells the file from the map.

    Returns
    -------
    str
        ``Scene_<mark>_0001.exr`` for ``Scene_0001.exr``, so that the files of an animation are an image sequence too;
        ``picture_<mark>.exr`` for ``picture.exr``, which has no frame number.
    """
    stem, ending = os.path.splitext(os.fspath(map_path))
    frame = _FRAME.search(stem)
    end = len(stem) if frame is None else frame.start()
    return f"{stem[:end]}_{mark}{stem[end:]}{ending}"


@dataclass(frozen=True)
class Companion:
    """A kind of file that lies beside a warp map."""

    format: MapFormat
    read: Callable[[PathLike], object]
    """Reads a file, and checks every pixel."""
    mark: str
    """Regular expression of what stands before the frame's number in its name."""
    paths: Callable[[PathLike, WarpMapParameters], tuple[Path, ...]]
    """Returns where the files of a map lie, none if it has none, for the map's path and what it is made from."""
    write: Callable[[PathLike, WarpMap, int], None]
    """Writes one of them: to a path, from what was baked, the number among `paths`."""
    is_optional: bool = False
    """Whether it can be made from the map alone, at any time."""
