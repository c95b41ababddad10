# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracing without steps: the radial motion by Gauss-Legendre quadrature, the polar motion in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .polar import PolarMotion
from .quadrature import direct_integrals, turning_integrals
from .rays import Array, Rays
from .trapped import Barrier


def sky_directions(rays: Rays, barrier: Barrier, tolerance: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the unit vectors, shape (n, 3), that rays from the sky come from, and which could be answered, (n,)."""
    motion = PolarMotion.of(rays)
    answered = motion.usable(tolerance)
    time, psi = np.zeros(len(rays)), np.zeros(len(rays))
    for chosen, integrals in (
        (np.flatnonzero(answered & barrier.blocks), turning_integrals),
        (np.flatnonzero(answered & ~barrier.blocks), direct_integrals),
    ):
        if len(chosen):
            time[chosen], psi[chosen], too_many = integrals(rays.select(chosen), barrier.select(chosen), tolerance)
            answered[chosen[too_many]] = False
    direction = np.full((len(rays), 3), np.nan)
    left = np.flatnonzero(answered)
    if len(left):
        direction[left] = motion.select(left).direction(time[left], psi[left], tolerance).T
    return direction, answered
