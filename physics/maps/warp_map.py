# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp maps: for each pixel, where in the sky its light comes from, how far it is shifted, and how much is seen."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

from ..disk_passes.disk_painting import DiskPainting
from ..disk_passes.disk_pass import DiskPass
from ..numerics.arrays import Image
from ..numerics.work import Cancel, Progress, drain, share_of
from ..sampling.view import View
from ..shot.map_parameters import WarpMapParameters
from .painting import Painting


@dataclass(frozen=True)
class WarpMap:
    """A warp map in memory; images of shape (height, width), row 0 at the top of the picture."""

    theta: Image
    """Angle from the world's z axis of the direction the light comes from, radians, [0, pi]."""
    phi: Image
    """Azimuth of that direction about the world's z axis, from x, radians, [0, 2 pi)."""
    one_plus_z: Image
    """f_source / f_camera for a source at rest at infinity; > 1 is redshift; never 0."""
    visibility: Image
    """Share of the pixel that sees the sky, 0 to 1."""
    metadata: dict[str, Any]
    """What the file's header says: ``format``, ``hash``, ``counts`` and ``parameters``."""
    disk_passes: tuple[DiskPass, ...] = ()
    """The disk's images, the first crossing first, where it was baked with a disk; they have files of their own."""

    @property
    def counts(self) -> dict[str, int]:
        """Pixels by what they see: ``sky``, ``edge`` (partly), ``shadow``, ``unresolved``.

        And ``rays`` traced for them, and ``shared``: rays that were traced for an earlier map instead.
        """
        counts: dict[str, int] = self.metadata["counts"]
        return counts


def bake(parameters: WarpMapParameters, *, progress: Progress | None = None, cancel: Cancel | None = None) -> WarpMap:
    """Trace a warp map.

    Parameters
    ----------
    parameters : WarpMapParameters
    progress : callable, optional
        Called with the fraction done, 0 to 1, after each block of rays.
    cancel : callable, optional
        Called before each block; if it returns true, the work ends.

    Returns
    -------
    WarpMap
        With the passes of its disk, if it has one.

    Raises
    ------
    BlackHoleError
        If no map can be made from these parameters.
    Cancelled
        If `cancel` returned true.
    """
    return drain(bake_steps(parameters), progress, cancel)


def bake_steps(parameters: WarpMapParameters) -> Generator[float, None, WarpMap]:
    """Trace a warp map step by step.

    A step takes some tens of milliseconds, so that a window can be kept alive between two steps.

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
        With the passes of its disk, if it has one.

    Raises
    ------
    BlackHoleError
        Before the first step, if no map can be made from these parameters.
    """
    parameters.validate()
    view = View(parameters)
    painting = Painting(parameters, view)
    metadata: dict[str, Any] = {"hash": parameters.hash, "parameters": parameters.to_metadata()}
    if parameters.disk is None:
        yield from painting.steps()
        return WarpMap(*painting.planes, {**metadata, "counts": painting.counts()})
    yield from share_of(painting.steps(), 0.0, 0.5)
    disk = DiskPainting(parameters, view)
    yield from share_of(disk.steps(), 0.5, 1.0)
    metadata["counts"] = {**painting.counts(), **disk.counts()}
    return WarpMap(*painting.planes, metadata, disk.passes(metadata))
