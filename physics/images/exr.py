# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading and writing OpenEXR files; the one module that knows the OpenEXR package."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import tempfile
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numerics.errors import ImageFileError
from . import exr_header
from .own_symbols import load_with_own_symbols

load_with_own_symbols("OpenEXR")
import OpenEXR  # noqa: E402  loaded by the line before

PathLike = str | os.PathLike[str]

# Names of files that are being written, or that a process was writing when it was killed.
_TEMPORARY = re.compile(r"\.(.+)\.[a-z0-9_]{8}\.tmp(\.[^.]+)")

# Header attributes that describe how a file is stored rather than what it is about.
STRUCTURAL_ATTRIBUTES = frozenset(
    "channels compression dataWindow displayWindow lineOrder pixelAspectRatio screenWindowCenter screenWindowWidth "
    "type name version chunkCount tiles".split()
)


# Bytes of a file's name that all common file systems allow, and what `replacing` adds to one.
LONGEST_NAME = 255
_ADDED_TO_NAME = len("..abcdefgh.tmp")

# More threads than this bring little: the checksum and the disk remain.
MOST_THREADS = 8

_library = threading.Lock()


@contextlib.contextmanager
def _library_threads() -> Iterator[None]:
    """Let OpenEXR compress on all cores, for as long as the block lasts; one block at a time.

    Its threads are ended again: left alive, they would have to be ended while the process ends, in any order.
    """
    set_count = getattr(OpenEXR, "set_global_thread_count", None)  # 3.3 has none
    if set_count is None:
        yield
        return
    with _library:
        set_count(min(os.cpu_count() or 1, MOST_THREADS))
        try:
            yield
        finally:
            set_count(0)


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
        stem = _shortened(target.stem, LONGEST_NAME - _ADDED_TO_NAME - len(os.fsencode(target.suffix)))
        handle, name = tempfile.mkstemp(prefix=f".{stem}.", suffix=f".tmp{target.suffix}", dir=target.parent)
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


def _shortened(text: str, most: int) -> str:
    """Return the beginning of a text that takes at most so many bytes in a file's name, without half characters."""
    while len(os.fsencode(text)) > max(most, 0):
        text = text[:-1]
    return text


def check_target(path: PathLike) -> None:
    """Check, without changing anything, that a file can be written at a path, as far as that can be told.

    Parameters
    ----------
    path : path
        Its folder need not be there.

    Raises
    ------
    ImageFileError
        If the path is a folder, if it or its name is too long, or if its folder cannot be made or written.
    """
    target = Path(path)
    try:
        if os.path.isdir(target):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if any(len(os.fsencode(part)) > LONGEST_NAME for part in target.parts):
            raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG))
        with contextlib.suppress(FileNotFoundError):
            os.lstat(target.with_name("." * (LONGEST_NAME - 1)))  # as long as a temporary name may be
        folder = next(parent for parent in (target.absolute().parent, *target.absolute().parents) if parent.exists())
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except (OSError, ValueError) as error:
        reason = _reason(error) if isinstance(error, OSError) else str(error)
        raise ImageFileError(
            f"Cannot write {_brief(target)}: {reason}; choose another name or folder.", code="file.not-written"
        ) from error


def _brief(path: Path) -> str:
    """Return a path as a message shows it: one that is too long, by its end."""
    text = str(path)
    return text if len(text) <= LONGEST_NAME else f"...{text[-LONGEST_NAME:]}"


def target_of(name: str) -> str | None:
    """Return the name of the file that a temporary file is written for.

    Parameters
    ----------
    name : str
        A file's name, without its folder.

    Returns
    -------
    str or None
        None if it is not the name of a temporary file of `replacing`. Of a name too long to be lengthened, as much as
        the temporary name holds.
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
        When the file cannot be written.
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
        When the file cannot be written.
    """
    header = {
        **(attributes or {}),
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
    }
    expected = None
    for each in channels.values():
        height, width = each.shape
        if not exr_header.fits(width, height):
            raise ImageFileError(
                f"Cannot write {path}: a picture of {width} x {height} pixels is more than can be read again; make it "
                "smaller.",
                code="file.not-written",
            )
    with replacing(path) as temporary:
        try:
            with _library_threads(), OpenEXR.File(header, dict(channels)) as file:
                # Names that are no UTF-8 only go through as bytes.
                file.write(str(temporary) if is_text(temporary) else os.fsencode(temporary))
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
    with _library_threads(), _opened(path, header_only=False) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}, _attributes(file)


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
    with _opened(path, header_only=True) as file:
        return _attributes(file)


def read_beginning(path: PathLike, count: int) -> bytes:
    """Return the first bytes of a file.

    Raises
    ------
    ImageFileError
        If it is missing or cannot be read.
    """
    with _file_errors(path), open(path, "rb") as stream:
        return stream.read(count)


@contextlib.contextmanager
def _file_errors(path: PathLike) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError as error:
        raise ImageFileError(f"{path} does not exist.", code="file.missing") from error
    except OSError as error:
        raise ImageFileError(f"Cannot read {_brief(Path(path))}: {_reason(error)}.", code="file.no-access") from error
    except MemoryError as error:
        raise ImageFileError(f"{path} is larger than the memory that is free.", code="file.memory") from error
    except ValueError as error:
        if isinstance(error, ImageFileError):
            raise
        raise ImageFileError(f"Cannot read {str(path)!r}: {error}.", code="file.missing") from error  # a zero byte


@contextlib.contextmanager
def _opened(path: PathLike, header_only: bool) -> Iterator[OpenEXR.File]:
    try:
        with _file_errors(path):
            data = Path(path).read_bytes() if not header_only or not is_text(path) else None
            with io.BytesIO(data) if data is not None else open(path, "rb") as stream:
                size = stream.seek(0, os.SEEK_END)
                stream.seek(0)
                exr_header.check(stream, size, whole=not header_only)
    except exr_header.BadHeader as error:
        raise ImageFileError(f"{path} {error}.", code="file.bad-exr") from error
    try:
        source: Any = str(path) if data is None else io.BytesIO(data)
        with OpenEXR.File(source, separate_channels=True, header_only=header_only) as file:
            yield file
    except MemoryError as error:
        raise ImageFileError(f"{path} is larger than the memory that is free.", code="file.memory") from error
    except (RuntimeError, ValueError, TypeError, UnicodeDecodeError) as error:
        if isinstance(error, ImageFileError):
            raise
        detail = str(error).strip() or type(error).__name__
        raise ImageFileError(f"{path} is damaged or cut short: {detail}.", code="file.bad-exr") from error


def _attributes(file: OpenEXR.File) -> dict[str, Any]:
    header = file.header()
    (left, top), (right, bottom) = (tuple(int(value) for value in corner) for corner in header["dataWindow"])
    kept = {name: value for name, value in header.items() if name not in STRUCTURAL_ATTRIBUTES}
    return {**kept, "size": (right - left + 1, bottom - top + 1)}


def is_text(path: PathLike) -> bool:
    """Return whether a path can be encoded, which a name that is no UTF-8 cannot be."""
    try:
        os.fspath(path).encode()
    except UnicodeEncodeError:
        return False
    return True


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
