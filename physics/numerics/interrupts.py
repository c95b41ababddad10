# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C while ``python -m physics`` starts: one sentence, as later, and no traceback through half-imported modules.

`physics/__init__.py` imports this module before all others. It does nothing unless the process was started in that way.
"""

from __future__ import annotations

import os
import signal
import sys

SENTENCE = "canceled: nothing was written"
STATUS = 130


def raise_again() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again, for whom it is caught from now on."""
    if signal.getsignal(signal.SIGINT) is _end:  # then this is the main thread
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(*_unused: object) -> None:
    if sys.stderr is not None:
        os.write(2, f"\n{SENTENCE}\n".encode())
    os._exit(STATUS)


def _is_started() -> bool:
    """Return whether Python is about to run ``-m physics``: it has imported nothing of it yet."""
    given = sys.orig_argv
    return sys.argv[:1] == ["-m"] and "-m" in given and given[given.index("-m") + 1 :][:1] == ["physics"]


if _is_started() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _end)
