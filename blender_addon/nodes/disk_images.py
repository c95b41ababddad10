# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk's small pictures, made with numpy and packed into the file: a table of colors, and the streaks.

The table is a column of pixels, its first value at the top.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import color_spaces
from ..core.physics_api import physics
from ..settings.typed import DiskSettings

FloatArray: TypeAlias = NDArray[np.float64]

COLORS_NAME, TEXTURE_NAME = "Umbra Disk Colors", "Umbra Disk Streaks"

COLOR_ROWS = physics.DISK_COLOR_COUNT  # as many as the numpy renderer interpolates between

# Pictures are scaled down to this before their means are taken.
MEANS_SIZE = 512

# A table in files whose node group is of version 1.
FORMER_PROFILE_NAME = "Umbra Disk Profile"

# Values are rounded to these steps, which are too fine to see, to keep the file small.
TEXTURE_STEPS = 256

# Custom property of a picture that says what it was made from.
_MADE_FROM = "umbra_made_from"

# Which law the colors follow; tables of older files do not name one.
_COLOR_LAW = "CIE 1931"


def ensure_colors() -> bpy.types.Image:
    """Return the table of the colors of black bodies, evenly spaced in ln(T), as an image."""

    def pixels() -> FloatArray:
        kelvin = np.geomspace(physics.COLDEST_DISK, physics.HOTTEST_DISK, COLOR_ROWS)
        return color_spaces.to_scene_linear(physics.disk_color(kelvin))[:, None, :]

    red, _green, _blue = color_spaces.to_scene_linear(np.eye(3)).round(3).tolist()
    space = "" if red == [1.0, 0.0, 0.0] else f" {red}"
    return _ensure(COLORS_NAME, f"{COLOR_ROWS}{space} {_COLOR_LAW}", pixels)


def streaks() -> FloatArray:
    """Return the default streaks and clumps of the disk, shape (rows, columns, 2), 0 to 1."""
    rounded: FloatArray = np.round(physics.disk_texture() * TEXTURE_STEPS) / TEXTURE_STEPS
    return rounded


def ensure_texture() -> bpy.types.Image:
    """Return the default streaks as an image, packed as half floats, which represent the steps exactly."""
    image = bpy.data.images.get(TEXTURE_NAME)
    if image is not None and image.packed_file is not None:
        return image
    values = streaks()
    pixels = np.zeros((*values.shape[:2], 3), np.float16)
    pixels[..., :2] = values
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "umbra_disk_streaks.exr")
        physics.write_exr(path, pixels)
        image = bpy.data.images.load(str(path))
        image.pack()
    image.name = TEXTURE_NAME
    color_spaces.mark_as_data(image)
    # A file that is passed on must not contain paths of this computer.
    image.filepath_raw = f"//{path.name}"
    for packed in image.packed_files:
        packed.filepath = image.filepath_raw
    return image


def _ensure(name: str, made_from: str, pixels: Callable[[], FloatArray]) -> bpy.types.Image:
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
        color_spaces.mark_as_data(image)
    image.pixels.foreach_set(full[::-1].ravel())
    image.update()
    image.pack()
    image[_MADE_FROM] = made_from
    return image


def mean_of_rows(image: bpy.types.Image) -> FloatArray | None:
    """Average the rows of an image.

    Parameters
    ----------
    image : bpy.types.Image
        Any image; it is scaled down to `MEANS_SIZE` at most first.

    Returns
    -------
    array of shape (rows, 4), or None
        RGBA of the rows from the top, premultiplied and scene-linear. None if the image has no pixels.
    """
    if min(image.size) <= 0:
        return None
    small = image.copy()
    try:
        small.scale(*(min(each, MEANS_SIZE) for each in image.size))
        values = np.empty(len(small.pixels), np.float32)
        small.pixels.foreach_get(values)
        pixels = values.reshape(small.size[1], small.size[0], -1)[::-1]
        if pixels.shape[2] == 3:
            pixels = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=-1)
        if not image.is_float:  # byte images have the file's values: not linear, not premultiplied
            if color_spaces.is_srgb(image):
                color = pixels[..., :3]
                linear = ((color + 0.055) / 1.055) ** 2.4
                pixels[..., :3] = np.where(color <= 0.04045, color / 12.92, linear)
            pixels[..., :3] *= pixels[..., 3:]
        means: FloatArray = pixels.mean(axis=1).astype(np.float64)
        return means
    finally:
        bpy.data.images.remove(small)


def remove_unused() -> None:
    """Remove the pictures that nothing uses."""
    for image in list(bpy.data.images):
        if image.name.startswith((FORMER_PROFILE_NAME, COLORS_NAME, TEXTURE_NAME)) and image.users == 0:
            bpy.data.images.remove(image)


@dataclass(frozen=True)
class Picture:
    """A picture that the node group looks up."""

    socket: str
    """The group's input."""
    description: str
    role: str
    """Of the Image node, see `outputs.shared.compositor_tree`."""
    image: Callable[[DiskSettings], bpy.types.Image]
    """Returns the image for the disk's settings, and makes it if need be."""


PICTURES = {
    "colors": Picture(
        "Colors",
        "Table of the colors of hot bodies (Non-Color)",
        "disk_colors",
        lambda _settings: ensure_colors(),
    ),
    "texture": Picture(
        "Texture",
        "Azimuth across, from the inner edge down: streaks in red and clumps in green, or a picture of the disk",
        "disk_texture",
        lambda settings: settings.texture or ensure_texture(),
    ),
}
"""Field of `disk_nodes.DiskInputs` -> the picture."""
