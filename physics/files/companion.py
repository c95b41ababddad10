# SPDX-License-Identifier: GPL-3.0-or-later
"""What a kind of file beside a warp map says of itself; see `companions`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..images.exr import PathLike
from ..maps.warp_map import WarpMap
from ..shot.map_parameters import WarpMapParameters
from .map_file import MapFormat


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
