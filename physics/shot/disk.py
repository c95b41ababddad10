# SPDX-License-Identifier: GPL-3.0-or-later
"""A thin disk of matter in the equatorial plane, as part of what a map is made from."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..geodesics.disk_tracer import DEFAULT_CROSSINGS, check_disk_settings
from ..kerr.metric import horizon_radius, isco_radius
from ..numerics.checks import number, switch, whole
from ..numerics.errors import BlackHoleError

DEFAULT_OUTER_RADIUS = 20.0
LARGEST_OUTER_RADIUS = 1e6

# Matter next to the horizon is redshifted out of sight, and its azimuth winds without end.
CLOSEST_TO_HORIZON = 1.001


@dataclass(frozen=True)
class Disk:
    """A disk between two radii.

    Parameters
    ----------
    crossings : int
        How many images of it are followed, 1 to 8: 1 is the direct image alone, each further one lies closer to
        the shadow's edge and is thinner by some 20 times.
    inner_radius : float or None
        Units of M; None is the innermost stable orbit. Inside of that, matter falls.
    outer_radius : float
        Units of M.
    retrograde : bool
        Whether it turns against the hole.
    """

    crossings: int = DEFAULT_CROSSINGS
    inner_radius: float | None = None
    outer_radius: float = DEFAULT_OUTER_RADIUS
    retrograde: bool = False

    def __post_init__(self) -> None:
        inner = self.inner_radius
        object.__setattr__(self, "crossings", whole(self.crossings, "the number of crossings"))
        object.__setattr__(self, "inner_radius", None if inner is None else number(inner, "the disk's inner radius"))
        object.__setattr__(self, "outer_radius", number(self.outer_radius, "the disk's outer radius"))
        object.__setattr__(self, "retrograde", switch(self.retrograde, "whether the disk is retrograde"))

    def radii(self, spin: float) -> tuple[float, float]:
        """Return the inner and the outer radius around a hole of this spin, units of M."""
        inner = self.inner_radius
        return isco_radius(spin, prograde=not self.retrograde) if inner is None else inner, self.outer_radius

    def validate(self, spin: float, method: str) -> None:
        """Raise BlackHoleError, with a sentence for the user, when there can be no such disk."""
        check_disk_settings(self.crossings, method)
        inner, outer = self.radii(spin)
        closest = CLOSEST_TO_HORIZON * horizon_radius(spin)
        if not (math.isfinite(inner) and inner >= closest):
            raise BlackHoleError(
                f"The disk's inner radius is {inner:.4g} M; the horizon of this hole allows {closest:.4g} M at the "
                f"least.",
                code="disk.radius",
            )
        if not inner < outer <= LARGEST_OUTER_RADIUS:
            raise BlackHoleError(
                f"The disk's outer radius is {outer:.4g} M; it must be larger than the inner one, {inner:.4g} M, and "
                f"at most {LARGEST_OUTER_RADIUS:g} M.",
                code="disk.radius",
            )
