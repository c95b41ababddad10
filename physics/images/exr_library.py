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


REMEDY = "install the package OpenEXR, 3.3 or newer, into this Python"

_lock = threading.Lock()


class _Choice:
    """The library of this process, once it is found, and how to look for it."""

    found: Library | None = None
    folders: tuple[str, ...] = ()
    remedy = REMEDY


def library() -> Library:
    """Return the library of this process.

    Returns
    -------
    Library

    Raises
    ------
    ImageFileError
        There is none.
    """
    with _lock:
        if _Choice.found is None:
            _Choice.found = _choose()
        return _Choice.found


def exr_library(folders: Sequence[str] = (), remedy: str = REMEDY) -> str:
    """Make sure that EXR files can be read and written, before any work.

    Parameters
    ----------
    folders : sequence of str, optional
        Where OpenImageIO may lie besides Python's path: it stands in for the package OpenEXR, where that is missing.
    remedy : str, optional
        The end of the sentence that is said when there is no library, now or later: what to do.

    Returns
    -------
    str
        Name and version of the library that does it.

    Raises
    ------
    ImageFileError
        There is none.
    """
    with _lock:
        _Choice.folders, _Choice.remedy = tuple(folders), remedy
    return library().name


def _choose() -> Library:
    reasons = []
    choices: tuple[Callable[[], Library], ...] = (OpenEXRLibrary, lambda: OpenImageIOLibrary(_Choice.folders))
    for choice in choices:
        try:
            return choice()
        except Exception as error:  # noqa: BLE001  a broken package can raise anything while it is imported
            reasons.append(" ".join(str(error).split()) or type(error).__name__)
    raise ImageFileError(
        f"EXR files can be neither read nor written ({', and '.join(reasons)}): {_Choice.remedy}.",
        code="file.no-library",
    )
