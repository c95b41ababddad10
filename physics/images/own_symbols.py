# SPDX-License-Identifier: GPL-3.0-or-later
"""Load an extension module so that it calls its own functions before others of the same names.

On Linux a library calls the first function of a name that the process has loaded, its own last. Blender's executable
has an OpenEXR of its own among its global names, of another version than the wheel's: the wheel then calls that one,
which crashes Blender 4.5. Loading the wheel with RTLD_DEEPBIND would prevent it, and would bind malloc and free apart
from the executable's as well, which replaces them in some builds: that crashes too. So a copy of the library is marked
DT_SYMBOLIC, which concerns only the functions that the library itself defines. The copy lies in memory, or for a moment
in a temporary folder where the kernel or a sandbox forbids that.

Windows binds each function to the library that it was linked with, and macOS does so too (its two-level namespace; the
wheels link OpenEXR statically). There a module is loaded as ever.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib.machinery
import importlib.util
import os
import struct
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

_PT_DYNAMIC = 2
_DT_NULL, _DT_RPATH, _DT_SYMBOLIC, _DT_RUNPATH = 0, 15, 16, 29

# Attribute of modules that were loaded here.
_MARK = "umbra_own_symbols"


def load_with_own_symbols(name: str, origin: str) -> ModuleType | None:
    """Load an extension module that is a single file, bound to its own functions.

    Parameters
    ----------
    name : str
        The module's name, by which it is known to `sys.modules` afterwards. Its last part is that of the file.
    origin : str
        The file.

    Returns
    -------
    module or None
        None, with nothing changed, where it is no such file, or where no copy can be loaded.

    Raises
    ------
    ImportError
        The library refused to be loaded: two of the same kind cannot be in a process.
    """
    if sys.platform != "linux" or ".so" not in Path(origin).suffixes:
        return None
    library = bytearray(Path(origin).read_bytes())
    if not mark_symbolic(library):
        return None
    for place in (_in_memory, _in_a_folder):
        with contextlib.suppress(OSError), place(bytes(library)) as path:
            try:
                module = _load(name, path)
            except ImportError as error:
                if error.path is None:  # the module itself says so, not the loader of libraries
                    raise
                continue
            module.__file__ = origin
            setattr(module, _MARK, True)
            return module
    return None


def _load(name: str, path: str) -> ModuleType:
    loader = importlib.machinery.ExtensionFileLoader(name, path)
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    if spec is None:
        raise ImportError(name, path=path)
    before = sys.modules.get(name)
    try:
        module = importlib.util.module_from_spec(spec)
        loader.exec_module(module)
    except BaseException:
        if before is None:
            sys.modules.pop(name, None)
        else:
            sys.modules[name] = before
        raise
    sys.modules[name] = module
    return module


@contextlib.contextmanager
def _in_memory(library: bytes) -> Iterator[str]:
    """A file that only this process has."""
    create: Callable[[str, int], int] | None = getattr(os, "memfd_create", None)
    if create is None:
        raise OSError("this Python knows no files in memory")
    with os.fdopen(create("umbra", os.MFD_CLOEXEC), "wb") as file:
        file.write(library)
        file.flush()
        path = f"/proc/self/fd/{file.fileno()}"
        os.stat(path)
        yield path


@contextlib.contextmanager
def _in_a_folder(library: bytes) -> Iterator[str]:
    """A file in a folder of its own; the loaded library outlives it."""
    with tempfile.TemporaryDirectory(prefix="umbra-") as folder:
        path = Path(folder, "library.so")
        path.write_bytes(library)
        yield str(path)


def is_bound_to_itself(module: ModuleType, function: str) -> bool:
    """Return whether a module calls its own functions.

    Parameters
    ----------
    module : module
        Loaded by whomever.
    function : str
        The name of a function that the module defines.

    Returns
    -------
    bool
        False where it was loaded in the ordinary way and the process has another function of that name for all to see.
    """
    return hasattr(module, _MARK) or not is_global(function)


def is_global(function: str) -> bool:
    """Return whether libraries that are loaded here in the ordinary way would call another function of this name.

    Parameters
    ----------
    function : str
        Its name in C.

    Returns
    -------
    bool
        False on systems that bind a library's functions to itself.
    """
    return sys.platform == "linux" and hasattr(ctypes.CDLL(None), function)


def mark_symbolic(library: bytearray) -> bool:
    """Mark a shared library DT_SYMBOLIC, in place.

    Parameters
    ----------
    library : bytearray
        An ELF file, 64 bits, little-endian. The entry takes the place of a search path for other libraries, which a
        wheel of one file does not need, or of spare room at the end of the table.

    Returns
    -------
    bool
        Whether the file could be marked; anything else than such a file stays as it is.
    """
    try:
        return _mark(library)
    except (struct.error, ValueError):  # numbers that point out of the file, a table without an end
        return False


def _mark(library: bytearray) -> bool:
    if library[:6] != b"\x7fELF\x02\x01":
        return False
    (headers,) = struct.unpack_from("<Q", library, 32)
    size, count = struct.unpack_from("<HH", library, 54)
    for number in range(count):
        kind, _flags, offset, _address, _physical, length = struct.unpack_from(
            "<IIQQQQ", library, headers + number * size
        )
        if kind != _PT_DYNAMIC:
            continue
        if offset + length > len(library):
            return False
        places = range(offset, offset + length, 16)
        tags = [struct.unpack_from("<q", library, place)[0] for place in places]
        end = tags.index(_DT_NULL)
        if _DT_SYMBOLIC in tags[:end]:
            return True
        useless = next((index for index, tag in enumerate(tags[:end]) if tag in (_DT_RUNPATH, _DT_RPATH)), None)
        if useless is None and len(tags) > end + 1 and tags[end + 1] == _DT_NULL:
            useless = end
        if useless is None:
            return False
        struct.pack_into("<qQ", library, places[useless], _DT_SYMBOLIC, 0)
        return True
    return False
