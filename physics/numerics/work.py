# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work as a generator: it yields the fraction done after each step, and returns its result."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TypeVar

from .errors import Cancelled

Result = TypeVar("Result")

Progress = Callable[[float], object]
"""Called with the fraction done, 0 to 1."""
Cancel = Callable[[], bool]
"""Returns whether to end the work."""


def drain(
    steps: Generator[float, None, Result], progress: Progress | None = None, cancel: Cancel | None = None
) -> Result:
    """Run a generator of fractions to its end and return its result.

    Parameters
    ----------
    steps : generator
        Yields the fraction done, 0 to 1, and returns the result.
    progress : callable, optional
        Called with each fraction.
    cancel : callable, optional
        Called before each step. If it returns true, the generator is closed.

    Raises
    ------
    Cancelled
        If `cancel` returned true.
    """
    while True:
        if cancel is not None and cancel():
            steps.close()
            raise Cancelled("The work was canceled.")
        try:
            fraction = next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        if progress is not None:
            progress(fraction)


def share_of(steps: Generator[float, None, Result], low: float, high: float) -> Generator[float, None, Result]:
    """Run a generator of fractions as a part of longer work, which it takes from `low` to `high`.

    Parameters
    ----------
    steps : generator
        Yields the fraction done, 0 to 1, and returns the result.
    low, high : float
        Fractions of the longer work.
    """
    while True:
        try:
            fraction = next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        yield low + (high - low) * fraction
