# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a ray is at given Mino times, by series: u = 1 / r and psi along the whole way to infinity or to the horizon.

For tight tolerances, and for what the closed form of `radial_motion` leaves open.

The radial coordinate x of `mino` grows along the ray and dx / dlambda = x' is known, so lambda(x) and psi(x) are
integrals of known functions, smooth on the way. Both integrands are sampled at Chebyshev points; their Chebyshev
series, integrated term by term, give lambda and psi for every x at once, and Newton's method finds the x of each Mino
time, whatever the number of them. The highest coefficients tell the error (Trefethen 2013, Approximation Theory and
Approximation Practice, ch. 8); rays whose series have not converged get twice the points.

Four kinds of ray: those that turn outside their barrier and those that go straight out go on to infinity, u = 0;
those that go straight in and those that turn inside their barrier end at the horizon. All have u = u_c (1 +- x) or
u_c (1 +- x^2). The equations know neither end: u goes on through 0 to a negative root of U, and through the horizon, so
u is a smooth function of the ray also where some rays have ended, and paths are followed some way beyond.

At the horizon psi is infinite: it winds up like +- W(u),
W(u) = a / (r_+ - r_-) ln((1 - r_+ u) / (1 - r_- u)), dW = -a du / (1 - 2 u + a^2 u^2), which is what Kerr's own
azimuth differs by from Boyer and Lindquist's (Kerr 1963, Phys. Rev. Lett. 11, 237). Along a ray, with
p = 1 + a (a - b) u^2 and S = |du / dlambda|, psi' = a - a p / (1 - 2 u + a^2 u^2), and since by Eq. 3
p^2 - S^2 = (1 - 2 u + a^2 u^2)(q + (b - a)^2) u^2,

    psi' = +- W'(u) S + a - a (q + (b - a)^2) u^2 / (p + S),

the upper sign for rays on their way in. What is left of W is regular at the horizon, and that is what is integrated.
p > 0 for light of positive energy; for that of negative energy, whose hole is mirrored (`negative_energy_rays`), p < 0
all along the ray, as p^2 > S^2 outside the horizon. Then W has the other sign, and p + S becomes p - S.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kerr.critical_curve import Barrier
from ..kerr.metric import horizon_radius
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Index, Mask
from .mino import direct_polynomial, inner_turning_polynomial, turning_polynomial
from .quadrature import negative_root

# Chebyshev points that are tried, one number after another; most rays need no more than the first. Few will do where
# the tolerance is at least this; straight into the hole the integrands are less smooth.
POINT_COUNTS = (12, 20, 32, 64, 128)
POINT_COUNTS_TO_HORIZON = (24, 32, 64, 128)
FEW_POINTS_TOLERANCE = 3e-6

# Multiplications of one matrix product up to which OpenBLAS stays with one thread; waking others takes longer.
SMALL_PRODUCT = 200_000

# Rays worked through at a time: their samples stay in the cache.
CHUNK = 4096

# Highest coefficients that tell the error, and how many times the tolerance they may amount to: they are those of the
# derivative, of which integration leaves 1 / (2 k), and what is left out is smaller still. Errors were found to be a
# third of the tolerance at the most. Rounding of some 1e-11 next to the horizon is no lack of points.
TAIL = 2
TAIL_SHARE = 100.0
ROUNDING = 1e-9

# A ray has ended before a Mino time for certain if it is later by this many times the coefficients that tell the error.
ENDED_MARGIN = 10.0
ENDED_ERROR = 1e-3

# Newton's rounds from the straight line between two points, and the share of the tolerance's square root that the last
# of them may change by: its square is left.
NEWTON_ROUNDS = 6
LAST_CHANGE = 0.03

# The horizon itself, where psi is infinite, is not reached: rays end at this multiple of its radius.
HORIZON_MARGIN = 1.0 + 1e-9

# How far paths go beyond infinity, as a share of the way to U's negative root; and beyond the horizon, as a share of
# the way to the inner one, and at most to this many times 1 / r_+.
BEYOND = 0.7
MOST_BEYOND = 2.0

# A singularity nearer to x = 0 than this share of the way is stretched away.
STRETCH_BELOW = 0.7


@dataclass(frozen=True)
class RadialPath:
    """The radial motion of rays of one kind; arrays of shape (n,)."""

    spin: float
    squared: bool
    """Whether u = unit (1 + sign x^2) instead of unit (1 + sign x)."""
    sign: float
    """-1 for rays that end at infinity, 1 for those that end at the horizon."""
    b: Array
    carter_k: Array
    """Carter's constant in the form K = q + (b - a)^2, units of M^2 (Carter 1968, Phys. Rev. 174, 1559)."""
    rates: Array
    """Polynomial of x'^2 in x or x^2, low powers first, shape (4 or 5, n)."""
    unit: Array
    start: Array
    end: Array
    far: Array
    """Where x' has a branch point beyond infinity, > 1: U's negative root."""
    near: Array
    """About where x' has a singularity next to x = 0, at +-i near."""
    pace: Array
    """How fast the ray's direction turns, radians per Mino time."""
    sense: Array
    """The sign of p: that of the light's energy."""

    def select(self, chosen: Index) -> RadialPath:
        """Return the path of the chosen rays alone."""
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        part: dict[str, Any] = {name: value[..., chosen] for name, value in values if isinstance(value, np.ndarray)}
        return replace(self, **part)

    def u(self, x: Array) -> Array:
        """Return 1 / r."""
        u: Array = self.unit * (1.0 + self.sign * (x * x if self.squared else x))
        return u

    def u_slope(self, x: Array) -> Array:
        """Return du / dlambda, along the ray backwards."""
        slope: Array = self.sign * self.unit * self.speed(x)
        return 2.0 * x * slope if self.squared else slope

    def u_bend(self, x: Array) -> Array:
        """Return d^2 u / dlambda^2."""
        z = x * x if self.squared else x
        # d(x'^2) / dz
        half: Array = np.zeros_like(z)
        for power in range(len(self.rates) - 1, 0, -1):
            half = half * z + power * self.rates[power]
        if not self.squared:
            return 0.5 * self.sign * self.unit * half
        bend: Array = 2.0 * self.sign * self.unit * (self.speed(x) ** 2 + z * half)
        return bend

    def speed(self, x: Array) -> Array:
        """Return dx / dlambda."""
        z = x * x if self.squared else x
        square: Array = self.rates[-1] * z
        for coefficient in self.rates[-2:0:-1]:
            square += coefficient
            square *= z
        square += self.rates[0]
        speed: Array = np.sqrt(np.maximum(square, 0.0))
        return speed

    def turn_rate(self, x: Array, speed: Array) -> Array:
        """Return dpsi / dlambda, without the winding of `wound`; `speed` is dx / dlambda."""
        u, a = self.u(x), self.spin
        if self.wound == 0.0:
            plain: Array = a * u * (a * self.b * u - 2.0) / self._delta(u)
            return plain
        slope = self.unit * speed * (2.0 * np.abs(x) if self.squared else 1.0)
        total = self.sense * (1.0 + a * (a - self.b) * u * u) + slope
        rate: Array = a - self.sense * a * self.carter_k * u * u / total
        if self.squared:
            # before the turning point the ray goes out
            rate = np.where(x < 0.0, a - self.sense * a * total / self._delta(u), rate)
        return rate

    def _delta(self, u: Array) -> Array:
        """Return u^2 Delta = 1 - 2 u + a^2 u^2, which keeps its digits at the horizon in this form."""
        outer = horizon_radius(self.spin)
        delta: Array = (1.0 - outer * u) * (1.0 - (self.spin * self.spin / outer) * u)
        return delta

    @property
    def wound(self) -> float:
        """How many times W is taken out of psi: 1 for rays that end at the horizon, -1 for those straight out."""
        return 0.0 if self.squared and self.sign < 0.0 else self.sign


def energy_sense(rays: Rays) -> Array:
    """Return the sign of p = 1 + a (a - b) u^2 along rays, shape (n,): 1, or -1 for light of negative energy.

    Parameters
    ----------
    rays : Rays
        Of a mirrored hole, if their energy is negative.
    """
    u = 1.0 / rays.observer.r
    return np.where(1.0 + rays.spin * (rays.spin - rays.b) * u * u < 0.0, -1.0, 1.0)


def winding(spin: float, u: NDArray[Any]) -> NDArray[Any]:
    """Return W(u), by which the azimuth of a ray winds up on its way to the horizon.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    u : ndarray
        1 / r < 1 / r_+, units of 1 / M.

    Returns
    -------
    ndarray
        Radians; the shape of `u`.
    """
    inner = spin * spin / horizon_radius(spin)
    between = 2.0 * math.sqrt((1.0 - spin) * (1.0 + spin))  # r_+ - r_-, with its digits for the fastest holes
    wound: NDArray[Any] = np.log1p(-between * u / (1.0 - inner * u))
    wound *= spin / between
    return wound


def paths_of(rays: Rays, barrier: Barrier) -> list[tuple[Index, RadialPath]]:
    """Return the rays by kind: indices, (n,), and their path."""
    outside = rays.observer.r > barrier.radius
    outgoing = rays.radial < 0.0
    kinds = (
        (barrier.blocks & outside, True, -1.0),
        (~barrier.blocks & outgoing, False, -1.0),
        (~barrier.blocks & ~outgoing, False, 1.0),
        (barrier.blocks & ~outside, True, 1.0),
    )
    found = []
    for chosen, squared, sign in kinds:
        index = np.flatnonzero(chosen)
        if len(index):
            found.append((index, _path(rays.select(index), barrier.select(index), squared, sign)))
    return found


def _path(rays: Rays, barrier: Barrier, squared: bool, sign: float) -> RadialPath:
    a = rays.spin
    pace = np.sqrt(np.maximum(rays.q_plus_b2 + a * a, 0.0))
    carter_k = rays.q_plus_b2 + a * (a - 2.0 * rays.b)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = negative_root(rays)
        if squared:
            start, unit, rates = (turning_polynomial if sign < 0.0 else inner_turning_polynomial)(rays, barrier)
            g0, g1, g2 = rates[:3]
            discriminant = np.sqrt(np.maximum(g1 * g1 - 4.0 * g0 * g2, 0.0))
            near = np.sqrt(np.where(g1 > 0.0, 2.0 * g0 / (g1 + discriminant), np.inf))
        else:
            start, unit, rates = direct_polynomial(rays, barrier, inward=sign > 0.0)
            if sign > 0.0:
                start = -start
                rates[1::2] *= -1.0
            near = np.sqrt(np.where(rates[2] > 0.0, rates[0] / rates[2], np.inf))
        u_end = -BEYOND * root if sign < 0.0 else beyond_horizon(a)
        end = sign * (u_end / unit - 1.0)
        far = 1.0 + root / unit
        if squared:
            end, far = np.sqrt(np.maximum(end, 0.0)), np.sqrt(far)
    sense = energy_sense(rays)
    return RadialPath(a, squared, sign, rays.b, carter_k, rates, unit, start, end, far, near, pace, sense)


def beyond_horizon(spin: float) -> float:
    """Return u where paths through the horizon end, before the inner one."""
    outer = 1.0 / horizon_radius(spin)
    square = spin * spin
    inner = 1.0 / (square * outer) if square else math.inf
    return min(outer + BEYOND * (inner - outer), MOST_BEYOND * outer)


def along_parabola(u: Array, slope: Array, bend: Array, late: Array) -> tuple[Array, Array, Array]:
    """Return u and du / dlambda so much later than where u, its slope and its bend are given, and how much that is: no
    later than the parabola's vertex, or u would come back."""
    late = np.where(slope * bend < 0.0, np.minimum(late, -slope / bend), late)
    return u + late * (slope + 0.5 * late * bend), slope + late * bend, late


@dataclass(frozen=True)
class Places:
    """Where rays are at Mino times asked for, shape (k, n), beyond their ends as well: u <= 0 or 1 / u <= r_+."""

    u: Array
    u_slope: Array
    """du / dlambda along the ray backwards."""
    unwound: Array
    """psi - W(u), or psi + W(u) for light of negative energy: regular at the horizon."""
    resolved: Mask
    """Shape (n,)."""

    @classmethod
    def empty(cls, times: int, count: int) -> Places:
        """Return places that are all unknown."""
        u, u_slope, unwound = (np.full((times, count), np.nan) for _ in range(3))
        return cls(u, u_slope, unwound, np.zeros(count, dtype=bool))

    def put(self, index: Index, other: Places) -> None:
        """Take over what `other` knows of the rays of `index`."""
        for name in ("u", "u_slope", "unwound"):
            getattr(self, name)[:, index] = getattr(other, name)
        self.resolved[index] = other.resolved


def places(path: RadialPath, times: Array, tolerance: float) -> Places:
    """Return where rays are at Mino times of shape (k, n), NaN for none, with an error of `tolerance` radians.

    Beyond the end of their path, which is beyond their own, rays go on along its last parabola to the vertex, and
    inside the horizon they turn on at their last rate.
    """
    count = len(path.b)
    found = Places.empty(len(times), count)
    waiting = np.arange(count)
    counts = POINT_COUNTS_TO_HORIZON if path.sign > 0.0 else POINT_COUNTS
    for points in counts if tolerance >= FEW_POINTS_TOLERANCE else counts[1:]:
        failed = []
        for start in range(0, len(waiting), CHUNK):
            index = waiting[start : start + CHUNK]
            part = _Series(path.select(index), points).places(times[:, index], tolerance)
            found.put(index, part)
            failed.append(index[~part.resolved])
        waiting = np.concatenate(failed) if failed else waiting
        if not len(waiting):
            break
    return found


def _points_and_matrices(count: int) -> tuple[Array, Array, Array, Array]:
    """Return Chebyshev points in [-1, 1], and matrices from values there to coefficients, to those of the integral from
    -1, (count + 1, count), and to that integral's values there."""
    angle: Array = np.pi * (count - 0.5 - np.arange(count)) / count
    order = np.arange(count)[:, None]
    to_series: Array = np.cos(order * angle) * (2.0 / count)
    to_series[0] *= 0.5
    # integral of T_j is T_(j+1) / (2 (j + 1)) - T_(j-1) / (2 (j - 1))
    integrate = np.zeros((count + 1, count))
    for j in range(count):
        integrate[j + 1, j] += 1.0 if j == 0 else 0.5 / (j + 1)
        if j > 1:
            integrate[j - 1, j] -= 0.5 / (j - 1)
    integrate[0] -= ((-1.0) ** np.arange(count + 1)) @ integrate
    to_integral = integrate @ to_series
    at_points: Array = np.cos(np.arange(count + 1) * angle[:, None]) @ to_integral
    points: Array = np.cos(angle)
    return points, to_series[-TAIL:], to_integral, at_points


def _product(matrix: Array, values: Array) -> Array:
    """Return matrix @ values in pieces too small for the linear algebra library to start threads for."""
    result = np.empty((len(matrix), values.shape[1]))
    width = max(1, SMALL_PRODUCT // matrix.size)
    for start in range(0, values.shape[1], width):
        np.matmul(matrix, values[:, start : start + width], out=result[:, start : start + width])
    return result


_RULES = {count: _points_and_matrices(count) for count in {*POINT_COUNTS, *POINT_COUNTS_TO_HORIZON}}


class _Series:
    """lambda and psi of some rays as Chebyshev series of z in [-1, 1], x = x(z)."""

    def __init__(self, path: RadialPath, count: int) -> None:
        self.path = path
        points, self.to_tail, to_integral, at_points = _RULES[count]
        self.points = points
        with np.errstate(all="ignore"):  # what comes of impossible rays is not finite, and found by `places`
            way = path.end - path.start
            self.stretched = path.near < STRETCH_BELOW * way
            self.center = self._unfold(np.zeros_like(path.near))
            # how far from there the singularity is once folded: its distance over |dx / dt|
            near = np.where(self.stretched, path.near, 1.0) / np.abs(self._fold(self.center)[1])
            self.scale = np.maximum(near, np.finfo(float).tiny)
            low, high = (self._unfold(x) for x in (path.start, path.end))
            low, high = (np.where(self.stretched, np.arcsinh((t - self.center) / self.scale), t) for t in (low, high))
            self.half, self.middle = 0.5 * (high - low), 0.5 * (high + low)
            x, step = self.place(points[:, None])
            speed = path.speed(x)
            values = step / speed
            self.time_tail = np.abs(_product(self.to_tail, values)).sum(axis=0)
            self.time_series, self.time_at_points = _product(to_integral, values), _product(at_points, values)
            self.duration = self.time_series.sum(axis=0)
            if path.spin != 0.0:
                values *= path.turn_rate(x, speed)
                self.psi_tail = np.abs(_product(self.to_tail, values)).sum(axis=0)
                self.psi_series = _product(to_integral, values)

    def place(self, z: Array) -> tuple[Array, Array]:
        """Return x and dx / dz at z."""
        t: Array = z * self.half + self.middle
        rate: Array | float = 1.0
        if self.stretched.any():
            chosen = self.stretched
            grown = np.exp(t[..., chosen])
            shrunk, half = 1.0 / grown, 0.5 * self.scale[chosen]
            t[..., chosen] = self.center[chosen] + half * (grown - shrunk)
            rate = np.ones_like(t)
            rate[..., chosen] = half * (grown + shrunk)
        x, slope = self._fold(t)
        return x, slope * self.half * rate

    def _fold(self, t: Array) -> tuple[Array, Array]:
        """Return x and dx / dt of the substitution that takes the branch point at `far` out of the integrands."""
        if self.path.sign > 0.0:
            return t, np.ones_like(t)
        if not self.path.squared:
            return self.path.far - t * t, -2.0 * t  # sqrt(far - x) = -t
        # sqrt(far^2 - x^2) = far (1 - t^2) / (1 + t^2)
        below = 1.0 / (1.0 + t * t)
        x = 2.0 * self.path.far * t * below
        return x, 2.0 * self.path.far * (2.0 * below - 1.0) * below

    def _unfold(self, x: Array) -> Array:
        """Return t of `_fold`."""
        if self.path.sign > 0.0:
            return x
        if not self.path.squared:
            root: Array = -np.sqrt(self.path.far - x)
            return root
        share = x / self.path.far
        t: Array = share / (1.0 + np.sqrt(1.0 - share * share))
        return t

    def select(self, chosen: Index) -> _Series:
        """Return the series of the chosen rays alone, for `place` and `sums`."""
        part = object.__new__(_Series)
        part.path = self.path.select(chosen)
        for name in ("half", "middle", "center", "scale", "stretched"):
            setattr(part, name, getattr(self, name)[chosen])
        part.time_series = self.time_series[:, chosen]
        if self.path.spin != 0.0:
            part.psi_series = self.psi_series[:, chosen]
        return part

    def unwound(self, u: Array, z: Array) -> Array:
        """Return psi without W(u) at z, where u is `u`."""
        path = self.path
        if path.spin == 0.0:
            return np.zeros_like(u)
        total = _clenshaw(self.psi_series, z)
        if path.wound != 0.0:
            total -= path.wound * path.sense * winding(path.spin, path.u(path.start))
        if path.wound != 1.0:
            total += (path.wound - 1.0) * path.sense * winding(path.spin, u)
        return total

    def places(self, times: Array, tolerance: float) -> Places:
        """Return where the rays are; `resolved` only where the series have converged."""
        path = self.path
        with np.errstate(all="ignore"):
            error = self.time_tail * path.pace
            if path.spin != 0.0:
                error += self.psi_tail
            resolved = error <= max(TAIL_SHARE * tolerance, ROUNDING)
            # Rays that have ended before anything is asked of them need be known no better than that.
            first = np.fmin.reduce(times, axis=0)
            resolved |= (first > self.duration + ENDED_MARGIN * self.time_tail) & (error < ENDED_ERROR)
            resolved &= np.isfinite(self.duration)
            found = Places.empty(*times.shape)
            found.resolved[:] = resolved
            order, ray = np.nonzero((times < self.duration) & resolved)
            if len(ray):
                series, wanted = self.select(ray), times[order, ray]
                z = self._invert(series, ray, wanted, LAST_CHANGE * tolerance**0.5)
                x, _ = series.place(z)
                u = series.path.u(x)
                found.u[order, ray], found.u_slope[order, ray] = u, series.path.u_slope(x)
                found.unwound[order, ray] = series.unwound(u, z)
            order, ray = np.nonzero((times >= self.duration) & resolved)
            if len(ray):
                series, late = self.select(ray), times[order, ray] - self.duration[ray]
                end = series.path.end
                u, slope, bend = series.path.u(end), series.path.u_slope(end), series.path.u_bend(end)
                found.u[order, ray], found.u_slope[order, ray], late = along_parabola(u, slope, bend, late)
                unwound = series.unwound(u, np.ones_like(end))
                if path.wound == 1.0 and path.spin != 0.0:
                    unwound += late * series.path.turn_rate(end, series.path.speed(end))
                found.unwound[order, ray] = unwound
        return found

    def _invert(self, series: _Series, ray: Index, times: Array, last_change: float) -> Array:
        """Return z at the given Mino times."""
        known = np.vstack([np.zeros(len(self.half)), self.time_at_points, self.duration])[:, ray]
        after = np.clip((known <= times).sum(axis=0), 1, len(known) - 1)
        every = np.arange(len(ray))
        low, high = known[after - 1, every], known[after, every]
        at = np.concatenate([[-1.0], self.points, [1.0]])
        z = at[after - 1] + (at[after] - at[after - 1]) * np.clip((times - low) / (high - low), 0.0, 1.0)
        for _ in range(NEWTON_ROUNDS):
            x, step = series.place(z)
            change = (_clenshaw(series.time_series, z) - times) * series.path.speed(x) / step
            z = np.clip(z - change, -1.0, 1.0)
            if not (np.abs(change) > last_change).any():
                break
        where: Array = z
        return where


def _clenshaw(series: Array, z: Array) -> Array:
    """Return the Chebyshev series, shape (m, n), at z, shape (n,)."""
    double = 2.0 * z
    one, two = np.zeros_like(z), np.zeros_like(z)
    for coefficient in series[:0:-1]:
        one, two = double * one - two + coefficient, one
    total: Array = z * one - two + series[0]
    return total


def places_of_rays(rays: Rays, barrier: Barrier, times: Array, tolerance: float) -> Places:
    """Return where rays of any kind are at Mino times of shape (k, n); see `places`."""
    found = Places.empty(len(times), len(rays))
    for index, path in paths_of(rays, barrier):
        found.put(index, places(path, times[:, index], tolerance))
    return found
