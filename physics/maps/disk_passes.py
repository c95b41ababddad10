# SPDX-License-Identifier: GPL-3.0-or-later
"""The passes of a disk alone, without the sky behind it."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

from ..disk_passes.disk_painting import DiskPainting
from ..disk_passes.disk_pass import DiskPass
from ..numerics.errors import BlackHoleError
from ..sampling.view import View
from ..shot.map_parameters import WarpMapParameters
from .sharing import turn_between, turned_pass
from .warp_map import WarpMap


@dataclass(frozen=True)
class DiskPasses:
    """All images of a disk in one picture."""

    images: tuple[DiskPass, ...]
    """The first crossing first."""
    unresolved: int
    """Pixels in which the disk could not be resolved, and is missing."""

    @classmethod
    def of(cls, warp_map: WarpMap) -> DiskPasses:
        """Return the passes that were baked along with a map."""
        return cls(warp_map.disk_passes, warp_map.counts.get("disk_unresolved", 0))


def disk_pass_steps(parameters: WarpMapParameters) -> Generator[float, None, DiskPasses]:
    """Trace the passes of a disk step by step.

    Parameters
    ----------
    parameters : WarpMapParameters
        With a disk.

    Yields
    ------
    float
        The fraction done, 0 to 1, after each block of rays.

    Raises
    ------
    BlackHoleError
        Before the first step, if there is no disk, or no map can be made from these parameters.
    """
    parameters.validate()
    if parameters.disk is None:
        raise BlackHoleError("There is no disk; give the parameters one.", code="map.no-disk")
    painting = DiskPainting(parameters, View(parameters))
    yield from painting.steps()
    metadata: dict[str, Any] = {"hash": parameters.hash, "parameters": parameters.to_metadata()}
    counts = {**painting.counts(), "unresolved": 0}
    return DiskPasses(painting.passes({**metadata, "counts": counts}), counts["disk_unresolved"])


def turned_passes(earlier: DiskPasses, before: WarpMapParameters, after: WarpMapParameters) -> DiskPasses | None:
    """Return the passes of a frame made from those of an earlier one, or None where that is not possible.

    Parameters
    ----------
    earlier : DiskPasses
    before, after : WarpMapParameters
        What the earlier ones, and the new ones, are made from; see `turn_between`.
    """
    azimuth = turn_between(before, after)
    if azimuth is None:
        return None
    own = {"hash": after.hash, "parameters": after.to_metadata()}
    images = tuple(turned_pass(each, azimuth, {**each.metadata, **own}) for each in earlier.images)
    return DiskPasses(images, earlier.unresolved)
