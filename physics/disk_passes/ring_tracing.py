# SPDX-License-Identifier: GPL-3.0-or-later
"""Making the tables of a disk's later images (`ring_table`) from rays around the shadow's edge in a FIDO's sky.

A few scouts tell where the images are, then each gets its grid. A table that leaves too much of its image open gets a
grid twice as fine: by rays in the cells that were not good enough, by interpolation elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..geodesics.crossings import cross_plane
from ..kerr.critical_curve import all_around, around_hole, edge_angles
from ..kerr.observer import Observer
from ..kerr.rays import rays_from_triad
from ..numerics.arrays import Array, Index
from .ring_grid import SCALE_ANGLES, SHARES, Draft, Needs, between
from .ring_table import RingTable

# How far from the edge the tables reach, inside and outside, as shares of its distance from the hole's direction.
REACH = (0.7, 1.5)

# Position angles of the grid, and of the finer one that is used where the first does not answer for this share of the
# disk.
ANGLES, MOST_ANGLES = 128, 256
ENOUGH = 0.97

# Error of the edge, in pixels, as long as the last image is the third; each that follows is thinner by up to e^pi.
EDGE_ERROR = 1e-3
THIRD = 2
# How far from where it is known to be about it is looked for first, in pixels.
EDGE_REACH = 0.05


def ring_tables(
    spin: float, observer: Observer, orders: Sequence[int], needs: Needs, edge_about: Array
) -> tuple[dict[int, RingTable], int]:
    """Return tables of some crossings, counted from 0, by their order, and how many rays these took; for `edge_about`
    see `View`.

    The observer's motion does not matter: the tables are of its FIDO's sky. It must be outside the ergosphere, where
    all rays have positive energy.
    """
    fido = Observer.fido(observer.r, observer.theta, observer.phi)
    sky = _Sky(spin, fido, max(orders) + 1, needs, edge_about)
    few = sky.evenly(SCALE_ANGLES)
    edge = sky.edge[few]
    distances = np.concatenate([-REACH[0] * SHARES, REACH[1] * SHARES[::-1]]) * edge[:, None]
    (scouted,) = sky.cross([(edge[:, None] + distances, few, list(orders))])
    drafts = {order: Draft.of(u, distances, edge, needs) for order, u in zip(orders, scouted[0], strict=True)}
    index = sky.evenly(ANGLES)
    grids = {order: draft.grid(sky.edge[index]) for order, draft in drafts.items()}
    found = sky.cross([(grid.away, index, [order]) for order, grid in grids.items()])
    traced = {order: new[:, 0] for order, new in zip(orders, found, strict=True)}
    tables = {order: RingTable(grid, traced[order], needs) for order, grid in grids.items()}
    left = {order: table.left() for order, table in tables.items() if table.answered < ENOUGH}
    if not left:
        return tables, sky.rays
    fine = {order: drafts[order].grid(sky.edge, places.shape[1]) for order, places in left.items()}
    asked = [(fine[order].away[places][:, None], np.nonzero(places)[0], [order]) for order, places in left.items()]
    for (order, places), new in zip(left.items(), sky.cross(asked), strict=True):
        values = between(traced[order])
        values[:, places] = new[:, 0, :, 0]
        tables[order] = RingTable(fine[order], values, needs)
    return tables, sky.rays


class _Sky:
    """A FIDO's sky around the shadow: where its edge is, and where rays along it cross the plane."""

    def __init__(self, spin: float, fido: Observer, count: int, needs: Needs, edge_about: Array) -> None:
        """`count`: how many crossings of a ray are of interest."""
        self._spin, self._fido, self._needs, self._count = spin, fido, needs, count
        self._aside, self._up = all_around(MOST_ANGLES)
        error = EDGE_ERROR * needs.pixel * math.exp(-math.pi * max(0, count - 1 - THIRD))
        place = np.arange(MOST_ANGLES) * (len(edge_about) / MOST_ANGLES)
        near = np.interp(place, np.arange(len(edge_about)), edge_about, period=len(edge_about))
        self.edge = edge_angles(spin, fido, self._aside, self._up, error, (near, EDGE_REACH * needs.pixel))
        """How far the edge is from the hole's direction at the most position angles there are."""
        self.rays = 0
        """How many rays were traced so far."""

    def evenly(self, angles: int) -> Index:
        """Return the numbers of so many of these position angles at equal steps."""
        return np.arange(0, MOST_ANGLES, MOST_ANGLES // angles)

    def cross(self, asked: list[tuple[Array, Index, list[int]]]) -> list[Array]:
        """Return u, unwound azimuth and du / dlambda, shape (3, orders, rows, distances), for each that is asked for.

        Asked for are angles from the hole's direction, shape (rows, distances); the numbers of the rows' position
        angles; and the orders of the crossings.
        """
        looking, wanted = [], []
        for away, index, orders in asked:
            looking.append(around_hole(away, self._aside[index, None], self._up[index, None]).reshape(-1, 3))
            here = np.zeros((self._count, away.size), dtype=bool)
            here[orders] = True
            wanted.append(here)
        self.rays += sum(away.size for away, *_ in asked)
        light, every = rays_from_triad(self._spin, self._fido, np.concatenate(looking)), np.concatenate(wanted, axis=1)
        crossings = cross_plane(light, self._count, self._needs.tolerance, beyond=True, wanted=every)
        values = np.stack([crossings.u, crossings.unwound, crossings.u_slope])
        ends = np.cumsum([away.size for away, *_ in asked])
        parts = np.split(values, ends[:-1], axis=2)
        return [
            part[:, orders].reshape(3, len(orders), *away.shape)
            for part, (away, _, orders) in zip(parts, asked, strict=True)
        ]
