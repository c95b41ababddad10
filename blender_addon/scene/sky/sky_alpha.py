# SPDX-License-Identifier: GPL-3.0-or-later
"""The alpha of 8-bit skies, by which Cycles multiplies their colors before it decodes them."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.session import SESSION, Life
from . import sky_frames

# How images use their alpha where it darkens them.
_MODES = frozenset({"STRAIGHT", "PREMUL"})

# Images by name, file and size -> whether any alpha is less than 1.
_transparent = SESSION.value(dict[tuple[object, ...], bool], Life.FILE)


def counts(image: bpy.types.Image) -> bool:
    """Return whether an image that stands still is an 8-bit one with alpha."""
    if image.source not in {"FILE", "GENERATED"} or image.alpha_mode not in _MODES:
        return False
    key = (image.session_uid, image.filepath, *image.size, image.is_dirty)
    if key not in _transparent.now:
        _transparent.now[key] = _has_alpha(image)
    return _transparent.now[key]


def _has_alpha(image: bpy.types.Image) -> bool:
    width, height = image.size
    if image.is_float or image.channels != 4 or width * height == 0:
        return False
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    return bool(values[3::4].min() < 1.0)


def note(image: bpy.types.Image, *, may_load: bool) -> str | None:
    """Return a warning about an image sequence with alpha.

    The file that the sequence names stands for all. Where it must not be loaded, what is known of it counts.
    """
    if image.source != "SEQUENCE" or image.alpha_mode not in _MODES:
        return None
    key = (image.session_uid, image.filepath)
    if may_load and key not in _transparent.now:
        _transparent.now[key] = _first_has_alpha(image)
    if not _transparent.now.get(key, False):
        return None
    return (
        f'The sky image "{image.name}" has alpha, which darkens a sequence less here than in Cycles: give it files '
        "without alpha, or choose Output: World."
    )


def _first_has_alpha(image: bpy.types.Image) -> bool:
    path = sky_frames.path_of(image)
    if not path.is_file():
        return False
    first = bpy.data.images.load(str(path), check_existing=False)
    try:
        return _has_alpha(first)
    finally:
        bpy.data.images.remove(first)
