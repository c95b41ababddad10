# SPDX-License-Identifier: GPL-3.0-or-later
"""The shadow's outline as an observer sees it, without a map: the critical curve in that observer's sky."""

from __future__ import annotations

import math

import numpy as np

from ..numerics.arrays import Array
from ..numerics.checks import whole
from ..numerics.errors import BlackHoleError
from ..numerics.sphere import spherical_triad
from .critical_curve import all_around, around_hole, edge_angles
from .metric import check_spin
from .observer import Observer

FEWEST_POINTS = 3
# How well the outline is known, as a share of about its own angle.
SHARE = 1e-4


def as_seen(observer: Observer, looking: Array) -> Array:
    """Return where a moving observer sees what the FIDO at its place sees in given directions: aberration.

    Eq. 5 turned round: the component along the motion becomes (cos + beta) / (1 + beta cos).

    Parameters
    ----------
    observer : Observer
    looking : ndarray, shape (n, 3)
        Unit vectors on (r-hat, theta-hat, phi-hat).

    Returns
    -------
    ndarray, shape (n, 3)
        Unit vectors on the same axes.
    """
    beta, motion = observer.beta, np.array(observer.direction)
    along = looking @ motion
    across = looking - along[:, None] * motion
    seen = math.sqrt(1.0 - beta * beta) * across + (along + beta)[:, None] * motion
    result: Array = seen / (1.0 + beta * along)[:, None]
    return result


def shadow_outline(spin: float, observer: Observer, count: int = 128) -> Array:
    """Return directions along the edge of the shadow in an observer's sky, in order.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    observer : Observer
        Outside the horizon.
    count : int
        Number of directions, 3 at least, at equal steps of position angle for the FIDO at the observer's place.

    Returns
    -------
    ndarray, shape (count, 3)
        Unit vectors along which the observer looks, Cartesian in the hole's frame (z along the spin axis), known to
        1e-4 of the shadow's angle.

    Raises
    ------
    BlackHoleError
        At or inside the horizon, or for values out of range.
    """
    spin, count = check_spin(spin), whole(count, "the number of points")
    if count < FEWEST_POINTS:
        raise BlackHoleError(f"An outline takes {FEWEST_POINTS} points at least, not {count}.", code="settings.range")
    aside, up = all_around(count)
    fido = Observer.fido(observer.r, observer.theta, observer.phi)
    away = edge_angles(spin, fido, aside, up, SHARE / max(observer.r, 1.0))
    directions: Array = as_seen(observer, around_hole(away, aside, up)) @ spherical_triad(observer.theta, observer.phi)
    return directions
