# SPDX-License-Identifier: GPL-3.0-or-later
"""The warp map's file format: float32 RGBA OpenEXR with a header that says all about it. See docs in README."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import ImageFileError, WarpMapError
from .exr import PathLike, read_channels, read_exr_header, write_channels
from .warp_map import WarpMap

FORMAT = "umbra warp map"
FORMAT_VERSION = 1

CHANNELS = ("R", "G", "B", "A")
"""theta, phi, 1 + z and visibility."""

# Header attributes, all strings.
ATTRIBUTE_FORMAT = "umbraFormat"
ATTRIBUTE_HASH = "umbraHash"
ATTRIBUTE_COUNTS = "umbraCounts"
ATTRIBUTE_PARAMETERS = "umbraParameters"
ATTRIBUTE_CHECKSUM = "umbraChecksum"


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
    write_channels(
        path,
        dict(zip(CHANNELS, planes, strict=True)),
        {
            **map_header(f"{FORMAT} {FORMAT_VERSION}", warp_map.metadata, planes),
            "comments": "R, G: theta, phi of the light's origin in world axes (radians); B: 1 + z; A: sky visibility",
        },
    )


def map_header(stamp: str, metadata: Mapping[str, Any], planes: Sequence[NDArray[Any]]) -> dict[str, str]:
    """Return the header attributes of a map of any format: its stamp, what made it, and its pixels' checksum."""
    return {
        ATTRIBUTE_FORMAT: stamp,
        ATTRIBUTE_HASH: metadata["hash"],
        ATTRIBUTE_COUNTS: json.dumps(metadata["counts"]),
        ATTRIBUTE_PARAMETERS: json.dumps(metadata["parameters"]),
        ATTRIBUTE_CHECKSUM: _checksum(planes),
    }


def read_warp_map(path: PathLike) -> WarpMap:
    """Read a warp map and check it: its format, its parameters, its pixels' checksum and ranges.

    Returns
    -------
    WarpMap
        As it was written: float32 images of shape (height, width), row 0 at the top, and the metadata.

    Raises
    ------
    WarpMapError
        When the file is missing, damaged, cut short, or not a warp map; the message names it and says which.
    """
    (theta, phi, one_plus_z, visibility), metadata, _ = read_map(path, FORMAT, FORMAT_VERSION)
    _check_ranges(path, theta, phi, one_plus_z, visibility)
    return WarpMap(theta, phi, one_plus_z, visibility, metadata)


def read_map(
    path: PathLike, kind: str, version: int
) -> tuple[list[NDArray[np.float32]], dict[str, Any], dict[str, Any]]:
    """Read a map of any format: its four channels, found to be as they were written, its metadata, and its header.

    Raises
    ------
    WarpMapError
        When the file is missing, damaged, cut short, or of another format or version.
    """
    try:
        channels, header = read_channels(path)
    except ImageFileError as error:
        raise WarpMapError(_advice(str(error))) from error
    metadata = map_metadata(path, header, kind, version)
    planes = [channels[name] for name in CHANNELS if name in channels]
    if len(planes) != len(CHANNELS) or _checksum(planes) != header.get(ATTRIBUTE_CHECKSUM):
        raise WarpMapError(_advice(f"{path} is damaged: its pixels are not those that were written."))
    return planes, metadata, header


def read_warp_map_metadata(path: PathLike) -> dict[str, Any]:
    """Read a warp map's metadata from its header alone, without its pixels.

    Raises
    ------
    WarpMapError
        When the file is missing, its header is damaged, or it is not a warp map.
    """
    try:
        header = read_exr_header(path)
    except ImageFileError as error:
        raise WarpMapError(_advice(str(error))) from error
    return map_metadata(path, header, FORMAT, FORMAT_VERSION)


def map_metadata(path: PathLike, header: Mapping[str, Any], kind: str, version: int) -> dict[str, Any]:
    """Return the metadata in the header of a map of the format `kind`, which is "umbra" and what it is called.

    Raises
    ------
    WarpMapError
        For a header of another format or version, or one that cannot be read.
    """
    stamp, noun = header.get(ATTRIBUTE_FORMAT), kind.removeprefix("umbra ")
    if not isinstance(stamp, str) or not stamp.startswith(kind + " "):
        raise WarpMapError(_advice(f"{Path(path)} is not a {noun}."))
    if stamp != f"{kind} {version}":
        raise WarpMapError(_advice(f"{Path(path)} is a {noun} of another version ({stamp})."))
    try:
        parameters = json.loads(header[ATTRIBUTE_PARAMETERS])
        counts = json.loads(header[ATTRIBUTE_COUNTS])
        expected = [
            parameters["camera"][side] * parameters["supersampling"] for side in ("width", "height")
        ]
        metadata = {"format": stamp, "hash": str(header[ATTRIBUTE_HASH]), "counts": counts, "parameters": parameters}
    except (KeyError, TypeError, ValueError) as error:
        raise WarpMapError(_advice(f"{Path(path)} is damaged: its header cannot be read.")) from error
    if list(header["size"]) != expected:
        raise WarpMapError(_advice(f"{Path(path)} is damaged: its size is not that of its parameters."))
    return metadata


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
        raise WarpMapError(_advice(f"{Path(path)} is damaged: it holds values that no warp map has."))


def _checksum(planes: Sequence[NDArray[Any]]) -> str:
    """Return the CRC-32 of the channels' bytes, one after another."""
    value = 0
    for plane in planes:
        value = zlib.crc32(np.ascontiguousarray(plane, dtype="<f4").data, value)
    return f"crc32 {value:08x}"


def _advice(sentence: str) -> str:
    return f"{sentence.removesuffix('.')}; bake it again."
