# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk's small pictures, made by numpy and packed into the file: a table of colors, and the streaks.

The table is a column of pixels, its first value at the top.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.physics_api import disk_look, disk_texture, exr

COLORS_NAME, TEXTURE_NAME = "Umbra Disk Colors", "Umbra Disk Streaks"

COLOR_ROWS = disk_look.COLORS  # those of numpy itself, between which it interpolates too

# Pictures are scaled down to this before their means are taken.
MEANS_SIZE = 512

# A table that files had whose node group was of version 1.
FORMER_PROFILE_NAME = "Umbra Disk Profile"

# Values are rounded to these steps, far finer than anything to be seen: the file stays small.
TEXTURE_STEPS = 256

# What a picture was made from, on the picture itself.
_MADE_FROM = "umbra_made_from"


def ensure_colors() -> bpy.types.Image:
    """The table of the colors of black bodies, evenly spaced in ln(T), as an image."""

    def pixels() -> NDArray:
        kelvin = np.geomspace(disk_look.COLDEST, disk_look.HOTTEST, COLOR_ROWS)
        return disk_look.seen_color(kelvin)[:, None, :]

    return _ensure(COLORS_NAME, f"{COLOR_ROWS}", pixels)


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


def mean_of_rows(image: bpy.types.Image) -> NDArray | None:
    """Means of an image's rows, from the top, premultiplied and scene-linear, shape (rows, 4); None without pixels."""
    if min(image.size) <= 0:
        return None
    small = image.copy()
    try:
        small.scale(*(min(each, MEANS_SIZE) for each in image.size))
        pixels = np.empty(len(small.pixels), np.float32)
        small.pixels.foreach_get(pixels)
        pixels = pixels.reshape(small.size[1], small.size[0], -1)[::-1]
        if pixels.shape[2] == 3:
            pixels = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)
        if not image.is_float:  # as it lies in the file
            if image.colorspace_settings.name == "sRGB":
                color = pixels[..., :3]
                linear = ((color + 0.055) / 1.055) ** 2.4
                pixels[..., :3] = np.where(color <= 0.04045, color / 12.92, linear)
            pixels[..., :3] *= pixels[..., 3:]
        return pixels.mean(axis=1).astype(np.float64)
    finally:
        bpy.data.images.remove(small)


def remove_unused() -> None:
    """Remove those of the pictures that nothing uses any more."""
    for image in list(bpy.data.images):
        if image.name.startswith((FORMER_PROFILE_NAME, COLORS_NAME, TEXTURE_NAME)) and image.users == 0:
            bpy.data.images.remove(image)
