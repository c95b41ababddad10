# SPDX-License-Identifier: GPL-3.0-or-later
"""The lensed sky of one place as a table: where the light comes from that a FIDO there sees.

Columns are position angles psi about the hole's direction. Rows are equal steps of s = ln(delta) + delta, with delta
the distance from the shadow's edge, as in `maps.world_map`; but in each column they end at the point opposite to the
hole. So the cells cover the sky outside of the shadow exactly once, and near the edge, where the sky winds up without
end, all orders of images have cells of about one size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..geodesics.tracer import Fate, trace_block
from ..kerr.critical_curve import around_hole, edge_angles
from ..kerr.observer import Observer
from ..kerr.rays import rays_from_triad
from ..maps.world_map import distances
from ..numerics.arrays import Array, Mask
from ..numerics.blocks import blocks
from ..numerics.interpolation import lagrange_weights
from ..numerics.sphere import cos_sin

ROW_HEIGHT = 2.4
"""Step of s between two rows, in columns: makes square cells where the sky is least distorted."""

TOLERANCE = 1e-7
"""Error of direction of the table's rays, radians."""
EDGE_ERROR = 1e-12

# How near to the edge the table begins, as a share of its distance from the hole's direction: images of orders 0 to 2
# lie farther out. Without spin each order more is nearer by exp(pi) (Luminet 1979, Astron. Astrophys. 75, 228).
THIRD_ORDER = 1e-3
MOST_FURTHER_ORDERS = 3
STEPS_PER_ORDER = 4
"""Tables begin at whole multiples of this part of an order, so that cameras can share them."""
# Radians; single rays know the edge no better.
NEAREST = 1e-9

# Rows beyond both ends of the table, for cubic interpolation.
MARGIN = 1
POINTS = (-1, 0, 1, 2)


@dataclass(frozen=True)
class LocalSky:
    """The table of one place. Columns and rows count from 0; positions between them are real numbers.

    The camera's azimuth is 0: at another one all directions are turned about the spin axis.
    """

    fido: Observer
    spin: float
    edge: Array
    """Angle between the hole's direction and the shadow's edge, shape (columns,), radians."""
    lowest: float
    """s of row 0."""
    rows: int
    directions: Array
    """Unit vectors toward the origin of the light, shape (rows + 2, columns + 3, 3), hole's frame; NaN where unknown.

    A row beyond each end comes along, and the last column before and the first two after the others.
    """

    @cached_property
    def nodes(self) -> Array:
        """The unit vectors of the rows and columns themselves, shape (rows, columns + 1, 3); the last column is the
        first."""
        return self.directions[MARGIN:-MARGIN, 1:-1]

    @cached_property
    def planes(self) -> Array:
        """The x, y and z of `directions`, shape (3, (rows + 2) (columns + 3)): faster to take numbers from."""
        return np.ascontiguousarray(np.moveaxis(self.directions, -1, 0)).reshape(3, -1)

    def is_for(self, smallest: float) -> bool:
        """Return whether the table begins where one does that is made with `smallest`."""
        nearest = beginning(float(self.edge.max()), smallest)
        return self.lowest == math.log(nearest) + nearest

    def edge_at(self, x: Array) -> Array:
        """Return the edge's angle at columns x, shape (n,)."""
        column = np.floor(x)
        weights = lagrange_weights(x - column, POINTS)
        column = column.astype(np.intp)
        total = np.zeros_like(x)
        for weight, point in zip(weights, POINTS, strict=True):
            total += weight * self.edge[(column + point) % len(self.edge)]
        return total

    def angles(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Return where places of the table are in the FIDO's sky.

        Parameters
        ----------
        x, y : ndarray, shape (n,)
            Columns and rows.

        Returns
        -------
        psi, away : ndarray, shape (n,)
            Position angle about the hole's direction, and the angle from there, radians; for `around_hole`.
        area : ndarray, shape (n,)
            Solid angle of one column times one row there, steradians.
        """
        edge = self.edge_at(x)
        highest = math.pi - edge
        rise = (np.log(highest) + highest - self.lowest) / (self.rows - 1)
        delta = distances(self.lowest + y * rise)
        psi = x * (2.0 * math.pi / len(self.edge))
        away = edge + delta
        area = np.abs(np.sin(away)) * (2.0 * math.pi / len(self.edge)) * rise * delta / (1.0 + delta)
        return psi, away, area

    def looking(self, x: Array, y: Array) -> Array:
        """Return the unit vectors along which the FIDO looks at places of the table, shape (n, 3), on its triad."""
        psi, away, _area = self.angles(x, y)
        return around_hole(away, *cos_sin(psi))

    def trace(self, looking: Array) -> tuple[Array, Mask]:
        """Return where light comes from that the FIDO sees along `looking`, shape (n, 3), and where that is known."""
        return _trace(self.spin, self.fido, looking)


def beginning(edge: float, smallest: float) -> float:
    """Return how near to the shadow's edge the table begins.

    Parameters
    ----------
    edge : float
        The edge's largest angle from the hole's direction, radians.
    smallest : float
        Angle within which images need not be told from the edge, radians, > 0.

    Returns
    -------
    float
        Radians. It changes with `smallest` by quarters of an order of images, so that cameras can share tables.
    """
    nearest = THIRD_ORDER * min(edge, math.pi - edge)
    steps = math.ceil(STEPS_PER_ORDER * math.log(max(nearest / smallest, 1.0)) / math.pi)
    orders = steps / STEPS_PER_ORDER
    return max(nearest * math.exp(-math.pi * min(orders, MOST_FURTHER_ORDERS)), NEAREST)


def local_sky(spin: float, r: float, theta: float, smallest: float, columns: int) -> LocalSky:
    """Trace the table of a place.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    r, theta : float
        The place; radius in units of M, outside the horizon, and polar angle in radians.
    smallest : float
        How far from the shadow's edge images shall be found, radians, > 0; see `beginning`.
    columns : int
        Position angles in the table.

    Returns
    -------
    LocalSky

    Raises
    ------
    BlackHoleError
        If the place is inside the horizon or the spin out of range.
    """
    fido = Observer.fido(r, theta, 0.0)
    step = 2.0 * math.pi / columns
    aside, up = cos_sin(np.arange(columns, dtype=np.float64) * step)
    edge = edge_angles(spin, fido, aside, up, EDGE_ERROR)
    closest = beginning(float(edge.max()), smallest)
    highest = math.pi - edge
    lowest = math.log(closest) + closest
    ends = np.log(highest) + highest
    rows = 1 + math.ceil((float(ends.max()) - lowest) / (ROW_HEIGHT * step))
    steps = np.arange(-MARGIN, rows + MARGIN)[:, None] / (rows - 1)
    away = edge + distances(lowest + steps * (ends - lowest))
    directions, known = _trace(spin, fido, around_hole(away, aside, up).reshape(-1, 3))
    directions[~known] = np.nan
    directions = directions.reshape(len(away), columns, 3)
    # All columns meet at the opposite point.
    directions[rows - 1 + MARGIN] = directions[rows - 1 + MARGIN, 0]
    around = np.concatenate([directions[:, -1:], directions, directions[:, :2]], axis=1)
    return LocalSky(fido, spin, edge, lowest, rows, around)


def _trace(spin: float, fido: Observer, looking: Array) -> tuple[Array, Mask]:
    directions = np.empty_like(looking)
    known = np.empty(len(looking), bool)
    for block in blocks(len(looking)):
        rays = rays_from_triad(spin, fido, looking[block])
        fate, directions[block] = trace_block(rays, TOLERANCE, "gauss-legendre")
        known[block] = fate == Fate.SKY
    return directions, known
