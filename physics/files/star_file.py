# SPDX-License-Identifier: GPL-3.0-or-later
"""The file format of star layers: like a warp map's, beside it, of the picture's own size."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..images.exr import PathLike
from ..numerics.errors import BlackHoleError, WarpMapError
from ..stars.star_layer import StarLayer
from ..stars.star_settings import StarParameters, StarSettings, star_hash
from .companion import path_beside
from .map_file import MapFormat, advice, made_from_view


def _is_made_from(metadata: Mapping[str, Any], wanted: StarParameters) -> bool:
    """Return whether a file was made from these parameters by this version, but for noise."""
    settings = _settings(metadata["umbraStars"])
    return (
        settings is not None
        and metadata["umbraLayer"] == star_hash(metadata["hash"], settings)
        and made_from_view(metadata, wanted.view)
        and wanted.agrees_with(settings.to_metadata())
    )


FORMAT = MapFormat(
    "umbra stars",
    2,
    "a layer of stars",
    "R, G, B: linear Rec. 709 radiance of stars, to be added to the sky; A: 1",
    attributes=("umbraStars", "umbraLayer"),
    is_made_from=_is_made_from,
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
    known_by = star_hash(layer.metadata["hash"], StarSettings.from_metadata(layer.metadata["stars"]))
    FORMAT.write(path, (*planes, np.ones_like(planes[0])), layer.metadata, (settings, known_by))


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
    whole = settings is not None and metadata.pop("umbraLayer") == star_hash(metadata["hash"], settings)
    if settings is None or not whole or not np.isfinite(image).all() or image.min(initial=0.0) < 0.0:
        raise WarpMapError(advice(f"{path} is damaged: it holds values that no stars have."), code="map.damaged")
    return StarLayer(image, {**metadata, "stars": settings.to_metadata()})


def _settings(text: str) -> StarSettings | None:
    try:
        return StarSettings.from_metadata(json.loads(text))
    except (BlackHoleError, TypeError, ValueError, KeyError, RecursionError):
        return None
