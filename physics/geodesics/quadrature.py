# SPDX-License-Identifier: GPL-3.0-or-later
"""The radial motion without steps: the Mino time to infinity and the rotation psi as two quadratures.

Both are integrals over the radial coordinate x of `mino`, whose ends are known (see there for the polynomials):

    lambda = integral of dx / x',   psi = integral of psi'(u(x)) / x' dx,   x' = sqrt(polynomial of x).

The right-hand sides do not depend on what is integrated, so a Runge-Kutta method is a quadrature rule, and the best
is Gauss and Legendre's: its error falls like rho^(-2 n) with n nodes, where rho is the sum of the half axes of the
largest ellipse, with foci at the ends of the interval, that contains no singularity (Trefethen 2008, SIAM Review 50,
67, theorem 4.5). The singularities are the other roots of the polynomial, known in closed form as well as this needs,
and the horizon's. Next to the critical curve they come close to x = 0 from both sides, at +-i eps; there
x = eps sinh(t) moves them to t = +-i pi / 2, and the number of nodes grows only like the logarithm of the distance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from ..kerr.critical_curve import Barrier
from ..kerr.metric import horizon_radius
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Index, Indices
from .mino import direct_polynomial, radial_polynomial, turning_polynomial

# The rules that are used: rays are sorted into classes by the nodes that they need. At the default tolerance nine of
# ten need 7 to 10; the others are so few that more classes would cost more than nodes that are not needed.
USUAL_NODES = 10
NODE_COUNTS = (USUAL_NODES, 16, 32, 64, 128)

MOST_NODES_ONE_BY_ONE = 10

# What multiplies rho^(-2 n) in the error of direction, about: the integrand's size on the ellipse times the ray's
# angular momentum. Found by tracing, not derived: with 1, the worst of the reference rays is wrong by twice the
# tolerance, the median by a tenth of it.
ERROR_FACTOR = 1.0
# The same where singularities crowd in: next to the critical curve, and for rays with nothing to turn them, which may
# start next to the horizon, where psi' is large. Such rays are few, and some nodes more cost little.
CROWDED_ERROR_FACTOR = 1e3

# A singularity at this many times the interval's length, or none, is all the same.
FAR_AWAY = 100.0

# Rounds of iteration for a singularity's place, which only has to be good to a few per cent.
ROOT_ROUNDS = 3

# Where plain nodes would be more than this many, the substitution by sinh is worth its exponentials.
MOST_PLAIN_NODES = 14


def _rule(count: int) -> tuple[list[float], list[float]]:
    nodes, weights = leggauss(count)
    return nodes.tolist(), weights.tolist()


RULES = {count: _rule(count) for count in NODE_COUNTS}


@dataclass
class _Integrand:
    """The radial equation of some rays from one camera, and where its singularities are; arrays of shape (n,)."""

    spin: float
    b: Array
    rates: Array
    """Polynomial of (d x / d lambda)^2, low powers first, shape (4 or 5, n)."""
    argument: Callable[..., Array]
    """What that polynomial takes, from x; also u = unit (1 - argument)."""
    unit: Array
    start: Array
    """x at the camera; the end is x = 1."""
    near: Array
    """Singularities at x = +-i near, or no nearer to 0 than that."""
    far: Array
    """A singularity at x = far > 1."""
    horizon: Array
    """Where psi' has its pole: +-i horizon for rays with a turning point, else x = -horizon, below the start."""


def turning_integrals(rays: Rays, barrier: Barrier, tolerance: float) -> tuple[Array, Array]:
    """Return Mino time to infinity and psi, shape (n,), of rays with a turning point; NaN: too many nodes."""
    start, turning, rates = turning_polynomial(rays, barrier)
    # The root of G next to 0 < s on the left, from its first terms: next to the critical curve it is close to 0.
    g0, g1, g2, _ = rates
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(g1 * g1 - 4.0 * g0 * g2, 0.0))
        near = np.sqrt(np.where(g1 > 0.0, 2.0 * g0 / (g1 + root), FAR_AWAY))
    near = np.minimum(near, FAR_AWAY)
    far = np.sqrt(1.0 + negative_root(rays) / turning)
    horizon = np.sqrt(1.0 / (horizon_radius(rays.spin) * turning) - 1.0)
    integrand = _Integrand(rays.spin, rays.b, rates, np.square, turning, start, near, far, horizon)
    goal, crowded_goal = _goals(tolerance)
    needed = _nodes(goal, np.minimum(_imaginary(near, start), _real(far, start)) / (1.0 - start))
    if rays.spin != 0.0:
        needed = np.maximum(needed, _nodes(crowded_goal, _imaginary(horizon, start) / (1.0 - start)))
        integrand.near = np.minimum(near, horizon)
    return _integrals(integrand, needed, crowded_goal)


def direct_integrals(rays: Rays, barrier: Barrier, tolerance: float) -> tuple[Array, Array]:
    """Return Mino time to infinity and psi, shape (n,), of rays that go straight out; NaN: too many nodes."""
    start, unit, rates = direct_polynomial(rays, barrier)
    # No root of the polynomial is nearer to x = 0 than this: none of its four terms can reach a quarter of the first.
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.abs(0.25 * rates[0] / rates[1:])
        near = np.minimum(np.minimum(shares[0], np.sqrt(shares[1])), np.cbrt(shares[2]))
        near = np.minimum(np.minimum(near, np.sqrt(np.sqrt(shares[3]))), FAR_AWAY)
    far = 1.0 + negative_root(rays) / unit
    horizon = 1.0 / (horizon_radius(rays.spin) * unit) - 1.0
    integrand = _Integrand(rays.spin, rays.b, rates, np.positive, unit, start, near, far, horizon)
    _, crowded_goal = _goals(tolerance)
    axes = np.minimum(_imaginary(near, start), _real(far, start))
    axes = np.minimum(axes, 1.0 + start + 2.0 * horizon)
    return _integrals(integrand, _nodes(crowded_goal, axes / (1.0 - start)), crowded_goal)


def negative_root(rays: Rays) -> Array:
    """Return -u at U's negative root, shape (n,): 1 = u^2 (-c_2 + c_3 |u| - c_4 u^2), by fixed point."""
    c2, c3, c4 = radial_polynomial(rays)
    with np.errstate(divide="ignore", invalid="ignore"):
        root: Array = 1.0 / (np.sqrt(np.maximum(-c2, 0.0)) + np.cbrt(c3))
        for _ in range(ROOT_ROUNDS):
            root = 1.0 / np.sqrt(np.maximum(-c2 + root * (c3 - c4 * root), 0.0))
    return root


def _goals(tolerance: float) -> tuple[float, float]:
    """Return what log(rho) times the number of nodes must reach, ordinarily and in a crowd of singularities."""
    return 0.5 * math.log(ERROR_FACTOR / tolerance), 0.5 * math.log(CROWDED_ERROR_FACTOR / tolerance)


def _imaginary(distance: Array, start: Array) -> Array:
    """Return the major axis of the ellipse about start .. 1 that reaches x = +-i distance."""
    square = distance * distance
    axis: Array = np.sqrt(1.0 + square) + np.sqrt(start * start + square)
    return axis


def _real(place: Array, start: Array) -> Array:
    """Return the major axis of the ellipse about start .. 1 that reaches x = place > 1."""
    return 2.0 * place - 1.0 - start


def _nodes(goal: float, axes: Array) -> Array:
    """Return how many nodes, goal / log(rho), ellipses with this major axis over the interval's length need."""
    axes = np.maximum(axes, 1.0)
    with np.errstate(divide="ignore"):
        nodes: Array = goal / np.log(axes + np.sqrt(axes * axes - 1.0))
    return nodes


def _integrals(integrand: _Integrand, needed: Array, crowded_goal: float) -> tuple[Array, Array]:
    """Return both integrals, NaN where they take too many nodes; `needed` is the number of plain ones."""
    start = integrand.start
    plain = needed <= MOST_PLAIN_NODES
    crowded = np.flatnonzero(~plain)
    usual = needed <= USUAL_NODES
    if 2 * np.count_nonzero(usual) > len(needed):
        # Where most rays need the usual rule, it costs less to apply it to all than to pick them out.
        time, psi = _apply(USUAL_NODES, integrand, slice(None), start, np.ones_like(start), None)
        time[crowded] = np.nan
        plain &= ~usual
    else:
        time, psi = np.full((2, len(needed)), np.nan)
    if len(crowded):
        scale = integrand.near[crowded]
        low, high, beyond = (np.arcsinh(x / scale) for x in (start[crowded], 1.0, integrand.far[crowded]))
        axes = np.minimum(np.hypot(0.5 * np.pi, low) + np.hypot(0.5 * np.pi, high), 2.0 * beyond - high - low)
        if integrand.argument is np.positive:
            axes = np.minimum(axes, high + low + 2.0 * np.arcsinh(integrand.horizon[crowded] / scale))
        stretched = _nodes(crowded_goal, axes / (high - low))
        # A lone singularity at the end of the interval may be better met by plain nodes all the same.
        better = stretched < needed[crowded]
        plain[crowded[~better]] = True
        for count, members in _classes(stretched, better):
            inner = crowded[members]
            time[inner], psi[inner] = _apply(count, integrand, inner, low[members], high[members], scale[members])
    for count, members in _classes(needed, plain):
        low = start[members]
        time[members], psi[members] = _apply(count, integrand, members, low, np.ones_like(low), None)
    return time, psi


def _classes(needed: Array, among: NDArray[np.bool_]) -> Iterable[tuple[int, Index]]:
    """Yield each number of nodes with the rays `among` all for which it is the least that is enough."""
    fewer = 0
    for count in NODE_COUNTS:
        members = np.flatnonzero(among & (needed > fewer) & (needed <= count))
        if len(members):
            yield count, members
        fewer = count


def _apply(
    count: int, integrand: _Integrand, rays: Indices, low: Array, high: Array, scale: Array | None
) -> tuple[Array, Array]:
    """Return both integrals of some rays by the rule of `count` nodes, with x = scale sinh(t) between t = low and high
    where a scale is given, otherwise x itself."""
    nodes_and_weights = RULES[count]
    rates, unit, spin, argument = integrand.rates[:, rays], integrand.unit[rays], integrand.spin, integrand.argument
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    a2, a_b = spin * spin, spin * integrand.b[rays]
    time, psi = np.zeros_like(unit), np.zeros_like(unit)
    # Node by node for the rules that most rays need; all nodes at once for the others, whose rays are few.
    passes: Iterable[tuple[float | Array, float | Array]] = zip(*nodes_and_weights, strict=True)
    if count > MOST_NODES_ONE_BY_ONE:
        passes = [(np.array(nodes_and_weights[0])[:, None], np.array(nodes_and_weights[1])[:, None])]
    for nodes, weights in passes:
        x = nodes * half
        x += middle
        if scale is not None:
            grown = np.exp(x)
            shrunk = 1.0 / grown
            x = grown - shrunk
            x *= 0.5 * scale
            grown += shrunk
            grown *= 0.5 * weights * scale
        z = argument(x)
        speed = rates[-1] * z
        for coefficient in rates[-2:0:-1]:
            speed += coefficient
            speed *= z
        speed += rates[0]
        np.sqrt(speed, out=speed)
        if spin == 0.0:
            np.divide(weights if scale is None else grown, speed, out=speed)
            time += _total(speed)
            continue
        # psi' = -a (2 u - a b u^2) / (1 - 2 u + a^2 u^2), with one division for both integrands
        np.subtract(1.0, z, out=z)
        z *= unit
        below = a2 * z
        below -= 2.0
        below *= z
        below += 1.0
        above = a_b * z
        above -= 2.0
        above *= z
        speed *= below
        np.divide(weights if scale is None else grown, speed, out=speed)
        below *= speed
        time += _total(below)
        above *= speed
        psi += _total(above)
    time *= half
    psi *= spin * half
    return time, psi


def _total(values: Array) -> Array:
    """Return the sum over the nodes, the first axis where there is more than one of them."""
    total: Array = values if values.ndim == 1 else values.sum(axis=0)
    return total
