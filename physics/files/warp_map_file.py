# SPDX-License-Identifier: GPL-3.0-or-later
"""The warp map's file format: float32 RGBA OpenEXR with a header that says all about it. See docs in README."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..images.exr import PathLike
from ..maps.warp_map import WarpMap
from ..numerics.errors import WarpMapError
from .map_file import MapFormat, advice

FORMAT = MapFormat(
    "umbra warp map",
    1,
    "a warp map",
    "R, G: theta, phi of the light's origin in world axes (radians); B: 1 + z; A: sky visibility",
)
"""R, G, B, A are theta, phi, 1 + z and visibility."""


def write_warp_map(path: PathLike, warp_map: WarpMap) -> None:
    """Write a warp map to an EXR file, whole or not at all.

    Parameters
    ----------
    path : path
        Its folder is made if need be; a file that is there is replaced.
    warp_map : WarpMap

    Raises
    ------
    ImageFileError
        When the file cannot be written.
    """
    planes = (warp_map.theta, warp_map.phi, warp_map.one_plus_z, warp_map.visibility)
    FORMAT.write(path, planes, warp_map.metadata)


def read_warp_map(path: PathLike) -> WarpMap:
    """Read a warp map and check its format, its parameters, and the checksum and ranges of its pixels.

    Parameters
    ----------
    path : path

    Returns
    -------
    WarpMap
        float32 images of shape (height, width), row 0 at the top, and the metadata.

    Raises
    ------
    WarpMapError
        If the file is missing, damaged, cut short, or not a warp map; the message names it and says which.
    """
    (theta, phi, one_plus_z, visibility), metadata = FORMAT.read(path)
    _check_ranges(path, theta, phi, one_plus_z, visibility)
    return WarpMap(theta, phi, one_plus_z, visibility, metadata)


def read_warp_map_metadata(path: PathLike) -> dict[str, Any]:
    """Read a warp map's metadata from its header, without its pixels.

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
        If the file is missing, its header is damaged, or it is not a warp map.
    """
    return FORMAT.read_metadata(path)


def _check_ranges(path: PathLike, *planes: NDArray[np.float32]) -> None:
    theta, phi, one_plus_z, visibility = planes
    fits = (
        np.isfinite(one_plus_z).all()
        and (one_plus_z != 0.0).all()
        and ((theta >= 0.0) & (theta <= np.float32(math.pi))).all()
        and ((phi >= 0.0) & (phi < np.float32(2.0 * math.pi))).all()
        and ((visibility >= 0.0) & (visibility <= 1.0)).all()
    )
    if not fits:
        raise WarpMapError(
            advice(f"{Path(path)} is damaged: it holds values that no warp map has."), code="map.damaged"
        )
