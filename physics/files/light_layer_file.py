# SPDX-License-Identifier: GPL-3.0-or-later
"""The file format of layers of light: like a warp map's, beside it. See docs/disk.md."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ..images.exr import PathLike
from ..light.matter_settings import MatterLook
from ..matter.light_layer import LightLayer, LightParameters, layer_hash
from ..numerics.errors import BlackHoleError, WarpMapError
from .companion import path_beside
from .map_file import MapFormat, advice, made_from_view


def _is_made_from(metadata: Mapping[str, Any], wanted: LightParameters) -> bool:
    """Return whether a file was made from these parameters by this version, but for noise."""
    made = _look_of(metadata)
    return made is not None and made_from_view(metadata, wanted.view) and wanted.agrees_with(made)


def _look_of(metadata: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return what a header says of a layer besides its view, or None if it is not one of this version, or damaged."""
    try:
        look, time = MatterLook(**json.loads(metadata["umbraLook"])), float(metadata["umbraTime"])
        look.validate()
    except (BlackHoleError, TypeError, ValueError, RecursionError):
        return None
    picture, stated = metadata["umbraPicture"], metadata["umbraLayer"]
    if stated != layer_hash(metadata["hash"], look, time, picture):
        return None
    return {"look": asdict(look), "time": time, "picture": picture, "layer_hash": stated}


FORMAT = MapFormat(
    "umbra light",
    2,
    "a layer of light",
    "R, G, B: light of the disk, linear Rec. 709, premultiplied; A: share of the light behind that passes",
    attributes=("umbraLook", "umbraTime", "umbraPicture", "umbraLayer"),
    is_made_from=_is_made_from,
)


def light_layer_path(map_path: PathLike) -> str:
    """Return where a map's layer of light lies: beside it, with _light in its name.

    Parameters
    ----------
    map_path : path
        The map's; also one that only Blender understands, such as ``//maps/Scene_0001.exr``.

    Returns
    -------
    str
        ``Scene_light_0001.exr`` for ``Scene_0001.exr``; ``picture_light.exr`` for ``picture.exr``.
    """
    return path_beside(map_path, "light")


def write_light_layer(path: PathLike, layer: LightLayer) -> None:
    """Write a layer to an EXR file in single precision, completely or not at all.

    Parameters
    ----------
    path : path
        Its folder is made if need be; an existing file is replaced.
    layer : LightLayer

    Raises
    ------
    ImageFileError
        If the file cannot be written.
    """
    own = layer.metadata
    planes = (*(np.ascontiguousarray(layer.light[..., channel]) for channel in range(3)), layer.transmittance)
    further = json.dumps(own["look"]), repr(own["time"]), own["picture"], own["layer_hash"]
    FORMAT.write(path, planes, own, further)


def read_light_layer(path: PathLike) -> LightLayer:
    """Read a layer and check its format, what it is made from, and the checksum and ranges of its pixels.

    Parameters
    ----------
    path : path

    Returns
    -------
    LightLayer

    Raises
    ------
    WarpMapError
        If the file is missing, damaged, cut short, or not a layer of light; the message names it and says which.
    """
    (red, green, blue, transmittance), metadata = FORMAT.read(path)
    made = _look_of(metadata)
    light = np.stack([red, green, blue], axis=-1).astype(np.float32)
    fits = np.isfinite(light).all() and (light >= 0.0).all() and ((transmittance > 0.0) & (transmittance <= 1.0)).all()
    if not fits or made is None:
        raise WarpMapError(
            advice(f"{path} is damaged: it holds values that no layer of light has."), code="map.damaged"
        )
    own = {name: value for name, value in metadata.items() if name not in FORMAT.attributes}
    return LightLayer(light, transmittance.astype(np.float32), own | made)
