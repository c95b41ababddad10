# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion in a quartic potential in closed form, by Weierstrass's elliptic function.

The solution of u'^2 = U(u), U = c_0 + c_2 u^2 + c_3 u^3 + c_4 u^4, that starts from u_0 with u_0' is a rational
function of P(t) and P'(t) (Biermann and Weierstrass; Whittaker & Watson 1927, A Course of Modern Analysis, 20.6):

    u - u_0 = [U' q / 2 + U U''' / 24 - u_0' P'] / [2 q^2 - U U'''' / 48],   q = P - U'' / 24,

U and its derivatives taken at u_0. P has the invariants of the quartic,

    g_2 = c_0 c_4 + c_2^2 / 12,   g_3 = c_0 c_2 c_4 / 6 - c_2^3 / 216 - c_0 c_3^2 / 16,

and does not know of turning points, ends or kinds of orbits: one formula, regular through all of them, serves every
ray. P itself is its Laurent series for short times, doubled as often as needed by its addition theorem (Abramowitz &
Stegun 1964, 18.5.1 and 18.4.5).
"""

from __future__ import annotations

import math

import numpy as np

from .arrays import Array, Index

# Terms of the Laurent series behind the pole, and the longest time they are used for, in units of what makes the first
# two of them 1: the next is below 1e-10 of the pole then, which is a relative error of time of half of that. Each
# doubling loses up to six binary digits of the invariants: the fewer the better.
LAST_TERM = 10
LONGEST = 0.33


class Weierstrass:
    """P and P' for many pairs of invariants, shape (n,)."""

    def __init__(self, half_g2: Array, rate: Array, terms: Array) -> None:
        """`terms`: coefficients of t^2, t^4 .. in P, shape (`LAST_TERM` - 1, n)."""
        self._half_g2, self._terms = half_g2, terms
        self.rate = rate
        """What makes a time one without units: half a turn around a hole takes about 0.8 of that."""

    @classmethod
    def of_quartic(cls, c2: Array, c3: Array, c4: Array, c0: Array | float = 1.0) -> Weierstrass:
        """Return the function that belongs to U."""
        square = c2 * c2
        half_g2 = 0.5 * c0 * c4 + square / 24.0
        terms = np.empty((LAST_TERM - 1, len(c2)))
        terms[0] = half_g2 / 10.0
        terms[1] = (c2 * (c0 * c4 / 6.0 - square / 216.0) - c0 * c3 * c3 / 16.0) / 28.0
        for k in range(4, LAST_TERM + 1):
            # sum of c_m c_(k - m), m = 2 .. k - 2
            pairs = (terms[: k - 3] * terms[k - 4 :: -1]).sum(axis=0)
            np.multiply(pairs, 3.0 / ((2 * k + 1) * (k - 3)), out=terms[k - 2])
        rate = np.maximum(np.sqrt(np.sqrt(np.abs(terms[0]))), np.cbrt(np.sqrt(np.abs(terms[1]))))
        return cls(half_g2, rate, terms)

    def select(self, chosen: Index) -> Weierstrass:
        """Return the function for the chosen invariants alone."""
        return Weierstrass(self._half_g2[chosen], self.rate[chosen], self._terms.take(chosen, axis=1))

    def at(self, time: Array) -> tuple[Array, Array]:
        """Return P and P' at times > 0, shape (n,) or (m, n)."""
        longest = float((time * self.rate).max())
        doublings = max(0, math.ceil(math.log2(longest / LONGEST))) if longest > 0.0 else 0
        short = time * 0.5**doublings
        square = short * short
        pole = 1.0 / square
        value = self._terms[-1] * square
        slope = (2 * LAST_TERM - 2) * value
        for k in range(LAST_TERM - 1, 1, -1):
            value += self._terms[k - 2]
            value *= square
            slope += (2 * k - 2) * self._terms[k - 2]
            slope *= square
        value += pole
        pole += pole
        slope -= pole
        slope /= short
        doubled, tangent = pole, square  # no longer needed
        for _ in range(doublings):
            # On the curve P'^2 = 4 P^3 - g_2 P - g_3 the tangent, of slope P'' / P', leads to -2 t.
            self.bend(value, tangent)
            tangent /= slope
            np.multiply(tangent, tangent, out=doubled)
            doubled *= 0.25
            doubled -= value
            doubled -= value
            value -= doubled
            tangent *= value
            tangent -= slope
            slope, tangent = tangent, slope
            value, doubled = doubled, value
        return value, slope

    def bend(self, value: Array, out: Array | None = None) -> Array:
        """Return P'' = 6 P^2 - g_2 / 2 where P is `value`, in `out` if given."""
        bend: Array = np.multiply(value, value, out=out)
        bend *= 6.0
        bend -= self._half_g2
        return bend


def acceleration(quartic: Array, u: Array) -> Array:
    """Return u'' = U'(u) / 2, shape (n,); `quartic`: c_2, c_3, c_4, shape (3, n)."""
    c2, c3, c4 = quartic
    bend: Array = u * (c2 + u * (1.5 * c3 + 2.0 * c4 * u))
    return bend


class QuarticMotion:
    """u over time for many quartics and starts, shape (n,)."""

    def __init__(self, function: Weierstrass, quartic: Array, u: Array, slope: Array) -> None:
        """`quartic`: c_2, c_3, c_4, shape (3, n); `function`: of these; `u`, `slope`: u and u' at the start."""
        c2, c3, c4 = quartic
        self._function, self._u = function, u
        self.slope = slope
        """u' at the start."""
        square = slope * slope
        self.bend = acceleration(quartic, u)
        """u'' at the start."""
        self._shift = (c2 + u * (3.0 * c3 + 6.0 * c4 * u)) / 12.0
        self._third = square * (0.25 * c3 + c4 * u)
        self._fourth = 0.5 * square * c4

    def after(self, value: Array, slope: Array) -> tuple[Array, Array]:
        """Return u and u' after the time of P and P', shape (n,) or (m, n)."""
        return self._places(value, slope)[0]

    def around(self, value: Array, slope: Array) -> list[tuple[Array, Array]]:
        """Return u and u' after the time of P and P', and as long before."""
        return self._places(value, slope, before=True)

    def cancellation(self, value: Array, slope: Array) -> Array:
        """Return how much larger than 1 what u - u_0 is a quotient's difference of gets, shape (n,): where u as long
        before is at a pole, so is all of it but the difference."""
        _, below, even, odd = self._quotient(value, slope)
        size: Array = (np.abs(even) + np.abs(odd)) / np.abs(below)
        return size

    def _quotient(self, value: Array, slope: Array) -> tuple[Array, Array, Array, Array]:
        """Return q, D, and the parts of N that are even and, to be subtracted, odd in time: u - u_0 = N / D."""
        q = value - self._shift
        below = q * q
        below *= 2.0
        below -= self._fourth
        even = self.bend * q
        even += self._third
        return q, below, even, self.slope * slope

    def _places(self, value: Array, slope: Array, before: bool = False) -> list[tuple[Array, Array]]:
        # u' = (N' - (u - u_0) D') / D; P' alone is odd in time.
        q, below, even, odd = self._quotient(value, slope)
        inverse = np.divide(1.0, below, out=below)
        rising = self.bend * slope
        q *= slope
        q *= 4.0
        turning = self.slope * self._function.bend(value)
        found = []
        for sign in (1.0, -1.0) if before else (1.0,):
            way = even - sign * odd
            way *= inverse
            speed = way * q
            np.subtract(rising, speed, out=speed)
            speed *= sign
            speed -= turning
            speed *= inverse
            way += self._u
            found.append((way, speed))
        return found
