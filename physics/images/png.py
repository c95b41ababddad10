# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing 8-bit PNG pictures, for looking at results without Blender."""

from __future__ import annotations

import struct
import zlib
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .exr import PathLike, replacing


def srgb_from_linear(linear: ArrayLike) -> NDArray[np.uint8]:
    """Return 8-bit sRGB values of linear Rec. 709 values, clipped to [0, 1] (IEC 61966-2-1).

    Parameters
    ----------
    linear : array_like

    Returns
    -------
    ndarray of uint8
        Of the same shape.
    """
    value = np.clip(np.nan_to_num(np.asarray(linear, dtype=np.float64)), 0.0, 1.0)
    encoded = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1.0 / 2.4) - 0.055)
    levels: NDArray[np.uint8] = np.round(encoded * 255.0).astype(np.uint8)
    return levels


def write_png(path: PathLike, linear: ArrayLike) -> None:
    """Write a picture as an 8-bit sRGB PNG, completely or not at all.

    Parameters
    ----------
    path : path
        Its folder is made if need be.
    linear : array_like, shape (height, width, 3 or 4)
        Linear Rec. 709, row 0 at the top. Alpha is ignored.

    Raises
    ------
    ImageFileError
        If the file cannot be written.
    """
    pixels = srgb_from_linear(np.asarray(linear)[:, :, :3])
    height, width = pixels.shape[:2]
    # Each row is preceded by its filter type, 0: none (PNG specification, section 9).
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        _write_chunk(file, b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
        _write_chunk(file, b"IDAT", zlib.compress(rows.tobytes(), 6))
        _write_chunk(file, b"IEND", b"")


def _write_chunk(file: BinaryIO, kind: bytes, data: bytes) -> None:
    checksum = struct.pack(">I", zlib.crc32(kind + data))
    file.write(struct.pack(">I", len(data)) + kind + data + checksum)
