# SPDX-License-Identifier: GPL-3.0-or-later
"""Embedded Runge-Kutta integration of many independent rays, each with a step of its own.

The method is a table (`Tableau`); the loop knows no method by name. Another pair is another table.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from .arrays import Array, Mask

# The step controller's usual constants (Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I,
# section II.4): aim a little below the tolerance, never change the step by more than these factors.
SAFETY = 0.9
SHRINK_LIMIT = 0.2
GROWTH_LIMIT = 5.0

# Rays that are done are dropped from the working arrays once they are this share of them: dropping copies
# everything, so doing it after every step would cost more than it saves.
DROP_SHARE = 0.125


@dataclass(frozen=True)
class Tableau:
    """An explicit embedded Runge-Kutta pair for autonomous systems.

    Parameters
    ----------
    name : str
    stages : tuple of tuple of float
        Row i holds the coefficients a_ij, j < i, of the Butcher tableau; the first row is empty.
    weights : tuple of float, shape (n_stages,)
        b_i of the solution that is carried on.
    error_weights : tuple of float, shape (n_stages,)
        b_i - b*_i, the difference to the embedded solution.
    order : int
        Order of the carried solution; the error estimate shrinks as step^error_order.
    error_order : int
    """

    name: str
    stages: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]
    error_weights: tuple[float, ...]
    order: int
    error_order: int


def _embedded(
    name: str,
    stages: tuple[tuple[float, ...], ...],
    weights: tuple[float, ...],
    embedded: tuple[float, ...],
    order: int,
    error_order: int,
) -> Tableau:
    difference = tuple(b - b_star for b, b_star in zip(weights, embedded, strict=True))
    return Tableau(name, stages, weights, difference, order, error_order)


# Cash & Karp 1990, ACM Trans. Math. Softw. 16, 201, orders 5 and 4: the pair of Press et al., Numerical
# Recipes, which the source text uses (its reference [3]).
CASH_KARP = _embedded(
    "Cash-Karp 5(4)",
    stages=(
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (3 / 10, -9 / 10, 6 / 5),
        (-11 / 54, 5 / 2, -70 / 27, 35 / 27),
        (1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096),
    ),
    weights=(37 / 378, 0.0, 250 / 621, 125 / 594, 0.0, 512 / 1771),
    embedded=(2825 / 27648, 0.0, 18575 / 48384, 13525 / 55296, 277 / 14336, 1 / 4),
    order=5,
    error_order=5,
)


class System(Protocol):
    """Equations of motion for a block of rays; states have shape (n_components, n_rays)."""

    state: Array
    """Where the rays are, shape (n_components, n_rays)."""

    def derivative(self, state: Array, out: Array) -> None:
        """Write the derivative of `state` along the backward ray to `out`, both (n_components, n_rays)."""

    def error(self, difference: Array, state: Array, slope: Array) -> Array:
        """Return each ray's error in radians of direction, shape (n_rays,), for a state wrong by `difference`."""

    def first_step(self) -> Array:
        """Return a step to begin with, shape (n_rays,)."""

    def limit(self, state: Array, slope: Array, step: Array) -> Array:
        """Return `step` shortened where it would pass the end of the ray, shape (n_rays,)."""

    def ended(self, state: Array) -> Mask:
        """Return which rays have reached their end, shape (n_rays,)."""

    def failed(self, state: Array) -> Mask:
        """Return which rays the coordinates cannot carry further, shape (n_rays,)."""

    def select(self, rays: Mask) -> Self:
        """Return the system of these rays alone."""

    def sky_direction(self, state: Array) -> Array:
        """Return the unit vectors towards which the rays of `state` leave, shape (n_rays, 3)."""


@dataclass
class Integration:
    """The outcome for each of n rays."""

    state: Array
    """Final states, shape (n_components, n)."""
    reached: Mask
    """Which rays reached their end; the others ran out of steps or of the coordinates' reach."""


def integrate(system: System, tableau: Tableau, tolerance: float, max_steps: int) -> Iterator[Integration | None]:
    """Integrate every ray of `system` to its end, yielding None after each round of steps and at last the result.

    A round is one attempted step of every ray still under way. A step is taken when the error that the
    system makes of the embedded difference is at most `tolerance` (radians); otherwise it is repeated,
    shorter. A ray that takes more than `max_steps` rounds, or that the system declares failed, or whose
    state is no longer finite, is given up: it is reported as not reached.
    """
    count = system.state.shape[1]
    final = np.full_like(system.state, np.nan)
    reached = np.zeros(count, dtype=bool)

    index = np.arange(count)
    state = system.state.copy()
    slope = np.empty_like(state)
    system.derivative(state, slope)
    step = system.first_step()
    exponent = -1.0 / tableau.error_order

    for _ in range(max_steps):
        if not len(index):
            break
        step = system.limit(state, slope, step)
        proposal, difference = attempt(system, tableau, state, slope, step)
        error = system.error(difference, state, slope) / tolerance
        accepted = error <= 1.0  # False for NaN
        factor = SAFETY * np.where(np.isfinite(error), np.maximum(error, 1e-12), np.inf) ** exponent
        step = step * np.clip(factor, SHRINK_LIMIT, GROWTH_LIMIT)
        np.copyto(state, proposal, where=accepted)
        system.derivative(state, slope)

        ended = system.ended(state)
        done = ended | system.failed(state)
        if done.sum() >= DROP_SHARE * len(index):
            final[:, index[done]] = state[:, done]
            reached[index[done]] = ended[done]
            left = ~done
            index, state, slope, step = index[left], state[:, left], slope[:, left], step[left]
            system = system.select(left)
        else:
            step[done] = 0.0  # stay where they are until they are dropped
        yield None

    ended = system.ended(state)
    final[:, index] = state
    reached[index] = ended
    yield Integration(final, reached & np.isfinite(final).all(axis=0))


def attempt(system: System, tableau: Tableau, state: Array, slope: Array, step: Array) -> tuple[Array, Array]:
    """Return the state after one step of `step` and its difference to the embedded solution."""
    stages = np.empty((len(tableau.stages), *state.shape))
    stages[0] = slope
    flat = stages.reshape(len(stages), -1)
    for i, row in enumerate(tableau.stages[1:], start=1):
        inner = (np.array(row) @ flat[:i]).reshape(state.shape)
        inner *= step
        inner += state
        system.derivative(inner, stages[i])
    proposal = (np.array(tableau.weights) @ flat).reshape(state.shape)
    proposal *= step
    proposal += state
    difference = (np.array(tableau.error_weights) @ flat).reshape(state.shape)
    difference *= step
    return proposal, difference
