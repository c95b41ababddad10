# SPDX-License-Identifier: GPL-3.0-or-later
"""Load an extension module so that it calls its own functions before others of the same names.

On Linux a library calls the first function of a name that the process has loaded, its own last. Blender's executable
has an OpenEXR of its own among its global names, of another version than the wheel's: the wheel then calls that one,
which crashes Blender 4.5. Loading the wheel with RTLD_DEEPBIND would prevent it, and would bind malloc and free apart
from the executable's as well, which replaces them in some builds: that crashes too. So a copy of the library in memory
is marked DT_SYMBOLIC, which concerns only the functions that the library itself defines.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import struct
import sys
from pathlib import Path

_PT_DYNAMIC = 2
_DT_NULL, _DT_RPATH, _DT_SYMBOLIC, _DT_RUNPATH = 0, 15, 16, 29


def load_with_own_symbols(name: str) -> None:
    """Import an extension module that is a single file, bound to its own functions.

    Does nothing where that is not needed or not possible; importing the module then works as ever.

    Parameters
    ----------
    name : str
        The module's name. If it is imported already, it stays as it is.
    """
    if sys.platform != "linux" or name in sys.modules:
        return
    found = importlib.util.find_spec(name)
    if found is None or found.origin is None or not found.origin.endswith(".so"):
        return
    library = bytearray(Path(found.origin).read_bytes())
    if not mark_symbolic(library):
        return
    try:
        descriptor = os.memfd_create(name, os.MFD_CLOEXEC)
    except OSError:  # a kernel or a sandbox without it
        return
    with os.fdopen(descriptor, "wb") as file:
        file.write(library)
        file.flush()
        path = f"/proc/self/fd/{descriptor}"
        if not Path(path).exists():
            return
        loader = importlib.machinery.ExtensionFileLoader(name, path)
        spec = importlib.util.spec_from_file_location(name, path, loader=loader)
        if spec is None:
            return
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        loader.exec_module(module)
    module.__file__ = found.origin


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
        Whether the file could be marked.
    """
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
        places = range(offset, offset + length, 16)
        tags = [struct.unpack_from("<q", library, place)[0] for place in places]
        end = tags.index(_DT_NULL)
        if _DT_SYMBOLIC in tags[:end]:
            return True
        useless = next((index for index, tag in enumerate(tags[:end]) if tag in (_DT_RUNPATH, _DT_RPATH)), None)
        if useless is None and len(tags) > end + 1:
            useless = end
        if useless is None:
            return False
        struct.pack_into("<qQ", library, places[useless], _DT_SYMBOLIC, 0)
        return True
    return False
