# SPDX-License-Identifier: GPL-3.0-or-later
"""The exit map's file format: two RGBA pictures, one below the other, in one float32 OpenEXR file.

What reads it is a texture look-up of red, green, blue and alpha, so the seven numbers of a pixel lie in two of its
pixels. `docs/cycles_lens.md` documents it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..images.exr import PathLike
from ..maps.exit_map import ExitMap
from ..numerics.errors import WarpMapError
from .map_file import MapFormat, advice

FORMAT = MapFormat(
    "umbra exit map",
    1,
    "an exit map",
    "Upper half: R, G, B: direction N of the light's origin, hole's frame; A: 1 + z. Lower half: R, G, B: impact "
    "vector D in M; A: 1 where both may be interpolated",
    pictures=2,
)

# N is a unit vector, and D perpendicular to it, up to single precision and the interpolation of tiles.
UNIT_TOLERANCE = 0.1


def write_exit_map(path: PathLike, exit_map: ExitMap) -> None:
    """Write an exit map to an EXR file, completely or not at all.

    Parameters
    ----------
    path : path
        Its folder is made if need be; an existing file is replaced.
    exit_map : ExitMap

    Raises
    ------
    ImageFileError
        If the file cannot be written.
    """
    upper = np.dstack([exit_map.direction, exit_map.one_plus_z])
    lower = np.dstack([exit_map.impact, exit_map.usable])
    pixels = np.concatenate([upper, lower])
    FORMAT.write(path, [np.ascontiguousarray(pixels[..., i]) for i in range(4)], exit_map.metadata)


def read_exit_map(path: PathLike) -> ExitMap:
    """Read an exit map and check its format, its parameters, and the checksum and ranges of its pixels.

    Parameters
    ----------
    path : path

    Returns
    -------
    ExitMap

    Raises
    ------
    WarpMapError
        If the file is missing, damaged, cut short, or not an exit map; the message names it and says which.
    """
    planes, metadata = FORMAT.read(path)
    pixels: NDArray[np.float32] = np.dstack(planes)
    upper, lower = pixels[: len(pixels) // 2], pixels[len(pixels) // 2 :]
    result = ExitMap(upper[..., :3], lower[..., :3], upper[..., 3], lower[..., 3], metadata)
    length = np.linalg.norm(result.direction, axis=-1)
    fits = (
        np.isfinite(pixels).all()
        and (result.one_plus_z > 0.0).all()
        and np.isin(result.usable, (0.0, 1.0)).all()
        and (np.abs(length[result.usable == 1.0] - 1.0) < UNIT_TOLERANCE).all()
    )
    if not fits:
        raise WarpMapError(advice(f"{path} is damaged: it holds values that no exit map has."), code="map.damaged")
    return result


def read_exit_map_metadata(path: PathLike) -> dict[str, Any]:
    """Read an exit map's metadata from its header, without its pixels.

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
        If the file is missing, its header is damaged, or it is not an exit map.
    """
    return FORMAT.read_metadata(path)
