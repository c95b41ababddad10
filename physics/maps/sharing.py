# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames that share their rays.

Space around the hole looks the same from every azimuth. When only the camera's azimuth changes from one frame to
the next, as on a circular orbit with the camera tracking the hole, or when hole and camera are turned together, each
pixel's ray is the same but for a rotation of the direction it comes from: one map serves all such frames. Frames of
other moves share nothing.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Generator

import numpy as np

from ..disk_passes.disk_pass import DiskPass
from ..numerics.angles import wrap_once
from ..numerics.arrays import Array
from ..numerics.sphere import celestial_coordinates, spherical_triad, unit_vectors
from ..shot.map_parameters import WarpMapParameters
from .warp_map import WarpMap, bake_steps

# Difference between cameras that counts as none, in pixels.
PIXEL_SHARE = 0.01


class MapBaker:
    """Bakes the maps of a shot one after another, and traces once what they have in common.

    A map is made from an earlier one by a rotation where `turned_map` allows it, and traced otherwise.
    """

    def __init__(self) -> None:
        self._traced: WarpMap | None = None

    def steps(self, parameters: WarpMapParameters) -> Generator[float, None, WarpMap]:
        """Bake one map step by step.

        Parameters
        ----------
        parameters : WarpMapParameters

        Yields
        ------
        float
            The fraction done, 0 to 1, after each block of rays.

        Returns
        -------
        WarpMap

        Raises
        ------
        BlackHoleError
            Before the first step, if no map can be made from these parameters.
        """
        if self._traced is not None:
            turned = turned_map(self._traced, parameters)
            if turned is not None:
                return turned
        self._traced = yield from bake_steps(parameters)
        return self._traced


def turned_map(earlier: WarpMap, parameters: WarpMapParameters) -> WarpMap | None:
    """Return the map of `parameters` made from an earlier one by a rotation, or None where that is not possible.

    Parameters
    ----------
    earlier : WarpMap
    parameters : WarpMapParameters
        Checked for validity by whoever made the earlier map: what differs cannot make them invalid.

    Returns
    -------
    WarpMap or None
        None where `turn_between` finds no turn. Directions are as good as the earlier map's, visibility and redshift
        are its own, and a disk's passes too but for their azimuth. To keep errors from adding up over many frames,
        always turn the same map.
    """
    before = WarpMapParameters.from_metadata(earlier.metadata["parameters"])
    azimuth = turn_between(before, parameters)
    if azimuth is None:
        return None
    about_axis = np.array(
        [
            [math.cos(azimuth), -math.sin(azimuth), 0.0],
            [math.sin(azimuth), math.cos(azimuth), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    rotation = np.array(parameters.hole_to_world) @ about_axis @ np.array(before.hole_to_world).T
    counts = {**earlier.counts, "rays": 0, "shared": earlier.counts["rays"] + earlier.counts.get("shared", 0)}
    metadata = {**earlier.metadata, "hash": parameters.hash, "counts": counts, "parameters": parameters.to_metadata()}
    turned = _rotated(earlier, rotation, metadata)
    passes = tuple(turned_pass(each, azimuth, metadata) for each in earlier.disk_passes)
    return dataclasses.replace(turned, disk_passes=passes)


def turn_between(before: WarpMapParameters, after: WarpMapParameters) -> float | None:
    """Return by how much the camera's azimuth is larger, radians, where nothing else tells two frames apart.

    Parameters
    ----------
    before, after : WarpMapParameters

    Returns
    -------
    float or None
        None unless everything but the azimuth and the hole's orientation agrees to within half of the
        interpolation error that the parameters allow, which for `interpolation` 0 means exactly, and to a hundredth of
        a pixel, so that a slow pan of a long lens is not taken for a standstill.
    """
    if _without_place(before) != _without_place(after):
        return None
    old, new = _Place(before), _Place(after)
    allowed = min(0.5 * after.interpolation, PIXEL_SHARE * after.pixel_angle)
    return new.phi - old.phi if old.sees_the_same_as(new, allowed) else None


def turned_pass(earlier: DiskPass, azimuth: float, metadata: dict[str, object]) -> DiskPass:
    """Return a disk's pass for a camera at another azimuth; only the azimuth on the disk changes.

    Parameters
    ----------
    earlier : DiskPass
    azimuth : float
        By how much the camera's azimuth is larger, radians.
    metadata : dict
        Of the new map.

    Returns
    -------
    DiskPass
    """
    seen = earlier.coverage > 0.0
    phi = earlier.phi.copy()
    phi[seen] = wrap_once((phi[seen].astype(np.float64) + azimuth) % (2.0 * math.pi))
    return dataclasses.replace(earlier, phi=phi, metadata={**metadata, "crossing": earlier.metadata["crossing"]})


def _without_place(parameters: WarpMapParameters) -> WarpMapParameters:
    """Return the parameters with all that `_Place` compares set to fixed values."""
    nowhere = ((0.0, 0.0, 0.0),) * 3
    return dataclasses.replace(
        parameters,
        camera_position=(0.0, 0.0, 0.0),
        velocity=(0.0, 0.0, 0.0),
        camera_to_hole=nowhere,
        hole_to_world=nowhere,
    )


class _Place:
    """Where the camera is, how it looks and how it moves, on the triad at its place."""

    def __init__(self, parameters: WarpMapParameters) -> None:
        x, y, z = parameters.camera_position
        self.phi = math.atan2(y, x)
        theta = math.atan2(math.hypot(x, y), z)
        triad = spherical_triad(theta, self.phi)
        turned = triad @ np.array(parameters.camera_to_hole)
        moving = triad @ np.array(parameters.velocity)
        self._numbers: Array = np.concatenate([[math.log(parameters.radius), theta], turned.ravel(), moving])

    def sees_the_same_as(self, other: _Place, tolerance: float) -> bool:
        return bool(np.abs(self._numbers - other._numbers).max() <= tolerance)


def _rotated(warp_map: WarpMap, rotation: Array, metadata: dict[str, object]) -> WarpMap:
    seen = warp_map.visibility > 0.0
    theta, phi = warp_map.theta.copy(), warp_map.phi.copy()
    turn = math.atan2(rotation[1, 0], rotation[0, 0])
    if np.abs(rotation[2] - [0.0, 0.0, 1.0]).max() < 1e-12:
        phi[seen] = wrap_once((phi[seen].astype(np.float64) + turn) % (2.0 * math.pi))
    else:
        turned_theta, turned_phi = celestial_coordinates(unit_vectors(theta[seen], phi[seen]) @ rotation.T)
        theta[seen], phi[seen] = turned_theta, wrap_once(turned_phi)
    return WarpMap(theta, phi, warp_map.one_plus_z, warp_map.visibility, metadata)
