# SPDX-License-Identifier: GPL-3.0-or-later
"""Crossings of the equatorial plane by Runge-Kutta steps: a check of `crossings.cross_plane` with other equations.

The radial motion is u'' = U'(u) / 2 and the polar motion that of the unit vector n, as `mino` has them, with neither
turning points nor closed forms. A step that takes n_z through zero is taken again, shorter, until it ends on the plane.
The azimuth is stepped without its winding at the horizon (`radial_path`), which it then passes like any other place.
Next to the critical curve, where solutions of u'' = U' / 2 part exponentially, rays may end on the wrong side of the
hole: the closed form knows which side is right, and such rays are UNRESOLVED.
"""

from __future__ import annotations

import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..kerr.critical_curve import comes_from_sky
from ..kerr.metric import horizon_radius
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Mask
from ..numerics.runge_kutta import CASH_KARP, attempt, integrate
from ..numerics.sphere import spherical_triad
from .crossings import Crossings
from .mino import FIRST_ANGLE, radial_polynomial
from .polar import IN_PLANE
from .radial_path import HORIZON_MARGIN, energy_sense, winding
from .tracer import Fate

# Rows of the state: 1 / r, its derivative, the unit vector n, its derivative, psi without its winding, the Mino time.
U, U_PRIME, N, N_PRIME, PSI, TIME = 0, 1, slice(2, 5), slice(5, 8), 8, 9
N_Z, N_Z_PRIME = 4, 7
N_COMPONENTS = 10

# Errors of single steps add up and are amplified on the way: steps are held to this share of the tolerance.
STEP_SHARE = 1e-3

# How far a step may lead, as a multiple of the straight way to the horizon.
PAST_HORIZON = 1.2

# Rounds of Newton's method that end a step on the plane.
REFINEMENTS = 4


class PlaneWatcher:
    """Rays from one camera to their ends, as a `runge_kutta.System`, that notes where they cross the plane."""

    def __init__(self, rays: Rays, count: int) -> None:
        r_hat, theta_hat, phi_hat = spherical_triad(rays.observer.theta, rays.observer.phi)[:, :, None]
        state = np.zeros((N_COMPONENTS, len(rays)))
        u = 1.0 / rays.observer.r
        state[U], state[U_PRIME] = u, u * u * rays.radial
        state[N] = r_hat
        state[N_PRIME] = -(theta_hat * rays.polar + phi_hat * rays.azimuthal)
        # cos(pi / 2) in floating point is not 0; a ray in the plane stays there
        state[N_Z, np.abs(state[N_Z]) < IN_PLANE] = 0.0
        pace = np.sqrt(np.maximum(rays.q_plus_b2 + rays.spin**2, 0.0))
        state[N_Z_PRIME, np.abs(state[N_Z_PRIME]) < IN_PLANE * pace] = 0.0
        sense, a = energy_sense(rays), rays.spin
        state[PSI] = -sense * winding(a, state[U])
        self.state = state
        self.places = np.full((count, N_COMPONENTS, len(rays)), np.nan)
        self.found = np.zeros(len(rays), dtype=np.intp)
        self._spin = rays.spin
        self._last_u = 1.0 / (horizon_radius(rays.spin) * HORIZON_MARGIN)
        carter_k = rays.q_plus_b2 + a * (a - 2.0 * rays.b)
        self._constants = np.vstack(
            [*radial_polynomial(rays), rays.q_plus_b2, 1.0 / (pace + 1.0), rays.b, carter_k, sense]
        )
        self._ray = np.arange(len(rays))
        self._before = state.copy()

    def derivative(self, state: Array, out: Array) -> None:
        """Write d state / d lambda along the backward ray to `out`."""
        c2, c3, c4, q_plus_b2, _, b, carter_k, sense = self._constants
        a, u, n_z = self._spin, state[U], state[N_Z]
        out[U] = state[U_PRIME]
        out[U_PRIME] = u * (c2 + u * (1.5 * c3 + 2.0 * c4 * u))
        out[N] = state[N_PRIME]
        out[N_PRIME] = -(q_plus_b2 + 2.0 * a * a * n_z * n_z) * state[N]
        out[N_Z_PRIME] += a * a * n_z
        square, outer = u * u, horizon_radius(a)
        total = sense * (1.0 + a * (a - b) * square) + np.abs(state[U_PRIME])
        delta = (1.0 - outer * u) * (1.0 - (a * a / outer) * u)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            share = np.where(state[U_PRIME] > 0.0, carter_k * square / total, total / delta)
        out[PSI] = a - sense * a * share
        out[TIME] = 1.0

    def error(self, difference: Array, state: Array, slope: Array) -> Array:
        """Return the error of direction, in radians, that `difference` amounts to; shape (n,)."""
        size, pace = np.abs(difference), self._constants[4]
        total: Array = size[N].max(axis=0) + size[N_PRIME].max(axis=0) * pace + size[PSI]
        total += size[U] / np.minimum(state[U] + pace, 1.0) + size[U_PRIME] * pace
        return total

    def first_step(self) -> Array:
        """Return a first step in Mino time, shape (n,)."""
        step: Array = 0.1 * FIRST_ANGLE * self._constants[4]
        return step

    def limit(self, state: Array, slope: Array, step: Array) -> Array:
        """Return `step` cut so that it ends not far inside the horizon."""
        with np.errstate(divide="ignore", invalid="ignore"):
            left = np.where(slope[U] > 0.0, (self._last_u - state[U]) / slope[U], np.inf)
        cut: Array = np.minimum(step, PAST_HORIZON * np.maximum(left, 0.0))
        return cut

    def ended(self, state: Array) -> Mask:
        """Return which rays have come to infinity or to the horizon, and note what they crossed on the way."""
        before, here = self._before[N_Z], state[N_Z]
        moved = state[TIME] > self._before[TIME]
        crossed = moved & (before * here <= 0.0) & (before != 0.0) & (self.found[self._ray] < len(self.places))
        if crossed.any():
            self._note(np.flatnonzero(crossed), state)
        self._before = state.copy()
        ended: Mask = (state[U] <= 0.0) | (state[U] >= self._last_u * (1.0 - 1e-12))
        return ended

    def failed(self, state: Array) -> Mask:
        """Return which rays cannot go on: none; shape (n,)."""
        return np.zeros(state.shape[1], dtype=bool)

    def select(self, rays: Mask) -> Self:
        """Return the system of these rays alone, which notes crossings in the same place."""
        chosen = copy.copy(self)
        chosen._constants = self._constants[:, rays]
        chosen._ray, chosen._before = self._ray[rays], self._before[:, rays]
        return chosen

    def sky_direction(self, state: Array) -> Array:
        """Not what this system is for."""
        raise NotImplementedError

    def _note(self, which: NDArray[np.intp], state: Array) -> None:
        part = self.select(np.isin(np.arange(state.shape[1]), which))
        start, end = self._before[:, which], state[:, which]
        whole = end[TIME] - start[TIME]
        step = whole * start[N_Z] / (start[N_Z] - end[N_Z])
        slope = np.empty_like(start)
        part.derivative(start, slope)
        place = end
        for _ in range(REFINEMENTS):
            place, _ = attempt(part, CASH_KARP, start, slope, step)
            step = np.clip(step - place[N_Z] / place[N_Z_PRIME], 0.0, whole)
        place, _ = attempt(part, CASH_KARP, start, slope, step)
        inside = (place[U] > 0.0) & (place[U] < self._last_u)
        ray = self._ray[which[inside]]
        self.places[self.found[ray], :, ray] = place[:, inside].T
        self.found[ray] += 1


def step_to_plane(rays: Rays, count: int, tolerance: float, max_steps: int) -> Crossings:
    """Return the first `count` crossings of rays of positive energy, by steps; see `crossings.cross_plane`."""
    watcher = PlaneWatcher(rays, count)
    outcome = None
    for outcome in integrate(watcher, CASH_KARP, max(STEP_SHARE * tolerance, 1e-14), max_steps):  # noqa: B007
        pass
    assert outcome is not None
    sky = comes_from_sky(rays)
    astray = outcome.reached & ((outcome.state[U] <= 0.0) != sky)
    places = np.moveaxis(watcher.places, 1, 0)
    places[:, :, astray] = np.nan  # what was found of rays that ran out of steps is kept
    ended = outcome.reached & ~astray
    fate = np.where(ended, np.where(sky, Fate.SKY, Fate.SHADOW), Fate.UNRESOLVED).astype(np.uint8)
    unwound = np.arctan2(places[3], places[2]) + places[PSI]
    return Crossings(places[U], places[U_PRIME], unwound, places[TIME], fate)
