# SPDX-License-Identifier: GPL-3.0-or-later
"""What a map knows of its disk at any place of the picture: by rays, and by tables next to the shadow."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geodesics.radial_path import winding
from ..geodesics.tracer import DEFAULT_METHOD, Fate
from ..kerr.critical_curve import position_angles
from ..kerr.metric import isco_radius
from ..kerr.orbiting_matter import circular_redshift, redshift_factor
from ..numerics.angles import wrap
from ..numerics.arrays import Array, Index, Mask
from ..numerics.blocks import BLOCK_SIZE
from ..sampling.view import View
from ..shot.map_parameters import WarpMapParameters
from .ring_grid import Needs
from .ring_table import RingTable
from .ring_tracing import REACH, ring_tables

Matter = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]
"""Radius, azimuth in [0, 2 pi) and g."""

# Error of place on the disk, relative, for each radian of error of direction that is allowed.
PLACE_ERROR = 40.0
# Rays need be better than that by this only.
TRACING_SHARE = 0.1
# Where the image is crowded, this share of the way from pixel to pixel will do.
PIXEL_ERROR = 0.03

# Tables are worthwhile for a shadow of at least this many pixels' radius. From afar that is about this in units of M.
LEAST_SHADOW = 8.0
SHADOW = math.sqrt(27.0)
# The largest impact parameter of a spherical photon orbit, and what tables reach to, as multiples of the shadow's
# radius.
LARGEST_SHADOW, AROUND_SHADOW = 7.0, 1.0 + REACH[1]
# Places along each side of the picture that are looked at for the shadow.
LOOKS = 16
# Outside of this radius there are no rays of negative energy, at any latitude.
ERGOSPHERE = 2.0

# So far off the disk, in units of 1 / r at its outer and inner rim, it does not matter any more how far; and in 1 / M
# for large disks, whose outer rim is next to infinity.
LOWEST_U, HIGHEST_U = -1000.0, 1000.0
FARTHEST_U = -0.5

# Channels of what is interpolated: 1 / r, the unwound azimuth, energy and angular momentum of the light for a camera
# energy of 1, and where matter falls du / dlambda on the same scale.
U, PHI, ENERGY, MOMENTUM, SLOPE = range(5)

# A disk that reaches inside the ISCO by less than this share of its radius does not.
AT_ISCO = 1e-9


class DiskSamples:
    """Samples of the crossings of one map's rays, and the redshift of matter there."""

    def __init__(self, parameters: WarpMapParameters, view: View) -> None:
        assert parameters.disk is not None
        self._parameters, self._view, self._disk = parameters, view, parameters.disk
        self._inner, self._outer = self._disk.radii(parameters.spin)
        isco = isco_radius(parameters.spin, prograde=not self._disk.retrograde)
        self._falls = self._inner < isco * (1.0 - AT_ISCO)
        self._tolerance = max(parameters.tolerance, TRACING_SHARE * PLACE_ERROR * parameters.interpolation)
        self._bounds = min(LOWEST_U / self._outer, FARTHEST_U), HIGHEST_U / self._inner
        self._tables: dict[int, RingTable] = {}
        self.channels = SLOPE + 1 if self._falls else SLOPE
        """How many channels there are: U to MOMENTUM, and SLOPE where matter falls."""
        self.rays = 0
        """How many rays were traced so far."""

    def at(self, x: Array, y: Array, wanted: Mask, smooth: bool = True) -> tuple[Array, Mask]:
        """Return the channels, shape (crossings, channels, n), and which rays were given up, (n,).

        Only what is `wanted`, shape (crossings, n), means anything; the others' u is NaN.

        u is finite everywhere: rays that never cross count as far beyond their end, and where it need not be `smooth`,
        so does all that is known to be beyond an image around the shadow.
        """
        if not self._tables:
            return self._trace_rays(x, y, wanted)
        values, lost = np.full((self._disk.crossings, self.channels, len(x)), np.nan), np.zeros(len(x), dtype=bool)
        asked = np.flatnonzero(wanted[list(self._tables)].any(axis=0))
        light, energy, momentum = self._view.light_and_momenta(x[asked], y[asked])
        away, angle = position_angles(light)
        left = wanted.copy()
        for order in self._tables:
            here = np.flatnonzero(wanted[order, asked])
            u, *others = self._from_table(order, (energy[here], momentum[here]), away[here], angle[here])
            known = np.flatnonzero(np.isfinite(u) if smooth else ~np.isnan(u))
            here = asked[here[known]]
            left[order, here] = False
            _put(values[order], here, (self._clipped(u), *others), known)
        traced = np.flatnonzero(left.any(axis=0))
        part, lost[traced] = self._trace_rays(x[traced], y[traced], left[:, traced])
        for order, mine in enumerate(left[:, traced]):
            known = np.flatnonzero(mine)
            _put(values[order], traced[known], part[order], known)
        return values, lost

    def _clipped(self, u: Array) -> Array:
        clipped: Array = np.clip(u, *self._bounds)
        return clipped

    def _trace_rays(self, x: Array, y: Array, wanted: Mask) -> tuple[Array, Mask]:
        """Do what `at` does, a ray for each place."""
        values = np.empty((self._disk.crossings, self.channels, len(x)))
        lost = np.zeros(len(x), dtype=bool)
        for start in range(0, len(x), BLOCK_SIZE):
            block = slice(start, start + BLOCK_SIZE)
            found, light = self._view.crossings(
                x[block],
                y[block],
                self._disk.crossings,
                self._tolerance,
                self._parameters.method,
                wanted[:, block],
            )
            low, high = self._bounds
            nowhere = np.where(found.fate == Fate.SHADOW, high, low)
            u = self._clipped(np.where(np.isnan(found.u), nowhere, found.u))
            values[:, U, block] = np.where(wanted[:, block], u, np.nan)
            values[:, PHI, block] = np.nan_to_num(found.unwound)
            values[:, ENERGY, block] = light.energy / light.camera_energy
            values[:, MOMENTUM, block] = light.b / light.camera_energy
            if self._falls:
                values[:, SLOPE, block] = np.nan_to_num(found.u_slope / light.camera_energy)
            lost[block] = found.fate == Fate.UNRESOLVED
        self.rays += len(x)
        return values, lost

    def make_tables(self) -> None:
        """Make tables of the later images, where the shadow is large enough in the picture for them."""
        orders = range(1, self._disk.crossings)
        observer = self._parameters.observer()
        pixel = self._parameters.pixel_angle
        stepping = self._parameters.method != DEFAULT_METHOD
        if not orders or stepping or observer.r < ERGOSPHERE or LEAST_SHADOW * pixel * observer.r > SHADOW:
            return
        if not self._sees_shadow(observer.r):
            return
        needs = Needs(
            self._inner, self._outer, self._tolerance, pixel, PIXEL_ERROR, PLACE_ERROR * self._parameters.interpolation
        )
        self._tables, rays = ring_tables(self._parameters.spin, observer, orders, needs, self._view.edge_about)
        self.rays += rays

    def _sees_shadow(self, r: float) -> bool:
        """Return whether the surroundings of the shadow may be in the picture."""
        width, height = self._parameters.map_size
        x, y = np.meshgrid(np.linspace(0.0, width, LOOKS), np.linspace(0.0, height, LOOKS))
        away = position_angles(self._view.light(x.ravel(), y.ravel()))[0].reshape(x.shape)
        step = max(float(np.abs(np.diff(away, axis=axis)).max()) for axis in (0, 1))
        return float(away.min()) < step + AROUND_SHADOW * math.asin(min(1.0, LARGEST_SHADOW / r))

    @property
    def has_tables(self) -> bool:
        """Whether there are tables: the shadow is no smaller than one of the smallest tiles."""
        return bool(self._tables)

    @property
    def rings(self) -> dict[int, RingTable]:
        """The tables of those images that are bands around the shadow, by order, counted from 0."""
        return {order: table for order, table in self._tables.items() if table.confined}

    def at_ring(self, order: int, light: tuple[Array, Array], away: Array, angle: Array) -> Matter:
        """Return the matter at `position_angles` from the table of an image, for light of this energy and angular
        momentum; NaN where it has no answer.

        There may be several angles from the hole's direction for each position angle, shape (n,): `away`, and what is
        returned, is of shape (k, n).
        """
        energy, momentum, angle = (np.broadcast_to(each, away.shape).ravel() for each in (*light, angle))
        u, *others = self._from_table(order, (energy, momentum), away.ravel(), angle)
        u = np.clip(u, 1.0 / self._outer, 1.0 / self._inner)
        return self.matter(np.stack([u, *others]).reshape(self.channels, *away.shape))

    def _from_table(self, order: int, light: tuple[Array, Array], away: Array, angle: Array) -> list[Array]:
        """Return the channels at position angles where the light is about this, from the table of an image."""
        u, azimuth, *slope = self._tables[order].places(away, angle, 3 if self._falls else 2)
        return [u, azimuth, *light, *(each * light[0] for each in slope)]

    def matter(self, values: NDArray[Any]) -> Matter:
        """Return radius, azimuth in [0, 2 pi) and g of places on the disk, from channels of shape (channels, ...)."""
        azimuth, g = self.azimuth_and_g(values)
        return 1.0 / values[U], wrap(azimuth), g

    def azimuth_and_g(self, values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return azimuth, unwrapped, and g of places on the disk, from channels of shape (channels, ...)."""
        u, spin, retrograde = values[U], self._parameters.spin, self._disk.retrograde
        phi = values[PHI] + winding(spin, u)
        if self._falls:
            radius = 1.0 / u
            # Moved to a rim, channels no longer fit together: no light of this energy and momentum has more (Eq. 3 with
            # q = 0).
            energy, b = values[ENERGY], values[MOMENTUM]
            b_minus_ae, p = b - spin * energy, energy * (radius * radius + spin * spin) - spin * b
            most = np.sqrt(np.maximum(p * p - (radius * (radius - 2.0) + spin * spin) * b_minus_ae * b_minus_ae, 0.0))
            radial = np.clip(values[SLOPE] / (u * u), -most, most)
            g = redshift_factor(spin, radius, values[MOMENTUM], values[ENERGY], radial, retrograde).astype(u.dtype)
        else:
            g = circular_redshift(spin, u, values[MOMENTUM], values[ENERGY], retrograde)
        return phi, g


def _put(values: Array, here: Index, found: Iterable[Array], known: Index) -> None:
    """Write those of what was found, by channel, that are known to their places: row by row, which is quicker."""
    for channel, new in zip(values, found, strict=True):
        channel[here] = new[known]
