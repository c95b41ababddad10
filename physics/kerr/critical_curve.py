# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rays come from the sky and which from the hole: spherical photon orbits and the shadow's edge.

Equations 9 to 12 of Verbraeck & Eisemann, "Raytracing Equations" (after James et al. 2015, appendix A). Their
flowchart compares b and q with the orbits at constant radius, found as roots of Eq. 9; that loses its
digits for small spin and divides by zero at spin 0. The form used for tracing needs no root search:

With A = (a^2 - b^2 - q) / 2 and C = ((b - a)^2 + q) / 2, the derivative of Eq. 3's R is
R'(r) / 4 = r^3 + A r + C. Its largest root r_m, where there is one, is where R has its outermost minimum: a
ray is turned back there exactly if R(r_m) < 0 with r_m outside the horizon. A camera outside such a barrier
sees sky, one inside sees the hole; without a barrier the sign of p_r decides. The critical curve, the edge of
the shadow, is R(r_m) = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..numerics.arrays import Array, Indices
from ..numerics.errors import BlackHoleError
from ..numerics.sphere import by_component, cos_sin
from .metric import check_spin, circular_photon_radius, horizon_radius
from .observer import Observer
from .rays import Rays, rays_from_triad

# Newton's method at most doubles its digits: this many rounds serve any start.
NEWTON_ROUNDS = 60


@dataclass(frozen=True)
class Barrier:
    """The outermost minimum of R(r) for each ray, shape (n,).

    Where R has no minimum outside r = 1, the place where it comes nearest to one stands in: the inflection of R',
    or r = 1, which always lies between the horizons. R is positive there, so nothing is blocked by it, and
    all of these numbers are continuous from one ray to the next.
    """

    radius: Array
    """r_m, units of M."""
    height: Array
    """R(r_m), units of M^4: negative where light is turned back."""
    slope: Array
    """R'(r_m), units of M^3: 0 at a minimum, positive where something stands in for it."""
    curvature: Array
    """R''(r_m) / 2, units of M^2, >= 0."""
    reach: Array
    """Y with R(r_cam) = R(r_m) + Y^2 and the sign of r_cam - r_m, units of M^2."""
    blocks: NDArray[np.bool_]
    """Whether the barrier turns rays back."""

    def select(self, chosen: Indices) -> Barrier:
        """Return the barriers of the chosen rays alone."""
        return Barrier(
            self.radius[chosen],
            self.height[chosen],
            self.slope[chosen],
            self.curvature[chosen],
            self.reach[chosen],
            self.blocks[chosen],
        )


def find_barrier(rays: Rays) -> Barrier:
    """Return the outermost minimum of Eq. 3's R for each ray, in closed form.

    Parameters
    ----------
    rays : Rays
        n rays of one camera.

    Returns
    -------
    Barrier
        Arrays of shape (n,).
    """
    a, r_cam = rays.spin, rays.observer.r
    linear = 0.5 * (a * a - rays.q_plus_b2)  # A
    constant = 0.5 * (rays.q_plus_b2 + a * a - 2.0 * a * rays.b)  # C
    third = np.sqrt(np.maximum(-linear, 0.0) / 3.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        # 3 C / (2 A sqrt(-A/3)) = -C / (2 sqrt(-A/3)^3); below -1 there is no minimum, and the formula, held at
        # -1, gives the inflection of R', sqrt(-A/3).
        cosine = np.maximum(-0.5 * constant / (third * third * third), -1.0)
        minimum = 2.0 * third * cos_sin(np.arccos(cosine) / 3.0)[0]
    radius = np.where(minimum > 1.0, minimum, 1.0)  # also where third = 0 made it NaN
    exists = (4.0 * linear * linear * linear + 27.0 * constant * constant <= 0.0) & (minimum > 1.0)
    square = radius * radius
    # R = r^4 + 2 A r^2 + 4 C r - a^2 q (Eq. 3 multiplied out) and its derivatives
    height = square * (square + 2.0 * linear) + 4.0 * constant * radius - a * a * rays.q
    slope = np.where(exists, 0.0, np.maximum(4.0 * (radius * (square + linear) + constant), 0.0))
    curvature = np.maximum(6.0 * square + 2.0 * linear, 0.0)
    # Taylor's series of R about r_m. It is negative far inside, where R(r_cam) < R(r_m): nothing turns such rays,
    # and Y plays no part.
    offset = r_cam - radius
    reach_squared = offset * (slope + offset * (curvature + offset * (4.0 * radius + offset)))
    reach = np.copysign(np.sqrt(np.maximum(reach_squared, 0.0)), offset)
    # R(r_m) = R(r_cam) - Y^2 cancels less than the polynomial for a camera among the spherical photon orbits, where the
    # critical curve is crossed with p_r near 0.
    near = (reach_squared >= 0.0) & (rays.radial**2 + reach_squared < square * square)
    height = np.where(near, (rays.radial - reach) * (rays.radial + reach), height)
    blocks = (height < 0.0) & exists & (radius > horizon_radius(a))
    return Barrier(radius, height, slope, curvature, reach, blocks)


def comes_from_sky(rays: Rays, barrier: Barrier | None = None) -> NDArray[np.bool_]:
    """Return which rays come from the sky (Eqs. 11, 12 in closed form); the others come from the hole.

    Rays of no or negative energy at infinity, which occur inside the ergosphere, come from the horizon.

    Parameters
    ----------
    rays : Rays
    barrier : Barrier, optional
        Of these rays, if it is known.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    barrier = find_barrier(rays) if barrier is None else barrier
    unobstructed = rays.radial < 0.0
    outside = rays.observer.r > barrier.radius
    sky: NDArray[np.bool_] = rays.escapes & np.where(barrier.blocks, outside, unobstructed)
    return sky


def edge_function(rays: Rays) -> Array:
    """Return a smooth signed measure of how far inside the sky each ray lies, shape (n,).

    Positive exactly for rays from the sky, negative for the shadow, zero on its edge, and smooth across it;
    a difference of radial direction cosines, of order 1.

    With X = Delta p_r, (Delta p_r)^2 = R(r_cam) = R(r_m) + Y^2 makes R(r_m) = (X - Y)(X + Y), and the cases of
    `comes_from_sky` become the single condition Y - X > 0.
    """
    r, a = rays.observer.r, rays.spin
    barrier = find_barrier(rays)
    total = barrier.reach + rays.radial
    with np.errstate(invalid="ignore", divide="ignore"):
        # From afar X and Y are both about r^2 and their difference drowns in rounding; R(r_m) does not.
        facing = (barrier.reach > 0.0) & (rays.radial > 0.0)
        margin = np.where(facing, -barrier.height / total, barrier.reach - rays.radial)
        # P of Eq. 3 bounds |X|: divided by it, the function stays bounded however large b and q grow.
        bound = r * r + a * a - a * rays.b
        return np.where(rays.escapes, margin / bound, -1.0)


def all_around(count: int) -> tuple[Array, Array]:
    """Return cosine and sine of position angles at equal steps, for `around_hole`.

    Parameters
    ----------
    count : int
        Number of angles; the first is 0.

    Returns
    -------
    aside, up : ndarray, shape (count,)
    """
    return cos_sin(np.linspace(0.0, 2.0 * math.pi, count, endpoint=False, dtype=np.float64))


def around_hole(away: Array, aside: Array, up: Array) -> Array:
    """Return directions in a FIDO's sky at given angles from the hole's direction.

    Parameters
    ----------
    away : ndarray
        Angles from the hole's direction, radians.
    aside, up : ndarray
        Cosine (along theta-hat) and sine (along phi-hat) of the position angles; shapes that broadcast with `away`.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit vectors along which the FIDO looks, on (r-hat, theta-hat, phi-hat).
    """
    cosine, sine = cos_sin(away)
    return by_component(-cosine, sine * aside, sine * up)


def position_angles(light: Array) -> tuple[Array, Array]:
    """Return where a FIDO sees light, relative to the hole's direction: the inverse of `around_hole`.

    Parameters
    ----------
    light : ndarray, shape (3, n)
        Where the light runs in the FIDO's frame, on (r-hat, theta-hat, phi-hat).

    Returns
    -------
    away : ndarray, shape (n,)
        Angle from the hole's direction, radians, [0, pi].
    angle : ndarray, shape (n,)
        Position angle about the hole's direction, radians, [0, 2 pi].
    """
    outward, aside, up = light
    away: Array = np.arctan2(np.sqrt(aside * aside + up * up), outward)
    angle = np.arctan2(-up, -aside)
    angle += (angle < 0.0) * (2.0 * math.pi)
    return away, angle


def edge_angles(
    spin: float, fido: Observer, aside: Array, up: Array, error: float, about: tuple[Array, float] | None = None
) -> Array:
    """Return the angles from the hole's direction to the shadow's edge in a FIDO's sky, by bisection.

    The shadow surrounds the hole's direction, and each great circle from there to the opposite point, which is sky,
    crosses its edge once.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    fido : Observer
        From `Observer.fido`, outside the horizon.
    aside, up : ndarray, shape (n,)
        Cosine and sine of position angles, see `around_hole`.
    error : float
        Radians, > 0.
    about : (ndarray, float), optional
        Where the edge is looked for first, radians, shape (n,), and how far on both sides. So near to it the edge
        function is nearly a straight line, which tells at once where the edge is to within `error`.

    Returns
    -------
    ndarray, shape (n,)
        Radians, (0, pi): on the sky's side of the edge, within `error` of it.
    """

    def height(*away: Array) -> Array:
        looking = [around_hole(each, aside, up) for each in away]
        values = edge_function(rays_from_triad(spin, fido, np.concatenate(looking)))
        return values.reshape(len(away), -1)

    low, high = np.zeros(len(aside)), np.full(len(aside), math.pi)

    def narrow(before: Array, after: Array) -> Array:
        """Take for low and high what lies in the shadow and in the sky of two places each; return their heights."""
        heights = height(before, after)
        for place, here in ((before, heights[0]), (after, heights[1])):
            inside = (place > low) & (place < high)
            sky = here > 0.0
            np.copyto(low, place, where=inside & ~sky)
            np.copyto(high, place, where=inside & sky)
        return heights

    if about is not None:
        near, reach = about
        first, last = near - reach, near + reach
        below, above = narrow(first, last)
        with np.errstate(divide="ignore", invalid="ignore"):
            edge = first - 2.0 * reach * below / (above - below)
        edge = np.where(np.abs(edge - near) < reach, edge, near)
        narrow(edge - 0.4 * error, edge + 0.4 * error)
    for _ in range(math.ceil(math.log2((high - low).max() / error))):
        middle = 0.5 * (low + high)
        sky = height(middle)[0] > 0.0
        low, high = np.where(sky, low, middle), np.where(sky, middle, high)
    return high


def spherical_orbit(spin: float, radius: ArrayLike) -> tuple[Array, Array]:
    """Return the constants b0, q0 of the spherical photon orbits, whose radius r_0 is constant (Eq. 9).

    Parameters
    ----------
    spin : float
        Kerr parameter, not 0: there the orbits share one radius, 3, and have b^2 + q = 27.
    radius : array_like
        r_0 between the r_1 and r_2 of `spherical_orbit_radii`, units of M.

    Returns
    -------
    b0, q0 : ndarray
        Shape of `radius`; units of M and M^2.

    Raises
    ------
    BlackHoleError
        For a spin of 0 or out of range.
    """
    a = check_spin(spin)
    if a == 0.0:
        raise BlackHoleError(
            "Eq. 9 divides by the spin: without spin every spherical photon orbit has r = 3 and b^2 + q = 27.",
            code="settings.range",
        )
    r = np.asarray(radius, dtype=np.float64)
    b0 = -(r**3 - 3.0 * r**2 + a * a * r + a * a) / (a * (r - 1.0))
    q0 = -(r**3) * (r**3 - 6.0 * r**2 + 9.0 * r - 4.0 * a * a) / (a * a * (r - 1.0) ** 2)
    return b0, q0


def spherical_orbit_radii(spin: float) -> tuple[float, float]:
    """Return the range of the radii of spherical photon orbits (Eq. 10).

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.

    Returns
    -------
    r_1, r_2 : float
        Radii of the prograde and the retrograde circular photon orbit, units of M.

    Raises
    ------
    BlackHoleError
        If the spin is out of range.
    """
    a = check_spin(spin)
    return circular_photon_radius(a), circular_photon_radius(-a)


def critical_impact_parameters(spin: float) -> tuple[float, float]:
    """Return the range of impact parameters on the critical curve, in closed form (the ends of Eq. 11).

    b0(r_1) = -a + 6 cos(arccos(-a)/3), b0(r_2) = -a - 6 cos(arccos(a)/3): good at spin 0 as well, where Eq. 9 is
    not. (BPT's radii of Eq. 10 put into Eq. 9 and simplified.)

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.

    Returns
    -------
    b_1, b_2 : float
        b0(r_2) < b0(r_1), units of M.

    Raises
    ------
    BlackHoleError
        If the spin is out of range.
    """
    a = check_spin(spin)
    return -a - 6.0 * math.cos(math.acos(a) / 3.0), -a + 6.0 * math.cos(math.acos(-a) / 3.0)


def critical_carter_constant(spin: float, b: ArrayLike) -> Array:
    """Return q0(b), Carter's constant of the spherical photon orbit with impact parameter b (Eqs. 9, 11).

    b0(r_0) = b is the cubic x^3 + (a^2 + a b - 3) x + 2 (a^2 - 1) = 0 in x = r_0 - 1, whose positive root is
    wanted; Carter's constant follows from R'(r_0) = 0 rather than from Eq. 9, so that a = 0 needs no case.

    Parameters
    ----------
    spin : float
    b : array_like
        Impact parameters between the ends given by `critical_impact_parameters`, units of M.

    Returns
    -------
    ndarray
        q0, shape of `b`, units of M^2.

    Raises
    ------
    BlackHoleError
        For an impact parameter outside that range, which no spherical photon orbit has.
    """
    a = check_spin(spin)
    b = np.asarray(b, dtype=np.float64)
    low, high = critical_impact_parameters(a)
    if np.any((b < low) | (b > high)):
        raise BlackHoleError(
            f"Spherical photon orbits have impact parameters between {low:.6g} and {high:.6g} only.",
            code="settings.range",
        )
    linear, constant = a * a + a * b - 3.0, 2.0 * (a * a - 1.0)
    # The constant is negative, so there is one positive root and the cubic is convex to its right: Newton's method
    # from above the root comes down to it without leaving the right side of the asymptote r_0 = 1.
    x = np.sqrt(np.maximum(-linear, 0.0)) + math.cbrt(-constant)
    for _ in range(NEWTON_ROUNDS):
        change = (x * (x * x + linear) + constant) / (3.0 * x * x + linear)
        x = x - change
        if np.all(np.abs(change) <= 2.0 * np.finfo(float).eps * x):
            break
    r = 1.0 + x
    # R = R' = 0 gives P(r) = 2 r Delta / (r - 1) and (b - a)^2 + q = P^2 / Delta = 4 r^2 Delta / (r - 1)^2.
    delta = r * r - 2.0 * r + a * a
    q0: Array = 4.0 * r * r * delta / (x * x) - (b - a) ** 2
    return q0
