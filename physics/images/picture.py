# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading pictures of any common format as linear Rec. 709: OpenEXR by itself, the others by OpenImageIO.

Blender has OpenImageIO, as a module of its own Python; elsewhere it is a package.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numerics.errors import ImageFileError
from . import exr_header, openimageio_library
from .chromaticities import to_rec709
from .exr import PathLike, read_beginning, read_exr
from .file_names import is_text

# The value of OpenEXR's attribute `envmap` for six sides of a cube; 0 is latitude and longitude.
CUBE = 1

# Rows decoded at a time: the table's result is as large as they are.
ROWS = 256


def read_picture(path: PathLike) -> NDArray[np.float32]:
    """Read a picture as linear Rec. 709.

    Parameters
    ----------
    path : path
        OpenEXR, whose chromaticities are honored; or Radiance (.hdr), PNG, JPEG, TIFF and whatever else OpenImageIO
        reads. Whole numbers are taken as sRGB (IEC 61966-2-1), floating-point ones as linear.

    Returns
    -------
    ndarray of float32, shape (height, width, 3 or 4)
        R, G, B(, A), row 0 at the top. Gray pictures are read as R = G = B.

    Raises
    ------
    ImageFileError
        If the file is missing, damaged, a cube map, or of a format that cannot be read here.
    """
    if read_beginning(path, len(exr_header.MAGIC)) == exr_header.MAGIC or Path(path).suffix.lower() == ".exr":
        return _read_exr(path)
    return _read_by_image_io(path)


def _read_exr(path: PathLike) -> NDArray[np.float32]:
    pixels, header = read_exr(path)
    if int(header.get("envmap", 0)) == CUBE:
        raise ImageFileError(
            f"{path} is a cube map; convert it to an equirectangular panorama (latitude and longitude).",
            code="file.cube-map",
        )
    primaries = header.get("chromaticities")
    if primaries is None:
        return pixels
    try:
        matrix = to_rec709(primaries)
    except (TypeError, ValueError) as error:
        raise ImageFileError(
            f"{path} is in colors that cannot be: {error}; save it with other chromaticities.", code="file.bad-exr"
        ) from error
    if matrix is not None:
        for row in pixels:
            row[:, :3] = row[:, :3].astype(np.float64) @ matrix.T
    return pixels


def _read_by_image_io(path: PathLike) -> NDArray[np.float32]:
    library = image_io()
    if library is None:
        raise ImageFileError(
            f"{path} is not an OpenEXR file; to read other formats, install OpenImageIO (pip install OpenImageIO).",
            code="file.no-reader",
        )
    if not is_text(path):
        raise ImageFileError(f"{path} has a name that is no UTF-8; rename it.", code="file.no-access")
    as_stored = library.ImageSpec()
    as_stored.attribute("oiio:UnassociatedAlpha", 1)
    source = library.ImageInput.open(os.fspath(path), as_stored)
    if source is None:
        raise ImageFileError(f"{path} {_complaint(library.geterror())}.", code="file.bad-picture")
    try:
        spec = source.spec()
        if not exr_header.fits(spec.width, spec.height):
            raise ImageFileError(
                f"{path} is {spec.width} x {spec.height} pixels large, which is more than can be read here.",
                code="file.bad-picture",
            )
        whole_numbers = np.dtype(str(spec.format).replace("half", "float16")).kind in "iu"
        kept = {1: [0, 0, 0], 2: [0, 0, 0, 1], 3: [0, 1, 2]}.get(spec.nchannels, [0, 1, 2, 3])
        pixels: Any = source.read_image(0, 0, 0, spec.nchannels, "float")
        if pixels is None:
            raise ImageFileError(f"{path} {_complaint(source.geterror())}.", code="file.bad-picture")
    finally:
        source.close()
    picture: NDArray[np.float32] = np.ascontiguousarray(
        np.asarray(pixels, np.float32).reshape(spec.height, spec.width, spec.nchannels)[..., kept]
    )
    if whole_numbers:
        for start in range(0, len(picture), ROWS):
            colors = picture[start : start + ROWS, :, :3]
            colors[:] = linear_from_srgb(colors)
    return picture


def linear_from_srgb(encoded: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return linear values of sRGB ones from 0 to 1 (IEC 61966-2-1).

    Parameters
    ----------
    encoded : ndarray

    Returns
    -------
    ndarray of float64
        Of the same shape.
    """
    value = encoded.astype(np.float64)
    linear: NDArray[np.float64] = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return linear


def image_io() -> Any:
    """Return OpenImageIO, or None where there is none: the package, or the one that Blender's package contains."""
    try:
        return openimageio_library.find()
    except ImportError:
        return None


def _complaint(text: str) -> str:
    """Return what the library says, as the end of a sentence."""
    lines = text.strip().splitlines()
    return f"cannot be read as a picture ({lines[0].rstrip('.')})" if lines else "cannot be read as a picture"
