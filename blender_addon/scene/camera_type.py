# SPDX-License-Identifier: GPL-3.0-or-later
"""The type of a camera as the artist chose it, also while an output has made another type of it."""

import bpy

# On the camera's data: what it was before it was converted.
BEFORE = "umbra_lens_before"

CUSTOM = "CUSTOM"


def is_converted(camera: bpy.types.Camera) -> bool:
    """Return whether the camera bends its rays by this add-on's shader."""
    return camera.type == CUSTOM and BEFORE in camera


def original_type(camera: bpy.types.Camera) -> str:
    """Return the type of the camera; for a converted one, the type before."""
    return str(camera[BEFORE]["type"]) if is_converted(camera) else camera.type
