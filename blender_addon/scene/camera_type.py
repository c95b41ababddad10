# SPDX-License-Identifier: GPL-3.0-or-later
"""The type of a camera as the artist chose it, also while an output has made another type of it."""

import bpy

from ..core.errors import SceneError

# On the camera's data: what it was before it was converted.
BEFORE = "umbra_lens_before"

CUSTOM = "CUSTOM"


def is_converted(camera: bpy.types.Camera) -> bool:
    """Return whether the camera bends its rays by this add-on's shader."""
    return camera.type == CUSTOM and BEFORE in camera


def original_type(camera: bpy.types.Camera) -> str:
    """Return the type of the camera; for a converted one, the type before."""
    return str(camera[BEFORE]["type"]) if is_converted(camera) else camera.type


def check_unbent(scene: bpy.types.Scene) -> None:
    """Refuse a camera that bends its rays, in a scene whose output is not the lens.

    Raises
    ------
    SceneError
        Another scene, whose output is the lens, has the same camera, or the camera was copied from there.
    """
    camera = scene.camera
    if camera is not None and camera.type == "CAMERA" and is_converted(camera.data):
        raise SceneError(
            f'The camera "{camera.name}" of scene "{scene.name}" bends its rays for the Output: Cycles Lens of another '
            "scene: give this scene a camera of its own, with Type Perspective or Panoramic in the camera's Lens "
            "settings.",
            code="camera.bent",
        )
