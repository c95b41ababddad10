# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture that an artist has put on the disk, as the physics takes it."""

from __future__ import annotations

import bpy
import numpy as np

from ..core import color_spaces
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..settings.disk_properties import DENSITY, RAMP
from ..settings.typed import DiskSettings


def _none() -> dict[tuple[object, ...], physics.Picture]:
    return {}


# Pictures that were read, by what tells their images apart.
_known = SESSION.value(_none, Life.FILE)


def picture_of(settings: DiskSettings) -> physics.Picture | None:
    """Return the picture of a disk, or None if it has none.

    Raises
    ------
    SceneError
        If it cannot be read.
    """
    image = settings.texture
    if image is None:
        return None
    image = image.original if isinstance(image.original, bpy.types.Image) else image
    key = (*_key(image), settings.texture_use)
    if key not in _known.now:
        _known.now.clear()  # the one before, most likely
        _known.now[key] = physics.Picture(
            _pixels(image), is_color=settings.texture_use != DENSITY, is_ramp=settings.texture_use == RAMP
        )
    return _known.now[key]


def _key(image: bpy.types.Image) -> tuple[object, ...]:
    return image.session_uid, image.filepath, tuple(image.size), image.colorspace_settings.name, image.is_dirty


def _pixels(image: bpy.types.Image) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """Return an image's pixels, row 0 at the top, scene-linear and premultiplied, shape (rows, columns, 4)."""
    width, height = image.size
    if not width * height:
        raise SceneError(
            f'The picture "{image.name}" of the disk cannot be read: choose another one, or none, under Texture.',
            code="disk.picture",
        )
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    pixels = values.reshape(height, width, image.channels)[::-1]
    if image.channels < 3:
        pixels = np.repeat(pixels[..., :1], 3, axis=-1)
    if image.channels < 4:
        pixels = np.concatenate([pixels[..., :3], np.ones_like(pixels[..., :1])], axis=-1)
    pixels = pixels.copy()
    if not image.is_float:  # byte images have the file's values: not linear, not premultiplied
        if color_spaces.is_srgb(image):
            pixels[..., :3] = physics.linear_from_srgb(pixels[..., :3])
        pixels[..., :3] *= pixels[..., 3:]
    return pixels
