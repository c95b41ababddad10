# SPDX-License-Identifier: GPL-3.0-or-later
"""The Kerr metric in Boyer-Lindquist coordinates, and the radii that matter in it.

Units G = c = M = 1. "Eq. n" is equation n of Verbraeck & Eisemann, "Raytracing Equations", which follows
appendix A of James, von Tunzelmann, Franklin & Thorne 2015, Class. Quantum Grav. 32 065001; "BPT" is
Bardeen, Press & Teukolsky 1972, Astrophys. J. 178, 347.

A negative spin is the same hole turning towards -phi: every formula holds as it stands.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..numerics.checks import number
from ..numerics.errors import BlackHoleError

# Beyond any scene; formulae hold powers of the radius, up to the eighth, that must stay finite.
LARGEST_RADIUS = 1e12


class MetricFunctions(NamedTuple):
    """The functions of Eq. 1 at one event, each a dimensionless number or a length in units of M."""

    alpha: float
    """Lapse: proper time of the FIDO per coordinate time."""
    omega: float
    """Angular velocity of the FIDO seen from infinity (frame dragging), in 1/M."""
    varpi: float
    """Circumference of the circle of constant r and theta, over 2 pi."""
    rho: float
    delta: float
    sigma: float


def check_spin(spin: float) -> float:
    """Return `spin` as a float, or raise.

    Raises
    ------
    BlackHoleError
        Unless -1 < spin < 1: a spin of 1 or more has no horizon to cast a shadow.
    """
    spin = number(spin, "the spin")
    if not -1.0 < spin < 1.0:  # also catches NaN
        raise BlackHoleError(f"The spin is {spin:g}; give it a value above -1 and below 1.", code="hole.spin")
    return spin


def metric_functions(spin: float, r: float, theta: float) -> MetricFunctions:
    """Evaluate the functions of Eq. 1.

    Parameters
    ----------
    spin : float
        Kerr parameter a, -1 < a < 1.
    r, theta : float
        Boyer-Lindquist radius in units of M, outside the horizon, and polar angle in radians, [0, pi].

    Returns
    -------
    MetricFunctions
        alpha, omega, varpi, rho, Delta and Sigma of Eq. 1.

    Raises
    ------
    BlackHoleError
        At or inside the horizon, where no observer can stay and the lapse is not real.
    """
    horizon = horizon_radius(spin)
    if not r <= LARGEST_RADIUS:
        raise BlackHoleError(
            f"The distance from the hole is {r:g} M; it must be at most {LARGEST_RADIUS:g} M.", code="camera.position"
        )
    if not math.isfinite(theta):
        raise BlackHoleError(f"The polar angle is {theta:g}; it must be a finite number.", code="camera.position")
    if not r > horizon:
        raise BlackHoleError(
            f"The camera is inside the black hole: its distance is {r:.4g} M and the horizon lies at "
            f"{horizon:.4g} M; move the camera away from the hole or make the hole smaller.",
            code="camera.inside-hole",
        )
    sin_theta = axis_safe_sin(theta)
    a2 = spin * spin
    # (r - r_+)(r - r_-) keeps its digits next to the horizon, where r^2 - 2 r + a^2 cancels.
    delta = (r - horizon) * (r - a2 / horizon)
    rho = math.sqrt(r * r + a2 * (1.0 - sin_theta * sin_theta))
    sigma = math.sqrt((r * r + a2) ** 2 - a2 * delta * sin_theta * sin_theta)
    return MetricFunctions(
        alpha=rho * math.sqrt(delta) / sigma,
        omega=2.0 * spin * r / (sigma * sigma),
        varpi=sigma * sin_theta / rho,
        rho=rho,
        delta=delta,
        sigma=sigma,
    )


def axis_safe_sin(theta: float) -> float:
    """Return sin(theta), exactly 0 at the float nearest to pi, where `math.sin` gives 1.2e-16.

    Parameters
    ----------
    theta : float
        Polar angle, radians, [0, pi].

    Returns
    -------
    float
    """
    return 0.0 if theta == math.pi else math.sin(theta)


def horizon_radius(spin: float) -> float:
    """Return the radius of the outer event horizon, r_+ = 1 + sqrt(1 - a^2) (BPT Eq. 2.6).

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1; not checked.

    Returns
    -------
    float
        Units of M, from 1 to 2.
    """
    return 1.0 + math.sqrt((1.0 - spin) * (1.0 + spin))


def ergosphere_radius(spin: float, theta: float) -> float:
    """Return the radius inside which nothing can be at rest relative to the stars.

    It is where g_tt = 0: r = 1 + sqrt(1 - a^2 cos^2 theta) (BPT Eq. 2.7).

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1; not checked.
    theta : float
        Polar angle, radians, [0, pi].

    Returns
    -------
    float
        Units of M, from 1 to 2.
    """
    a_cos = spin * math.cos(theta)
    return 1.0 + math.sqrt((1.0 - a_cos) * (1.0 + a_cos))


def photon_orbit_radius(spin: float, prograde: bool = True) -> float:
    """Return the radius of the equatorial circular photon orbit (Eq. 10; BPT Eq. 2.18).

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1; not checked.
    prograde : bool
        Whether the light orbits with the hole's rotation, whatever the sign of the spin.

    Returns
    -------
    float
        Units of M, from 1 to 4.
    """
    return circular_photon_radius(abs(spin) if prograde else -abs(spin))


def circular_photon_radius(spin: float) -> float:
    """Return the radius of the circular photon orbit toward +phi, r_1 of Eq. 10 (BPT Eq. 2.18).

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1; not checked. Of the opposite spin, the radius is that of the orbit toward -phi, r_2.

    Returns
    -------
    float
        Units of M, from 1 to 4.
    """
    return 2.0 * (1.0 + math.cos(2.0 / 3.0 * math.acos(-spin)))


def isco_radius(spin: float, prograde: bool = True) -> float:
    """Return the radius of the innermost stable circular orbit, the ISCO (BPT Eq. 2.21).

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1; not checked.
    prograde : bool
        Whether the matter orbits with the hole's rotation, whatever the sign of the spin.

    Returns
    -------
    float
        Units of M, from 1 to 9.
    """
    a = abs(spin)
    z1 = 1.0 + ((1.0 - a) * (1.0 + a)) ** (1.0 / 3.0) * ((1.0 + a) ** (1.0 / 3.0) + (1.0 - a) ** (1.0 / 3.0))
    z2 = math.sqrt(3.0 * a * a + z1 * z1)
    split = math.sqrt((3.0 - z1) * (3.0 + z1 + 2.0 * z2))
    return 3.0 + z2 - split if prograde else 3.0 + z2 + split
