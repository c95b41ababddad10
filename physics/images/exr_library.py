# SPDX-License-Identifier: GPL-3.0-or-later
"""Which library reads and writes EXR files: the package OpenEXR, or OpenImageIO where that is missing."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from numpy.typing import NDArray

from ..numerics.errors import ImageFileError
from .openexr_library import OpenEXRLibrary
from .openimageio_library import OpenImageIOLibrary


class Library(Protocol):
    """What is needed of a library. Files have been checked before (`exr_header`); anything can be raised."""

    name: str
    """With its version."""

    def read(self, path: str, data: bytes) -> dict[str, NDArray[Any]]:
        """Return the channels of a file, which has these bytes, as they are, row 0 at the top."""

    def write(self, path: str, channels: Mapping[str, NDArray[Any]], attributes: Mapping[str, str]) -> None:
        """Write a file of scan lines with ZIP compression, or raise RuntimeError."""


_lock = threading.Lock()
_found: list[Library] = []


def library(folders: Sequence[str] = ()) -> Library:
    """Return the library of this process.

    Parameters
    ----------
    folders : sequence of str, optional
        Where OpenImageIO may lie besides Python's path.

    Returns
    -------
    Library

    Raises
    ------
    ImageFileError
        There is none.
    """
    with _lock:
        if not _found:
            _found.append(_choose(folders))
        return _found[0]


def exr_library(folders: Sequence[str] = ()) -> str:
    """Make sure that EXR files can be read and written, before any work.

    Parameters
    ----------
    folders : sequence of str, optional
        Where OpenImageIO may lie besides Python's path: it stands in for the package OpenEXR, where that is missing.

    Returns
    -------
    str
        Name and version of the library that does it.

    Raises
    ------
    ImageFileError
        There is none.
    """
    return library(folders).name


def _choose(folders: Sequence[str]) -> Library:
    reasons = []
    choices: tuple[Callable[[], Library], ...] = (OpenEXRLibrary, lambda: OpenImageIOLibrary(folders))
    for choice in choices:
        try:
            return choice()
        except Exception as error:  # noqa: BLE001  a broken package can raise anything while it is imported
            reasons.append(" ".join(str(error).split()) or type(error).__name__)
    raise ImageFileError(
        f"EXR files can be neither read nor written ({', and '.join(reasons)}): install the package OpenEXR, 3.3 or "
        "newer, into this Python.",
        code="file.no-library",
    )
