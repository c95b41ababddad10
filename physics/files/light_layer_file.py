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
from ..shot.map_parameters import WarpMapParameters
from .companion import path_beside
from .map_file import MapFormat, advice, made_from_view


def _is_made_from(metadata: Mapping[str, Any], wanted: LightParameters) -> bool:
    """Return whether a file was made from these parameters by this version, but for noise."""
    if not made_from_view(metadata, wanted.view):
        return False
    made = _made_from(metadata)
    return made is not None and wanted.agrees_with({"look": asdict(made.look), "time": made.time})


def _made_from(metadata: Mapping[str, Any]) -> LightParameters | None:
    """Return what a header says its layer is made from, or None if it is not one of this version, or damaged."""
    try:
        view = WarpMapParameters.from_metadata(metadata["parameters"])
        made = LightParameters(view, MatterLook(**json.loads(metadata["umbraLook"])), float(metadata["umbraTime"]))
        made.look.validate()
    except (BlackHoleError, TypeError, ValueError):
        return None
    return made if metadata["umbraLayer"] == layer_hash(metadata["hash"], made.look, made.time) else None


FORMAT = MapFormat(
    "umbra light",
    1,
    "a layer of light",
    "R, G, B: light of the disk, linear Rec. 709, premultiplied; A: opacity, 1 less what passes of the light behind",
    attributes=("umbraLook", "umbraTime", "umbraLayer"),
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
    planes = (*(np.ascontiguousarray(layer.light[..., channel]) for channel in range(3)), layer.opacity)
    further = json.dumps(own["look"]), repr(own["time"]), own["layer_hash"]
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
    (red, green, blue, opacity), metadata = FORMAT.read(path)
    made = _made_from(metadata)
    light = np.stack([red, green, blue], axis=-1).astype(np.float32)
    fits = np.isfinite(light).all() and (light >= 0.0).all() and ((opacity >= 0.0) & (opacity <= 1.0)).all()
    if not fits or made is None:
        raise WarpMapError(
            advice(f"{path} is damaged: it holds values that no layer of light has."), code="map.damaged"
        )
    own = {name: value for name, value in metadata.items() if name not in FORMAT.attributes}
    own |= {"look": asdict(made.look), "time": made.time, "layer_hash": metadata["umbraLayer"]}
    return LightLayer(light, opacity.astype(np.float32), own)
