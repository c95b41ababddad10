# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a thin disk shines at each radius: Novikov & Thorne's steady disk, and a plain power law.

Page & Thorne 1974, Astrophys. J. 191, 499: a disk in which matter drifts inwards at a steady rate through circular
orbits, without stress at the innermost stable one, sends out from each face, per area and proper time, the flux
F = Mdot f / (4 pi r), with f of their Eq. 15n in closed form.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from ..kerr.metric import check_spin, isco_radius
from ..numerics.arrays import Array
from ..numerics.checks import shown
from ..numerics.errors import BlackHoleError

PROFILES = ("novikov_thorne", "power_law")

# Radii, relative to the innermost stable orbit, among which the brightest is looked for, and how many.
PEAK_WITHIN = 8.0
PEAK_SAMPLES = 4001


def page_thorne_flux(spin: float, radius: ArrayLike, retrograde: bool = False) -> Array:
    """Return 4 pi F M^2 / Mdot of a Novikov-Thorne disk.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    radius : array_like
        Units of M.
    retrograde : bool
        Whether the disk turns against the hole.

    Returns
    -------
    ndarray
        f / r of Page & Thorne 1974, Eqs. 11b and 15n; 0 inside the innermost stable orbit.

    Raises
    ------
    BlackHoleError
        For a spin out of range.
    """
    a = abs(check_spin(spin)) * (-1.0 if retrograde else 1.0)
    r0 = isco_radius(spin, prograde=not retrograde)
    r = np.maximum(np.asarray(radius, dtype=np.float64), r0)
    x, x0 = np.sqrt(r), math.sqrt(r0)
    # x_1, x_2, x_3 of Eq. 15d: the roots of x^3 - 3 x + 2 a
    third = math.acos(a) / 3.0
    roots = [2.0 * math.cos(third - math.pi / 3.0), 2.0 * math.cos(third + math.pi / 3.0), -2.0 * math.cos(third)]
    total = x - x0 - 1.5 * a * np.log(x / x0)
    for i, root in enumerate(roots):
        if a == 0.0 and i == 1:
            continue  # the root is 0, and its share (x_2 - a)^2 / x_2 vanishes with a
        one, other = roots[i - 1], roots[i - 2]
        weight = 3.0 * (root - a) ** 2 / (root * (root - one) * (root - other))
        total = total - weight * np.log((x - root) / (x0 - root))
    f = 1.5 / (x * x * (x * x * x - 3.0 * x + 2.0 * a)) * total
    # Next to the innermost orbit, where the terms cancel, rounding may leave less than nothing.
    flux: Array = np.where(np.asarray(radius) > r0, np.maximum(f, 0.0) / r, 0.0)
    return flux


def peak_radius(spin: float, retrograde: bool = False) -> float:
    """Return the radius at which a Novikov-Thorne disk shines brightest, units of M."""
    r0 = isco_radius(spin, prograde=not retrograde)
    radii = r0 * np.geomspace(1.0, PEAK_WITHIN, PEAK_SAMPLES)
    return float(radii[np.argmax(page_thorne_flux(spin, radii, retrograde))])


@cache
def peak_flux(spin: float, retrograde: bool = False) -> float:
    """Return `page_thorne_flux` where it is largest."""
    return float(page_thorne_flux(spin, peak_radius(spin, retrograde), retrograde))


def relative_flux(
    profile: str, spin: float, radius: ArrayLike, inner: float, exponent: float = 3.0, retrograde: bool = False
) -> Array:
    """Return the flux relative to its largest, 0 to 1.

    Parameters
    ----------
    profile : {"novikov_thorne", "power_law"}
    spin : float
        Kerr parameter, -1 < a < 1.
    radius : array_like
        Units of M.
    inner : float
        The disk's inner radius, where the power law is 1, units of M.
    exponent : float
        Of the power law (inner / radius)^exponent; 3 is the far limit of the other.
    retrograde : bool
        Whether the disk turns against the hole.

    Raises
    ------
    BlackHoleError
        For a profile that there is not.
    """
    r = np.asarray(radius, dtype=np.float64)
    if not isinstance(profile, str):
        raise BlackHoleError(
            f"There is no temperature profile {shown(profile)}; choose one of {', '.join(PROFILES)}.",
            code="settings.choice",
        )
    if profile == "power_law":
        return np.minimum(inner / r, 1.0) ** exponent
    if profile != "novikov_thorne":
        raise BlackHoleError(
            f"There is no temperature profile {shown(profile)}; choose one of {', '.join(PROFILES)}.",
            code="settings.choice",
        )
    return page_thorne_flux(spin, r, retrograde) / peak_flux(spin, retrograde)
