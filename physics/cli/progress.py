# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress on standard error."""

from __future__ import annotations

import sys

from .console import note


class ProgressPrinter:
    """Prints the fraction done: as a line that is rewritten on a terminal, at every tenth elsewhere."""

    def __init__(self) -> None:
        self._terminal = sys.stderr is not None and sys.stderr.isatty()
        self._shown = -1

    def __call__(self, fraction: float) -> None:
        """Print a fraction, 0 to 1, if it differs visibly from the last."""
        percent = int(100.0 * fraction)
        if not self._terminal:
            percent -= percent % 10
        if percent == self._shown:
            return
        self._shown = percent
        end = "\n" if percent >= 100 or not self._terminal else ""
        start = "\r" if self._terminal else ""
        note(f"{start}tracing {percent} %", end=end)
