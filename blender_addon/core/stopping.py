# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C, and a farm's request to end, as a question that long work without a window asks itself between two steps.

An exception out of a signal could come at any moment, in the middle of starting a thread as well.
"""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any


class Stop:
    """Whether the process has been asked to end."""

    asked = False


@contextlib.contextmanager
def stoppable() -> Iterator[Stop]:
    """Listen for a request to end; the second one ends the process at once, as without this.

    Only the main thread can listen; in any other, as renders in a window have, nothing is ever asked.
    """
    stop = Stop()
    before: dict[signal.Signals, signal.Handlers | Callable[[int, FrameType | None], Any] | int | None] = {}

    def note(_signal: int, _frame: FrameType | None) -> None:
        stop.asked = True
        restore()

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)

    if threading.current_thread() is threading.main_thread():
        before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        restore()
