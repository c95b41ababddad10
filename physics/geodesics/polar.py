# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of a ray's direction on the sphere over a given Mino time, in closed form.

With v = cos(theta) and w = v^2, Eq. 3's Theta makes v'^2 = q - (q + b^2 - a^2) w - a^2 w^2 =
(w_+ - w)(A + a^2 w), where w_+ = q / A and A is the larger root of A^2 - (q + b^2 - a^2) A - a^2 q = 0. Put
v = sqrt(w_+) sin(chi): then chi' = s(w), s(w)^2 = A + a^2 w. In terms of chi the path is a great circle but
for a slow turn about the axis. Taking the pole w = 1 out of the azimuth's rate b / (1 - w),

    b / (1 - w) = s b / ((1 - w) s_1) + s f,   f = a^2 b / (s_1 s (s + s_1)),   s_1 = s(1),

the first term is the azimuth along the great circle of inclination cos(i) = |b| / s_1, exactly, also through the
poles, and f is smooth and small. So the ray's direction is n_0 cos(D) + t_0 sin(D), D = chi - chi_0, with the unit
tangent t_0 = (theta' / s(w_0), b / (sin(theta_0) s_1)) on (theta-hat, phi-hat), turned about the axis by the
integral of f over chi. Its rate in Mino time, by the same formulas, is s times the tangent n_0' and a turn of s f.

D follows from the Mino time through lambda = integral of d chi / s. With M = A + a^2 w_+ / 2 and
e = a^2 w_+ / (2 M), s^2 = M (1 - e cos(2 chi)), and 1 / s is a Fourier series whose coefficients fall like
(e / 2)^k: e is at most a^2 / (2 L^2) for a ray of angular momentum L, 0.02 for one that skims a hole without spin.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from ..kerr.rays import Rays
from ..numerics.arrays import Array, Indices, indices
from ..numerics.sphere import cos_sin, spherical_triad

# Rays are sorted by e into classes up to these, each with as many terms as its upper end needs, so that what becomes of
# a ray does not depend on its company. Beyond the last the series is no longer a short one.
ELLIPTICITY_CLASSES = (0.0, 0.04, 0.3)
MOST_TERMS = 12
# Powers of e kept beyond the last harmonic: a harmonic k is made of the powers k, k + 2, ...
EXTRA_POWERS = 2

# A height above the equatorial plane, or a slope towards it, of less than this is rounding.
IN_PLANE = 1e-15

# For the few rays without a short series: nodes of a quadrature that leave 1e-13 and 1e-7, with singularities 1e-8 from
# the path, and the tightest tolerance that the fewer are used for.
_PLANE_RULE, _SMALL_PLANE_RULE = leggauss(32), leggauss(16)
SMALL_RULE_TOLERANCE = 1e-6


@dataclass(frozen=True)
class PolarMotion:
    """The constants of the motion for rays from one camera, backward; arrays of shape (n,)."""

    spin: float
    triad: Array
    """n_0, theta-hat and phi-hat at the camera, shape (3, 3)."""
    tangent_theta: Array
    tangent_phi: Array
    """t_0 on the triad."""
    base: Array
    """A."""
    pole_speed: Array
    """s_1."""
    b: Array
    """The backward ray's angular momentum about the axis, -b."""
    mean: Array
    """M."""
    ellipticity: Array
    """e."""

    @classmethod
    def of(cls, rays: Rays) -> PolarMotion:
        """Return the constants for `rays`."""
        triad = spherical_triad(rays.observer.theta, rays.observer.phi)
        a2, w0 = rays.spin * rays.spin, triad[0, 2] * triad[0, 2]
        reduced = rays.q_plus_b2 - a2
        root = np.sqrt(np.maximum(reduced * reduced + 4.0 * a2 * rays.q, 0.0))
        with np.errstate(invalid="ignore", divide="ignore"):
            base = np.where(reduced < 0.0, 2.0 * a2 * rays.q / (root - reduced), 0.5 * (reduced + root))
            pole_speed = np.sqrt(base + a2)
            tangent_theta = -rays.polar / np.sqrt(base + a2 * w0)
            tangent_phi = -rays.azimuthal / pole_speed
            # w_+ as the squared length of (v, v' / s), which has no cancellation
            top = w0 + (triad[1, 2] * tangent_theta) ** 2
            mean = base + 0.5 * a2 * top
            ellipticity = 0.5 * a2 * top / mean
        return cls(
            rays.spin,
            triad,
            tangent_theta,
            tangent_phi,
            base,
            pole_speed,
            -rays.b,
            mean,
            ellipticity,
        )

    def usable(self, tolerance: float) -> NDArray[np.bool_]:
        """Return which rays the series serves to within `tolerance` radians, shape (n,); the rest have q < 0 or little
        angular momentum."""
        usable: NDArray[np.bool_] = (self.base > 0.0) & (self.ellipticity >= 0.0)
        usable &= self.ellipticity <= self._largest(tolerance)
        return usable

    @staticmethod
    def _largest(tolerance: float) -> float:
        """Return the largest e that the series serves."""
        return min(ELLIPTICITY_CLASSES[-1], 2.0 * math.pow(tolerance, 1.0 / (MOST_TERMS + 1)))

    def direction(self, mino_time: Array, rotation: Array, tolerance: float) -> Array:
        """Return the unit vectors after `mino_time`, turned about the axis by `rotation` more, shape (3, n)."""
        direction = np.empty((3, len(mino_time)))
        for chosen, largest in self._classes():
            part = self.select(chosen)
            direction[:, chosen] = part._vectors(*part._path(mino_time[chosen], rotation[chosen], largest, tolerance))
        return direction

    def exit_lines(self, mino_time: Array, rotation: Array, tolerance: float) -> tuple[Array, Array]:
        """Return what `direction` does and its derivative by the Mino time, without that of `rotation`; (3, n) each."""
        direction, rate = np.empty((2, 3, len(mino_time)))
        a2 = self.spin * self.spin
        for chosen, largest in self._classes():
            part = self.select(chosen)
            cos, sin, turn = part._path(mino_time[chosen], rotation[chosen], largest, tolerance)
            direction[:, chosen] = x, y, z = part._vectors(cos, sin, turn)
            speed = np.sqrt(part.base + a2 * z * z)
            drift = a2 * part.b / (part.pole_speed * (speed + part.pole_speed))
            along = part._vectors(-sin, cos, turn)
            rate[:, chosen] = speed * along + drift * np.stack([-y, x, np.zeros_like(z)])
        return direction, rate

    def _classes(self) -> Iterator[tuple[Indices, float]]:
        """Yield the rays of each class of `ELLIPTICITY_CLASSES`, and the largest e of that class."""
        below = np.zeros(len(self.ellipticity), dtype=bool)
        for largest in ELLIPTICITY_CLASSES:
            members = (self.ellipticity <= largest) & ~below
            if members.any():
                yield indices(members), largest
                below |= members

    def plane_crossings(self, count: int, tolerance: float) -> tuple[Array, Array]:
        """Return when and where the rays cross the equatorial plane for the first `count` times, the camera excluded.

        v = 0 is chi = k pi, where the series in sin(2 chi) vanish: both answers are linear in chi from there on. Rays
        that the series do not serve, of q > 0 but little angular momentum, have their integrals over chi worked out
        by quadrature.

        Returns
        -------
        mino_time, azimuth : ndarray, shape (count, n)
            The azimuth lacks psi, and counts turns: from ray to ray it jumps only where b changes sign. Both are NaN
            for rays that never cross: q < 0, or motion in the plane for ever.
        """
        with np.errstate(invalid="ignore"):
            height, rise = self.triad[0, 2], self.triad[1, 2] * self.tangent_theta
        if abs(height) < IN_PLANE:  # cos(pi / 2) in floating point is not 0
            height = 0.0
        crosses = (self.base > 0.0) & (np.hypot(height, rise) > IN_PLANE)
        # Rays that never cross may have no tangent either.
        rise, along_theta, along_phi = (
            np.where(crosses, each, 0.0) for each in (rise, self.tangent_theta, self.tangent_phi)
        )
        # Cosine and sine of the angle along the path to the plane, both times their hypotenuse.
        along, aside = (-rise if height >= 0.0 else rise), abs(height)
        first = np.arctan2(aside, along) if height else np.full(len(rise), np.pi)
        usable = crosses & self.usable(tolerance)
        time, turn = np.full((2, len(rise)), np.nan), np.full((2, len(rise)), np.nan)  # first, and from one to the next
        for chosen, integrals in (
            (usable, self._samples_to_plane),
            (crosses & ~usable, self._quadrature_to_plane),
        ):
            if chosen.any():
                those = indices(chosen)
                time[:, those], turn[:, those] = integrals(those, first[those], tolerance)
        if not height:
            along = np.full(len(rise), -1.0)
        # Counted from the camera's meridian the first is at most half a turn away, in the sense of b.
        x, y = along_theta * aside * self.triad[0, 2] - along * self.triad[1, 2], along_phi * aside
        camera = math.atan2(-self.triad[2, 0], self.triad[2, 1])
        order = np.arange(count)[:, None]
        turn[1] += np.copysign(np.pi, self.b)
        return time[0] + order * time[1], camera + np.arctan2(y, x) + turn[0] + order * turn[1]

    def _samples_to_plane(self, chosen: Indices, first: Array, tolerance: float) -> tuple[Array, Array]:
        """Return Mino time and drift to the first crossing and from one to the next, shape (2, n) each.

        The series come from values of 1 / s and f at a few chi: it is their sums at the plane that are wanted, not
        their terms.
        """
        part, a2 = self.select(chosen), self.spin * self.spin
        cosines, to_weights = _plane_samples(_terms(self._largest(tolerance), tolerance) + 1)
        # e cos(2 chi) and e sin(2 chi) at the camera.
        v, vertical = part.triad[0, 2], part.triad[1, 2] * part.tangent_theta
        swing = 0.5 * a2 / part.mean
        whole = 1.0 / np.maximum(part.ellipticity, np.finfo(float).tiny)
        cos, sin = swing * (vertical * vertical - v * v) * whole, 2.0 * swing * vertical * v * whole
        sines = [np.zeros_like(sin), sin]
        for _ in range(len(cosines) - 2):
            sines.append(2.0 * cos * sines[-1] - sines[-2])
        weights = to_weights @ np.stack(sines[1 : len(cosines)])

        def to_plane(samples: Array) -> tuple[Array, Array]:
            mean = samples.mean(axis=0)
            return mean * first - (weights * samples).sum(axis=0), mean * np.pi

        scale = np.sqrt(part.mean)
        root = np.sqrt(1.0 - cosines * part.ellipticity)
        speeds = 1.0 / root  # sqrt(M) / s
        time = np.stack(to_plane(speeds)) / scale
        if a2 == 0.0:
            return time, np.zeros_like(time)
        speeds /= root + part.pole_speed / scale  # M / (s (s + s_1))
        return time, np.stack(to_plane(speeds)) * (a2 * part.b / (part.pole_speed * part.mean))

    def _quadrature_to_plane(self, chosen: Indices, first: Array, tolerance: float) -> tuple[Array, Array]:
        """Return what `_samples_to_plane` does, by Gauss-Legendre quadrature of 1 / s and f over chi.

        1 / s is singular at sin(chi) = +-i eps, eps^2 = A / (a^2 w_+), which chi = eps sinh(t) keeps away.
        """
        part, a2 = self.select(chosen), self.spin * self.spin
        swing = 2.0 * part.mean * part.ellipticity  # a^2 w_+
        near = np.sqrt(part.base / swing)
        rule = _SMALL_PLANE_RULE if tolerance >= SMALL_RULE_TOLERANCE else _PLANE_RULE
        nodes, weights = (each[:, None] for each in rule)

        angle = np.stack([np.minimum(first, np.pi - first), np.full(len(first), 0.5 * np.pi)])[:, None]
        half = 0.5 * np.arcsinh(angle / near)
        t = half * (1.0 + nodes)
        speed = np.sqrt(part.base + swing * np.sin(near * np.sinh(t)) ** 2)
        step = weights * half * near * np.cosh(t) / speed
        drift = step * (a2 * part.b / part.pole_speed) / (speed + part.pole_speed)
        (ahead, quarter), (turn_ahead, turn_quarter) = step.sum(axis=1), drift.sum(axis=1)
        farther = first > 0.5 * np.pi
        time = np.where(farther, 2.0 * quarter - ahead, ahead)
        turn = np.where(farther, 2.0 * turn_quarter - turn_ahead, turn_ahead)
        return np.stack([time, 2.0 * quarter]), np.stack([turn, 2.0 * turn_quarter])

    def select(self, chosen: Indices) -> PolarMotion:
        """Return the motion of the chosen rays alone."""
        names = ("tangent_theta", "tangent_phi", "base", "pole_speed", "b", "mean", "ellipticity")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def _path(self, mino_time: Array, rotation: Array, largest: float, tolerance: float) -> tuple[Array, Array, Array]:
        """Return cosine and sine of the angle D along the path, and the whole turn about the axis, for e up to
        `largest`."""
        a2 = self.spin * self.spin
        v, vertical = self.triad[0, 2], self.triad[1, 2] * self.tangent_theta  # z components of n_0 and t_0
        swing = 0.5 * a2 / self.mean

        def phase(cos: Array | float, sin: Array | float) -> tuple[Array, Array]:
            """Return e cos(2 chi) and e sin(2 chi) at a path angle, chi being counted from the equator."""
            height = v * cos + vertical * sin
            rise = vertical * cos - v * sin
            return swing * (rise * rise - height * height), 2.0 * swing * rise * height

        coefficients = _speed_series(self.ellipticity, largest, tolerance)
        start = phase(1.0, 0.0)
        target = mino_time * np.sqrt(self.mean)
        target += _harmonics(coefficients, *start)
        angle = target / coefficients[0]
        # The first guess lacks the harmonics at the end, e / 4 and little more; a round of Halley's method, whose
        # function has derivatives beyond the first of e and 2 e, leaves 2 e times the cube of that at most.
        error = 0.3 * largest
        while error > 0.1 * tolerance:
            even, odd = phase(*cos_sin(angle))
            excess = coefficients[0] * angle + _harmonics(coefficients, even, odd)
            excess -= target
            square = 1.0 / (1.0 - even)
            excess /= np.sqrt(square)
            # f' = (1 - even)^(-1/2), f'' / (2 f') = -odd / (2 (1 - even))
            angle -= excess / (1.0 + 0.5 * odd * square * excess)
            error = 2.0 * largest * error**3
        cos, sin = cos_sin(angle)
        turn = rotation
        if a2 > 0.0:
            drift = _turn_series(self.pole_speed / np.sqrt(self.mean), self.ellipticity, len(coefficients))
            path = drift[0] * angle
            path += _harmonics(drift, *phase(cos, sin))
            path -= _harmonics(drift, *start)
            turn = rotation + path * (a2 * self.b / (self.pole_speed * self.mean))
        return cos, sin, turn

    def _vectors(self, cos: Array, sin: Array, turn: Array) -> Array:
        """Return n_0 cos + t_0 sin, turned about the axis by `turn`, shape (3, n)."""
        along_theta, along_phi = self.tangent_theta * sin, self.tangent_phi * sin
        x, y, z = (
            n_0 * cos + theta_hat * along_theta + phi_hat * along_phi for n_0, theta_hat, phi_hat in self.triad.T
        )
        cos, sin = cos_sin(turn)
        return np.stack([x * cos - y * sin, x * sin + y * cos, z])


def _terms(largest: float, tolerance: float) -> int:
    """Return how many terms the series need beyond the first, for e up to `largest`."""
    terms = 0
    while terms < MOST_TERMS and (0.5 * largest) ** (terms + 1) > 0.1 * tolerance:
        terms += 1
    return terms


@cache
def _plane_samples(count: int) -> tuple[Array, Array]:
    """Return cos(x), shape (count, 1), at places x = 2 chi that determine count terms of a series in cos(k x), and the
    weights of values there, shape (count, count - 1), for each sin(k x) in the sum of c_k sin(k x) / (2 k)."""
    places = (np.arange(count) + 0.5) * (np.pi / count)
    order = np.arange(1, count)
    return np.cos(places)[:, None], np.cos(places[:, None] * order) / (count * order)


def _speed_series(ellipticity: Array, largest: float, tolerance: float) -> list[Array]:
    """Return the Fourier series of sqrt(M) / s = (1 - e cos x)^(-1/2), with as many terms as are needed."""
    terms = _terms(largest, tolerance)
    powers: list[float] = [1.0]
    for m in range(1, terms + EXTRA_POWERS + 1):
        powers.append(powers[-1] * (2 * m - 1) / (2 * m))
    return _fourier(powers, ellipticity * ellipticity, terms)


def _turn_series(pole_ratio: Array, ellipticity: Array, length: int) -> list[Array]:
    """Return the Fourier series of M / (s (s + s_1)), s_1 / sqrt(M) = `pole_ratio`, with `length` terms.

    With S = (1 - y)^(1/2), y = e cos x, it is the reciprocal of (1 - y) + pole_ratio S.
    """
    root, below = 1.0, [1.0 + pole_ratio]
    for m in range(1, length + EXTRA_POWERS):
        root *= (2 * m - 3) / (2 * m)
        below.append(pole_ratio * root - (1.0 if m == 1 else 0.0))
    inverse = 1.0 / below[0]
    powers = [inverse]
    for m in range(1, len(below)):
        total = below[m] * powers[0]
        for i in range(1, m):
            total += below[m - i] * powers[i]
        powers.append(-inverse * total)
    return _fourier(powers, ellipticity * ellipticity, length - 1)


def _fourier(powers: Sequence[Array | float], square: Array, terms: int) -> list[Array]:
    """Return c_0 and c_k / e^k up to k = terms, of sum p_m (e cos x)^m = c_0 + sum c_k cos(k x); `square` is e^2.

    cos^m x holds cos(k x) with weight 2^(1 - m) binom(m, (m - k) / 2), the constant with half of that.
    """
    series = []
    for k in range(terms + 1):
        total = np.zeros_like(square)
        highest = len(powers) - 1
        for m in range(highest - (highest - k) % 2, k - 1, -2):
            weight = math.comb(m, (m - k) // 2) * (2.0 ** (1 - m) if k else 2.0**-m)
            total *= square
            total += powers[m] * weight
        series.append(total)
    return series


def _harmonics(coefficients: list[Array], even: Array, odd: Array) -> Array:
    """Return sum c_k sin(2 k chi) / (2 k) from even = e cos(2 chi), odd = e sin(2 chi)."""
    total = np.zeros_like(even)
    cos, sin = even, odd
    for k in range(1, len(coefficients)):
        total += coefficients[k] * sin * (0.5 / k)
        cos, sin = cos * even - sin * odd, sin * even + cos * odd
    return total
