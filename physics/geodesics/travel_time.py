# SPDX-License-Identifier: GPL-3.0-or-later
"""How long light has been under way: the coordinate time between its crossing of the equatorial plane and the camera.

With Mino time lambda, u = 1 / r and D = 1 - 2 u + a^2 u^2 (Carter 1968, Phys. Rev. 174, 1559; Gralla & Lupsasca 2020,
Phys. Rev. D 101, 044032, Eq. 8),

    dt / dlambda = (1 + a^2 u^2)(1 + a^2 u^2 - a b u^2) / (u^2 D) + a b - a^2 + a^2 cos^2 theta.

The radial part grows like u'/u^2 + 2 u'/u far away, u' = du / dlambda, whose integral is known; the rest is smooth, and
integrated by Gauss and Legendre's rule over the closed form of u. The polar part is integrated over the angle chi of
the path, cos^2 theta = w_+ sin^2 chi (`polar`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial.legendre import leggauss

from ..kerr.rays import Rays
from ..numerics.arrays import Array
from ..numerics.weierstrass import QuarticMotion, Weierstrass
from .mino import radial_polynomial
from .polar import PolarMotion

NODES = 32
_PLACES, _WEIGHTS = (each[:, None] for each in leggauss(NODES))


def time_to_plane(rays: Rays, order: int, tolerance: float) -> tuple[Array, Array, Array]:
    """Return how much earlier light crossed the equatorial plane than it reaches the camera.

    Parameters
    ----------
    rays : Rays
        Of one camera and of positive energy.
    order : int
        Which crossing, 0 for the first along the backward ray.
    tolerance : float
        Of the Mino time of the crossing, as for `PolarMotion.plane_crossings`.

    Returns
    -------
    time : ndarray, shape (n,)
        Units of M, to some 1e-6 of the distance. NaN or meaningless for rays that never cross, or end before.
    way : ndarray, shape (n,)
        1 where the light ran outward there, -1 inward.
    u : ndarray, shape (n,)
        1 / r of the crossing, in 1/M.
    """
    polar = PolarMotion.of(rays)
    times, _ = polar.plane_crossings(order + 1, tolerance)
    with np.errstate(all="ignore"):
        time, way, u = _radial(rays, times[-1])
        time += _polar(polar, order)
    return time, way, u


def _radial(rays: Rays, time: Array) -> tuple[Array, Array, Array]:
    a, start = rays.spin, 1.0 / rays.observer.r
    quartic = radial_polynomial(rays)
    function = Weierstrass.of_quartic(*quartic)
    motion = QuarticMotion(function, np.stack(quartic), np.full(len(rays), start), rays.radial * (start * start))
    ends = np.concatenate([0.5 * (1.0 + _PLACES) * time, time[None]])
    u, slope = motion.after(*function.at(ends))
    end, way, u, slope = u[-1], np.sign(slope[-1]), u[:-1], slope[:-1]
    square = u * u
    spinning = 1.0 + a * a * square
    rate = spinning * (spinning - a * rays.b * square) / (square * (1.0 - 2.0 * u + a * a * square))
    rate -= slope * (1.0 + 2.0 * u) / square
    rest = 0.5 * time * (_WEIGHTS * rate).sum(axis=0)
    total: Array = rest + (1.0 / start - 1.0 / end) + 2.0 * np.log(end / start) + time * (a * rays.b - a * a)
    return total, way, end


def _polar(polar: PolarMotion, order: int) -> Array:
    a2 = polar.spin * polar.spin
    height, rise = polar.triad[0, 2], polar.triad[1, 2] * polar.tangent_theta
    first = np.arctan2(height, rise)
    last = (np.floor(first / math.pi) + 1.0 + order) * math.pi
    chi = first + 0.5 * (1.0 + _PLACES) * (last - first)
    square = (height * height + rise * rise) * np.sin(chi) ** 2
    rate = a2 * square / np.sqrt(polar.base + a2 * square)
    total: Array = 0.5 * (last - first) * (_WEIGHTS * rate).sum(axis=0)
    return total
