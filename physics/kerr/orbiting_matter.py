# SPDX-License-Identifier: GPL-3.0-or-later
"""Matter of a thin disk in the equatorial plane: its motion, and the redshift of the light that it sends.

Outside the innermost stable orbit matter moves on circular geodesics (Bardeen, Press & Teukolsky 1972, Astrophys. J.
178, 347, Eqs. 2.12 and 2.16); inside it falls with the energy and angular momentum of that orbit (Cunningham 1975,
Astrophys. J. 202, 788). Matter that turns towards -phi is seen in a mirror that reverses phi: there its hole has the
spin -a, and light the angular momentum -b. So all formulae are for matter that turns towards +phi.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..numerics.arrays import Array
from .metric import check_spin, horizon_radius, isco_radius


def matter_direction(spin: float, retrograde: bool = False) -> float:
    """Return the direction in which the matter of a disk orbits.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    retrograde : bool
        Whether the matter orbits against the hole's rotation.

    Returns
    -------
    float
        1 toward +phi, -1 toward -phi. Around a hole without spin, matter that is not retrograde orbits toward +phi.
    """
    with_hole = -1.0 if spin < 0.0 else 1.0
    return -with_hole if retrograde else with_hole


def orbital_frequency(spin: float, radius: ArrayLike, retrograde: bool = False) -> Array:
    """Return dphi/dt of circular geodesics (BPT Eq. 2.16), signed, in 1/M.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    radius : array_like
        Units of M, outside the horizon.
    retrograde : bool
        Against the hole's rotation.
    """
    direction = matter_direction(check_spin(spin), retrograde)
    r = np.asarray(radius, dtype=np.float64)
    frequency: Array = direction / (r * np.sqrt(r) + direction * spin)
    return frequency


def redshift_factor(
    spin: float,
    radius: ArrayLike,
    b: ArrayLike,
    energy: ArrayLike = 1.0,
    radial: ArrayLike = 0.0,
    retrograde: bool = False,
) -> Array:
    """Return g = nu_camera / nu_matter times E_camera^-1 for light that leaves the disk.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    radius : array_like
        Of the matter, units of M, outside the horizon.
    b : array_like
        p_phi of the light, units of M.
    energy : array_like
        -p_t of the light; 1 but for light of negative energy.
    radial : array_like
        p_r Delta of the light at the matter, units of M^2; it matters inside the ISCO alone.
    retrograde : bool
        Whether the matter turns against the hole.

    Returns
    -------
    ndarray
        1 / (-p . u) with u the matter's four-velocity, of the broadcast shape.
    """
    spin = check_spin(spin)
    direction = matter_direction(spin, retrograde)
    a, b = direction * spin, direction * np.asarray(b, dtype=np.float64)
    r, energy = np.asarray(radius, dtype=np.float64), np.asarray(energy, dtype=np.float64)
    isco = isco_radius(spin, prograde=not retrograde)
    with np.errstate(invalid="ignore", divide="ignore"):
        outside = circular_redshift(spin, 1.0 / np.maximum(r, isco), direction * b, energy, retrograde)
        if not (r < isco).any():
            return outside
        inside = 1.0 / _falling(a, r, b, energy, np.asarray(radial, dtype=np.float64), isco)
    return np.where(r < isco, inside, outside)


def circular_redshift(
    spin: float, u: NDArray[Any], b: NDArray[Any], energy: NDArray[Any], retrograde: bool = False
) -> NDArray[Any]:
    """Return g for matter on circular geodesics outside the ISCO, in the precision of `u`.

    -p . u = u^t (E - Omega L) with u^t from BPT Eqs. 2.12 and 2.16, multiplied out.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    u : ndarray
        1 / r of the matter, units of 1 / M.
    b, energy : ndarray
        p_phi and -p_t of the light, units of M and 1, as for `redshift_factor`.
    retrograde : bool
        Whether the matter orbits against the hole's rotation.

    Returns
    -------
    ndarray
        1 / (-p . u), of the broadcast shape.
    """
    direction = matter_direction(spin, retrograde)
    a = direction * spin
    root = u * np.sqrt(u)
    factor: NDArray[Any] = np.sqrt(1.0 - 3.0 * u + (2.0 * a) * root)
    factor /= energy + root * (a * energy - direction * b)
    return factor


def _falling(a: float, r: Array, b: Array, energy: Array, radial: Array, isco: float) -> Array:
    """Return -p . u for matter that falls from the ISCO (Cunningham 1975; r^2 u^r = -sqrt(R_matter))."""
    matter_energy, momentum = circular_constants(a, isco)
    outer = horizon_radius(a)
    delta = (r - outer) * (r - a * a / outer)
    l_minus_ae = momentum - a * matter_energy
    p = matter_energy * (r * r + a * a) - a * momentum
    inward = np.sqrt(np.maximum(p * p - delta * (r * r + l_minus_ae * l_minus_ae), 0.0))
    light = energy * (r * r + a * a) - a * b
    # -p . u = [(P p - Delta p_r r^2 u^r) / Delta - (b - a E)(L - a E)] / r^2, all of it multiplied out from BPT 2.9
    product: Array = ((light * p + radial * inward) / delta - (b - a * energy) * l_minus_ae) / (r * r)
    return product


def circular_constants(a: float, r: float) -> tuple[float, float]:
    """Return energy and angular momentum per mass of the circular orbit toward +phi (BPT Eqs. 2.12, 2.13).

    Parameters
    ----------
    a : float
        Kerr parameter, -1 < a < 1; negative for an orbit against the hole's rotation.
    r : float
        Units of M, outside the photon orbit.

    Returns
    -------
    energy : float
        E per mass.
    momentum : float
        L per mass, units of M.
    """
    root = math.sqrt(r)
    below = r**0.75 * math.sqrt(r * root - 3.0 * root + 2.0 * a)
    return (r * root - 2.0 * root + a) / below, (r * r - 2.0 * a * root + a * a) / below
