# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said about the accuracy of a map, as numbers and in words."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

ARC_SECONDS = math.degrees(1.0) * 3600.0


@dataclass(frozen=True)
class DiskAccuracy:
    """How far one pass of a disk is from the reference."""

    crossing: int
    """Which pass, counted from 1."""
    compared: int
    """Sampled pixels that the disk covers whole: place and g were compared there."""
    radius: float
    """Largest error of the radius, relative."""
    azimuth: float
    """Largest error of the azimuth on the disk, radians."""
    g: float
    """Largest error of g, relative."""
    differing: int
    """Samples whose center the reference sees on the disk and the pass has no part of the disk, or the reverse."""
    reference_unresolved: int
    """Samples that the reference itself gave up."""


@dataclass(frozen=True)
class AccuracyReport:
    """How far a baked map is from the reference; angles in radians."""

    map: str
    """Name of the file."""
    hash: str
    """Hash of what the map was made from."""
    size: tuple[int, int]
    """Width and height of the map in pixels."""
    samples: int
    """Pixels that were looked at."""
    compared: int
    """Of these, pixels of nothing but sky, whose directions were compared."""
    environment_width: int
    """Width of the environment's picture, in units of whose pixels errors are told."""
    worst: float
    """Largest error of direction."""
    worst_pixel: tuple[int, int] | None
    """Column and row where that is, from the top left; None where nothing was compared."""
    percentile_999: float
    """Error of direction that 99.9 % of the evenly spread samples stay below."""
    median: float
    """Median error of direction of the evenly spread samples."""
    redshift: float
    """Largest error of 1 + z, relative."""
    visibility: float
    """Largest error of the share of a pixel that sees the sky."""
    differing: int
    """Samples whose visible share is wrong by more than a level of 8 bits: sky for shadow, shadow for sky, or a
    displaced edge."""
    differing_pixel: tuple[int, int] | None
    """Column and row of the worst of these."""
    unresolved: int
    """Pixels of the whole map that were given up when it was baked: they show magenta."""
    reference_unresolved: int
    """Samples that the reference itself gave up: nothing is said about their directions."""
    impact: float | None = None
    """Of an exit map, largest error of the impact vector, units of M."""
    disk: tuple[DiskAccuracy, ...] = ()
    """Of each pass of a disk."""

    @property
    def worst_arc_seconds(self) -> float:
        """Largest error of direction in arc seconds."""
        return self.worst * ARC_SECONDS

    @property
    def percentile_999_arc_seconds(self) -> float:
        """Error of direction that 99.9 % of the picture stays below, in arc seconds."""
        return self.percentile_999 * ARC_SECONDS

    @property
    def worst_environment_pixels(self) -> float:
        """Largest error of direction in pixels of the environment, at the middle of its height."""
        return self.worst * self.environment_width / (2.0 * math.pi)

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain JSON values."""
        return {
            **asdict(self),
            "worst_arc_seconds": self.worst_arc_seconds,
            "percentile_999_arc_seconds": self.percentile_999_arc_seconds,
            "worst_environment_pixels": self.worst_environment_pixels,
        }

    def sentences(self) -> list[str]:
        """Return the report as sentences, the most important first."""
        pixels = f"{self.samples} of its {self.size[0] * self.size[1]} pixels"
        found = []
        if self.worst_pixel:
            found += [
                f"The worst error of direction is {self.worst_arc_seconds:.3g} arc seconds, "
                f"{self.worst_environment_pixels:.2g} pixels of an environment {self.environment_width} pixels wide, "
                f"at column {self.worst_pixel[0]}, row {self.worst_pixel[1]}.",
                f"99.9 % of the picture is better than {self.percentile_999_arc_seconds:.3g} arc seconds.",
                f"The redshift 1 + z is right to {self.redshift:.2g}.",
            ]
        else:
            found.append("None of them is nothing but sky, so that there is no direction to compare.")
        if self.impact is not None:
            found.append(f"The impact vector is right to {self.impact:.2g} M.")
        if self.differing and self.differing_pixel:
            column, row = self.differing_pixel
            found.append(
                f"{_pixels(self.differing)} wrong in what can be seen of the sky, the worst by {self.visibility:.2g} "
                f"at column {column}, row {row}: bake this map again."
            )
        else:
            found.append(f"Sky and shadow are right everywhere, the edge to {self.visibility:.2g} of a pixel.")
        if self.unresolved:
            found.append(f"{_pixels(self.unresolved)} unresolved and magenta; choose the method gauss-legendre.")
        if self.reference_unresolved:
            found.append(f"{_pixels(self.reference_unresolved)} too close to the edge for the reference to judge.")
        for one in self.disk:
            found.append(
                f"Disk, image {one.crossing}: radius right to {one.radius:.2g}, azimuth to "
                f"{one.azimuth * ARC_SECONDS:.3g} arc seconds, g to {one.g:.2g} in {one.compared} pixels"
                + (f"; {_pixels(one.differing)} wrong about where it is." if one.differing else ".")
                + (f" {_pixels(one.reference_unresolved)} beyond its reference." if one.reference_unresolved else "")
            )
        return [f"{self.map} was compared with the reference method in {pixels}.", *found]

    def text(self) -> str:
        """Return the report as one paragraph."""
        return " ".join(self.sentences())


def _pixels(count: int) -> str:
    return "1 pixel is" if count == 1 else f"{count} pixels are"
