# SPDX-License-Identifier: GPL-3.0-or-later
"""Check an OpenEXR file before the library reads it: is it complete, of a supported kind, and of a reasonable size?

The library alone is not enough. It allocates what a header asks for before it notices that the file is too short, reads
an unknown compression as ZIP, and only the first of several parts. It reports damage on the standard streams instead of
in its exceptions. Before release 3.4 it cannot read a header by itself.

The layout is that of "OpenEXR File Layout", https://openexr.com/en/latest/OpenEXRFileLayout.html; numbers are
little-endian.
"""

from __future__ import annotations

import math
import os
import struct
from typing import Any, BinaryIO

MAGIC = b"\x76\x2f\x31\x01"

# The version field: its lowest byte and its flags.
VERSION = 2
TILED, LONG_NAMES, NON_IMAGE, MULTIPART = 0x200, 0x400, 0x800, 0x1000
KNOWN = 0xFF | TILED | LONG_NAMES | NON_IMAGE | MULTIPART

LONGEST_NAME = 255
MOST_ATTRIBUTES = 10_000

# Picture sides and pixels beyond any camera or sky: a sky of 32768 x 16384 is read.
LARGEST_SIDE = 1 << 17
MOST_PIXELS = 1 << 29

# Scan lines in a chunk, by the number of the compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB, and
# the newer HTJ2K256, HTJ2K32, LJ2K and ZSTD, which only newer libraries read.
LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256, 256, 32, 256, 1)
# How much smaller a chunk can be than its pixels: runs of 128 bytes in two for RLE; 258 bytes in two bits for deflate
# (RFC 1951), which PXR24 uses too after it has left out a byte in four. Others may make nothing of an even picture.
LARGEST_RATIO = {0: 1.0, 1: 64.0, 2: 1032.0, 3: 1032.0, 5: 4.0 / 3.0 * 1032.0}

# Bytes per pixel, by the number of a channel's type: unsigned, half, float.
PIXEL_BYTES = {0: 4, 1: 2, 2: 4}

# Header attributes that describe how a file is stored rather than what it is about.
STRUCTURAL_ATTRIBUTES = frozenset(
    "channels compression dataWindow displayWindow lineOrder pixelAspectRatio screenWindowCenter screenWindowWidth "
    "type name version chunkCount tiles".split()
)

# Types of attributes that are numbers, as `struct` names them.
NUMBERS = {
    "int": "<i", "float": "<f", "double": "<d", "chromaticities": "<8f", "envmap": "<B", "v2i": "<2i", "v2f": "<2f",
    "v2d": "<2d", "v3i": "<3i", "v3f": "<3f", "v3d": "<3d", "m33f": "<9f", "m44f": "<16f", "m33d": "<9d",
    "m44d": "<16d",
}  # fmt: skip

# Values by name and type.
Attributes = dict[tuple[str, str], bytes]


class BadHeader(Exception):
    """What is wrong, as the rest of a sentence that begins with the file's name."""


def fits(width: int, height: int) -> bool:
    """Return whether a picture of this size can be read, and so may be written.

    Parameters
    ----------
    width, height : int
        Pixels.
    """
    return max(width, height) <= LARGEST_SIDE and width * height <= MOST_PIXELS


def check(stream: BinaryIO, size: int, *, whole: bool) -> None:
    """Check an OpenEXR file.

    Parameters
    ----------
    stream : binary file
        At its beginning.
    size : int
        Bytes of the file.
    whole : bool
        Whether its pixels are to be read as well. Then they must all be there.

    Raises
    ------
    BadHeader
        If the file cannot be read.
    """
    if stream.read(4) != MAGIC:
        raise BadHeader("is not an OpenEXR file")
    (version,) = struct.unpack("<I", _take(stream, 4, size))
    if version & 0xFF != VERSION or version & ~KNOWN:
        raise BadHeader("is of a version of OpenEXR that is not known here")
    header = _read_attributes(stream, size)
    kind = header.get(("type", "string"), b"")
    if version & NON_IMAGE or kind.startswith(b"deep"):
        raise BadHeader("holds deep data, not a picture")
    if version & MULTIPART and _take(stream, 1, size) != b"\0":
        raise BadHeader("holds several parts; save the picture by itself")
    try:
        compression, height = _check_size(header, size)
    except KeyError as error:
        raise BadHeader(f"is damaged: its header has no {error.args[0][0]}") from error
    except struct.error as error:
        raise BadHeader("is damaged: its header cannot be read") from error
    if whole and not version & TILED and kind != b"tiledimage":
        _check_chunks(stream, size, -(-height // LINES[compression]), 12 if version & MULTIPART else 8)


def attributes(stream: BinaryIO) -> dict[str, Any]:
    """Return what a file's header says, without a library.

    Parameters
    ----------
    stream : binary file
        A file that has passed `check`.

    Returns
    -------
    dict
        Texts and numbers by name, tuples where there are several, with ``size`` as (width, height). Structural
        attributes and those of other types are left out.

    Raises
    ------
    BadHeader, UnicodeDecodeError, struct.error
        If the file is damaged.
    """
    size = stream.seek(0, os.SEEK_END)
    stream.seek(8)
    header = _read_attributes(stream, size)
    left, top, right, bottom = struct.unpack("<4i", header["dataWindow", "box2i"])
    found: dict[str, Any] = {}
    for (name, kind), value in header.items():
        if name in STRUCTURAL_ATTRIBUTES:
            continue
        if kind == "string":
            found[name] = value.decode()
        elif kind in NUMBERS:
            numbers = struct.unpack(NUMBERS[kind], value)
            found[name] = numbers if len(numbers) > 1 else numbers[0]
    return {**found, "size": (right - left + 1, bottom - top + 1)}


def _take(stream: BinaryIO, count: int, size: int) -> bytes:
    """Read the next bytes; never ask for more than the file has."""
    data = stream.read(count) if 0 <= count <= size - stream.tell() else b""
    if len(data) != count:
        raise BadHeader("is cut short or damaged in its header")
    return data


def _read_attributes(stream: BinaryIO, size: int) -> Attributes:
    """Read one header, up to and including the zero byte that ends it."""
    found: Attributes = {}
    while name := _read_text(stream):
        key = name, _read_text(stream)
        (count,) = struct.unpack("<i", _take(stream, 4, size))
        if key in found or len(found) >= MOST_ATTRIBUTES:
            raise BadHeader("is damaged: its header cannot be read")
        found[key] = _take(stream, count, size)
    return found


def _read_text(stream: BinaryIO) -> str:
    """Read a text that ends with a zero byte."""
    begin = stream.tell()
    text, end, _rest = stream.read(LONGEST_NAME + 1).partition(b"\0")
    if not end:
        raise BadHeader("is cut short or damaged in its header")
    stream.seek(begin + len(text) + 1)
    return text.decode("latin-1")


def _check_size(header: Attributes, size: int) -> tuple[int, int]:
    """Return compression and height in pixels, if a file of this many bytes can hold the picture."""
    (compression,) = struct.unpack("<B", header["compression", "compression"])
    if compression >= len(LINES):
        raise BadHeader(f"is compressed in a way that is not known here ({compression})")
    left, top, right, bottom = struct.unpack("<4i", header["dataWindow", "box2i"])
    width, height = right - left + 1, bottom - top + 1
    if width < 1 or height < 1:
        raise BadHeader("is damaged: its size is not one")
    if not fits(width, height):
        raise BadHeader(f"is {width} x {height} pixels large, which is more than can be read here")
    if header["displayWindow", "box2i"] != header["dataWindow", "box2i"]:
        raise BadHeader("holds a crop of a larger picture, or one with a margin; save it whole")
    needed = width * height * _bytes_per_pixel(header["channels", "chlist"])
    if needed > LARGEST_RATIO.get(compression, math.inf) * size:
        raise BadHeader(f"is cut short: {size} bytes cannot hold {width} x {height} pixels")
    return compression, height


def _bytes_per_pixel(channels: bytes) -> int:
    """Return the bytes of all channels of a pixel."""
    total = place = 0
    try:
        while channels[place]:
            end = channels.index(0, place) + 1
            kind, *sampling = struct.unpack_from("<i4x2i", channels, end)
            if sampling != [1, 1]:
                raise BadHeader("holds channels of a lower resolution; save it as plain RGB")
            total, place = total + PIXEL_BYTES[kind], end + 16
    except (LookupError, ValueError, struct.error) as error:
        raise BadHeader("is damaged: its channels cannot be read") from error
    return total


def _check_chunks(stream: BinaryIO, size: int, count: int, head: int) -> None:
    """Refuse a file of scan lines whose table of chunks, or whose last chunk, is incomplete."""
    table = struct.unpack(f"<{count}Q", _take(stream, 8 * count, size))
    first, last = stream.tell(), max(table)
    stream.seek(min(last, size))
    leader = stream.read(head)  # of the last chunk; ends with its length
    length = int.from_bytes(leader[-4:], "little", signed=True)
    if min(table) < first or len(leader) < head or not 0 <= length <= size - last - head:
        raise BadHeader("is cut short: not all of its pixels are there")
