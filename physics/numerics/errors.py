# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors that a user of the package can cause, each with a sentence for the user and a stable code."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any


class BlackHoleError(ValueError):
    """Base of every error that a user can cause.

    Parameters
    ----------
    message : str
        One sentence that says what is wrong and what to do; ``str(error)`` returns it. Its wording may change.
    code : str
        A stable name of the fault, ``kind.what``, such as ``"camera.orthographic"``. The troubleshooting page of the
        manual lists all codes.

    Attributes
    ----------
    code : str
        The code.
    """

    def __init__(self, message: str, *, code: str) -> None:
        super().__init__(message)
        self.code = code

    def __reduce__(self) -> tuple[Callable[..., BlackHoleError], tuple[Any, ...]]:
        """Keep the code when the error is copied or pickled."""
        return partial(type(self), code=self.code), self.args

    def for_user(self) -> str:
        """Return the sentence followed by the code in brackets."""
        return f"{self} [{self.code}]"


class WarpMapError(BlackHoleError):
    """A warp-map file is missing, damaged, truncated or not a warp map; the message names it."""


class ImageFileError(BlackHoleError):
    """An image file cannot be read or written; the message names it."""


class Cancelled(Exception):
    """The caller asked for the work to stop. Not a failure, hence not a :class:`BlackHoleError`."""


class UnstableOrbitWarning(UserWarning):
    """A circular orbit inside the ISCO: it exists, but the least push ends it."""
