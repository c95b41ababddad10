# SPDX-License-Identifier: GPL-3.0-or-later
"""How much earlier each place of a pass is seen: light-travel time for every covered pixel, from few rays.

The light that reaches a camera at one moment left on its past light cone, along which dx . p = 0 for neighboring rays:
-E dt + p_r dr + p_phi dphi = 0 (the eikonal; Misner, Thorne & Wheeler 1973, 22.5). So between the pixels of one tile
the time follows from the places and the momenta alone, by the trapezoidal rule, and one ray per tile is enough.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..disk_passes.disk_pass import DiskPass
from ..geodesics.travel_time import time_to_plane
from ..kerr.rays import Rays
from ..numerics.angles import wrap_symmetric
from ..numerics.arrays import Array, Image, Index
from ..numerics.blocks import blocks
from ..sampling.view import View
from ..shot.map_parameters import WarpMapParameters

TILE = 4
"""Pixels along the sides of tiles."""

LARGEST_STEP = 0.1
"""Pixels farther than this from their tile's, in ln r or radians, have rays of their own."""

FARTHEST = 0.3
"""A ray that meets the plane farther than this in ln r from what its pixel shows, as beside a rim, says nothing."""


def delays(passes: Sequence[DiskPass], view: View, parameters: WarpMapParameters) -> tuple[Image, ...]:
    """Return for each pass how much earlier its places are seen, units of M, shape (height, width); 0 where empty.

    Parameters
    ----------
    passes : sequence of DiskPass
    view : View
    parameters : WarpMapParameters
        Of their map.
    """
    return tuple(_delay(one, order, view, parameters.tolerance) for order, one in enumerate(passes))


def _delay(one: DiskPass, order: int, view: View, tolerance: float) -> Image:
    rows, columns = one.radius.shape
    found = np.zeros(rows * columns)
    covered = np.flatnonzero(one.coverage.ravel() > 0.0)
    if not len(covered):
        return found.reshape(rows, columns).astype(np.float32)
    radius, phi = one.radius.ravel().astype(np.float64), one.phi.ravel().astype(np.float64)
    row, column = np.divmod(covered, columns)
    tile = (row // TILE) * (columns // TILE + 1) + column // TILE
    chosen, of_tile = _one_of_each(tile)
    leader = covered[chosen][of_tile]
    step = np.maximum(
        np.abs(np.log(radius[covered] / radius[leader])), np.abs(wrap_symmetric(phi[covered] - phi[leader]))
    )
    alone = step > LARGEST_STEP
    asked = np.union1d(covered[chosen], covered[alone])
    way = np.zeros(rows * columns)
    found[asked], way[asked] = _traced(asked, columns, order, view, radius[asked], tolerance)
    follows, leader = covered[~alone], leader[~alone]
    (b, outward), (b_leader, outward_leader) = (
        _momenta(each, columns, view, radius[each]) for each in (follows, leader)
    )
    late = 0.5 * (b + b_leader) * wrap_symmetric(phi[follows] - phi[leader])
    late += 0.5 * way[leader] * (outward + outward_leader) * (radius[follows] - radius[leader])
    found[follows] = np.where(follows == leader, found[leader], found[leader] - late)
    unknown = ~np.isfinite(found)
    found[unknown] = np.median(found[covered][~unknown[covered]]) if not unknown[covered].all() else 0.0
    found[one.coverage.ravel() == 0.0] = 0.0
    return found.reshape(rows, columns).astype(np.float32)


def _one_of_each(tile: Index) -> tuple[Index, Index]:
    """Return the member in the middle of each tile's list, and for each member the tile's place in that list."""
    order = np.argsort(tile, kind="stable")
    _, first, of_tile, count = np.unique(tile[order], return_index=True, return_inverse=True, return_counts=True)
    places = np.empty_like(order)
    places[order] = of_tile
    return order[first + count // 2], places


def _traced(
    pixels: Index, columns: int, order: int, view: View, radius: Array, tolerance: float
) -> tuple[Array, Array]:
    """Return how much earlier the rays of pixels crossed the plane, and whether they ran outward."""
    found = np.empty((2, len(pixels)))
    for block in blocks(len(pixels)):
        rays = _rays(pixels[block], columns, view)
        time, found[1, block], u = time_to_plane(rays, order, tolerance)
        with np.errstate(invalid="ignore"):
            met = np.abs(np.log(np.abs(u) * radius[block])) < FARTHEST
        found[0, block] = np.where(met, time, np.nan)
    return found[0], found[1]


def _rays(pixels: Index, columns: int, view: View) -> Rays:
    row, column = np.divmod(pixels, columns)
    return view.rays(column + 0.5, row + 0.5)


def _momenta(pixels: Index, columns: int, view: View, radius: Array) -> tuple[Array, Array]:
    """Return b and |p_r| of the light of pixels at radii, for energy 1: Eqs. 3 and 8."""
    b, outward = np.empty((2, len(pixels)))
    for block in blocks(len(pixels)):
        rays, r = _rays(pixels[block], columns, view), radius[block]
        a = rays.spin
        delta = r * (r - 2.0) + a * a
        p = r * r + a * a - a * rays.b
        potential = p * p - delta * (rays.q_plus_b2 + a * (a - 2.0 * rays.b))
        b[block], outward[block] = rays.b, np.sqrt(np.maximum(potential, 0.0)) / delta
    return b, outward
