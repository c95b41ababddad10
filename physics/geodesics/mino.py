# SPDX-License-Identifier: GPL-3.0-or-later
"""The null geodesics in Mino time: the regularised form of Eq. 2.

Multiplying Eq. 2 of Verbraeck & Eisemann by rho^2 (Mino 2003, Phys. Rev. D 67, 084027: d lambda = d zeta /
rho^2) separates r from theta. With u = 1/r and n the unit vector of the angles (theta, phi_theta):

* u'^2 = U(u) = 1 + (a^2 - q - b^2) u^2 + 2 ((a - b)^2 + q) u^3 - a^2 q u^4, or u'' = U'(u) / 2: infinity is
  u = 0, reached at a finite lambda;
* n'' = -|n'|^2 n + a^2 n_z (z - n_z n), |n'|^2 = q + b^2 + a^2 n_z^2: motion on a sphere, regular at its poles;
* phi = phi_theta + psi, psi' = a (2 u - a b u^2) / (1 - 2 u + a^2 u^2).

Why the radial equation is not integrated as u'' = U'(u) / 2: next to the critical curve its solutions part
exponentially, and an integration error of size e throws rays within about e of the edge to the wrong
side of the hole. Its first integral has no such freedom once the turning point u_t is taken out of it.
With u = u_t (1 - x^2), x runs from the camera through the turning point at x = 0 to infinity at x = 1 and

    x' = sqrt(G(x^2)) / 2,   G(s) = g_0 + g_1 s + g_2 s^2 + g_3 s^3 > 0,

an equation in which an error is a shift in time and stays one: the smoothness of u'' = U'/2 without its
instability. Rays that go straight out have u = u_0 (1 - x) instead, x' = sqrt(U) / u_0.
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from typing import Self

import numpy as np

from ..kerr.critical_curve import Barrier
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Mask
from ..numerics.sphere import spherical_triad

# Rows of the state: the radial coordinate x, the unit vector n, its derivative n', the extra rotation psi.
X, N, N_PRIME, PSI = 0, slice(1, 4), slice(4, 7), 7
N_COMPONENTS = 8

# The first step, as an angle along the ray's path in radians; the controller takes over from there.
FIRST_ANGLE = 0.3

# Gauss-Legendre nodes and weights on [0, 1] for the time left to infinity. Where the step that error control
# allows reaches infinity, the integrand is smooth enough for these to be far better than the step itself.
# For five nodes they have closed forms (Abramowitz & Stegun 1964, table 25.4).
_OUTER, _INNER = (math.sqrt(5.0 + sign * 2.0 * math.sqrt(10.0 / 7.0)) / 3.0 for sign in (1.0, -1.0))
_NODES = tuple(0.5 * (1.0 + node) for node in (-_OUTER, -_INNER, 0.0, _INNER, _OUTER))
_SMALL, _LARGE = ((322.0 + sign * 13.0 * math.sqrt(70.0)) / 1800.0 for sign in (-1.0, 1.0))
_WEIGHTS = (_SMALL, _LARGE, 64.0 / 225.0, _LARGE, _SMALL)

# Rounds of Halley's method for the turning point, at the most, and the relative change after which what is left, about
# its cube, is below rounding.
HALLEY_ROUNDS = 16
HALLEY_CHANGE = 4e-6
# Bisection alone, where Newton's method keeps leaving the bracket, ends after this many.
BRACKETED_ROUNDS = 60


def radial_polynomial(rays: Rays) -> tuple[Array, Array, Array]:
    """Return the coefficients of U, the radial potential of Eq. 3 in u = 1 / r.

    U = (du / dlambda)^2 = 1 + c_2 u^2 + c_3 u^3 + c_4 u^4.

    Parameters
    ----------
    rays : Rays

    Returns
    -------
    c2, c3, c4 : ndarray, shape (n,)
        Units of M^2, M^3 and M^4.
    """
    a = rays.spin
    c2 = a * a - rays.q_plus_b2
    c3 = 2.0 * (rays.q_plus_b2 + a * a - 2.0 * a * rays.b)
    c4 = -a * a * rays.q
    return c2, c3, c4


class MinoSystem(ABC):
    """Rays from one camera towards the sky, as a `runge_kutta.System` in Mino time."""

    def __init__(self, rays: Rays, tolerance: float, start: Array, unit: Array, rates: Array) -> None:
        """`start`: x at the camera; `unit`: u where x = 0; `rates`: polynomial of (d x / d lambda)^2, low first."""
        r_hat, theta_hat, phi_hat = spherical_triad(rays.observer.theta, rays.observer.phi)[:, :, None]
        state = np.zeros((N_COMPONENTS, len(rays)))
        state[X] = start
        state[N] = r_hat
        # Light moves with p_theta along theta-hat and b / sin(theta) along phi-hat; the backward ray against it.
        state[N_PRIME] = -(theta_hat * rays.polar + phi_hat * rays.azimuthal)
        self.state = state
        self._spin = rays.spin
        # Rotation rate psi' = u (2 a - a^2 b u) / (1 - 2 u + a^2 u^2), for the backward ray with its sign turned.
        self._constants = np.vstack(
            [
                unit,
                rays.q_plus_b2,
                np.full(len(rays), -2.0 * rays.spin),
                rays.spin**2 * rays.b,
                1.0 / (np.sqrt(np.maximum(rays.q_plus_b2 + rays.spin**2, 0.0)) + 1.0),
                rates,
            ]
        )
        # A last step that ends short of infinity, or beyond, is corrected to first order; what that leaves is
        # of the order of the square of the distance.
        self._arrival = 0.1 * math.sqrt(tolerance)

    @staticmethod
    @abstractmethod
    def argument(x: Array) -> Array:
        """Return what the rate polynomial and u = u_unit (1 - argument) take, from x."""

    @property
    def _pace(self) -> Array:
        pace: Array = self._constants[4]
        return pace

    def _rate(self, argument: Array) -> Array:
        rates = self._constants[5:]
        total = rates[-1] * argument
        for coefficient in rates[-2:0:-1]:
            total += coefficient
            total *= argument
        total += rates[0]
        rate: Array = np.sqrt(np.maximum(total, 0.0))
        return rate

    def derivative(self, state: Array, out: Array) -> None:
        """Write d state / d lambda along the backward ray to `out`; both (8, n)."""
        unit, q_plus_b2, psi_u, psi_u2 = self._constants[:4]
        a2 = self._spin * self._spin
        argument = self.argument(state[X])
        out[X] = self._rate(argument)
        n_z = state[3]
        out[N] = state[N_PRIME]
        # n'' = -(q_plus_b2 + 2 a^2 n_z^2) n + a^2 n_z z
        bend = n_z * n_z
        bend *= -2.0 * a2
        bend -= q_plus_b2
        np.multiply(state[N], bend, out=out[N_PRIME])
        out[6] += a2 * n_z
        u = unit * (1.0 - argument)
        below = u * a2
        below -= 2.0
        below *= u
        below += 1.0
        turn = psi_u2 * u
        turn += psi_u
        turn *= u
        np.divide(turn, below, out=out[PSI])

    def error(self, difference: Array, state: Array, slope: Array) -> Array:
        """Return the error of direction, in radians, that `difference` amounts to; shape (n,).

        An error of x is a delay; it counts by the angle the ray moves in that time. One of n' counts by
        what it makes over the time of a radian.
        """
        size = np.abs(difference)
        speed = 1.0 / self._pace + np.abs(slope[PSI])
        with np.errstate(divide="ignore", invalid="ignore"):
            delay = size[X] * speed / slope[X]
        total: Array = delay + size[N].max(axis=0) + size[N_PRIME].max(axis=0) * self._pace + size[PSI]
        return total

    def first_step(self) -> Array:
        """Return a first step in Mino time, shape (n,)."""
        return FIRST_ANGLE * self._pace

    def time_left(self, x: Array) -> Array:
        """Return the Mino time from x to infinity by quadrature, shape (n,): good when x is past any slow part."""
        distance = 1.0 - x
        total = np.zeros_like(x)
        with np.errstate(divide="ignore"):
            for node, weight in zip(_NODES, _WEIGHTS, strict=True):
                total += weight / self._rate(self.argument(x + node * distance))
        return total * distance

    def limit(self, state: Array, slope: Array, step: Array) -> Array:
        """Return `step` cut so that it ends at infinity, shape (n,)."""
        return np.minimum(step, np.maximum(self.time_left(state[X]), 0.0))

    def ended(self, state: Array) -> Mask:
        """Return which rays have come to infinity, shape (n,)."""
        ended: Mask = 1.0 - state[X] <= self._arrival
        return ended

    def failed(self, state: Array) -> Mask:
        """Return which rays cannot go on: none, these coordinates are regular everywhere; shape (n,)."""
        return np.zeros(state.shape[1], dtype=bool)

    def select(self, rays: Mask) -> Self:
        """Return the system of these rays alone."""
        chosen = copy.copy(self)
        chosen._constants = self._constants[:, rays]
        return chosen

    def sky_direction(self, state: Array) -> Array:
        """Return the unit vectors towards which the rays of `state` leave, shape (n, 3)."""
        return self.exit_lines(state)[0]

    def exit_lines(self, state: Array) -> tuple[Array, Array]:
        """Return what `sky_direction` does and the derivative of n by the Mino time at infinity, shape (n, 3) each.

        psi' vanishes there.
        """
        slope = np.empty_like(state)
        self.derivative(state, slope)
        with np.errstate(invalid="ignore", divide="ignore"):
            left = (1.0 - state[X]) / slope[X]
        final = state + slope * left
        n = final[N] / np.sqrt((final[N] ** 2).sum(axis=0))
        cos_psi, sin_psi = np.cos(final[PSI]), np.sin(final[PSI])
        turned, rate = (
            np.stack([v[0] * cos_psi - v[1] * sin_psi, v[0] * sin_psi + v[1] * cos_psi, v[2]], axis=-1)
            for v in (n, final[N_PRIME])
        )
        return turned, rate


class TurningRays(MinoSystem):
    """Rays with a turning point u_t between hole and camera: u = u_t (1 - x^2)."""

    def __init__(self, rays: Rays, barrier: Barrier, tolerance: float) -> None:
        super().__init__(rays, tolerance, *turning_polynomial(rays, barrier))

    @staticmethod
    def argument(x: Array) -> Array:
        """Return x^2."""
        return x * x


class DirectRays(MinoSystem):
    """Rays that go from the camera straight out, with nothing to turn them: u = u_c (1 - x).

    The center u_c is the camera, or, for a camera inside a barrier that does not turn the ray, the barrier: next to
    the critical curve U almost vanishes there, and expanded about it keeps its digits.
    """

    def __init__(self, rays: Rays, barrier: Barrier, tolerance: float) -> None:
        super().__init__(rays, tolerance, *direct_polynomial(rays, barrier))

    @staticmethod
    def argument(x: Array) -> Array:
        """Return x."""
        return x


def direct_polynomial(rays: Rays, barrier: Barrier, inward: bool = False) -> tuple[Array, Array, Array]:
    """Return x at the camera and u_c, shape (n,), and the polynomial U / u_c^2 in x of `DirectRays`, shape (5, n).

    The barrier is ahead of rays that go out from inside it and, where these are meant, of those that come `inward`.
    """
    r = rays.observer.r
    ahead = (barrier.radius < r) if inward else (barrier.radius > r)
    unit = 1.0 / np.where(ahead, barrier.radius, r)
    square = unit * unit
    c2, c3, c4 = radial_polynomial(rays)
    # U = u^4 R, hence U' = 4 u^3 R - u^2 R'.
    rates = np.stack(
        [
            square * np.where(ahead, barrier.height, rays.radial**2),
            np.where(
                ahead,
                unit * barrier.slope - 4.0 * square * barrier.height,
                -(2.0 * c2 + 3.0 * c3 * unit + 4.0 * c4 * square),
            ),
            c2 + 3.0 * c3 * unit + 6.0 * c4 * square,
            -unit * (c3 + 4.0 * c4 * unit),
            c4 * square,
        ]
    )
    return 1.0 - 1.0 / (r * unit), unit, rates


def turning_polynomial(rays: Rays, barrier: Barrier) -> tuple[Array, Array, Array]:
    """Return x at the camera and u_t, shape (n,), and the polynomial G / 4 in x^2 of `TurningRays`, shape (4, n)."""
    turning, rates = _turning_point(rays, barrier)
    u = 1.0 / rays.observer.r
    apart = np.maximum(1.0 - u / turning, 0.0)  # x^2 at the camera, short of digits when small
    slope = np.sqrt(rates[0] + apart * (rates[1] + apart * (rates[2] + apart * rates[3])))
    # u'^2 = U gives x without that loss: u' = -2 u_t x x', and |u'| = u^2 |Delta p_r|.
    start = -rays.radial * (u * u) / (turning * slope)
    return start, turning, 0.25 * rates


def _turning_point(rays: Rays, barrier: Barrier) -> tuple[Array, Array]:
    """Return u_t, shape (n,), and the coefficients g_0 .. g_3 of G, shape (4, n).

    The largest root of R lies h above its minimum r_m, with R(r_m) + R''/2 h^2 + 4 r_m h^3 + h^4 = 0. All
    terms but the first grow with h, so each alone bounds the root from above; their bounds, put together as reciprocal
    cubes, are within some per cent of it, and Halley's method does the rest. Written in h, the equation keeps its
    digits for the nearly double roots next to the critical curve.
    """
    r_m, half, depth = barrier.radius, barrier.curvature, -barrier.height
    with np.errstate(divide="ignore"):
        square, fourth = half / depth, 1.0 / np.sqrt(depth)
        h = 1.0 / np.cbrt(square * np.sqrt(square) + 4.0 * r_m / depth + fourth * np.sqrt(fourth))
    h = np.minimum(h, np.maximum(rays.observer.r - r_m, np.finfo(float).tiny))
    for _ in range(HALLEY_ROUNDS):
        excess = h * h * (half + h * (4.0 * r_m + h)) - depth
        slope = h * (2.0 * half + h * (12.0 * r_m + 4.0 * h))
        bend = half + h * (12.0 * r_m + 6.0 * h)  # half of the second derivative
        change = excess * slope / (slope * slope - excess * bend)
        h -= change
        if np.all(np.abs(change) <= HALLEY_CHANGE * h):
            break
    r_t = r_m + h
    u_t = 1.0 / r_t
    return u_t, _rates_at_root(rays, u_t, h * (2.0 * half + h * (12.0 * r_m + 4.0 * h)))


def inner_turning_polynomial(rays: Rays, barrier: Barrier) -> tuple[Array, Array, Array]:
    """Return what `turning_polynomial` does for rays inside their barrier, which turn them back to the hole.

    There u = u_t (1 + x^2): x runs from the camera, negative on the way out, through 0 to the horizon, and with
    s = -x^2 in U = u_t^2 s G(s), x'^2 = -G(-x^2) / 4. The root lies h below r_m,
    -|R(r_m)| + R'' / 2 h^2 - 4 r_m h^3 + h^4 = 0, between 0 and the camera; Newton's method in h, held in that bracket.
    """
    r = rays.observer.r
    r_m, half, depth = barrier.radius, barrier.curvature, -barrier.height
    low, high = np.zeros_like(r_m), r_m - r
    with np.errstate(divide="ignore", invalid="ignore"):
        h = np.minimum(np.sqrt(depth / half), high)
        for _ in range(BRACKETED_ROUNDS):
            excess = h * h * (half - h * (4.0 * r_m - h)) - depth
            low, high = np.where(excess < 0.0, h, low), np.where(excess < 0.0, high, h)
            change = excess / (h * (2.0 * half - h * (12.0 * r_m - 4.0 * h)))
            following = h - change
            held = (following >= low) & (following <= high)
            following = np.where(held, following, 0.5 * (low + high))
            done = np.abs(following - h) <= 4.0 * np.finfo(float).eps * h
            h = following
            if np.all(done):
                break
    u, u_t = 1.0 / r, 1.0 / (r_m - h)
    g = 0.25 * _rates_at_root(rays, u_t, -h * (2.0 * half - h * (12.0 * r_m - 4.0 * h)))
    rates = np.stack([-g[0], g[1], -g[2], g[3]])
    apart = np.maximum(u / u_t - 1.0, 0.0)
    slope = np.sqrt(rates[0] + apart * (rates[1] + apart * (rates[2] + apart * rates[3])))
    start = rays.radial * (u * u) / (2.0 * u_t * slope)
    return start, u_t, rates


def _rates_at_root(rays: Rays, u_t: Array, slope: Array) -> Array:
    """Return g_0 .. g_3 of G, shape (4, n), at a root of R where R' is `slope`."""
    c2, c3, c4 = radial_polynomial(rays)
    return np.stack(
        [
            slope * u_t,  # R'(r_t) / r_t
            c2 + u_t * (3.0 * c3 + 6.0 * c4 * u_t),
            -u_t * (c3 + 4.0 * c4 * u_t),
            c4 * u_t * u_t,
        ]
    )
