# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk's small pictures, made by numpy and packed into the file: two tables, and the streaks.

Tables are a column of pixels, their first value at the top.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ._physics import disk_flux, disk_look, disk_texture, exr

PROFILE_NAME, COLOURS_NAME, TEXTURE_NAME = "Umbra Disk Profile", "Umbra Disk Colours", "Umbra Disk Streaks"

# Enough that values between rows are off by less than 1e-5 of the largest.
PROFILE_ROWS = 2048
COLOUR_ROWS = disk_look.COLOURS  # those of numpy itself, between which it interpolates too

# Values are rounded to these steps, far finer than anything to be seen: the file stays small.
TEXTURE_STEPS = 256

# What a picture was made from, on the picture itself.
_MADE_FROM = "umbra_made_from"


def profile(name: str, exponent: float, spin: float, inner: float, outer: float, retrograde: bool) -> NDArray:
    """Flux relative to its largest at radii evenly spaced in ln(r) from the inner to the outer edge."""
    radii = np.geomspace(inner, outer, PROFILE_ROWS)
    return disk_flux.relative_flux(name, spin, radii, inner, exponent, retrograde)


def ensure_profile(
    hole_name: str, name: str, exponent: float, spin: float, inner: float, outer: float, retrograde: bool
) -> bpy.types.Image:
    """The table of the profile of a hole's disk, as an image; each hole has one of its own."""
    wanted = repr((name, exponent, spin, inner, outer, retrograde))

    def pixels() -> NDArray:
        flux = profile(name, exponent, spin, inner, outer, retrograde)
        return np.repeat(flux[:, None, None], 3, axis=2)

    return _ensure(f"{PROFILE_NAME} ({hole_name})", wanted, pixels)


def ensure_colours() -> bpy.types.Image:
    """The table of the colours of black bodies, evenly spaced in ln(T), as an image."""

    def pixels() -> NDArray:
        kelvin = np.geomspace(disk_look.COLDEST, disk_look.HOTTEST, COLOUR_ROWS)
        return disk_look.seen_colour(kelvin)[:, None, :]

    return _ensure(COLOURS_NAME, f"{COLOUR_ROWS}", pixels)


def streaks() -> NDArray:
    """The streaks and clumps that the disk has by default, shape (rows, columns, 2), 0 to 1."""
    return np.round(disk_texture.disk_texture() * TEXTURE_STEPS) / TEXTURE_STEPS


def ensure_texture() -> bpy.types.Image:
    """The default streaks as an image, packed as half floats, which hold their steps exactly."""
    image = bpy.data.images.get(TEXTURE_NAME)
    if image is not None and image.packed_file is not None:
        return image
    values = streaks()
    pixels = np.zeros((*values.shape[:2], 3), np.float16)
    pixels[..., :2] = values
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "umbra_disk_streaks.exr")
        exr.write_exr(path, pixels)
        image = bpy.data.images.load(str(path))
        image.pack()
    image.name = TEXTURE_NAME
    image.colorspace_settings.name = "Non-Color"
    # no path of this computer in a file that may be passed on
    image.filepath_raw = f"//{path.name}"
    for packed in image.packed_files:
        packed.filepath = image.filepath_raw
    return image


def _ensure(name: str, made_from: str, pixels: Callable[[], NDArray]) -> bpy.types.Image:
    image = bpy.data.images.get(name)
    if image is not None and image.get(_MADE_FROM) == made_from and image.packed_file is not None:
        return image
    values = pixels()
    full = np.ones((*values.shape[:2], 4), np.float32)
    full[..., :3] = values
    if image is None or tuple(image.size) != (full.shape[1], full.shape[0]):
        if image is not None:
            image.name = f"{name} (former)"
        image = bpy.data.images.new(name, full.shape[1], full.shape[0], float_buffer=True)
        image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(full[::-1].ravel())
    image.update()
    image.pack()
    image[_MADE_FROM] = made_from
    return image


def remove_unused() -> None:
    """Remove those of the pictures that nothing uses any more."""
    for image in list(bpy.data.images):
        if image.name.startswith((PROFILE_NAME, COLOURS_NAME, TEXTURE_NAME)) and image.users == 0:
            bpy.data.images.remove(image)
