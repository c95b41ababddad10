# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracing rays from a camera back to the celestial sphere."""

from __future__ import annotations

import enum
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kerr.critical_curve import Barrier, comes_from_sky, find_barrier
from ..kerr.observer import Observer
from ..kerr.rays import Rays, camera_directions, rays_from_camera
from ..numerics.arrays import Array, indices
from ..numerics.blocks import blocks
from ..numerics.checks import number, shown, whole
from ..numerics.errors import BlackHoleError
from ..numerics.runge_kutta import CASH_KARP, Integration, System, Tableau, integrate
from ..numerics.sphere import celestial_coordinates
from ..numerics.work import Cancel, Progress, drain
from .boyer_lindquist import PrintedSystem
from .closed_form import sky_directions
from .mino import DirectRays, TurningRays

# Error of direction, radians: of the whole ray for quadrature, of one step for the methods that take steps. Either way
# it leaves medians of about 1e-7 rad.
DEFAULT_TOLERANCE = 1e-6
# Below this a step's error estimate is rounding noise, and step control stalls.
SMALLEST_TOLERANCE = 1e-13
LARGEST_TOLERANCE = 1e-2

# Attempted steps before a ray is given up as UNRESOLVED, where a method takes steps. With Cash-Karp ordinary rays take
# 5 to 40; each decade of closeness to the critical curve adds some 10 at the default tolerance, up to 150 or so at
# float64's limit.
DEFAULT_MAX_STEPS = 4000


class Fate(enum.IntEnum):
    """Where a ray comes from."""

    UNRESOLVED = 0
    """The integration gave up: steps ran out, or the coordinates of the method cannot carry the ray."""
    SKY = 1
    SHADOW = 2


class Tracer(Protocol):
    """What a method does with rays that come from the sky."""

    def __call__(
        self, rays: Rays, barrier: Barrier, tolerance: float, max_steps: int
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return the unit vectors the rays come from, shape (n, 3), and which of them were resolved, shape (n,)."""


@dataclass(frozen=True)
class Method:
    """A way to trace."""

    name: str
    label: str
    """What an artist calls it."""
    description: str
    trace: Tracer


Systems = Callable[[Rays, Barrier, float], list[tuple[NDArray[np.intp], System]]]
"""Splits rays into the systems of equations that trace them: (indices, system) pairs."""


def mino_systems(rays: Rays, barrier: Barrier, tolerance: float) -> list[tuple[NDArray[np.intp], System]]:
    """Return the regularized equations of motion in Mino time for rays from the sky.

    Parameters
    ----------
    rays : Rays
    barrier : Barrier
        Of these rays.
    tolerance : float
        Radians.

    Returns
    -------
    list of (ndarray of int, System)
        The rays that the barrier turns back, and the others: their indices and their system.
    """
    turning = np.flatnonzero(barrier.blocks)
    direct = np.flatnonzero(~barrier.blocks)
    return [
        (turning, TurningRays(rays.select(turning), barrier.select(turning), tolerance)),
        (direct, DirectRays(rays.select(direct), barrier.select(direct), tolerance)),
    ]


def printed_system(rays: Rays, barrier: Barrier, tolerance: float) -> list[tuple[NDArray[np.intp], System]]:
    """Return Eq. 2 as printed for rays from the sky; parameters and result as for `mino_systems`."""
    return [(np.arange(len(rays)), PrintedSystem(rays, barrier, tolerance))]


def stepping(tableau: Tableau, systems: Systems) -> Tracer:
    """Return a tracer that integrates equations of motion step by step with a Runge-Kutta pair.

    Parameters
    ----------
    tableau : Tableau
    systems : callable
        See `Systems`.

    Returns
    -------
    Tracer
    """

    def trace(rays: Rays, barrier: Barrier, tolerance: float, max_steps: int) -> tuple[Array, NDArray[np.bool_]]:
        direction = np.full((len(rays), 3), np.nan)
        resolved = np.zeros(len(rays), dtype=bool)
        for members, system in systems(rays, barrier, tolerance):
            if not len(members):
                continue
            outcome = last(integrate(system, tableau, tolerance, max_steps))
            resolved[members] = outcome.reached
            arrived = system.select(outcome.reached).sky_direction(outcome.state[:, outcome.reached])
            direction[members[outcome.reached]] = arrived
        return direction, resolved

    return trace


def _without_steps(rays: Rays, barrier: Barrier, tolerance: float, max_steps: int) -> tuple[Array, NDArray[np.bool_]]:
    """Trace by quadrature and closed forms; the few rays beyond their reach by Cash-Karp steps."""
    direction, resolved = sky_directions(rays, barrier, tolerance)
    rest = np.flatnonzero(~resolved)
    if len(rest):
        direction[rest], resolved[rest] = _by_cash_karp(rays.select(rest), barrier.select(rest), tolerance, max_steps)
    return direction, resolved


_by_cash_karp = stepping(CASH_KARP, mino_systems)

METHODS = {
    method.name: method
    for method in (
        Method(
            "gauss-legendre",
            "Fast",
            "Radial motion by Gauss-Legendre quadrature, polar motion in closed form: exact like Reference, but faster",
            _without_steps,
        ),
        Method(
            "cash-karp",
            "Reference",
            "Geodesics in Mino time, integrated step by step with the Cash-Karp pair",
            _by_cash_karp,
        ),
        Method(
            "cash-karp-printed",
            "Boyer-Lindquist",
            "Geodesics as printed in the source paper: a check of the others. It cannot carry rays through the poles",
            stepping(CASH_KARP, printed_system),
        ),
    )
}
"""The methods by name."""

DEFAULT_METHOD = "gauss-legendre"


@dataclass(frozen=True)
class TraceResult:
    """What became of each ray; arrays share the shape of the directions asked for."""

    fate: NDArray[np.uint8]
    """Values of `Fate`."""
    theta: Array
    """Polar angle of the direction the light comes from, hole's frame, radians in [0, pi]; NaN unless SKY."""
    phi: Array
    """Azimuth of that direction, radians in [0, 2 pi); NaN unless SKY."""
    one_plus_z: Array
    """f_source / f_camera for a source at rest at infinity (Eq. 13), > 1 is redshift; NaN unless SKY."""

    @property
    def counts(self) -> dict[str, int]:
        """Number of rays of each fate, by its name in lower case."""
        return {fate.name.lower(): int(np.count_nonzero(self.fate == fate)) for fate in Fate}


def trace_rays(
    spin: float,
    observer: Observer,
    theta_rd: ArrayLike,
    phi_rd: ArrayLike,
    *,
    tolerance: float = DEFAULT_TOLERANCE,
    method: str = DEFAULT_METHOD,
    max_steps: int = DEFAULT_MAX_STEPS,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> TraceResult:
    """Trace rays backwards from a camera to the celestial sphere.

    The physics is that of Verbraeck & Eisemann, "Raytracing Equations", after James et al. 2015,
    Class. Quantum Grav. 32 065001.

    Parameters
    ----------
    spin : float
        Kerr parameter a in units of M, -1 < a < 1.
    observer : Observer
        The camera's position and motion.
    theta_rd, phi_rd : array_like
        Where the camera looks, radians, in its own frame with y along its motion (Eq. 4); any shape, broadcast
        against each other.
    tolerance : float
        Error of direction, radians, 1e-13 to 1e-2: aimed at for the whole ray by quadrature, allowed in each step by
        the methods that take steps.
    method : str
        A name in `METHODS`.
    max_steps : int
        Attempted steps before a ray is reported as UNRESOLVED, by the methods that take steps.
    progress : callable, optional
        Called with the fraction done after each block of rays.
    cancel : callable, optional
        Asked before each block; true ends the work.

    Returns
    -------
    TraceResult
        Fate, celestial coordinates and redshift, of the broadcast shape.

    Raises
    ------
    BlackHoleError
        For a spin, tolerance or method out of range, directions that are not finite, or a camera inside the
        horizon.
    Cancelled
        When `cancel` returned true.
    """
    theta, phi = viewing_angles(theta_rd, phi_rd)
    fate = np.empty(theta.size, dtype=np.uint8)
    theta_cs, phi_cs, one_plus_z = np.empty((3, theta.size))

    def steps() -> Generator[float, None, None]:
        for block in blocks(theta.size):
            rays = rays_from_camera(spin, observer, camera_directions(theta.flat[block], phi.flat[block]))
            fate[block], direction = trace_block(rays, tolerance, method, max_steps)
            theta_cs[block], phi_cs[block] = celestial_coordinates(direction)
            one_plus_z[block] = np.where(fate[block] == Fate.SKY, rays.one_plus_z, np.nan)
            yield block.stop / theta.size

    check_settings(tolerance, method, max_steps)
    rays_from_camera(spin, observer, np.empty((0, 3)))  # a bad spin or place is an error with no rays as well
    drain(steps(), progress, cancel)
    return TraceResult(
        fate.reshape(theta.shape),
        theta_cs.reshape(theta.shape),
        phi_cs.reshape(theta.shape),
        one_plus_z.reshape(theta.shape),
    )


def trace_block(
    rays: Rays, tolerance: float, method: str, max_steps: int = DEFAULT_MAX_STEPS
) -> tuple[NDArray[np.uint8], Array]:
    """Trace one block of rays, all at once.

    Parameters
    ----------
    rays : Rays
        n rays of one camera.
    tolerance, method, max_steps
        See `trace_rays`; not checked.

    Returns
    -------
    fate : ndarray of uint8, shape (n,)
        Values of `Fate`.
    direction : ndarray, shape (n, 3)
        Unit vectors toward the origin of the light, in the hole's frame; NaN unless SKY.
    """
    barrier = find_barrier(rays)
    sky = indices(comes_from_sky(rays, barrier))
    fate = np.full(len(rays), Fate.SHADOW, dtype=np.uint8)
    direction = np.full((3, len(rays)), np.nan)
    found, resolved = METHODS[method].trace(rays.select(sky), barrier.select(sky), tolerance, max_steps)
    fate[sky] = np.where(resolved, Fate.SKY, Fate.UNRESOLVED)
    direction[:, sky] = found.T
    return fate, direction.T


def viewing_angles(theta_rd: ArrayLike, phi_rd: ArrayLike) -> tuple[Array, Array]:
    """Return viewing directions broadcast against each other.

    Parameters
    ----------
    theta_rd, phi_rd : array_like
        Radians; shapes that broadcast.

    Returns
    -------
    theta, phi : ndarray
        Of the broadcast shape.

    Raises
    ------
    BlackHoleError
        If they are not finite numbers, or their shapes do not broadcast.
    """
    try:
        theta, phi = np.broadcast_arrays(np.asarray(theta_rd, np.float64), np.asarray(phi_rd, np.float64))
    except (TypeError, ValueError, OverflowError) as error:
        raise BlackHoleError(
            "theta_rd and phi_rd must be numbers, of one shape or shapes that broadcast.", code="settings.array"
        ) from error
    if not (np.isfinite(theta).all() and np.isfinite(phi).all()):
        raise BlackHoleError(
            "The viewing directions theta_rd and phi_rd must all be finite numbers.", code="settings.array"
        )
    return theta, phi


def check_settings(tolerance: float, method: str, max_steps: int = DEFAULT_MAX_STEPS) -> None:
    """Check the settings of tracing.

    Parameters
    ----------
    tolerance, method, max_steps
        See `trace_rays`.

    Raises
    ------
    BlackHoleError
        If the tolerance is out of range, there is no such method, or there are no steps.
    """
    tolerance, max_steps = number(tolerance, "the tolerance"), whole(max_steps, "the number of steps")
    if not SMALLEST_TOLERANCE <= tolerance <= LARGEST_TOLERANCE:
        raise BlackHoleError(
            f"The tolerance is {tolerance:g}; give it a value between {SMALLEST_TOLERANCE:g} and "
            f"{LARGEST_TOLERANCE:g} radians.",
            code="settings.range",
        )
    if not isinstance(method, str) or method not in METHODS:
        raise BlackHoleError(
            f"There is no method {shown(method)}; choose one of {', '.join(METHODS)}.", code="settings.choice"
        )
    if max_steps < 1:
        raise BlackHoleError(f"The number of steps is {max_steps}; it must be at least 1.", code="settings.range")


def last(rounds: Iterator[Integration | None]) -> Integration:
    """Return the outcome of an integration.

    Parameters
    ----------
    rounds : iterator
        From `integrate`.

    Returns
    -------
    Integration
    """
    for outcome in rounds:
        if outcome is not None:
            return outcome
    raise AssertionError("an integration always ends with its outcome")
