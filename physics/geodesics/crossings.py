# SPDX-License-Identifier: GPL-3.0-or-later
"""Where rays cross the equatorial plane on their way back from a camera: the first few crossings of each.

The polar motion says when, in Mino time (`polar`); the radial motion says where it is then (`radial_motion`). Rays of
the sky and of the shadow alike are followed to their end, infinity or the horizon, also those inside the ergosphere
whose energy at infinity is negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kerr.critical_curve import comes_from_sky, find_barrier
from ..kerr.metric import horizon_radius
from ..kerr.observer import Observer
from ..kerr.orbiting_matter import redshift_factor
from ..kerr.rays import Rays, negative_energy_rays, rays_from_camera
from ..numerics.arrays import Array
from .polar import PolarMotion
from .radial_motion import places_of_rays
from .radial_path import HORIZON_MARGIN
from .tracer import Fate


@dataclass(frozen=True)
class Crossings:
    """Crossings of the equatorial plane in their order along the backward ray; arrays of shape (count, n).

    NaN where there is none, unless asked for beyond the ray's end: there u goes on smoothly to 0 and less, or to
    1 / r_+ and more.
    """

    u: Array
    """1 / r, in 1/M."""
    u_slope: Array
    """du / dlambda of the ray backwards: u^2 Delta p_r of the light."""
    unwound: Array
    """Azimuth in the hole's frame, radians, without `radial_path.winding` of the hole itself, which is also that of
    light of negative energy about the mirrored hole, with its sign: regular at the horizon. It counts
    turns: from ray to ray it jumps, by whole ones, only where b changes sign, as long as no steps are taken."""
    mino_time: Array
    """Mino time from the camera, in 1/M, for energy +-1 at infinity."""
    fate: NDArray[np.uint8]
    """`tracer.Fate` of the ray, shape (n,)."""

    @classmethod
    def empty(cls, count: int, rays: int) -> Crossings:
        """Return crossings that are all unknown."""
        u, u_slope, unwound, mino_time = (np.full((count, rays), np.nan) for _ in range(4))
        return cls(u, u_slope, unwound, mino_time, np.full(rays, Fate.UNRESOLVED, dtype=np.uint8))

    def put(self, index: NDArray[np.intp] | NDArray[np.bool_], other: Crossings) -> None:
        """Take over the crossings of the rays of `index`."""
        for name in ("u", "u_slope", "unwound", "mino_time"):
            getattr(self, name)[:, index] = getattr(other, name)
        self.fate[index] = other.fate


@dataclass(frozen=True)
class LightAtDisk:
    """What of a ray the redshift of matter depends on besides the crossing; arrays of shape (n,)."""

    b: Array
    """p_phi, units of M."""
    energy: Array
    """-p_t, which the constants of motion are scaled to: 1, or -1 inside the ergosphere."""
    camera_energy: Array
    """In the camera's frame, on the same scale; > 0."""

    @classmethod
    def empty(cls, rays: int) -> LightAtDisk:
        """Return the light of so many rays, yet to be told."""
        return cls(*(np.full(rays, np.nan) for _ in range(3)))

    def put(self, index: NDArray[np.intp], other: LightAtDisk) -> None:
        """Take over what the rays of `index` are made of."""
        self.b[index], self.energy[index], self.camera_energy[index] = other.b, other.energy, other.camera_energy

    def g(self, spin: float, u: Array, u_slope: Array, retrograde: bool = False) -> Array:
        """Return nu_camera / nu_matter at crossings, shape (count, n)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            radial = u_slope / (u * u)
            factor = redshift_factor(spin, 1.0 / u, self.b, self.energy, radial, retrograde)
        return factor * self.camera_energy


def cross_plane(
    rays: Rays, count: int, tolerance: float, beyond: bool = False, wanted: NDArray[np.bool_] | None = None
) -> Crossings:
    """Return the first `count` crossings of rays of positive energy, without steps: `radial_motion` and `polar`.

    Where `wanted`, shape (count, n), is given, the others are left NaN.

    Rays whose answer does not converge to `tolerance` radians have the fate UNRESOLVED and no crossings.
    """
    barrier = find_barrier(rays)
    motion = PolarMotion.of(rays)
    times, azimuth = motion.plane_crossings(count, tolerance)
    if wanted is not None:
        times[~wanted] = np.nan
    found = places_of_rays(rays, barrier, times, tolerance, beyond)
    if not beyond:
        with np.errstate(invalid="ignore"):
            ended = (found.u <= 0.0) | (found.u * (horizon_radius(rays.spin) * HORIZON_MARGIN) >= 1.0)
        for values in (found.u, found.u_slope, found.unwound):
            values[ended] = np.nan
    reached = np.isfinite(found.u)
    # A ray that never crosses is resolved as it is.
    resolved = found.resolved | np.isnan(times).all(axis=0)
    fate = np.where(comes_from_sky(rays, barrier), Fate.SKY, Fate.SHADOW)
    return Crossings(
        found.u,
        found.u_slope,
        azimuth + found.unwound,
        np.where(reached, times, np.nan),
        np.where(resolved, fate, Fate.UNRESOLVED).astype(np.uint8),
    )


def split_by_energy(spin: float, observer: Observer, directions: Array) -> list[tuple[NDArray[np.intp], Rays, float]]:
    """Return rays along `directions`, shape (n, 3), by the sign of their energy: indices, rays, sign.

    See `rays.negative_energy_rays` for what those of negative energy are.
    """
    rays = rays_from_camera(spin, observer, directions)
    if rays.escapes.all():
        return [(np.arange(len(rays)), rays, 1.0)]
    mirrored = negative_energy_rays(spin, observer, directions)
    positive, negative = np.flatnonzero(rays.escapes), np.flatnonzero(~rays.escapes)
    parts = [(positive, rays.select(positive), 1.0), (negative, mirrored.select(negative), -1.0)]
    return [part for part in parts if len(part[0])]
