# SPDX-License-Identifier: GPL-3.0-or-later
"""The lensed sky of one place, for all cameras there: turned, zoomed, moving at any speed.

Where a ray comes from depends on the hole's spin, on the radius and polar angle of the place, and on the direction in
the local FIDO's sky. The camera's orientation, lens and speed only choose among those directions (Eqs. 4 and 5), and
its azimuth turns the answer. So one table over the FIDO's sky serves every camera at that place.

Its coordinates are chosen for what it holds. Around the shadow's edge the sky winds up without end, by equal angles for
equal factors in the distance delta from the edge. So one coordinate is the position angle psi about the hole's
direction, the other s = ln(delta) + delta, which is the logarithm next to the edge and plain far from it. In (psi, s)
the unit vectors turn at nearly one rate everywhere, and a regular grid serves them with Lagrange's interpolation, among
four points in psi and six in s. Where the differences that it leaves out say that it does not (next to the flat side of
a fast hole's shadow) the table gives no answer, and rays are traced as without it.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geodesics.tracer import Fate, trace_block
from ..kerr.critical_curve import all_around, around_hole, edge_angles, position_angles
from ..kerr.observer import Observer
from ..kerr.rays import rays_from_triad
from ..numerics.angles import circle_steps
from ..numerics.arrays import Array
from ..numerics.blocks import BLOCK_SIZE
from ..numerics.interpolation import CUBIC_ERROR, CUBIC_POINTS, lagrange_weights
from ..numerics.sphere import by_component
from ..shot.map_parameters import WarpMapParameters

# Position angles of the grid, and the step of s.
ANGLES = 512
STEP = 0.06
# Closest to the edge, as a share of the edge's largest distance from the hole's direction.
CLOSEST = 1e-3

# Points of the interpolation, counted from the one before the place. Half way between, four leave out 3/128 of the
# fourth difference, six 5/1024 of the sixth.
ALONG = (-2, -1, 0, 1, 2, 3)
ALONG_ERROR = 5.0 / 1024.0
# Share of the tolerance that each of the two coordinates, and the edge's place, may use up.
ERROR_SHARE = 0.1

# Digits of radius and polar angle that tell places apart: next to the edge at `CLOSEST` the sky moves by 1/CLOSEST of
# what the edge moves, which must be well below the error.
PLACE_DIGITS = 11

# How well the edge's place is found, radians: as well as double precision has it.
EDGE_ERROR = math.pi * 2.0**-53
NEWTON_ROUNDS = 60

Place = tuple[float, float, float, float, float, str]
"""Spin, r, theta, and the settings of tracing: all that a table depends on."""


def sky_table_steps(parameters: WarpMapParameters) -> Generator[float, None, SkyTable]:
    """Make the table of a map's place, step by step: yields the fraction done after each block of rays, returns it.

    The place is the map's observer's; the errors allowed to tracing and interpolation are the map's own.
    """
    place = spin, r, theta, error, tolerance, method = _place(parameters)
    fido = Observer.fido(r, theta, 0.0)
    aside, up = all_around(ANGLES)
    edge = edge_angles(spin, fido, aside, up, EDGE_ERROR)
    closest = CLOSEST * float(edge.max())
    first = math.log(closest) + closest
    count = math.ceil((math.log(math.pi) + math.pi - first) / STEP) + len(ALONG)
    delta = distances(first + STEP * (np.arange(count) + ALONG[0]))
    # Beyond the opposite point, where delta + edge passes pi, the same formula goes on down the other side.
    looking = around_hole(edge[:, None] + delta, aside[:, None], up[:, None]).reshape(-1, 3)
    directions = np.empty((3, len(looking)))
    for start in range(0, len(looking), BLOCK_SIZE):
        block = slice(start, start + BLOCK_SIZE)
        fate, found = trace_block(rays_from_triad(spin, fido, looking[block]), tolerance, method)
        directions[:, block] = np.where(fate == Fate.SKY, found.T, np.nan)
        yield min(block.stop, len(looking)) / len(looking)
    values = directions.reshape(3, ANGLES, count)
    served = _served(values, edge, delta, error)
    return SkyTable(place, first, edge, np.where(served, values, np.nan))


class SkyTable:
    """The directions that light comes from, over the sky of the FIDO at one radius and polar angle."""

    def __init__(self, place: Place, first: float, edge: Array, values: Array) -> None:
        """`first`: s of the first place served; `edge`, shape (angles,); `values`, shape (3, angles, count)."""
        self._place = place
        self._first = first
        around = np.arange(CUBIC_POINTS[0], ANGLES + CUBIC_POINTS[-1]) % ANGLES  # psi is a circle
        self._edge = edge[around]
        self._values = [np.ascontiguousarray(each[around]).ravel() for each in values]
        self._count = values.shape[2]

    def serves(self, parameters: WarpMapParameters) -> bool:
        """Return whether the table was made for the place, and for the errors, of another map."""
        return self._place == _place(parameters)

    def directions(self, light: Array, phi: float) -> Array:
        """Return the unit vectors towards the origin of light, in the hole's frame, shape (n, 3).

        `light`, shape (3, n), is where it runs in the FIDO's frame, on (r-hat, theta-hat, phi-hat), at azimuth `phi`.
        NaN where the table has no answer: in the shadow, next to its edge, and where interpolation is not good enough.
        """
        away, angle = position_angles(light)
        row, part = circle_steps(angle, ANGLES)
        across = lagrange_weights(part, CUBIC_POINTS)
        edge = sum(weight * self._edge.take(row + i) for i, weight in enumerate(across))
        delta = away - edge
        with np.errstate(invalid="ignore", divide="ignore"):
            place = (np.log(delta) + delta - self._first) / STEP  # NaN in the shadow
        inside = place >= 0.0
        place = np.where(inside, place, 0.0)
        column = np.minimum(place.astype(np.intp), self._count - len(ALONG))
        along = lagrange_weights(place - column, ALONG)
        result = np.zeros((3, len(away)))
        for i, weight in enumerate(across):
            first = (row + i) * self._count + column
            for j, other in enumerate(along):
                both, index = weight * other, first + j
                for component, values in zip(result, self._values, strict=True):
                    component += both * values.take(index)
        result[:, ~inside] = np.nan
        x, y, z = result
        return by_component(x * math.cos(phi) - y * math.sin(phi), x * math.sin(phi) + y * math.cos(phi), z)


def same_place(one: WarpMapParameters, other: WarpMapParameters) -> bool:
    """Return whether one table would serve two maps."""
    return _place(one) == _place(other)


def _place(parameters: WarpMapParameters) -> Place:
    """Return all that a table depends on; the place is rounded, so that a camera's azimuth does not matter."""
    observer = parameters.observer()
    return (
        parameters.spin,
        float(f"{observer.r:.{PLACE_DIGITS}g}"),
        round(observer.theta, PLACE_DIGITS),
        parameters.interpolation,
        parameters.tolerance,
        parameters.method,
    )


def distances(s: NDArray[np.floating[Any]]) -> Array:
    """Return delta with ln(delta) + delta = s, by Newton's method in ln(delta), which comes down from above."""
    logarithm: Array = s.astype(np.float64)
    for _ in range(NEWTON_ROUNDS):
        delta = np.exp(logarithm)
        logarithm -= (logarithm + delta - s) / (1.0 + delta)
    return np.exp(logarithm)


def _served(values: Array, edge: Array, delta: Array, error: float) -> NDArray[np.bool_]:
    """Return the nodes, shape (angles, count), around which interpolation keeps to the error."""
    angles, count = values.shape[1:]
    around = np.arange(-2, angles + 2) % angles
    bends = np.abs(np.diff(values[:, around], 4, axis=1)).max(axis=0)
    good: NDArray[np.bool_] = CUBIC_ERROR * bends < ERROR_SHARE * error  # NaN: False
    rises = np.abs(np.diff(values, 6, axis=2)).max(axis=0)
    smooth = ALONG_ERROR * rises < ERROR_SHARE * error
    good &= smooth[:, np.clip(np.arange(count) - 3, 0, smooth.shape[1] - 1)]
    # An error of the edge's place is one of delta, by which the sky turns about twice as fast as by ln(delta) at most.
    displaced = CUBIC_ERROR * np.abs(np.diff(edge[around], 4))
    good &= 2.0 * displaced[:, None] < ERROR_SHARE * error * delta
    return good
