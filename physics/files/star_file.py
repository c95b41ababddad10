# SPDX-License-Identifier: GPL-3.0-or-later
"""The file format of star layers: like a warp map's, beside it, of the picture's own size."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ..images.exr import PathLike
from ..numerics.errors import WarpMapError
from ..stars.star_layer import StarLayer
from .companion import path_beside
from .map_file import MapFormat, advice

FORMAT = MapFormat(
    "umbra stars",
    1,
    "a layer of stars",
    "R, G, B: linear Rec. 709 radiance of stars, to be added to the sky; A: 0",
    attributes=("umbraStars",),
)


def stars_path(map_path: PathLike) -> str:
    """Return where a map's stars lie: beside it, with _stars in its name.

    Parameters
    ----------
    map_path : path
        The map's; also one that only Blender understands, such as ``//maps/Scene_0001.exr``.

    Returns
    -------
    str
        ``Scene_stars_0001.exr`` for ``Scene_0001.exr``; ``picture_stars.exr`` for ``picture.exr``.
    """
    return path_beside(map_path, "stars")


def write_stars(path: PathLike, layer: StarLayer) -> None:
    """Write a layer of stars to an EXR file, completely or not at all.

    Parameters
    ----------
    path : path
        Its folder is made if need be; an existing file is replaced.
    layer : StarLayer

    Raises
    ------
    ImageFileError
        If the file cannot be written.
    """
    planes = [np.ascontiguousarray(layer.image[..., channel]) for channel in range(3)]
    settings = json.dumps(layer.metadata["stars"], sort_keys=True)
    FORMAT.write(path, (*planes, np.zeros_like(planes[0])), layer.metadata, (settings,))


def read_stars(path: PathLike) -> StarLayer:
    """Read a layer of stars and check its format, its parameters, and the checksum and ranges of its pixels.

    Parameters
    ----------
    path : path

    Returns
    -------
    StarLayer

    Raises
    ------
    WarpMapError
        If the file is missing, damaged, cut short, or not a layer of stars; the message names it and says which.
    """
    planes, metadata = FORMAT.read(path)
    image = np.stack(planes[:3], axis=-1).astype(np.float32)
    settings = _settings(metadata.pop("umbraStars"))
    if settings is None or not np.isfinite(image).all() or image.min(initial=0.0) < 0.0:
        raise WarpMapError(advice(f"{path} is damaged: it holds values that no stars have."), code="map.damaged")
    return StarLayer(image, {**metadata, "stars": settings})


def _settings(text: str) -> dict[str, Any] | None:
    try:
        settings = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return settings if isinstance(settings, dict) else None
