# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracing without steps: the radial motion by Gauss-Legendre quadrature, the polar motion in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kerr.critical_curve import Barrier
from ..kerr.rays import Rays
from ..numerics.arrays import Array, indices
from .polar import PolarMotion
from .quadrature import direct_integrals, turning_integrals


def sky_directions(rays: Rays, barrier: Barrier, tolerance: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the unit vectors, shape (n, 3), that rays from the sky come from, and which could be answered, (n,)."""
    motion = PolarMotion.of(rays)
    answered = motion.usable(tolerance)
    time, psi = radial_integrals(rays, barrier, answered, tolerance)
    answered &= ~np.isnan(time)
    direction = np.full((3, len(rays)), np.nan)
    left = indices(answered)
    direction[:, left] = motion.select(left).direction(time[left], psi[left], tolerance)
    return direction.T, answered


def radial_integrals(rays: Rays, barrier: Barrier, wanted: NDArray[np.bool_], tolerance: float) -> tuple[Array, Array]:
    """Return Mino time to infinity and psi of the rays wanted, shape (n,); NaN elsewhere and for too many nodes."""
    time, psi = np.full((2, len(rays)), np.nan)
    for members, integrals in (
        (wanted & barrier.blocks, turning_integrals),
        (wanted & ~barrier.blocks, direct_integrals),
    ):
        if members.any():
            chosen = indices(members)
            time[chosen], psi[chosen] = integrals(rays.select(chosen), barrier.select(chosen), tolerance)
    return time, psi
