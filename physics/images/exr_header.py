# SPDX-License-Identifier: GPL-3.0-or-later
"""A look at an OpenEXR file before the library has it: is it whole, of a kind that is read here, and of a sane size?

The library allocates what a header asks for before it finds that the file cannot hold that much, reads only the first
of several parts, and tells of a damaged one in words for programmers. The layout is that of "OpenEXR File Layout",
https://openexr.com/en/latest/OpenEXRFileLayout.html; all numbers are little-endian.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import BinaryIO

MAGIC = b"\x76\x2f\x31\x01"

# The version field: its lowest byte and its flags.
VERSION = 2
TILED, LONG_NAMES, NON_IMAGE, MULTIPART = 0x200, 0x400, 0x800, 0x1000
KNOWN = 0xFF | TILED | LONG_NAMES | NON_IMAGE | MULTIPART

SHORT_NAME, LONG_NAME = 31, 255
# Previews and the like make headers of some hundred kilobytes.
LARGEST_ATTRIBUTE = 64 << 20
MOST_ATTRIBUTES = 10_000
MOST_CHANNELS = 1024

# Picture sides and pixels beyond any camera or sky: a sky of 32768 x 16384 is read.
LARGEST_SIDE = 1 << 17
MOST_PIXELS = 1 << 29

# Scan lines in a chunk, by the number of the compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB, and
# the newer HTJ2K256, HTJ2K32, LJ2K and ZSTD, which only newer libraries read.
LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256, 256, 32, 256, 1)
# How much smaller a chunk can be than its pixels: runs of 128 bytes in two for RLE; 258 bytes in two bits for deflate
# (RFC 1951), which PXR24 uses too after it has left out a byte in four. Others may make nothing of an even picture.
LARGEST_RATIO = {0: 1.0, 1: 64.0, 2: 1032.0, 3: 1032.0, 5: 4.0 / 3.0 * 1032.0}

# Bytes of a pixel, by the number of its type: unsigned, half, float.
PIXEL_BYTES = (4, 2, 4)


class BadHeader(Exception):
    """What is wrong, as the rest of a sentence that begins with the file's name."""


@dataclass(frozen=True)
class Part:
    """What the header of a file's part says about its pixels."""

    attributes: dict[str, tuple[str, bytes]]
    """Type and value by name."""

    def box(self, name: str) -> tuple[int, int, int, int]:
        """Return left, top, right and bottom of a window, inclusive."""
        left, top, right, bottom = struct.unpack("<4i", self._value(name, "box2i", 16))
        return left, top, right, bottom

    @property
    def compression(self) -> int:
        """The number of the compression."""
        number = self._value("compression", "compression", 1)[0]
        if number >= len(LINES):
            raise BadHeader(f"is compressed in a way that is not known here ({number})")
        return number

    @property
    def bytes_per_pixel(self) -> int:
        """Bytes of all channels of a pixel."""
        kind, value = self.attributes.get("channels", ("", b""))
        if kind != "chlist":
            raise BadHeader("is damaged: its header has no channels")
        total, place, count = 0, 0, 0
        while place < len(value) and value[place]:
            end = value.find(b"\0", place, place + LONG_NAME + 1)
            if end < 0 or end + 17 > len(value) or count >= MOST_CHANNELS:
                raise BadHeader("is damaged: its channels cannot be read")
            pixel_type, x_sampling, y_sampling = struct.unpack_from("<i4x2i", value, end + 1)
            if not 0 <= pixel_type < len(PIXEL_BYTES):
                raise BadHeader("is damaged: its channels cannot be read")
            if (x_sampling, y_sampling) != (1, 1):
                raise BadHeader("holds channels of a lower resolution; save it as plain RGB")
            total, place, count = total + PIXEL_BYTES[pixel_type], end + 17, count + 1
        if not count or place >= len(value):
            raise BadHeader("is damaged: its channels cannot be read")
        return total

    def _value(self, name: str, kind: str, size: int) -> bytes:
        found, value = self.attributes.get(name, ("", b""))
        if found != kind or len(value) != size:
            raise BadHeader(f"is damaged: its header has no {name}")
        return value


def check(stream: BinaryIO, size: int, *, whole: bool) -> None:
    """Check an OpenEXR file.

    Parameters
    ----------
    stream : binary file
        At its beginning.
    size : int
        Bytes of the file.
    whole : bool
        Whether its pixels are to be read as well: then they must all be there.

    Raises
    ------
    BadHeader
        It is not a file that can be read.
    """
    reader = _Reader(stream, size)
    if reader.take(min(4, size)) != MAGIC:
        raise BadHeader("is not an OpenEXR file")
    (version,) = struct.unpack("<I", reader.take(4))
    if version & 0xFF != VERSION or version & ~KNOWN:
        raise BadHeader("is of a version of OpenEXR that is not known here")
    if version & NON_IMAGE:
        raise BadHeader("holds deep data, not a picture")
    part = _read_part(reader, bool(version & LONG_NAMES))
    if version & MULTIPART:
        if part.attributes.get("type", ("", b""))[1] not in (b"scanlineimage", b"tiledimage"):
            raise BadHeader("holds deep data, not a picture")
        if reader.take(1) != b"\0":
            raise BadHeader("holds several parts; save the picture by itself")
    pixels = _check_size(part, size)
    tiled = bool(version & TILED) or part.attributes.get("type", ("", b""))[1] == b"tiledimage"
    if whole and not tiled:
        _check_chunks(reader, part.compression, pixels[1], bool(version & MULTIPART))


def _check_size(part: Part, size: int) -> tuple[int, int]:
    """Return width and height, or refuse them."""
    left, top, right, bottom = part.box("dataWindow")
    width, height = right - left + 1, bottom - top + 1
    if width < 1 or height < 1:
        raise BadHeader("is damaged: its size is not one")
    if max(width, height) > LARGEST_SIDE or width * height > MOST_PIXELS:
        raise BadHeader(f"is {width} x {height} pixels large, which is more than can be read here")
    if part.box("displayWindow") != (left, top, right, bottom):
        raise BadHeader("holds a crop of a larger picture, or one with a margin; save it whole")
    needed = width * height * part.bytes_per_pixel
    ratio = LARGEST_RATIO.get(part.compression)
    if ratio is not None and needed > ratio * size:
        raise BadHeader(f"is cut short: {size} bytes cannot hold {width} x {height} pixels")
    return width, height


def _check_chunks(reader: _Reader, compression: int, height: int, multipart: bool) -> None:
    """Refuse a file of scan lines whose table or pixels are not all there."""
    count = -(-height // LINES[compression])
    table = reader.take(8 * count)
    first = reader.place
    head = 12 if multipart else 8  # the part's number, the first line, the number of bytes
    for (offset,) in struct.iter_unpack("<Q", table):
        if not first <= offset <= reader.size - head:
            raise BadHeader("is cut short: not all of its pixels are there")
        reader.go_to(offset)
        (length,) = struct.unpack("<i", reader.take(head)[-4:])
        if not 0 <= length <= reader.size - reader.place:
            raise BadHeader("is cut short: not all of its pixels are there")


class _Reader:
    """Takes bytes from a file, and never more than there are."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream = stream
        self.size = size
        self.place = 0

    def take(self, count: int) -> bytes:
        """Return the next bytes."""
        if not 0 <= count <= self.size - self.place:
            raise BadHeader("is cut short in its header")
        data = self._stream.read(count)
        if len(data) != count:
            raise BadHeader("is cut short in its header")
        self.place += count
        return data

    def text(self, longest: int) -> str:
        """Return the next text that ends with a zero byte."""
        found = bytearray()
        while (byte := self.take(1)) != b"\0":
            found += byte
            if len(found) > longest:
                raise BadHeader("is damaged: its header cannot be read")
        try:
            return found.decode()
        except UnicodeDecodeError as error:
            raise BadHeader("is damaged: its header cannot be read") from error

    def go_to(self, place: int) -> None:
        """Go on from another place."""
        self._stream.seek(place)
        self.place = place


def _read_part(reader: _Reader, long_names: bool) -> Part:
    """Read one header, up to and including the zero byte that ends it."""
    longest = LONG_NAME if long_names else SHORT_NAME
    attributes: dict[str, tuple[str, bytes]] = {}
    while name := reader.text(longest):
        kind = reader.text(longest)
        (count,) = struct.unpack("<i", reader.take(4))
        if not 0 <= count <= LARGEST_ATTRIBUTE or len(attributes) >= MOST_ATTRIBUTES or name in attributes:
            raise BadHeader("is damaged: its header cannot be read")
        attributes[name] = (kind, reader.take(count))
    return Part(attributes)
