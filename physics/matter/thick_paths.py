# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays through a layer about the equatorial plane: where they are inside it, pass by pass.

The polar motion is cos theta = sqrt(w_+) sin chi (`polar`), so pass k through the layer |cos theta| <= cos theta_m is
chi between k pi - c and k pi + c, c = arcsin(cos theta_m / sqrt(w_+)), or all of chi where that exceeds 1: rays that
stay within. A camera in the layer begins at its own chi. Mino time is the integral of
d chi / sqrt(A + a^2 cos^2 theta); the radius follows in closed form (`weierstrass`), azimuth and time by quadrature.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from ..geodesics.mino import radial_polynomial
from ..geodesics.polar import PolarMotion
from ..kerr.metric import horizon_radius
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Index, Mask
from ..numerics.weierstrass import QuarticMotion, Weierstrass

LEAD_NODES = 12
"""Nodes of Gauss and Legendre's rule from the camera to the layer."""
_PLACES, _WEIGHTS = (each[:, None] for each in leggauss(LEAD_NODES))

CULLED_AT = np.linspace(0.0, 1.0, 9)[:, None]
LED_AT = np.linspace(0.0, 1.0, 5, endpoint=False)[:, None]
"""Shares of the way to a pass at which a ray may have ended before."""
CULLED_BEYOND = 1.05
"""Passes are left out whose radius at these shares of them stays outside the disk by this factor, and cut there."""
CUT_MARGIN = 0.25
"""Of the cuts, in steps between these shares."""

LEAST_HEIGHT = 1e-12
LEAST_PASS = 0.35
"""Path angle below which the rest of a pass of a camera in the layer is none of its own."""
LEAST_BASE = 1.0
"""Rays of a smaller A run nearly straight in or out, and turn little on their way."""
HORIZON_MARGIN = 1.0 + 1e-6


@dataclass(frozen=True)
class Samples:
    """Places along passes of rays; arrays of shape (nodes, n) unless said otherwise."""

    u: Array
    """1 / r; NaN behind the ray's end."""
    u_slope: Array
    """du / dlambda of the ray backwards."""
    height: Array
    """cos theta."""
    phi: Array
    """Azimuth, radians, not wrapped."""
    mino_step: Array
    """Mino time that the node stands for."""
    delay: Array
    """How much earlier light left there, units of M; 0 if not asked for."""
    time: Array
    """Mino time from the camera."""


class LayerPaths:
    """Rays of one camera, and their way through a layer."""

    def __init__(self, rays: Rays, cosine: float) -> None:
        """`cosine`: cos theta_m."""
        polar = PolarMotion.of(rays)
        self._height = polar.triad[0, 2]
        rise = polar.triad[1, 2] * polar.tangent_theta
        top = np.hypot(self._height, rise)
        with np.errstate(invalid="ignore"):
            usable = (polar.base >= LEAST_BASE) & (polar.ellipticity >= 0.0) & (top > LEAST_HEIGHT) & rays.escapes
        self.usable: Mask = usable
        """Which rays have such a motion, shape (n,); `slow_paths` takes those of the others that have energy."""
        self.live: Index = np.flatnonzero(usable)
        self.rays, self._polar = rays.select(self.live), polar.select(self.live)
        self._rise, top = rise[self.live], top[self.live]
        self._start = np.arctan2(self._height, self._rise)
        self._reach = np.where(cosine >= top, 0.5 * math.pi, np.arcsin(np.minimum(cosine / top, 1.0)))
        self._first = np.floor((self._start - self._reach) / math.pi) + 1.0
        # What little is left of a pass that goes over into the next is part of that.
        self._joined = (cosine >= top) & (self._first * math.pi + self._reach - self._start < LEAST_PASS)
        self._first += self._joined
        quartic = radial_polynomial(self.rays)
        self._quartic = np.stack(quartic)
        self._function = Weierstrass.of_quartic(*quartic)
        self._u0 = 1.0 / rays.observer.r
        self._highest = 1.0 / (horizon_radius(rays.spin) * HORIZON_MARGIN)

    def orders(self, crossings: int) -> range:
        """Return the numbers of the passes that any ray may make."""
        if not len(self.live):
            return range(0)
        return range(int(self._first.min()), int(np.floor(self._start.max() / math.pi)) + crossings + 1)

    def passes(self, order: int, crossings: int, inner: float, outer: float) -> tuple[Index, Array, Array]:
        """Return which of `live` meet the disk in a pass, and the path angles from the camera to its ends, (n,).

        `order`: of the pass, that about chi = order pi; neighboring rays have the same. `crossings`: how often rays may
        cross the plane; what lies before they first do is free.
        """
        middle = order * math.pi
        low = np.maximum(self._start, middle - self._reach) - self._start
        low[self._joined & (order == self._first)] = 0.0
        high = middle + self._reach - self._start
        asked = (order >= self._first) & (order <= np.floor(self._start / math.pi) + crossings) & (high > low)
        chosen = np.flatnonzero(asked)
        low, high = low[chosen], high[chosen]
        for led, margin in ((LED_AT, CUT_MARGIN), (LED_AT[:0], 0.0)):  # the second cut is finer
            met, low, high = self._cut(chosen, low, high, led, margin, (inner, outer))
            chosen, low, high = chosen[met], low[met], high[met]
        return chosen, low, high

    def _cut(
        self, chosen: Index, low: Array, high: Array, led: Array, margin: float, radii: tuple[float, float]
    ) -> tuple[Mask, Array, Array]:
        """Return which passes meet the disk, and the path angles between which they do."""
        if not len(chosen):
            return np.zeros(0, dtype=bool), low, high
        with np.errstate(all="ignore"):
            angle = np.concatenate([low * led, low + (high - low) * CULLED_AT]).clip(1e-9)
            height = self._height * np.cos(angle) + self._rise[chosen] * np.sin(angle)
            time = self._times(chosen, angle, self._speed(chosen, height))
            u, slope = self._motion(chosen).after(*self._function.select(chosen).at(time))
            gone = self._gone(u)[len(led) :]
            u, slope = u[len(led) :], slope[len(led) :]
            # Rays that jump over the disk meet it where they pass its middle.
            rims = 1.0 / (radii[1] * CULLED_BEYOND), CULLED_BEYOND / radii[0]
            inside = ~gone & (u > rims[0]) & (u < rims[1])
        past = u > 0.5 * (rims[0] + rims[1])
        past[1:] = np.where(gone[1:], slope[:-1] > 0.0, past[1:])
        jumps = ~inside[:-1] & ~inside[1:] & (past[:-1] != past[1:]) & ~gone[:-1]
        met = inside.copy()
        met[:-1] |= jumps
        met[1:] |= jumps
        begin, end = _hull(met, inside, np.where(gone, np.nan, u), rims, margin)
        return met.any(axis=0) & ~gone[0], low + begin * (high - low), low + end * (high - low)

    def heights(self, chosen: Index, low: Array, high: Array, edges: Array) -> tuple[Samples, Array]:
        """Return what `samples` does without azimuths and delays, and the path angles."""
        middles, widths = 0.5 * (edges[1:] + edges[:-1]), edges[1:] - edges[:-1]
        angle = (low + (high - low) * middles).clip(1e-9)
        height = self._height * np.cos(angle) + self._rise[chosen] * np.sin(angle)
        speed = self._speed(chosen, height)
        with np.errstate(all="ignore"):
            time = self._times(chosen, angle, speed)
            u, slope = self._motion(chosen).after(*self._function.select(chosen).at(time))
            u[self._gone(u)] = np.nan
        none = np.zeros(0)
        return Samples(u, slope, height, none, (high - low) * widths / speed, none, time), angle

    def samples(self, chosen: Index, low: Array, high: Array, edges: Array, timed: bool) -> Samples:
        """Return places in the middle of parts of passes.

        Parameters
        ----------
        chosen, low, high
            From `passes`.
        edges : ndarray, shape (nodes + 1, n) or (nodes + 1, 1)
            Shares of the pass at which parts begin and end, 0 to 1, rising.
        timed : bool
            Whether delays are wanted.
        """
        known, angle = self.heights(chosen, low, high, edges)
        rays, a, time, height = self.rays.select(chosen), self.rays.spin, known.time, known.height
        pole = self._polar.pole_speed[chosen]
        speed = self._speed(chosen, height)
        drift_rate = a * a * self._polar.b[chosen] / (pole * speed * (speed + pole))
        delay = np.zeros_like(time)
        with np.errstate(all="ignore"):
            lead = 0.5 * (1.0 + _PLACES) * time[0]
            u, slope = self._motion(chosen).after(*self._function.select(chosen).at(lead))
            weights = 0.5 * time[0] * _WEIGHTS
            turned = (weights * turn_rate(rays, u)).sum(axis=0) + along(time, turn_rate(rays, known.u))
            if timed:
                delay = (weights * late_rate(rays, u, slope)).sum(axis=0)
                delay = delay + along(time, late_rate(rays, known.u, known.u_slope))
                delay += 1.0 / self._u0 - 1.0 / known.u + 2.0 * np.log(known.u / self._u0)
                delay += time * (a * rays.b - a * a)
                delay += a * a * (self._lead(chosen, angle[0], 2) + along(time, height * height))
        drift = self._drift(chosen, angle[0]) + along(angle, drift_rate)
        (x0, y0, _), (xt, yt, _), (xp, yp, _) = self._polar.triad
        along_theta, along_phi = self._polar.tangent_theta[chosen], self._polar.tangent_phi[chosen]
        cos, sin = np.cos(angle), np.sin(angle)
        x = x0 * cos + (xt * along_theta + xp * along_phi) * sin
        y = y0 * cos + (yt * along_theta + yp * along_phi) * sin
        return replace(known, phi=unwrapped(np.arctan2(y, x)) + drift + turned, delay=delay)

    def _times(self, chosen: Index, angle: Array, speed: Array) -> Array:
        """Return Mino times after path angles of shape (nodes, n) that rise; `speed`: s there."""
        times: Array = self._lead(chosen, angle[0], 0) + along(angle, 1.0 / speed)
        return times

    def _lead(self, chosen: Index, span: Array, power: int) -> Array:
        """Return the integral of cos(theta)^power d chi / s over a span of the path from the camera."""
        _, height, speed = self._lead_nodes(chosen, span)
        total: Array = 0.5 * span * (_WEIGHTS * height**power / speed).sum(axis=0)
        return total

    def _lead_nodes(self, chosen: Index, span: Array) -> tuple[Array, Array, Array]:
        """Return path angles, cos theta and s at the rule's nodes, shape (nodes, n)."""
        angle = 0.5 * (1.0 + _PLACES) * span
        height = self._height * np.cos(angle) + self._rise[chosen] * np.sin(angle)
        return angle, height, self._speed(chosen, height)

    def _speed(self, chosen: Index, height: Array) -> Array:
        """Return s = d chi / d lambda."""
        speed: Array = np.sqrt(self._polar.base[chosen] + self.rays.spin**2 * height * height)
        return speed

    def _drift(self, chosen: Index, span: Array) -> Array:
        """Return the slow turn about the axis of the great circle over a span from the camera: f of `polar`."""
        a2, pole = self.rays.spin**2, self._polar.pole_speed[chosen]
        _, _, speed = self._lead_nodes(chosen, span)
        total = 0.5 * span * (_WEIGHTS / (speed * (speed + pole))).sum(axis=0)
        result: Array = total * (a2 * self._polar.b[chosen] / pole)
        return result

    def _motion(self, chosen: Index) -> QuarticMotion:
        slope = self.rays.radial[chosen] * self._u0**2
        quartic = self._quartic[:, chosen]
        return QuarticMotion(self._function.select(chosen), quartic, np.full(len(chosen), self._u0), slope)

    def _gone(self, u: Array) -> NDArray[np.bool_]:
        """Return where rays have come to their end, at nodes in order."""
        ended: NDArray[np.bool_] = np.logical_or.accumulate(~((u > 0.0) & (u < self._highest)), axis=0)
        return ended


def _hull(met: Mask, inside: Mask, u: Array, rims: tuple[float, float], margin: float) -> tuple[Array, Array]:
    """Return the shares of passes between which rays are in the disk, (n,), u being nearly linear at its rims.

    `met`, `inside`: whether rays meet the disk about these shares, and whether they are in it; `u`: NaN at their end;
    `margin`: in steps.
    """
    ends = []
    every = np.arange(met.shape[1])
    for flipped in (False, True):
        is_met, is_in, place, shares = (each[::-1] if flipped else each for each in (met, inside, u, CULLED_AT[:, 0]))
        first = is_met.argmax(axis=0)
        before = np.maximum(first - 1, 0)
        out, within = place[before, every], place[first, every]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = (within - np.where(out < rims[0], *rims)) / (within - out) + margin
        share = np.where(is_in[first, every] & np.isfinite(share), share.clip(0.0, 1.0), 1.0)
        ends.append(shares[first] + share * (shares[before] - shares[first]))
    return ends[0], ends[1]


def turn_rate(rays: Rays, u: Array) -> Array:
    """Return the azimuth's part of the radial motion by Mino time, backward."""
    a, square = rays.spin, u * u
    rate: Array = -a * (2.0 * u - a * rays.b * square) / (1.0 - 2.0 * u + a * a * square)
    return rate


def late_rate(rays: Rays, u: Array, slope: Array) -> Array:
    """Return the time's radial part by Mino time, less what is known of it (`travel_time`)."""
    a, square = rays.spin, u * u
    spinning = 1.0 + a * a * square
    rate: Array = spinning * (spinning - a * rays.b * square) / (square * (1.0 - 2.0 * u + a * a * square))
    rate -= slope * (1.0 + 2.0 * u) / square
    return rate


def unwrapped(angle: Array) -> Array:
    """Return angles of shape (nodes, n) without jumps by whole turns from node to node."""
    jumps = np.rint(np.diff(angle, axis=0) * (0.5 / math.pi))
    angle[1:] -= np.cumsum(jumps, axis=0) * (2.0 * math.pi)
    return angle


def along(time: Array, rate: Array) -> Array:
    """Return the integral of a rate from the first node on, by the trapezoidal rule."""
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time, axis=0)
    total: Array = np.concatenate([np.zeros((1, time.shape[1])), np.cumsum(steps, axis=0)])
    return total
