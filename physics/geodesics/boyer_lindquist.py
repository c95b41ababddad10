# SPDX-License-Identifier: GPL-3.0-or-later
"""The null geodesics as printed: Eq. 2 of Verbraeck & Eisemann, with the affine parameter zeta.

The source text's own method, kept as a check of the Mino-time form, with which it shares no equation of motion.
It has that text's limits, stated rather than hidden: infinity is a large radius; rays that pass close to the
spin axis, where Eq. 2 contains 1/sin^3 theta, are given up, and so are those so close to the critical curve that
its exponential parting of neighbors would amplify the integration's own error into a wrong direction.
"""

from __future__ import annotations

import copy
import math
from typing import Self

import numpy as np

from ..kerr.critical_curve import Barrier
from ..kerr.metric import horizon_radius
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Mask

R, THETA, PHI, P_R, P_THETA = range(5)

# Where the ray counts as having left, units of M, and in multiples of the camera's own radius. The sky direction
# is read off the momentum, not the position, so what bending remains is of the order of b / r^2.
FAR_RADIUS = 1e7
FAR_FACTOR = 1e3

# Closest approach to the axis, as sin(theta), that Eq. 2 is trusted with.
POLE_LIMIT = 1e-3

# How far the constants of motion may wander, in multiples of the tolerance, before an answer is not believed:
# far above what error control leaves on rays that are well resolved, far below what a missed pole does.
DRIFT_LIMIT = 1e4

# Closest approach to the critical curve that is trusted: |R(r_m)| over R''/2 r_m^2, which grows like the distance
# from it, in multiples of the tolerance. Neighboring rays part like 1 / distance, so that errors of direction stay
# below some 1e-3 radians.
EDGE_LIMIT = 1e4

# The first step in zeta, as a share of the camera's radius.
FIRST_STEP = 0.02


class PrintedSystem:
    """Rays from one camera towards the sky, as a `runge_kutta.System` in the affine parameter of Eq. 2."""

    def __init__(self, rays: Rays, barrier: Barrier, tolerance: float) -> None:
        count = len(rays)
        observer = rays.observer
        state = np.empty((5, count))
        state[R], state[THETA], state[PHI] = observer.r, observer.theta, observer.phi
        a = rays.spin
        delta = observer.r**2 - 2.0 * observer.r + a * a
        state[P_R] = rays.radial / delta
        state[P_THETA] = rays.polar
        self.state = state
        self._spin = a
        self._b = rays.b
        self._q_plus_b2 = rays.q_plus_b2
        self._scale = np.sqrt(np.abs(rays.q_plus_b2) + a * a) + 1.0
        self._far = max(FAR_RADIUS, FAR_FACTOR * observer.r)
        self._horizon = horizon_radius(a)
        self._drift_limit = DRIFT_LIMIT * tolerance
        passes = (rays.radial > 0.0) | (barrier.radius > observer.r)
        near = np.abs(barrier.height) < EDGE_LIMIT * tolerance * barrier.curvature * barrier.radius**2
        # A camera on the axis has no ray that these coordinates could even begin with.
        on_axis = not math.sin(observer.theta) > POLE_LIMIT
        self._critical = (passes & near) | on_axis

    def derivative(self, state: Array, out: Array) -> None:
        """Write d state / d zeta along the backward ray to `out`; both (5, n).

        With Eq. 3 put in, Carter's constant drops out of R + Delta Theta = P^2 - Delta W^2,
        W = b / sin(theta) - a sin(theta), which leaves its derivatives at fixed b and q without ambiguity.
        """
        a, b = self._spin, self._b
        r, theta, _, p_r, p_theta = state
        with np.errstate(all="ignore"):  # near the axis and beyond the horizon: `failed` finds what this makes
            sin, cos = np.sin(theta), np.cos(theta)
            delta = r * r - 2.0 * r + a * a
            delta_r = 2.0 * r - 2.0
            rho2 = r * r + a * a * cos * cos
            rho2_theta = -2.0 * a * a * sin * cos
            big_p = r * r + a * a - a * b
            w = b / sin - a * sin
            w_theta = -(b / (sin * sin) + a) * cos
            numerator = big_p * big_p - delta * w * w
            numerator_r = 4.0 * r * big_p - delta_r * w * w
            numerator_theta = -2.0 * delta * w * w_theta
            kinetic = delta * p_r * p_r + p_theta * p_theta
            out[R] = -delta * p_r / rho2
            out[THETA] = -p_theta / rho2
            out[PHI] = -(a * big_p / delta + w / sin) / rho2
            out[P_R] = -(
                (numerator_r - numerator * (delta_r / delta + 2.0 * r / rho2)) / (2.0 * delta * rho2)
                - delta_r * p_r * p_r / (2.0 * rho2)
                + r * kinetic / (rho2 * rho2)
            )
            out[P_THETA] = -(
                (numerator_theta - numerator * rho2_theta / rho2) / (2.0 * delta * rho2)
                + rho2_theta * kinetic / (2.0 * rho2 * rho2)
            )

    def error(self, difference: Array, state: Array, slope: Array) -> Array:
        """Return the error of direction, in radians, that `difference` amounts to; shape (n,)."""
        size = np.abs(difference)
        with np.errstate(invalid="ignore"):
            total: Array = (
                size[R] / state[R]
                + size[THETA]
                + size[PHI]
                + size[P_R] / np.maximum(1.0, np.abs(state[P_R]))
                + size[P_THETA] / self._scale
            )
        return total

    def first_step(self) -> Array:
        """Return a first step in zeta, shape (n,)."""
        step: Array = FIRST_STEP * self.state[R]
        return step

    def limit(self, state: Array, slope: Array, step: Array) -> Array:
        """Return `step` as it is: the far radius need not be met exactly."""
        return step

    def ended(self, state: Array) -> Mask:
        """Return which rays have gone far enough to count as gone, shape (n,)."""
        ended: Mask = (state[R] >= self._far) & ~self.failed(state)
        return ended

    def failed(self, state: Array) -> Mask:
        """Return which rays came too near the axis or fell in, or broke their constants of motion; shape (n,)."""
        a = self._spin
        r, theta, _, p_r, p_theta = state
        with np.errstate(all="ignore"):
            sin, cos = np.sin(theta), np.cos(theta)
            near_axis = ~((theta > 0.0) & (theta < np.pi) & (sin > POLE_LIMIT))
            inside = ~(r > self._horizon * (1.0 + 1e-9))
            delta = r * r - 2.0 * r + a * a
            w = self._b / sin - a * sin
            # Null condition and Eq. 8: both vanish identically on the true ray.
            big_p = r * r + a * a - a * self._b
            null = (delta * p_r) ** 2 + delta * (p_theta * p_theta + w * w) - big_p * big_p
            violation = p_theta * p_theta + (self._b / sin) ** 2 - a * a * cos * cos - self._q_plus_b2
            drift = np.abs(null) / (big_p * big_p) + np.abs(violation) / (self._scale * self._scale)
        failed: Mask = near_axis | inside | self._critical | ~(drift <= self._drift_limit)
        return failed

    def select(self, rays: Mask) -> Self:
        """Return the system of these rays alone."""
        chosen = copy.copy(self)
        chosen._b, chosen._q_plus_b2, chosen._scale = self._b[rays], self._q_plus_b2[rays], self._scale[rays]
        chosen._critical = self._critical[rays]
        return chosen

    def sky_direction(self, state: Array) -> Array:
        """Return the unit vectors towards which the rays of `state` leave, shape (n, 3)."""
        slope = np.empty_like(state)
        self.derivative(state, slope)
        r, theta, phi = state[R], state[THETA], state[PHI]
        sin_theta, cos_theta, sin_phi, cos_phi = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
        outward, south, east = slope[R], r * slope[THETA], r * sin_theta * slope[PHI]
        across = outward * sin_theta + south * cos_theta
        vector: Array = np.stack(
            [
                across * cos_phi - east * sin_phi,
                across * sin_phi + east * cos_phi,
                outward * cos_theta - south * sin_theta,
            ],
            axis=-1,
        )
        unit: Array = vector / np.linalg.norm(vector, axis=-1, keepdims=True)
        return unit
