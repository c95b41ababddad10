# SPDX-License-Identifier: GPL-3.0-or-later
"""The straight lines along which light comes in from afar: the asymptotes of backward rays.

With u = 1/r and n(lambda) the unit vector of a ray's place, turned by psi (see `mino`), u falls to 0 at a finite Mino
time lambda_e with u' = -1, so that close to it u = (lambda_e - lambda) + O(u^3) and

    X = n / u = N / u - n'(lambda_e) + O(u),   N = n(lambda_e):

the ray runs along the line X(s) = D + s N with the impact vector D = -n'(lambda_e), perpendicular to N, in units of M.
No term of first order in M is left: in the radial coordinate of Boyer and Lindquist a ray without spin leaves the line
by M D^3 / (4 r^3) only. `docs/cycles_lens.md` derives this.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kerr.critical_curve import Barrier, comes_from_sky, find_barrier
from ..kerr.rays import Rays
from ..numerics.arrays import Array
from ..numerics.errors import BlackHoleError
from ..numerics.runge_kutta import CASH_KARP, integrate
from .closed_form import radial_integrals
from .mino import MinoSystem
from .polar import PolarMotion
from .tracer import DEFAULT_MAX_STEPS, Fate, last, mino_systems

# Methods whose equations carry n' along; the form of Eq. 2 as printed does not.
QUADRATURE, STEPS = "gauss-legendre", "cash-karp"
EXIT_METHODS = (QUADRATURE, STEPS)


def exit_lines(rays: Rays, tolerance: float, method: str = QUADRATURE) -> tuple[NDArray[np.uint8], Array, Array]:
    """Return where rays from one camera come from, as lines in space.

    Parameters
    ----------
    rays : Rays
    tolerance : float
        Error of direction, radians, as for `trace_rays`.
    method : {"gauss-legendre", "cash-karp"}

    Returns
    -------
    fate : ndarray of uint8, shape (n,)
        Values of `Fate`.
    direction : ndarray, shape (n, 3)
        N, unit vectors towards the origin of the light, in the hole's frame; NaN unless SKY.
    impact : ndarray, shape (n, 3)
        D, the point of the line that is nearest to the hole, in the hole's frame, units of M; NaN unless SKY.

    Raises
    ------
    BlackHoleError
        For another method.
    """
    check_exit_method(method)
    barrier = find_barrier(rays)
    sky = np.flatnonzero(comes_from_sky(rays, barrier))
    fate = np.full(len(rays), Fate.SHADOW, dtype=np.uint8)
    direction, impact = np.full((len(rays), 3), np.nan), np.full((len(rays), 3), np.nan)
    chosen, blocking = rays.select(sky), barrier.select(sky)
    rest = np.arange(len(sky))
    if method == QUADRATURE:
        answered = _by_quadrature(chosen, blocking, tolerance, sky, direction, impact)
        rest = np.flatnonzero(~answered)
    fate[sky] = Fate.SKY
    if len(rest):
        lost = _by_steps(chosen.select(rest), blocking.select(rest), tolerance, sky[rest], direction, impact)
        fate[sky[rest[lost]]] = Fate.UNRESOLVED
    return fate, direction, impact


def check_exit_method(method: str) -> None:
    """Check that a method can trace exit lines.

    Parameters
    ----------
    method : str
        A name in `tracer.METHODS`.

    Raises
    ------
    BlackHoleError
        If it cannot.
    """
    if method not in EXIT_METHODS:
        raise BlackHoleError(
            f"The method '{method}' gives directions alone and cannot tell where rays leave: choose one of "
            f"{', '.join(EXIT_METHODS)}.",
            code="settings.method",
        )


def _by_quadrature(
    rays: Rays, barrier: Barrier, tolerance: float, place: NDArray[np.intp], direction: Array, impact: Array
) -> NDArray[np.bool_]:
    """Fill the rows `place` of `direction` and `impact` as far as quadrature goes; return which rays, shape (n,)."""
    motion = PolarMotion.of(rays)
    answered = motion.usable(tolerance)
    time, psi = radial_integrals(rays, barrier, answered, tolerance)
    answered &= ~np.isnan(time)
    done = np.flatnonzero(answered)
    if len(done):
        unit, rate = motion.select(done).exit_lines(time[done], psi[done], tolerance)
        direction[place[done]], impact[place[done]] = unit.T, -rate.T
    return answered


def _by_steps(
    rays: Rays, barrier: Barrier, tolerance: float, place: NDArray[np.intp], direction: Array, impact: Array
) -> NDArray[np.bool_]:
    """Fill the rows `place` by Cash-Karp steps; return which rays were given up, shape (n,)."""
    lost = np.zeros(len(rays), dtype=bool)
    for indices, system in mino_systems(rays, barrier, tolerance):
        if not len(indices) or not isinstance(system, MinoSystem):
            continue
        outcome = last(integrate(system, CASH_KARP, tolerance, DEFAULT_MAX_STEPS))
        reached = outcome.reached
        unit, rate = system.select(reached).exit_lines(outcome.state[:, reached])
        direction[place[indices[reached]]], impact[place[indices[reached]]] = unit, -rate
        lost[indices[~reached]] = True
    return lost
