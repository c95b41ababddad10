# SPDX-License-Identifier: GPL-3.0-or-later
"""One piece of work at a time behind the caller's back: a map is written while the next one is traced.

Compression and the disk leave Python's interpreter free, so a thread is enough, and no process has to be started from
within Blender. The thread touches nothing but the arrays and the path that it is given, and whoever starts it waits for
it before going on with other things, whatever happens: use `with`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import TracebackType


class Background:
    """Runs callables one after another in a thread of its own."""

    def __init__(self) -> None:
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None

    def start(self, work: Callable[[], object]) -> None:
        """Start a piece of work once the one before is done; what that raised is raised here, instead of starting."""
        self.wait()
        self._thread = threading.Thread(target=self._run, args=(work,), name="umbra background")
        self._thread.start()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for the work to end, at most so long; return whether it has. What it raised is raised here."""
        if self._thread is not None:
            self._thread.join(seconds)
            if self._thread.is_alive():
                return False
            self._thread = None
        error, self._error = self._error, None
        if error is not None:
            raise error
        return True

    def _run(self, work: Callable[[], object]) -> None:
        try:
            work()
        except BaseException as error:  # noqa: BLE001  (raised again by whoever waits)
            self._error = error

    def __enter__(self) -> Background:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Wait; what the work raised is raised here, unless another exception is on its way."""
        if error is None:
            self.wait()
        elif self._thread is not None:
            self._thread.join()
