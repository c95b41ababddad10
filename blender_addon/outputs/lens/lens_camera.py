# SPDX-License-Identifier: GPL-3.0-or-later
"""Turn a camera into one that bends its rays (Cycles' type Custom), and back exactly.

The camera's own settings (focal length, sensor, shift, panorama, depth of field) stay where they are: a custom camera
ignores them, and the shader is given what they say. Only what is written over is remembered, in the camera itself.
"""

import bpy

from ...core.errors import SceneError
from ...scene.camera_type import BEFORE, CUSTOM, is_converted

SHADER_BEFORE = "umbra_lens_shader_before"  # a pointer cannot lie among other values

_REMEMBERED = ("type", "custom_mode", "custom_filepath", "custom_bytecode", "custom_bytecode_hash")


def cameras_of(scene: bpy.types.Scene) -> list[bpy.types.Camera]:
    """The data of the cameras that the scene renders with: the active one, and those its markers bind."""
    objects = [scene.camera, *(marker.camera for marker in scene.timeline_markers)]
    return list(dict.fromkeys(each.data for each in objects if each is not None and each.type == "CAMERA"))


def check(camera: bpy.types.Camera) -> None:
    """Refuse a camera that cannot be converted.

    Raises
    ------
    SceneError
        If the camera is linked from another file.
    """
    if not is_converted(camera) and camera.library is not None:
        raise SceneError(
            f'Camera "{camera.name}" is linked from another file: make it local first.', code="settings.linked"
        )


def convert(camera: bpy.types.Camera) -> None:
    """Make a camera Custom, its settings kept; nothing happens to one that is.

    Raises
    ------
    SceneError
        The camera is linked from another file.
    """
    if is_converted(camera):
        return
    check(camera)
    forget(camera)
    before: dict[str, object] = {name: getattr(camera, name) for name in _REMEMBERED}
    # Before 5.0 the group itself is a custom property, made when it is first looked at.
    before["has_parameters"] = "cycles_custom" in camera
    before["parameters"] = {name: _plain(value) for name, value in camera.cycles_custom.items()}
    camera[BEFORE] = before
    if camera.custom_shader is not None:
        camera[SHADER_BEFORE] = camera.custom_shader
        camera.custom_shader = None
    for name in list(camera.cycles_custom.keys()):
        del camera.cycles_custom[name]
    camera.type = CUSTOM


def restore(camera: bpy.types.Camera) -> None:
    """Make a camera what it was before `convert`; one whose type was changed by hand since then keeps that type."""
    if BEFORE not in camera:
        return
    before = camera[BEFORE].to_dict()
    kept_type = None if is_converted(camera) else camera.type
    for name in list(camera.cycles_custom.keys()):
        del camera.cycles_custom[name]
    for name, value in before["parameters"].items():
        camera.cycles_custom[name] = value
    # Setting any of these makes Blender compile the shader again, also with the value that is there.
    wanted = {name: before[name] for name in _REMEMBERED} | {"custom_shader": camera.get(SHADER_BEFORE)}
    for name, value in wanted.items():
        if getattr(camera, name) != value:
            setattr(camera, name, value)
    if kept_type is not None:
        camera.type = kept_type
    if not before["has_parameters"] and "cycles_custom" in camera:
        del camera["cycles_custom"]
    forget(camera)


def forget(camera: bpy.types.Camera) -> None:
    """Drop what is remembered."""
    for key in (BEFORE, SHADER_BEFORE):
        if key in camera:
            del camera[key]


def _plain(value: object) -> object:
    """A custom property's value as Python's own."""
    return value.to_list() if hasattr(value, "to_list") else value
