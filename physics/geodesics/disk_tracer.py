# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracing rays from a camera to a thin disk in the equatorial plane."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kerr.observer import Observer
from ..kerr.rays import Rays, camera_directions, rays_from_camera
from ..numerics.arrays import Array
from ..numerics.blocks import blocks
from ..numerics.checks import shown, whole
from ..numerics.errors import BlackHoleError
from ..numerics.work import Cancel, Progress, drain
from .crossings import Crossings, LightAtDisk, cross_plane, split_by_energy
from .plane_stepping import step_to_plane
from .radial_path import winding
from .tracer import DEFAULT_MAX_STEPS, DEFAULT_METHOD, DEFAULT_TOLERANCE, Fate, check_settings, viewing_angles

DEFAULT_CROSSINGS = 3
MOST_CROSSINGS = 8

Crosser = Callable[[Rays, int, float, int, bool, NDArray[np.bool_] | None], Crossings]


def _without_steps(
    rays: Rays, count: int, tolerance: float, max_steps: int, beyond: bool, wanted: NDArray[np.bool_] | None
) -> Crossings:
    """Return crossings in closed form, and by steps what few do not converge."""
    found = cross_plane(rays, count, tolerance, beyond, wanted)
    left = np.flatnonzero(found.fate == Fate.UNRESOLVED)
    if len(left):
        found.put(left, step_to_plane(rays.select(left), count, tolerance, max_steps))
    return found


def _by_steps(
    rays: Rays, count: int, tolerance: float, max_steps: int, beyond: bool, wanted: NDArray[np.bool_] | None
) -> Crossings:
    """Return crossings by steps; beyond a ray's end, where there is nothing to step along, as without steps."""
    found = step_to_plane(rays, count, tolerance, max_steps)
    if beyond:
        ended = np.isnan(found.u) & (found.fate != Fate.UNRESOLVED)
        other = cross_plane(rays, count, tolerance, beyond=True)
        for name in ("u", "u_slope", "unwound"):
            np.copyto(getattr(found, name), getattr(other, name), where=ended)
        turns = np.round((other.unwound - found.unwound) / (2.0 * np.pi))
        found.unwound[:] += 2.0 * np.pi * np.where(np.isfinite(turns), turns, 0.0)  # which steps do not count
    return found


DISK_METHODS: dict[str, Crosser] = {"gauss-legendre": _without_steps, "cash-karp": _by_steps}
"""How crossings are found, by the name of the method in `tracer.METHODS`."""


@dataclass(frozen=True)
class DiskResult:
    """Where rays cross the equatorial plane; arrays of shape (*directions, crossings) unless said otherwise.

    In the order of the backward ray from the camera, the camera itself excluded; NaN where there is no such crossing.
    """

    radius: Array
    """Boyer-Lindquist radius, units of M, outside the horizon."""
    phi: Array
    """Azimuth in the hole's frame, radians in [0, 2 pi)."""
    g: Array
    """nu_camera / nu_matter of matter that orbits there, or falls from the ISCO inside of it."""
    mino_time: Array
    """Mino time from the camera, in 1/M, of the ray scaled to energy 1 (or -1) at infinity: grows with the order."""
    fate: NDArray[np.uint8]
    """Values of `Fate`, of the directions' shape: where the ray ends behind all its crossings."""

    @property
    def counts(self) -> dict[str, int]:
        """Number of rays of each fate, by its name in lower case."""
        return {fate.name.lower(): int(np.count_nonzero(self.fate == fate)) for fate in Fate}


def trace_disk(
    spin: float,
    observer: Observer,
    theta_rd: ArrayLike,
    phi_rd: ArrayLike,
    *,
    crossings: int = DEFAULT_CROSSINGS,
    retrograde: bool = False,
    tolerance: float = DEFAULT_TOLERANCE,
    method: str = DEFAULT_METHOD,
    max_steps: int = DEFAULT_MAX_STEPS,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> DiskResult:
    """Trace rays backwards from a camera to their first crossings of the equatorial plane.

    Parameters
    ----------
    spin : float
        Kerr parameter a in units of M, -1 < a < 1.
    observer : Observer
        The camera's position and motion. A camera in the plane is not itself a crossing.
    theta_rd, phi_rd : array_like
        Where the camera looks, as for `trace_rays`; any shape, broadcast against each other.
    crossings : int
        How many crossings are looked for, 1 to 8.
    retrograde : bool
        Whether the matter that `g` is about turns against the hole. Without spin, matter turns towards +phi, and
        retrograde matter towards -phi.
    tolerance : float
        Error of position along the ray, radians as seen from the hole, 1e-13 to 1e-2.
    method : {"gauss-legendre", "cash-karp"}
        Closed form and series, or Runge-Kutta steps.
    max_steps : int
        Attempted steps before a ray is reported as UNRESOLVED, where steps are taken.
    progress, cancel : callable, optional
        As for `trace_rays`.

    Returns
    -------
    DiskResult
        Radius, azimuth, redshift and Mino time of shape (*broadcast shape, crossings), and fates.

    Raises
    ------
    BlackHoleError
        For settings out of range or a camera inside the horizon.
    Cancelled
        When `cancel` returned true.
    """
    check_settings(tolerance, method, max_steps)
    check_disk_settings(crossings, method)
    theta, phi = viewing_angles(theta_rd, phi_rd)
    rays_from_camera(spin, observer, np.empty((0, 3)))  # a bad spin or place is an error with no rays as well
    found = Crossings.empty(crossings, theta.size)
    g = np.full((crossings, theta.size), np.nan)

    def steps() -> Generator[float, None, None]:
        for block in blocks(theta.size):
            looking = camera_directions(theta.flat[block], phi.flat[block])
            part, light = disk_crossings(spin, observer, looking, crossings, tolerance, method, max_steps)
            found.put(np.arange(block.start, block.stop), part)
            g[:, block] = light.g(spin, part.u, part.u_slope, retrograde)
            yield block.stop / theta.size

    drain(steps(), progress, cancel)

    def shaped(values: Array) -> Array:
        return np.moveaxis(values.reshape(crossings, *theta.shape), 0, -1)

    azimuth = (found.unwound + winding(spin, found.u)) % (2.0 * np.pi)
    azimuth[azimuth >= 2.0 * np.pi] = 0.0  # a tiny negative angle rounds up to 2 pi itself
    return DiskResult(
        shaped(1.0 / found.u), shaped(azimuth), shaped(g), shaped(found.mino_time), found.fate.reshape(theta.shape)
    )


def check_disk_settings(crossings: int, method: str) -> None:
    """Check the settings of tracing to the disk.

    Parameters
    ----------
    crossings : int
        1 to `MOST_CROSSINGS`.
    method : str
        A name in `DISK_METHODS`.

    Raises
    ------
    BlackHoleError
        If the number is out of range, or the method knows no disk.
    """
    crossings = whole(crossings, "the number of crossings")
    if not 1 <= crossings <= MOST_CROSSINGS:
        raise BlackHoleError(
            f"The number of crossings is {shown(crossings)}; give it a value between 1 and {MOST_CROSSINGS}.",
            code="disk.setting",
        )
    if method not in DISK_METHODS:
        raise BlackHoleError(
            f"The method '{method}' knows no disk; choose one of {', '.join(DISK_METHODS)}.", code="settings.method"
        )


def disk_crossings(
    spin: float,
    observer: Observer,
    directions: Array,
    count: int,
    tolerance: float,
    method: str,
    max_steps: int = DEFAULT_MAX_STEPS,
    beyond: bool = False,
    wanted: NDArray[np.bool_] | None = None,
) -> tuple[Crossings, LightAtDisk]:
    """Return the crossings of rays along `directions`, shape (n, 3), and what their redshifts depend on.

    Where `wanted`, shape (count, n), is given, the other crossings may be left out.
    """
    found, light = Crossings.empty(count, len(directions)), LightAtDisk.empty(len(directions))
    for index, rays, sign in split_by_energy(spin, observer, directions):
        part = DISK_METHODS[method](
            rays, count, tolerance, max_steps, beyond, None if wanted is None else wanted[:, index]
        )
        if sign < 0.0:
            part.fate[part.fate == Fate.SKY] = Fate.SHADOW
        own_light = LightAtDisk(rays.b, np.full(len(rays), sign), 1.0 / rays.one_plus_z)
        if len(rays) == len(directions):  # of one sign all, as everywhere outside the ergosphere
            return part, own_light
        found.put(index, part)
        light.put(index, own_light)
    return found, light
