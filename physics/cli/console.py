# SPDX-License-Identifier: GPL-3.0-or-later
"""What commands say, on streams that may be closed, full, or unable to show every name."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator

from ..numerics.errors import BlackHoleError


def allow_any_name() -> None:
    """Let the standard streams show names that they cannot encode, by escapes."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)  # none if the stream is closed or replaced
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")


def say(text: str = "") -> None:
    """Print results on standard output, at once.

    Raises
    ------
    BlackHoleError
        If it is closed, or its device is full.
    """
    with _written():
        print(text, flush=True)


def note(text: str, end: str = "\n") -> None:
    """Print something on standard error, if anything can be printed there."""
    if sys.stderr is not None:
        with contextlib.suppress(OSError, ValueError):
            print(text, end=end, file=sys.stderr, flush=True)


@contextlib.contextmanager
def _written() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        _forget_output()
        reason = (error.strerror or str(error)).lower()
        raise BlackHoleError(
            f"The standard output cannot be written: {reason}; let it lead to a file or a program that takes it.",
            code="command.standard-output",
        ) from error


def _forget_output() -> None:
    """Lead standard output nowhere, so that the end of the process does not fail to write it once more."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
