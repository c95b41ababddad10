# SPDX-License-Identifier: GPL-3.0-or-later
"""Color spaces by what they are for. Their names are the color configuration's, and studios have their own."""

from functools import cache

import bpy
import numpy as np
from mathutils import Color
from numpy.typing import NDArray

# What the linear space with Rec.709's primaries is called: Blender's name, and words that other configurations use.
_LINEAR_REC709 = "Linear Rec.709"
_WORDS = ({"linear", "lin"}, {"rec.709", "rec709", "srgb"})

# How far Blender 4.5's own matrix, between two equal spaces, is from an identity.
_ROUNDING = 1e-4

Array = NDArray[np.float64]


def mark_as_data(image: bpy.types.Image) -> None:
    """Have an image's numbers read as they are."""
    if not image.colorspace_settings.is_data:
        image.colorspace_settings.is_data = True


def mark_as_linear_rec709(image: bpy.types.Image) -> bool:
    """Have an image's numbers read as linear Rec.709; return False where the configuration has no such space."""
    settings = image.colorspace_settings
    choices = settings.bl_rna.properties["name"]
    assert isinstance(choices, bpy.types.EnumProperty)
    names = choices.enum_items.keys()
    wanted = next((each for each in names if each == _LINEAR_REC709 or _is_linear_rec709(each)), None)
    if wanted is None:
        return False
    if settings.name != wanted:
        settings.name = wanted
    return True


def is_linear_rec709(image: bpy.types.Image) -> bool:
    """Return whether an image's numbers are linear Rec.709."""
    return _is_linear_rec709(image.colorspace_settings.name)


def _is_linear_rec709(name: str) -> bool:
    words = set(name.casefold().replace("_", " ").replace("(", " ").replace(")", " ").replace("-", " ").split())
    return all(words & each for each in _WORDS)


def is_srgb(image: bpy.types.Image) -> bool:
    """Return whether an image is encoded as pictures on screens are: in the configuration's space for 8-bit images."""
    return bool(image.colorspace_settings.name == _space_of_8_bits())


@cache
def _space_of_8_bits() -> str:
    """The space that the configuration, one for the process, gives to new images of 8 bits."""
    probe = bpy.data.images.new("Umbra Probe", 1, 1)
    try:
        return str(probe.colorspace_settings.name)
    finally:
        bpy.data.images.remove(probe)


def to_scene_linear(colors: Array) -> Array:
    """Return linear Rec.709 colors, shape (..., 3), in the space that Blender renders in."""
    rows = [Color(each).from_rec709_linear_to_scene_linear() for each in np.eye(3).tolist()]
    matrix = np.array([tuple(each) for each in rows])
    is_same = bool(np.abs(matrix - np.eye(3)).max() < _ROUNDING)
    return colors if is_same else colors @ matrix
