# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR files to be spoiled: small ones of every kind, and where their pieces begin."""

import random
import struct

import numpy as np
import OpenEXR

COMPRESSIONS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB")
LINES = dict(zip(COMPRESSIONS, (1, 1, 1, 16, 32, 16, 32, 32, 32, 256), strict=True))
SIZE = (24, 40)  # width, height

# What counts and sizes are replaced by.
ODD_NUMBERS = (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFF0, 100_000, 65536)


def planes(names="RGBA", kind=np.float32, seed=0):
    values = np.random.default_rng(seed)
    return {name: (10.0 * values.random(SIZE[::-1])).astype(kind) for name in names}


def written(path, channels, **header):
    with OpenEXR.File({"type": OpenEXR.scanlineimage, **header}, channels) as file:
        file.write(str(path))
    return path.read_bytes()


def every_kind(folder):
    """Bytes of a picture in each compression, tiled, in two parts, and deep, by name."""
    path = folder / "kind.exr"
    found = {
        f"{name} {np.dtype(kind).name}": written(path, planes(kind=kind), compression=compression(name))
        for name in COMPRESSIONS
        for kind in (np.float16, np.float32)
    }
    found["tiled"] = written(path, planes(), type=OpenEXR.tiledimage, tiles=OpenEXR.TileDescription())
    found["multipart"] = multipart(path, 2)
    found["deep"] = deep(path)
    return found


def compression(name):
    return getattr(OpenEXR, f"{name}_COMPRESSION")


def multipart(path, count):
    parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage}, planes(), f"part {i}") for i in range(count)]
    with OpenEXR.File(parts) as file:
        file.write(str(path))
    return path.read_bytes()


def deep(path):
    samples = np.empty(SIZE[::-1], dtype=object)
    for place in np.ndindex(samples.shape):
        samples[place] = np.arange(2, dtype=np.float32)
    return written(path, {"Z": samples}, type=OpenEXR.deepscanline, compression=OpenEXR.ZIPS_COMPRESSION)


def attributes(data):
    """(name, where it begins, where its value begins, where it ends) of the attributes of a file's first header."""
    found, place = [], 8
    while data[place]:
        begin = place
        place = data.index(b"\0", place) + 1
        name = data[begin : place - 1].decode()
        place = data.index(b"\0", place) + 1
        (size,) = struct.unpack_from("<i", data, place)
        found.append((name, begin, place + 4, place + 4 + size))
        place += 4 + size
    return found


def chunks(data, lines, height=SIZE[1]):
    """Where the table of chunks begins and where the chunks of a file of one part do."""
    table = attributes(data)[-1][3] + 1
    count = -(-height // lines)
    return table, list(struct.unpack_from(f"<{count}Q", data, table))


def with_value(data, name, value):
    """The file with the value of an attribute replaced by one of the same size."""
    begin, end = next((begin, end) for each, _, begin, end in attributes(data) if each == name)
    assert end - begin == len(value)
    return data[:begin] + value + data[end:]


def with_window(data, *box):
    """The file with other windows: left, top, right, bottom."""
    value = struct.pack("<4i", *box)
    return with_value(with_value(data, "dataWindow", value), "displayWindow", value)


def spoiled(data, source: random.Random):
    """The file with a few bytes changed, put in, or cut off, mostly in its header."""
    result = bytearray(data)
    for _ in range(source.choice((1, 1, 1, 2, 5))):
        place = source.randrange(4, min(len(result), 450) if source.random() < 0.7 else len(result))
        how = source.random()
        if how < 0.3:
            result[place] = source.randrange(256)
        elif how < 0.5:
            result[place] ^= 1 << source.randrange(8)
        elif how < 0.8:
            result[place : place + 4] = struct.pack("<I", source.choice(ODD_NUMBERS))
        elif how < 0.9:
            result[place:place] = source.randbytes(source.randrange(1, 20))
        else:
            del result[max(place, 5) :]
        if len(result) < 6:
            break
    return bytes(result)
