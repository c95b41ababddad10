# SPDX-License-Identifier: GPL-3.0-or-later
"""What a map knows of one image of the disk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..numerics.arrays import Image


@dataclass(frozen=True)
class DiskPass:
    """One crossing of the equatorial plane; images of shape (height, width), row 0 at the top of the picture.

    Where `coverage` is 0 the others are 0 and mean nothing. Passes lie in front of one another in the order of the
    crossings, the first in front, and all of them in front of the sky.
    """

    radius: Image
    """Boyer-Lindquist radius in the covered part of the pixel, units of M."""
    phi: Image
    """Azimuth there in the hole's frame, about its spin axis, radians in [0, 2 pi)."""
    g: Image
    """nu_camera / nu_matter there; below 1 is redshift."""
    coverage: Image
    """Share of the pixel that the disk covers at this crossing, 0 to 1."""
    metadata: dict[str, Any]
    """``hash``, ``counts``, ``parameters`` as of the warp map, and ``crossing``, counted from 1."""
