# SPDX-License-Identifier: GPL-3.0-or-later
"""One frame's light of matter, as a layer that is laid over the sky."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..kerr.metric import metric_functions
from ..kerr.observer import Observer
from ..light.matter_settings import MatterLook
from ..maps.warp_map import WarpMap
from ..numerics.arrays import Image
from ..numerics.checks import finite
from ..numerics.errors import BlackHoleError
from ..sampling.view import View
from ..shot.map_parameters import WarpMapParameters
from .delays import delays
from .surface import Surface
from .thick_layer import thick_layer
from .thin_layer import thin_layer

LAYER_VERSION = 1
"""Raised whenever the same parameters and look would give other light."""

LATEST = 1e12
"""Beyond this time, units of M, float64 does not tell the phases of orbits."""


@dataclass(frozen=True)
class LightLayer:
    """The light of a frame's matter."""

    light: Image
    """Premultiplied linear Rec. 709, shape (height, width, 3), row 0 at the top."""
    opacity: Image
    """Share of the light behind that does not pass, shape (height, width), 0 to 1."""
    metadata: dict[str, Any]
    """``hash``, ``counts`` and ``parameters`` as of the warp map, and ``look``, ``time`` and ``layer_hash``."""


def render_matter(warp_map: WarpMap, look: MatterLook, time: float = 0.0) -> LightLayer:
    """Render the light of a map's disk.

    Parameters
    ----------
    warp_map : WarpMap
        With the passes of its disk.
    look : MatterLook
    time : float
        Coordinate time, that of clocks far away, at which the camera takes the picture; units of M. See `clock_rate`.

    Returns
    -------
    LightLayer

    Raises
    ------
    BlackHoleError
        If the map has no disk, a setting is out of its range, or the time is.

    Notes
    -----
    For each crossing in turn, front to back, with T = 1 at first: ``light += T alpha emission``, ``T *= 1 - alpha``
    (Chandrasekhar 1960, Radiative Transfer, ch. I, for layers one behind the other).
    """
    look.validate()
    time = check_time(time)
    parameters = WarpMapParameters.from_metadata(warp_map.metadata["parameters"])
    if parameters.disk is None or not warp_map.disk_passes:
        raise BlackHoleError("The map was baked without a disk; bake it again with one.", code="map.no-disk")
    asked = time
    view, surface = View(parameters), Surface(look, parameters.disk, parameters.spin)
    if look.thickness > 0.0:
        layer, unresolved = thick_layer(surface, view, parameters.map_size, parameters.disk, parameters.spin, time)
        counts = {**warp_map.metadata["counts"], "light_unresolved": unresolved}
        return finished(layer, {**warp_map.metadata, "counts": counts}, look, asked)
    late = None
    if look.light_travel > 0.0:
        travel = delays(warp_map.disk_passes, view, parameters)
        # The mean goes with the time, in float64; what is left is small.
        covered = warp_map.disk_passes[0].coverage > 0.0
        mean = float(travel[0][covered].mean()) if covered.any() else 0.0
        late = [np.float32(look.light_travel) * (each - np.float32(mean)) for each in travel]
        time -= look.light_travel * mean
    layer = thin_layer(surface, warp_map.disk_passes, view, time, late)
    return finished(layer, warp_map.metadata, look, asked)


def finished(layer: Image, metadata: dict[str, Any], look: MatterLook, time: float) -> LightLayer:
    """Return light and what passes, shape (height, width, 4), as a layer with what it is known by."""
    opacity = np.clip(np.float32(1.0) - layer[..., 3], np.float32(0.0), np.float32(1.0))
    known = {name: metadata[name] for name in ("hash", "counts", "parameters")}
    own = {**known, "look": dataclasses.asdict(look), "time": time}
    own["layer_hash"] = layer_hash(metadata["hash"], look, time)
    return LightLayer(np.ascontiguousarray(layer[..., :3]), opacity, own)


def layer_hash(map_hash: str, look: MatterLook, time: float) -> str:
    """Return what a layer is known by: SHA-256 of its map's hash, its look and its time, in hexadecimal."""
    known = {"version": LAYER_VERSION, "map": map_hash, "look": dataclasses.asdict(look), "time": float(time)}
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


def check_time(time: float) -> float:
    """Return a time as a float.

    Raises
    ------
    BlackHoleError
        If it is not a finite number of at most `LATEST`.
    """
    time = finite(time, "the time of the disk")
    if not abs(time) <= LATEST:
        raise BlackHoleError(
            f"The time of the disk is {time:g} M; give -{LATEST:g} to {LATEST:g} M.", code="disk.setting"
        )
    return time


def clock_rate(spin: float, observer: Observer) -> float:
    """Return how fast a camera's clock runs, seen by clocks far away.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    observer : Observer
        The camera.

    Returns
    -------
    float
        d tau / dt = alpha / gamma = 1 / u^t (Bardeen, Press & Teukolsky 1972, Eq. 2.4), 0 to 1: the time of matter, in
        coordinate time, passes 1 / rate times as fast as the camera's.
    """
    alpha = metric_functions(spin, observer.r, observer.theta).alpha
    return alpha * math.sqrt((1.0 - observer.beta) * (1.0 + observer.beta))
