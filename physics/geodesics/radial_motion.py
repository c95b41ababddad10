# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a ray is at given Mino times, in closed form: u = 1 / r by elliptic functions, psi by a few of their values.

u obeys u'^2 = U(u) (`mino`), which `weierstrass` solves for any time at once: from the camera to the middle of the time
asked for, and from there to the nodes of Gauss's and Legendre's quadrature on both sides of it, where psi' is wanted.
That is smooth in Mino time, unlike in r: six nodes serve most rays. Its highest coefficients tell the error, as in
`radial_path`, whose conventions are also these: psi without its winding, and paths that go on beyond infinity and
through the horizon for a while. What is not determined, and rays that start inside of what turns them, are left to
that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss

from ..kerr.critical_curve import Barrier
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Index, Mask
from ..numerics.weierstrass import QuarticMotion, Weierstrass, acceleration
from .mino import radial_polynomial
from .quadrature import negative_root
from .radial_path import TAIL, Places, along_parabola, beyond_horizon, winding
from .radial_path import places_of_rays as places_by_series

# Tightest tolerance that is served: where rays part next to the critical curve rounding costs up to 1e-7 of u.
TIGHTEST = 3e-7

# Numbers of nodes, and the longest times that they are used for (`Weierstrass.rate`): half a turn, one and a half. Last
# what the others are not enough for.
NODE_COUNTS = (6, 12, 24)
LONGEST_TIMES = (1.0, 2.6)

# Fewer pairs than this are better served by more nodes than by a call of their own.
FEW = 800
# Fewer rays that have fallen in than this are followed to their ends with the next.
FEW_ENDED = 150

# What the highest coefficients may amount to, squared, in units of the tolerance: the error was found to be a hundredth
# of that square, as Gauss's and Legendre's rule is good for polynomials of twice the degree.
TAIL_SQUARE = 50.0

# So many times may rounding grow, per tolerance: being some 1e-11 of the elliptic function, it is a tenth of that then.
MOST_LOST = 1e10

# A path into the hole whose slope is above minus this has not turned; and how well its end has to be met, in u.
HOVERING = 1e-3
END_ERROR = 0.05

# No ray is followed longer than this for the first crossing that may be asked for, and for each more, in the same
# units.
LONGEST_FIRST, LONGEST_MORE = 1.5, 0.9

# Pairs of rays and times worked through at once: what is known of their nodes stays in the cache.
CHUNK = 4096

# Rounds to the end of a path at the most, and the share of the tolerance's cube root that the last may change by.
END_ROUNDS = 8
LAST_CHANGE = 0.1
# The least share of the way between two nodes that is left before the end, to start with.
LEAST_WAY = 1e-6
# A round shortens the way to this share of it at the most.
LEAST_SHARE = 0.1


@dataclass(frozen=True)
class _Rule:
    """Gauss's and Legendre's rule over a time, by nodes on both sides of its middle."""

    sides: Array
    """Distances from the middle, first 1, the end itself, in units of half of the time; shape (1 + k,)."""
    weights: Array
    """For the values at + and then at - sides[1:], shape (2 k,); they sum up to 1."""
    to_tail: Array
    """To the highest Legendre coefficients, shape (`TAIL`, 2 k)."""
    in_order: Index
    """Of the nodes' values, followed by those in the middle and at the end, in time; shape (2 k + 2,)."""
    times: Array
    """These times in order, 0 before them; shape (2 k + 3,)."""

    @classmethod
    def of(cls, count: int) -> _Rule:
        """Return the rule of an even number of nodes."""
        nodes, weights = leggauss(count)
        polynomials = [np.ones(count), nodes]
        for n in range(1, count - 1):
            polynomials.append(((2 * n + 1) * nodes * polynomials[n] - n * polynomials[n - 1]) / (n + 1))
        to_series = (np.arange(count)[:, None] + 0.5) * np.stack(polynomials) * weights
        half = count // 2
        both = np.concatenate([np.arange(half, count), np.arange(half)[::-1]])
        times = 0.5 * (1.0 + np.concatenate([nodes[both], [0.0, 1.0]]))
        in_order = np.argsort(times)
        return cls(
            np.concatenate([[1.0], nodes[half:]])[:, None],
            0.5 * weights[both],
            to_series[-TAIL:][:, both],
            in_order,
            np.concatenate([[0.0], times[in_order]]),
        )


_RULES = {count: _Rule.of(count) for count in NODE_COUNTS}


class _Paths:
    """Rays from one camera and a time for each; arrays of shape (n,)."""

    def __init__(self, spin: float, start: float, function: Weierstrass, constants: Array, time: Array) -> None:
        """`start`: u at the camera; `constants`: all that is told of single rays below, shape (9, n)."""
        self.spin, self.start, self.function, self.time = spin, start, function, time
        self._constants = constants
        self.quartic: Array = constants[:3]
        """c_2, c_3, c_4 of U, shape (3, n)."""
        self.slope, self.b, self.carter_k, inward, self.lowest, self.pace = constants[3:]
        """du / dlambda at the camera; p_phi; q + (b - a)^2; U's negative root, to some per cent, where rays stay that
        have gone beyond infinity; how fast the ray's direction turns, radians per Mino time."""
        self.inward: Mask = inward > 0.0
        """Whether the ray falls straight in: it ends at the horizon, the others at infinity."""
        self.highest = beyond_horizon(spin)
        """u inside the horizon where paths end."""

    @classmethod
    def of(cls, rays: Rays, barrier: Barrier) -> _Paths:
        """Return the paths of rays, for no time yet."""
        spin, start = rays.spin, 1.0 / rays.observer.r
        with np.errstate(all="ignore"):  # impossible rays are not asked for
            quartic = radial_polynomial(rays)
            constants = np.stack(
                [
                    *quartic,
                    rays.radial * (start * start),
                    rays.b,
                    rays.q_plus_b2 + spin * (spin - 2.0 * rays.b),
                    ~barrier.blocks & (rays.radial >= 0.0),
                    -negative_root(rays),
                    np.sqrt(np.maximum(rays.q_plus_b2 + spin * spin, 0.0)),
                ]
            )
            return cls(spin, start, Weierstrass.of_quartic(*quartic), constants, np.empty(0))

    def for_times(self, chosen: Index, time: Array) -> _Paths:
        """Return the paths of the chosen rays, for these times."""
        return _Paths(self.spin, self.start, self.function.select(chosen), self._constants.take(chosen, axis=1), time)

    def lasting(self, time: Array) -> _Paths:
        """Return the same paths for other times."""
        return _Paths(self.spin, self.start, self.function, self._constants, time)

    def motion(self) -> QuarticMotion:
        """Return u from the camera on."""
        return QuarticMotion(self.function, self.quartic, np.full_like(self.slope, self.start), self.slope)

    def nodes(self, rule: _Rule) -> tuple[Array, Array, Array]:
        """Return u and du / dlambda at a rule's nodes, in the middle and at the end, shape (2 k + 2, n), and how many
        times rounding has grown on the way there, at the most."""
        value, slope = self.function.at((0.5 * self.time) * rule.sides)
        motion = self.motion()
        middle = motion.after(value[0], slope[0])
        from_middle = QuarticMotion(self.function, self.quartic, *middle)
        after, before = from_middle.around(value, slope)
        u, rate = (
            np.concatenate([later[1:], earlier[1:], center[None], later[:1]])
            for later, earlier, center in zip(after, before, middle, strict=True)
        )
        lost = np.maximum(motion.cancellation(value[0], slope[0]), from_middle.cancellation(value[0], slope[0]))
        return u, rate, lost

    def turn_rate(self, u: Array, slope: Array) -> Array:
        """Return dpsi / dlambda without the winding W(u), regular at the horizon on the way in (`radial_path`)."""
        a = self.spin
        square = u * u
        p = square * (a * (a - self.b))
        p += 1.0
        p += np.abs(slope)
        square *= self.carter_k
        # 1 - 2 u + a^2 u^2
        delta = u * (a * a)
        delta -= 2.0
        delta *= u
        delta += 1.0
        inward = slope > 0.0
        rate: Array = np.where(inward, square, p)
        rate /= np.where(inward, p, delta)
        rate *= -a
        rate += a
        return rate

    def unwound(self, rule: _Rule, u: Array, slope: Array) -> tuple[Array, Array]:
        """Return psi - W(u) at the end, from `nodes`, and what tells its error."""
        if self.spin == 0.0:
            return np.zeros_like(self.time), np.zeros_like(self.time)
        rate = self.turn_rate(u[:-2], slope[:-2])
        gone = float(winding(self.spin, np.array([self.start]))[0])
        return self.time * (rule.weights @ rate) - gone, self.time * np.abs(rule.to_tail @ rate).sum(axis=0)


def places_of_rays(rays: Rays, barrier: Barrier, times: Array, tolerance: float, beyond: bool = True) -> Places:
    """Return where rays of any kind are at Mino times of shape (k, n), NaN for none, with an error of `tolerance`
    radians; see `radial_path.places`. Unless asked for beyond the rays' ends, u there says no more than that it is."""
    if tolerance < TIGHTEST:
        return places_by_series(rays, barrier, times, tolerance)
    found = Places.empty(*times.shape)
    every = _Paths.of(rays, barrier)
    with np.errstate(invalid="ignore"):
        span = times * every.function.rate
        span[:, barrier.blocks & (rays.observer.r <= barrier.radius)] = np.nan
    longest = (LONGEST_FIRST + LONGEST_MORE * (len(times) - 1)) / every.function.rate
    known = np.zeros(times.size, dtype=bool)
    span, time_of = span.ravel(), times.ravel()
    parts = [values.reshape(-1) for values in (found.u, found.u_slope, found.unwound)]
    for count, most in zip(NODE_COUNTS, (*LONGEST_TIMES, math.inf), strict=True):
        fewest = (1 if count > NODE_COUNTS[0] else FEW_ENDED) if beyond else None
        pairs = np.flatnonzero((span <= most) & ~known)
        if len(pairs) < FEW and count != NODE_COUNTS[-1]:
            continue
        for start in range(0, len(pairs), CHUNK):
            some = pairs[start : start + CHUNK]
            ray, time = some % len(rays), time_of[some]
            with np.errstate(all="ignore"):  # beyond a path's end there may be poles; what is not finite is not known
                followed = every.for_times(ray, np.minimum(time, longest[ray]))
                *there, known[some], ended = _places(followed, time, _RULES[count], tolerance, fewest)
            for values, new in zip(parts, there, strict=True):
                values[some] = new
            if not beyond:
                known[some[ended]] = True
    found.resolved[:] = (known.reshape(times.shape) | np.isnan(times)).all(axis=0)
    left = np.flatnonzero(~found.resolved)
    if len(left):
        found.put(left, places_by_series(rays.select(left), barrier.select(left), times[:, left], tolerance))
    return found


def _places(
    paths: _Paths, time: Array, rule: _Rule, tolerance: float, fewest: int | None
) -> tuple[Array, Array, Array, Mask, Index]:
    """Return u, du / dlambda and psi - W(u) after a time, no shorter than `paths` are followed, where that is known,
    and which rays have fallen in before for certain: these are followed to their ends if they are `fewest` or more."""
    u, slope, lost = paths.nodes(rule)
    unwound, error = paths.unwound(rule, u, slope)
    place, rate = u[-1], slope[-1]
    # Beyond infinity u falls to U's negative root and would come back: there rays stay.
    beyond_sky = (u <= 0.0) & ~paths.inward
    gone = beyond_sky.any(axis=0)
    in_time = time == paths.time
    back = gone & ((beyond_sky & (slope >= 0.0)).any(axis=0) | (place > 0.0) | ~in_time)
    place[back], rate[back] = paths.lowest[back], 0.0
    known = in_time | gone
    outside = paths.inward & ~((u > 0.0) & (u < paths.highest))
    # Next to the critical curve rays hover, and rounding tells the sign of their slope.
    left = outside | (paths.inward & (slope <= -HOVERING))
    index = np.flatnonzero(left.any(axis=0))
    if fewest is not None and len(index) >= fewest:
        ends, known[index] = _ends(paths.for_times(index, paths.time[index]), rule, u, slope, left, index, tolerance)
        further = time[index] - ends.time
        place[index], rate[index], unwound[index], error[index], lost[index] = _beyond_end(ends, further, rule)
    else:
        known[index], place[index] = False, paths.highest
    exact = lost <= MOST_LOST * tolerance
    known &= exact & (error * error <= TAIL_SQUARE * tolerance) & np.isfinite(place) & np.isfinite(unwound)
    return place, rate, unwound, known, index[(exact & outside.any(axis=0))[index]]


def _beyond_end(paths: _Paths, late: Array, rule: _Rule) -> tuple[Array, Array, Array, Array, Array]:
    """Return u, du / dlambda, psi - W(u), what tells its error and how rounding has grown, so much later than the end
    of paths into the hole: along a parabola, and turning on at the last rate."""
    u, slope, lost = paths.nodes(rule)
    unwound, error = paths.unwound(rule, u, slope)
    end, steep = u[-1], slope[-1]
    lost = np.where(np.abs(end / paths.highest - 1.0) < END_ERROR, lost, np.inf)  # an end that is none
    place, rate, late = along_parabola(end, steep, acceleration(paths.quartic, end), late)
    if paths.spin != 0.0:
        unwound += late * paths.turn_rate(end, steep)
    return place, rate, unwound, error, lost


def _ends(
    paths: _Paths, rule: _Rule, u: Array, slope: Array, left: Mask, index: Index, tolerance: float
) -> tuple[_Paths, Mask]:
    """Return paths into the hole, shape (n,), up to their ends, and for which of them that is well known.

    `u`, `slope`: at the nodes of more paths, of which these have the numbers `index`; `left`: where those are no
    longer on their way. Chebyshev's method, Newton's with the second derivative, for 1 / u^(1/2), which is nearly
    linear, from the last node before the end.
    """
    in_order = rule.in_order[:, None], index
    first = left[in_order].argmax(axis=0)
    since = rule.times[first] * paths.time
    gap = rule.times[first + 1] * paths.time - since
    before = rule.in_order[first - 1], index
    from_camera = first == 0
    start = np.where(from_camera, paths.start, u[before])
    motion = QuarticMotion(paths.function, paths.quartic, start, np.where(from_camera, paths.slope, slope[before]))
    goal, enough = 1.0 / math.sqrt(paths.highest), LAST_CHANGE * tolerance ** (1.0 / 3.0)

    def ahead(u: Array, slope: Array, bend: Array) -> Array:
        """Return Chebyshev's step, of third order."""
        root = 1.0 / np.sqrt(u)
        inverse = 1.0 / slope
        step = 2.0 * (1.0 - goal / root) * u * inverse
        curved: Array = step * (1.0 + step * (0.75 * slope / u - 0.5 * bend * inverse))
        return curved

    way = np.clip(ahead(start, motion.slope, motion.bend), LEAST_WAY * gap, gap)
    for _ in range(END_ROUNDS):
        here, steep = motion.after(*paths.function.at(way))
        # Beyond the pole, back.
        following = np.where(here > 0.0, way + ahead(here, steep, acceleration(paths.quartic, here)), 0.0)
        following = np.clip(following, LEAST_SHARE * way, gap)
        change, way = np.abs(following - way) * paths.pace, following
        if not (change > enough).any():
            break
    return paths.lasting(since + way), change <= enough
