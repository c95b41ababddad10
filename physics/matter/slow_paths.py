# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays through a layer that turn little on their way, or never meet the plane: where they are, by Mino time.

`thick_paths` counts passes by the path angle. That says nothing of rays whose Carter's constant is negative, which stay
on one side of the plane ("vortical"; Gralla & Lupsasca 2020, Phys. Rev. D 101, 044032, II), and little of rays of small
A, which have run into the hole before their angle has changed. Such rays have no turning point of r, so one stretch of
Mino time holds all that they meet of the layer.

With v = cos theta, v'^2 = q - (q + b^2 - a^2) v^2 - a^2 v^4 for all of them, a quartic like that of u = 1 / r: the same
elliptic function solves both (`weierstrass`). For q < 0 put v^2 = w_+ cos^2 psi + w_- sin^2 psi; then psi' = a |v|, and
b / (1 - v^2), whose integral is the azimuth, is that of the ellipse (sqrt(1 - w_+) cos psi, sqrt(1 - w_-) sin psi), of
length sin theta, and b / (1 + |v|). That is what `polar` finds for q >= 0 with A = 0: the horizontal part of the ray's
direction is n_0 cos D + t_0 sin D, D the integral of s = sqrt(A + a^2 v^2), turned by the integral of
a^2 b / (s_1 (s + s_1)), s_1 = sqrt(A + a^2), with A = 0 where q < 0.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.legendre import leggauss

from ..geodesics.mino import radial_polynomial
from ..geodesics.polar import PolarMotion
from ..kerr.metric import horizon_radius
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Index, Mask
from ..numerics.weierstrass import QuarticMotion, Weierstrass
from .thick_paths import CULLED_BEYOND, HORIZON_MARGIN, LEAST_BASE, Samples, along, late_rate, turn_rate, unwrapped

LEAD_NODES = 12
"""Nodes of Gauss and Legendre's rule from the camera to the layer."""
_PLACES, _WEIGHTS = (each[:, None] for each in leggauss(LEAD_NODES))

INWARD_TIME, OUTWARD_TIME, LONGEST = 2.0, 1.5, 6.0
"""Mino times after which rays have ended, over their way in u: U >= 1/2 on the way of those of small A. And for rays
that stay in the plane, in units of `Weierstrass.rate`."""

SEARCHED, BISECTIONS = 48, 8
"""Places along a ray at which the layer is looked for, and halvings of what is left of where it begins and ends."""

LEAST_TIME, LEAST_SPEED = 1e-9, 1e-9


class SlowPaths:
    """Rays of one camera that `LayerPaths` does not follow, and their way through a layer; used as that is."""

    def __init__(self, rays: Rays, cosine: float, left: Mask) -> None:
        """`cosine`: cos theta_m; `left`: which rays are meant, shape (n,); those without energy are left out."""
        self.live: Index = np.flatnonzero(left & rays.escapes)
        self.rays, self._cosine = rays.select(self.live), cosine
        rays, a2 = self.rays, rays.spin**2
        self._base = np.maximum(np.nan_to_num(PolarMotion.of(rays).base), 0.0)
        (self._x0, self._y0, self._v0), theta_hat, phi_hat = PolarMotion.of(rays).triad
        rate = -(rays.polar * theta_hat[:, None] + rays.azimuthal * phi_hat[:, None])
        self._rise = rate[2]
        self._pole = np.sqrt(self._base + a2)
        speed = self._speed_at(slice(None), np.full(len(rays), self._v0))
        with np.errstate(all="ignore"):
            drift = -a2 * rays.b / (self._pole * (speed + self._pole)) if a2 > 0.0 else np.zeros(len(rays))
            known = speed > LEAST_SPEED
            self._xt, self._yt = (
                np.where(known, each / np.where(known, speed, 1.0), 0.0)
                for each in (rate[0] + drift * self._y0, rate[1] - drift * self._x0)
            )
        polar = -(rays.q_plus_b2 - a2), np.zeros(len(rays)), np.full(len(rays), -a2)
        self._polar, self._polar_function = np.stack(polar), Weierstrass.of_quartic(*polar, c0=rays.q)
        radial = radial_polynomial(rays)
        self._radial, self._radial_function = np.stack(radial), Weierstrass.of_quartic(*radial)
        self._u0 = 1.0 / rays.observer.r
        self._highest = 1.0 / (horizon_radius(rays.spin) * HORIZON_MARGIN)

    def orders(self, crossings: int) -> range:
        """Return the numbers of passes: all that rays meet is one pass."""
        return range(min(crossings, 1) if len(self.live) else 0)

    def passes(self, order: int, crossings: int, inner: float, outer: float) -> tuple[Index, Array, Array]:
        """Return which of `live` meet the disk, and the Mino times from the camera between which they do, (n,)."""
        count = len(self.live)
        none = np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0)
        if order or not count:
            return none
        inward = self.rays.radial > 0.0
        way = np.where(inward, INWARD_TIME * (self._highest - self._u0), OUTWARD_TIME * self._u0)
        long = self._base >= LEAST_BASE
        way[long] = LONGEST / self._radial_function.rate[long]
        every = np.arange(count)
        shares = np.linspace(0.0, 1.0, SEARCHED)[:, None]

        def met(index: Index, time: Array) -> tuple[Mask, Mask, Array]:
            """Return where rays are in the layer, where they are on the disk alone, and cos theta."""
            u, _, height = self._places(index, np.maximum(time, LEAST_TIME))
            on_disk = (u > 1.0 / (outer * CULLED_BEYOND)) & (u < CULLED_BEYOND / inner)
            return on_disk & (np.abs(height) <= self._cosine), on_disk, height

        for _ in range(2):
            u, _, _ = self._places(every, np.maximum(shares * way, LEAST_TIME))
            gone = self._gone(u)
            way = np.where(gone.any(axis=0), way * shares[gone.argmax(axis=0), 0], way)
        time = shares * way
        gone = self._gone(self._places(every, np.maximum(time, LEAST_TIME))[0])
        inside, on_disk, height = met(every, time)
        inside &= ~gone
        # A layer thinner than the steps is found where the plane is crossed.
        one, other = height[:-1], height[1:]
        with np.errstate(all="ignore"):
            crossed = (one * other < 0.0) & on_disk[:-1] & on_disk[1:] & ~inside[:-1] & ~inside[1:] & ~gone[1:]
            share = np.where(crossed, one / (one - other), 0.0)
        moved = time.copy()
        moved[:-1] += share * np.diff(time, axis=0)
        inside[:-1] |= crossed
        chosen = np.flatnonzero(inside.any(axis=0))
        if not len(chosen):
            return none
        first, last = inside.argmax(axis=0)[chosen], SEARCHED - 1 - inside[::-1].argmax(axis=0)[chosen]
        ends = []
        for number, outside, within in (
            (first, moved[np.maximum(first - 1, 0), chosen], moved[first, chosen]),
            (last, time[np.minimum(last + 1, SEARCHED - 1), chosen], moved[last, chosen]),
        ):
            outside = np.where(inside[0, chosen] & (number == 0), 0.0, outside)
            for _ in range(BISECTIONS):
                middle = 0.5 * (outside + within)
                is_in = met(chosen, middle[None])[0][0]
                within, outside = np.where(is_in, middle, within), np.where(is_in, outside, middle)
            ends.append(outside)
        long_enough = ends[1] > ends[0]
        return chosen[long_enough], ends[0][long_enough], ends[1][long_enough]

    def heights(self, chosen: Index, low: Array, high: Array, edges: Array) -> tuple[Samples, Array]:
        """Return what `samples` does without azimuths and delays, and the Mino times."""
        middles, widths = 0.5 * (edges[1:] + edges[:-1]), edges[1:] - edges[:-1]
        time = np.maximum(low + (high - low) * middles, LEAST_TIME)
        u, slope, height = self._places(chosen, time)
        u[self._gone(u)] = np.nan
        none = np.zeros(0)
        return Samples(u, slope, height, none, (high - low) * widths, none, time), time

    def samples(self, chosen: Index, low: Array, high: Array, edges: Array, timed: bool) -> Samples:
        """Return places in the middle of parts of passes; see `LayerPaths.samples`."""
        known, time = self.heights(chosen, low, high, edges)
        rays, a = self.rays.select(chosen), self.rays.spin
        lead, weights = 0.5 * (1.0 + _PLACES) * time[0], 0.5 * time[0] * _WEIGHTS
        with np.errstate(all="ignore"):
            u, slope, height = self._places(chosen, lead)

            def integral(before: Array, here: Array) -> Array:
                total: Array = (weights * before).sum(axis=0) + along(time, here)
                return total

            turned = integral(turn_rate(rays, u), turn_rate(rays, known.u))
            drifts = self._drift_rate(chosen, height), self._drift_rate(chosen, known.height)
            turned += integral(*drifts)
            angle = integral(self._speed_at(chosen, height), self._speed_at(chosen, known.height))
            delay = np.zeros_like(time)
            if timed:
                delay = integral(late_rate(rays, u, slope), late_rate(rays, known.u, known.u_slope))
                delay += 1.0 / self._u0 - 1.0 / known.u + 2.0 * np.log(known.u / self._u0)
                delay += time * (a * rays.b - a * a) + a * a * integral(height * height, known.height**2)
        cos, sin = np.cos(angle), np.sin(angle)
        x, y = self._x0 * cos + self._xt[chosen] * sin, self._y0 * cos + self._yt[chosen] * sin
        phi = unwrapped(np.arctan2(y, x)) + turned
        return Samples(known.u, known.u_slope, known.height, phi, known.mino_step, delay, time)

    def _places(self, chosen: Index, time: Array) -> tuple[Array, Array, Array]:
        """Return u, du / dlambda and cos theta at Mino times > 0, shape (k, n)."""
        count = len(chosen)
        with np.errstate(all="ignore"):  # rays may have ended before
            motion = QuarticMotion(
                self._radial_function.select(chosen),
                self._radial[:, chosen],
                np.full(count, self._u0),
                self.rays.radial[chosen] * self._u0**2,
            )
            u, slope = motion.after(*self._radial_function.select(chosen).at(time))
            function = self._polar_function.select(chosen)
            swing = QuarticMotion(function, self._polar[:, chosen], np.full(count, self._v0), self._rise[chosen])
            height, _ = swing.after(*function.at(time))
        return u, slope, height

    def _speed_at(self, chosen: Index | slice, height: Array) -> Array:
        """Return s = dD / d lambda."""
        speed: Array = np.sqrt(self._base[chosen] + self.rays.spin**2 * height * height)
        return speed

    def _drift_rate(self, chosen: Index, height: Array) -> Array:
        """Return the slow turn of that circle about the axis by Mino time."""
        a2, pole = self.rays.spin**2, self._pole[chosen]
        if a2 == 0.0:
            return np.zeros_like(height)
        rate: Array = -a2 * self.rays.b[chosen] / (pole * (self._speed_at(chosen, height) + pole))
        return rate

    def _gone(self, u: Array) -> Mask:
        """Return where rays have come to their end, at places in order."""
        ended: Mask = np.logical_or.accumulate(~((u > 0.0) & (u < self._highest)), axis=0)
        return ended
