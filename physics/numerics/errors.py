# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors that a user of the package can cause, each carrying one ready sentence."""

from __future__ import annotations


class BlackHoleError(ValueError):
    """Base of every error a user can cause; ``str(error)`` says what is wrong and what to do."""


class WarpMapError(BlackHoleError):
    """A warp-map file is missing, damaged, truncated or not a warp map; the message names it."""


class ImageFileError(BlackHoleError):
    """An image file cannot be read or written; the message names it."""


class Cancelled(Exception):
    """The caller asked for the work to stop. Not a failure, hence not a :class:`BlackHoleError`."""


class UnstableOrbitWarning(UserWarning):
    """A circular orbit inside the ISCO: it exists, but the least push ends it."""
