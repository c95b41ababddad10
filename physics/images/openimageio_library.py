# SPDX-License-Identifier: GPL-3.0-or-later
"""EXR files by OpenImageIO, which comes with Blender; the one module that imports it.

It stands in where the package OpenEXR is missing. Pixels are the same bit by bit.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import itertools
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

NAME = "OpenImageIO"

# Of its names for the types of channels.
TYPES = {"half": np.float16, "float": np.float32, "uint": np.uint32}


class OpenImageIOLibrary:
    """Reads and writes EXR files by OpenImageIO.

    Parameters
    ----------
    folders : sequence of str
        Where to look for the package when it is not on Python's path.

    Raises
    ------
    ImportError
        If it is not there.
    """

    def __init__(self, folders: Sequence[str]) -> None:
        self._module = find(folders)
        self.name = f"{NAME} {self._module.VERSION_STRING}"

    def read(self, path: str, data: bytes) -> dict[str, NDArray[Any]]:
        """Return the channels of a file; see `exr_library.Library`."""
        source = self._module.ImageInput.open(path)
        if source is None:
            raise RuntimeError(self._module.geterror() or "it cannot be opened")
        try:
            spec = source.spec()
            types = [str(each) for each in spec.channelformats] or [str(spec.format)] * spec.nchannels
            channels: dict[str, NDArray[Any]] = {}
            # Channels of one type at a time, as they are: whole numbers would be scaled to 0..1.
            for kind, group in itertools.groupby(range(spec.nchannels), key=types.__getitem__):
                numbers = list(group)
                pixels = source.read_image(0, 0, numbers[0], numbers[-1] + 1, kind)
                if pixels is None:
                    raise RuntimeError(source.geterror() or "its pixels cannot be read")
                planes = np.asarray(pixels, dtype=TYPES[kind]).reshape(spec.height, spec.width, len(numbers))
                for index, number in enumerate(numbers):
                    channels[spec.channelnames[number]] = np.ascontiguousarray(planes[:, :, index])
        finally:
            source.close()
        return channels

    def write(self, path: str, channels: Mapping[str, NDArray[Any]], attributes: Mapping[str, str]) -> None:
        """Write a file; see `exr_library.Library`."""
        names = tuple(channels)
        planes = [channels[name] for name in names]
        height, width = planes[0].shape
        kinds = [{each: kind for kind, each in TYPES.items()}[plane.dtype.type] for plane in planes]
        spec = self._module.ImageSpec(width, height, len(names), "float" if len(set(kinds)) > 1 else kinds[0])
        spec.channelnames = names
        if len(set(kinds)) > 1:
            spec.channelformats = tuple(self._module.TypeDesc(kind) for kind in kinds)
        # Without a date of its own it would note the time of writing.
        for name, value in {"DateTime": "", **attributes, "compression": "zip"}.items():
            spec.attribute(name, value)
        target = self._module.ImageOutput.create("exr")
        if target is None:
            raise RuntimeError(self._module.geterror() or "it cannot write EXR files")
        pixels = np.ascontiguousarray(np.stack(planes, axis=-1))
        done = target.open(path, spec) and target.write_image(pixels)
        if not (target.close() and done):
            raise RuntimeError(target.geterror() or self._module.geterror() or "it gives no reason")


def find(folders: Sequence[str] = ()) -> Any:
    """Return the package OpenImageIO.

    Parameters
    ----------
    folders : sequence of str, optional
        Where to look for it when it is not on Python's path; then Blender's package is looked into.

    Raises
    ------
    ImportError
        If it is not there.
    """
    if NAME not in sys.modules and importlib.util.find_spec(NAME) is None:
        found = importlib.machinery.PathFinder.find_spec(NAME, [*folders, *_inside_blender()])
        if found is None or found.loader is None:
            raise ImportError(f"there is no {NAME}")
        module = importlib.util.module_from_spec(found)
        sys.modules[NAME] = module
        try:
            found.loader.exec_module(module)
        except BaseException:
            sys.modules.pop(NAME, None)
            raise
    import OpenImageIO

    if not hasattr(OpenImageIO, "VERSION_STRING"):
        raise ImportError(f"the module {NAME} is not the one of that name")
    return OpenImageIO


def _inside_blender() -> list[str]:
    """Where the package `bpy`, if it is installed here, keeps packages of its own; it is not imported for that."""
    blender = importlib.util.find_spec("bpy")
    if blender is None or blender.origin is None:
        return []
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    root = Path(blender.origin).parent
    places = (*root.glob(f"*/python/lib/{version}/site-packages"), *root.glob("*/python/lib/site-packages"))
    return [str(place) for place in places]
