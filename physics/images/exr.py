# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and writing EXR files: what is checked and promised whichever library does it."""

from __future__ import annotations

import contextlib
import io
import os
import re
import struct
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numerics.errors import ImageFileError
from . import exr_header
from .exr_library import library

# At once, before anybody loads another: see `own_symbols`. Whoever needs it hears that there is none.
with contextlib.suppress(ImageFileError):
    library()

PathLike = str | os.PathLike[str]

# Names of files that are being written, or that a process was writing when it was killed.
_TEMPORARY = re.compile(r"\.(.+)\.[a-z0-9_]{8}\.tmp(\.[^.]+)")


@contextlib.contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Yield a temporary path beside `path` that takes its place when the block ends without an error.

    A reader, or a crash, meets either the old file or the complete new one. Use it in a `with` statement.

    Parameters
    ----------
    path : path
        Its folder is made if need be.

    Yields
    ------
    Path
        Where to write; see `target_of` for its name.

    Raises
    ------
    ImageFileError
        If the folder cannot be made or written, or the disk is full.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}.", suffix=f".tmp{target.suffix}", dir=target.parent)
        os.close(handle)
    except OSError as error:
        raise ImageFileError(
            f"Cannot write {target}: {_reason(error)}; choose another folder.", code="file.not-written"
        ) from error
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files that only their owner can read; a map is as public as its folder allows.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, target)
    except OSError as error:
        raise ImageFileError(
            f"Cannot write {target}: {_reason(error)}; free some space or choose another folder.",
            code="file.not-written",
        ) from error
    finally:
        temporary.unlink(missing_ok=True)


def target_of(name: str) -> str | None:
    """Return the name of the file that a temporary file is written for.

    Parameters
    ----------
    name : str
        A file's name, without its folder.

    Returns
    -------
    str or None
        None if it is not the name of a temporary file of `replacing`.
    """
    match = _TEMPORARY.fullmatch(name)
    return None if match is None else match[1] + match[2]


def write_exr(path: PathLike, pixels: NDArray[Any], attributes: Mapping[str, str] | None = None) -> None:
    """Write an image as a scanline EXR with lossless ZIP compression, whole or not at all.

    Parameters
    ----------
    path : path
        Its folder is made if need be.
    pixels : ndarray of float16 or float32, shape (height, width, 3 or 4)
        R, G, B(, A), row 0 at the top.
    attributes : mapping, optional
        Strings for the header.

    Raises
    ------
    ImageFileError
        When the file cannot be written, or there is no library that can.
    """
    names = "RGBA"[: pixels.shape[2]]
    write_channels(path, {name: np.ascontiguousarray(pixels[:, :, i]) for i, name in enumerate(names)}, attributes)


def write_channels(
    path: PathLike, channels: Mapping[str, NDArray[Any]], attributes: Mapping[str, str] | None = None
) -> None:
    """Write channels, arrays of float16 or float32 of one shape (height, width), as `write_exr` does.

    Raises
    ------
    ImageFileError
        When the file cannot be written, or there is no library that can.
    """
    exr = library()
    expected = None
    with replacing(path) as temporary:
        try:
            exr.write(str(temporary), channels, attributes or {})
            expected = temporary.stat().st_size
        except (RuntimeError, ValueError, TypeError) as error:
            raise OSError(f"the EXR writer failed ({error})") from error
        if not expected:
            raise OSError("no space left on the device")


def read_exr(path: PathLike) -> tuple[NDArray[np.float32], dict[str, Any]]:
    """Read an EXR picture and its header.

    Parameters
    ----------
    path : path

    Returns
    -------
    pixels : ndarray of float32, shape (height, width, 3 or 4)
        R, G, B(, A), row 0 at the top. Files with luminance only are read as gray.
    header : dict
        As from `read_exr_header`.

    Raises
    ------
    ImageFileError
        If the file is missing, damaged, or has no picture.
    """
    channels, header = read_channels(path)
    if "Y" in channels and "R" not in channels:
        channels = dict.fromkeys("RGB", channels["Y"]) | {k: v for k, v in channels.items() if k == "A"}
    names = [name for name in "RGBA" if name in channels]
    if names[:3] != ["R", "G", "B"]:
        raise ImageFileError(
            f"{path} has no channels R, G and B; it is not a picture that can be used here.", code="file.no-colors"
        )
    return np.stack([np.asarray(channels[name], dtype=np.float32) for name in names], axis=-1), header


def read_channels(path: PathLike) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Read an EXR file's channels as they are, shape (height, width) each, row 0 at the top, and its header.

    Raises
    ------
    ImageFileError
        When the file is missing or damaged.
    """
    exr = library()
    data = _checked(path, header_only=False)
    with _damage_told(path):
        return exr.read(str(path), data), exr_header.attributes(io.BytesIO(data))


def read_exr_header(path: PathLike) -> dict[str, Any]:
    """Read an EXR file's header.

    Parameters
    ----------
    path : path

    Returns
    -------
    dict
        Attributes by name, with ``size`` as (width, height).

    Raises
    ------
    ImageFileError
        If the file is missing or its header is damaged.
    """
    _checked(path, header_only=True)
    with _damage_told(path), open(path, "rb") as stream:
        return exr_header.attributes(stream)


def _checked(path: PathLike, header_only: bool) -> bytes:
    """Return a file's bytes, none where only its header is read, if it is a file that can be read."""
    try:
        data = Path(path).read_bytes() if not header_only else b""
        with io.BytesIO(data) if not header_only else open(path, "rb") as stream:
            size = stream.seek(0, os.SEEK_END)
            stream.seek(0)
            exr_header.check(stream, size, whole=not header_only)
    except FileNotFoundError as error:
        raise ImageFileError(f"{path} does not exist.", code="file.missing") from error
    except OSError as error:
        raise ImageFileError(f"Cannot read {path}: {_reason(error)}.", code="file.no-access") from error
    except exr_header.BadHeader as error:
        raise ImageFileError(f"{path} {error}.", code="file.bad-exr") from error
    return data


@contextlib.contextmanager
def _damage_told(path: PathLike) -> Iterator[None]:
    """Turn whatever a library says of a file into one sentence."""
    try:
        yield
    except (exr_header.BadHeader, struct.error, RuntimeError, ValueError, TypeError, OSError, MemoryError) as error:
        detail = str(error).strip() or type(error).__name__
        raise ImageFileError(f"{path} is damaged or cut short: {detail}.", code="file.bad-exr") from error


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
