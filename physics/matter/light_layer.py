# SPDX-License-Identifier: GPL-3.0-or-later
"""One frame's light of matter, as a layer that is laid over the sky."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Generator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..kerr.metric import metric_functions
from ..kerr.observer import Observer
from ..light.matter_settings import MatterLook
from ..maps.disk_passes import DiskPasses, disk_pass_steps, turned_passes
from ..numerics.arrays import Image
from ..numerics.checks import finite
from ..numerics.errors import BlackHoleError
from ..numerics.work import drain, share_of
from ..sampling.view import View
from ..shot.identity import alike
from ..shot.map_parameters import WarpMapParameters
from .delays import delays
from .picture import Picture
from .surface import Surface
from .thick_layer import thick_layer_steps
from .thin_layer import thin_layer

LAYER_VERSION = 4
"""Raised whenever the same parameters and look would give other light."""

LEAST_TRANSMITTANCE = 1e-6
"""Less is taken for this: 0 is left to files that are missing, which a compositor reads as 0 everywhere."""

LATEST = 1e12
"""Beyond this time, units of M, float64 does not tell the phases of orbits."""


@dataclass(frozen=True)
class LightParameters:
    """What a layer of light is made from.

    Parameters
    ----------
    view : WarpMapParameters
        With a disk.
    look : MatterLook
    time : float
        Coordinate time, that of clocks far away, at which the camera takes the picture; units of M. See `clock_rate`.
    picture : Picture, optional
        That the disk shows in place of its turbulence.
    """

    view: WarpMapParameters
    look: MatterLook
    time: float = 0.0
    picture: Picture | None = None

    def validate(self) -> None:
        """Raise BlackHoleError, with a sentence for the user, when no layer can be made from these parameters."""
        self.view.validate()
        self.look.validate()
        check_time(self.time)
        if self.view.disk is None:
            raise BlackHoleError("The map was baked without a disk; bake it again with one.", code="map.no-disk")

    @property
    def map_size(self) -> tuple[int, int]:
        """Width and height of the layer in pixels."""
        return self.view.map_size

    @property
    def hash(self) -> str:
        """SHA-256, in hexadecimal, of the view, the look, the time and the version of what is made from them."""
        return layer_hash(self.view.hash, self.look, self.time, self.digest)

    @property
    def digest(self) -> str:
        """What the picture is known by; empty without one."""
        return "" if self.picture is None else self.picture.digest

    def agrees_with(self, made: Mapping[str, Any]) -> bool:
        """Return whether ``look``, ``time`` and ``picture`` of a layer's metadata are these but for noise."""
        own = {"look": asdict(self.look), "time": float(self.time), "picture": self.digest}
        return alike({name: made[name] for name in own}, own)


@dataclass(frozen=True)
class LightLayer:
    """The light of a frame's matter."""

    light: Image
    """Premultiplied linear Rec. 709, shape (height, width, 3), row 0 at the top."""
    transmittance: Image
    """Share of the light behind that passes, shape (height, width), `LEAST_TRANSMITTANCE` to 1."""
    metadata: dict[str, Any]
    """``hash`` and ``parameters`` as of a warp map of the same view, ``counts``, ``look``, ``time``, ``picture`` and
    ``layer_hash``."""

    @property
    def counts(self) -> dict[str, int]:
        """Pixels by what they see: ``covered``, and ``unresolved``: pixels in which some of the light is missing."""
        counts: dict[str, int] = self.metadata["counts"]
        return counts


def render_matter(parameters: LightParameters, passes: DiskPasses | None = None) -> LightLayer:
    """Render the light of a disk.

    Parameters
    ----------
    parameters : LightParameters
    passes : DiskPasses, optional
        Of its view, if they are there already; a thick layer needs none.

    Raises
    ------
    BlackHoleError
        If no layer can be made from these parameters.
    """
    return drain(light_steps(parameters, passes))


def light_steps(parameters: LightParameters, passes: DiskPasses | None = None) -> Generator[float, None, LightLayer]:
    """Render the light of a disk step by step; see `render_matter`.

    Yields
    ------
    float
        The fraction done, 0 to 1.

    Notes
    -----
    For each crossing in turn, front to back, with T = 1 at first: ``light += T alpha emission``, ``T *= 1 - alpha``
    (Chandrasekhar 1960, Radiative Transfer, ch. I, for layers one behind the other).
    """
    parameters.validate()
    shot, look, time = parameters.view, parameters.look, float(parameters.time)
    assert shot.disk is not None
    view, surface = View(shot), Surface(look, shot.disk, shot.spin, parameters.picture)
    if look.thickness > 0.0:
        layer, unresolved = yield from thick_layer_steps(surface, view, shot.map_size, shot.disk, shot.spin, time)
        return _finished(layer, parameters, unresolved)
    if passes is None:
        passes = yield from share_of(disk_pass_steps(shot), 0.0, 0.5)
    late = None
    if look.light_travel > 0.0:
        travel = delays(passes.images, view, shot)
        # The mean goes with the time, in float64; what is left is small.
        covered = passes.images[0].coverage > 0.0
        mean = float(travel[0][covered].mean()) if covered.any() else 0.0
        late = [np.float32(look.light_travel) * (each - np.float32(mean)) for each in travel]
        time -= look.light_travel * mean
    yield 0.6
    layer = thin_layer(surface, passes.images, view, time, late)
    return _finished(layer, parameters, passes.unresolved)


def _finished(layer: Image, parameters: LightParameters, unresolved: int) -> LightLayer:
    """Return light and what passes, shape (height, width, 4), as a layer with what it is known by."""
    transmittance = np.clip(layer[..., 3], np.float32(LEAST_TRANSMITTANCE), np.float32(1.0))
    view = parameters.view
    own = {
        "hash": view.hash,
        "counts": {"covered": int(np.count_nonzero(transmittance < 1.0)), "unresolved": unresolved},
        "parameters": view.to_metadata(),
        "look": asdict(parameters.look),
        "time": float(parameters.time),
        "picture": parameters.digest,
        "layer_hash": parameters.hash,
    }
    return LightLayer(np.ascontiguousarray(layer[..., :3]), transmittance, own)


class LightBaker:
    """Renders the layers of a shot one after another, and traces once what they have in common.

    Frames of one place share all of the geometry; those of which only the azimuth differs, as on an orbit with the
    camera tracking the hole, share it but for the azimuth. Another look, or another time, traces nothing.
    """

    def __init__(self) -> None:
        self._shot: WarpMapParameters | None = None
        self._passes: DiskPasses | None = None

    def steps(self, parameters: LightParameters) -> Generator[float, None, LightLayer]:
        """Render one layer step by step; see `light_steps`."""
        parameters.validate()
        if parameters.look.thickness > 0.0:
            return (yield from light_steps(parameters))
        passes, share = None, 0.0
        if self._shot is not None and self._passes is not None:
            passes = turned_passes(self._passes, self._shot, parameters.view)
        if passes is None:
            share = 0.5
            passes = yield from share_of(disk_pass_steps(parameters.view), 0.0, share)
            self._shot, self._passes = parameters.view, passes
        return (yield from share_of(light_steps(parameters, passes), share, 1.0))


def layer_hash(map_hash: str, look: MatterLook, time: float, picture: str = "") -> str:
    """Return what a layer is known by: SHA-256 of its map's hash, look, time and picture, in hexadecimal."""
    known = {"version": LAYER_VERSION, "map": map_hash, "look": asdict(look), "time": float(time), "picture": picture}
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
