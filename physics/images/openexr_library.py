# SPDX-License-Identifier: GPL-3.0-or-later
"""EXR files by the package OpenEXR, 3.3 or newer; the one module that imports it."""

from __future__ import annotations

import contextlib
import importlib.machinery
import importlib.metadata
import importlib.util
import io
import os
import sys
import threading
from collections.abc import Iterator, Mapping
from typing import Any

from numpy.typing import NDArray

from . import own_symbols

NAME = "OpenEXR"

# More threads than this bring little: the checksum and the disk remain.
MOST_THREADS = 8

# A function that the library defines, and Blender's OpenEXR too.
_FUNCTION = "exr_start_read"


class OpenEXRLibrary:
    """Reads and writes EXR files by the package OpenEXR."""

    def __init__(self) -> None:
        self._module = _find()
        self._lock = threading.Lock()
        self.name = f"{NAME} {getattr(self._module, '__version__', '')}".strip()

    def read(self, path: str, data: bytes) -> dict[str, NDArray[Any]]:
        """Return the channels of a file's bytes; see `exr_library.Library`."""
        with self._threads(), self._opened(path, data) as file:
            return {name: channel.pixels for name, channel in file.channels().items()}

    def write(self, path: str, channels: Mapping[str, NDArray[Any]], attributes: Mapping[str, str]) -> None:
        """Write a file; see `exr_library.Library`."""
        header = {
            **attributes,
            "compression": self._module.ZIP_COMPRESSION,
            "type": self._module.scanlineimage,
        }
        with self._threads(), self._module.File(header, dict(channels)) as file:
            file.write(path if _is_utf8(path) else os.fsencode(path))

    def _opened(self, path: str, data: bytes) -> Any:
        try:
            return self._module.File(io.BytesIO(data), separate_channels=True, header_only=False)
        except TypeError:  # before release 3.5 it opens files by their names only
            return self._module.File(path, separate_channels=True, header_only=False)

    @contextlib.contextmanager
    def _threads(self) -> Iterator[None]:
        """Let OpenEXR compress on all cores, for as long as the block lasts; one block at a time.

        Its threads are ended again: left alive, they would have to be ended while the process ends, in any order.
        """
        set_count = getattr(self._module, "set_global_thread_count", None)  # 3.3 has none
        if set_count is None:
            yield
            return
        with self._lock:
            set_count(min(os.cpu_count() or 1, MOST_THREADS))
            try:
                yield
            finally:
                set_count(0)


def _is_utf8(path: str) -> bool:
    """Return whether a path can be handed over as text; any other only goes through as bytes."""
    try:
        path.encode()
    except UnicodeEncodeError:
        return False
    return True


# --- which one ------------------------------------------------------------------------------------


def _find() -> Any:
    """Return the package: the one that is imported already, or the first on the path; else another on the path.

    Raises
    ------
    ImportError
        There is none, or none of a version that can be used, or not safely in this process.
    """
    first = _imported()
    problem = _problem(first)
    if problem is None:
        return first
    private = f"{__name__}.{NAME}"
    if private in sys.modules:
        return sys.modules[private]
    for origin in _installed():
        if origin == getattr(first, "__file__", None):
            continue
        with contextlib.suppress(ImportError):  # a second one of a like version is refused by itself
            other = own_symbols.load_with_own_symbols(private, origin)
            if other is not None and _problem(other) is None:
                return other
            sys.modules.pop(private, None)
    raise ImportError(problem)


def _imported() -> Any:
    if NAME not in sys.modules:
        found = importlib.util.find_spec(NAME)
        if found is None or found.origin is None:
            raise ImportError(f"no package {NAME} is installed")
        own_symbols.load_with_own_symbols(NAME, found.origin)
    if NAME not in sys.modules and own_symbols.is_global(_FUNCTION):
        raise ImportError(f"the package {NAME} cannot be kept apart from Blender's own")
    import OpenEXR

    return OpenEXR


def _problem(module: Any) -> str | None:
    """Return why a package cannot be used, or None if it can."""
    if not all(hasattr(module, name) for name in ("File", "ZIP_COMPRESSION", "scanlineimage")):
        return f"the package {NAME} at {getattr(module, '__file__', None)} is too old"
    if not own_symbols.is_bound_to_itself(module, _FUNCTION):
        return f"another add-on has loaded the package {NAME} so that it calls Blender's own"
    return None


def _installed() -> Iterator[str]:
    """Files of all packages of the name, as far as they were installed with a list of files."""
    wanted = {NAME + suffix for suffix in importlib.machinery.EXTENSION_SUFFIXES}
    for each in importlib.metadata.distributions(name=NAME):
        for file in each.files or ():
            if file.name in wanted:
                yield str(each.locate_file(file))
