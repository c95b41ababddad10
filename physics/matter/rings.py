# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigid rings: a pattern that turns with the disk for any length of time and never winds up.

ln r is cut into rings of one width. Each turns for ever as a whole, with Omega at its middle, and is a part of the
field of its own. Neighbors are blended by w / sqrt(sum w^2), which keeps the variance of independent fields.
"""

from __future__ import annotations

import math

import numpy as np

from ..kerr.metric import isco_radius
from ..kerr.orbiting_matter import orbital_frequency
from ..numerics.arrays import Image
from .rip_map import Complex, Levels, RipMap, Whole

FINE_WIDTH, COARSE_WIDTH = 0.085, 0.21
"""Widths of rings in ln r: narrower ones cut strands into hairs, wider ones turn less like matter."""


class TurningRings:
    """One field on the disk, turning."""

    def __init__(
        self, field: RipMap, width: float, spin: float, radii: tuple[float, float], seed: int, retrograde: bool = False
    ) -> None:
        """`radii`: of the disk's rims, units of M."""
        inner, outer = radii
        self.field, self._width = field, np.float32(width)
        self._first = math.log(inner) - 0.5 * width
        count = int((math.log(outer) - self._first) / width) + 4
        random = np.random.default_rng(seed)
        self._turned = random.random(count) * 2.0 * math.pi
        self._shifted = (random.random(count) * field.span).astype(np.float32)
        middles = np.exp(self._first + np.arange(count) * width)
        # Matter that falls in from the innermost stable orbit keeps about that orbit's frequency.
        middles = np.maximum(middles, min(isco_radius(spin, prograde=not retrograde), outer))
        self.omega = orbital_frequency(spin, middles, retrograde)

    def at(self, log_radius: Image, phi: Image, time: float, delay: Image | None, levels: Levels) -> Complex:
        """Return heat and density at places and a time, both Gaussian of variance 1 less what the levels have lost.

        `delay`: how much earlier each place is seen than at `time`, units of M; none if None.
        """
        turns = ((self._turned - self.omega * time) % (2.0 * math.pi)).astype(np.float32)
        share = (log_radius - np.float32(self._first)) * (np.float32(1.0) / self._width)
        ring = share.astype(np.int32)
        share -= ring
        share = share * share * (np.float32(3.0) - np.float32(2.0) * share)
        total = self._ring(ring, log_radius, phi, turns, delay, levels)
        ring += 1
        other = self._ring(ring, log_radius, phi, turns, delay, levels)
        rest = np.float32(1.0) - share
        scale = np.float32(1.0) / np.sqrt(rest * rest + share * share)
        rest *= scale
        share *= scale
        total *= rest
        other *= share
        total += other
        return total

    def _ring(
        self, ring: Whole, log_radius: Image, phi: Image, turns: Image, delay: Image | None, levels: Levels
    ) -> Complex:
        azimuth = phi + turns.take(ring)
        if delay is not None:
            azimuth += self.omega.astype(np.float32).take(ring) * delay
        return self.field.at(log_radius + self._shifted.take(ring), azimuth, levels)
