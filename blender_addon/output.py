# SPDX-License-Identifier: GPL-3.0-or-later
"""The switch between the two outputs: the compositor, and the camera that bends its rays."""

import bpy

from . import compositing, disk_sync, foreground, lens_camera, lens_disk, lens_shader, lens_sync, messages, shot
from ._physics import physics
from .compositor_tree import find_setup, find_tree
from .errors import SceneError
from .properties import COMPOSITOR, CYCLES_LENS

# On the scene, while the lens is on: what to put back.
BEFORE = "umbra_lens_before"

# The scene's settings and the group's sockets that say the same.
SHARED = {
    "redshift_colour": "Redshift Colour",
    "redshift_brightness": "Redshift Brightness",
    "sky_temperature": "Sky Temperature",
}

_switching = False


def switch(scene: bpy.types.Scene, wanted: str) -> list[str]:
    """Choose the output of a scene and set it up; return what the artist should know.

    Raises
    ------
    SceneError
        The scene cannot be rendered that way; it stays as it is.
    """
    global _switching
    if scene.library is not None:
        raise SceneError(f'Scene "{scene.name}" is linked from another file: open that one.')
    notes = _to_lens(scene) if wanted == CYCLES_LENS else _to_compositor(scene)
    _switching = True
    try:
        scene.umbra.output = wanted
    finally:
        _switching = False
    if wanted == CYCLES_LENS:
        lens_sync.show_live(scene)
        disk_sync.refresh(scene)
    return notes


def on_switched(scene: bpy.types.Scene) -> None:
    """The artist, or a script, has changed the setting itself: follow it, or set it back with a message."""
    global _switching
    if _switching:
        return
    wanted = scene.umbra.output
    try:
        for note in switch(scene, wanted):
            messages.warn(note)
    except physics.BlackHoleError as error:
        messages.warn(str(error))
        messages.popup(str(error))
        _switching = True
        try:
            scene.umbra.output = COMPOSITOR if wanted == CYCLES_LENS else CYCLES_LENS
        finally:
            _switching = False


def _to_lens(scene: bpy.types.Scene) -> list[str]:
    lens_sync.check(scene)
    tree, hole = find_tree(scene), shot.find_active_hole(scene)
    if tree is not None and hole is not None and hole.umbra.disk.enabled:
        compositing.check_shared(scene, tree)
    lens_sync.camera_of(scene)
    lens_shader.bytecode(uses_map=False)
    for camera in lens_camera.cameras_of(scene):
        lens_camera.convert(camera)
    if BEFORE not in scene:
        setup = find_setup(scene)
        look = _look(setup.group) if setup is not None else {}
        for name, socket in SHARED.items():
            if socket in look:
                setattr(scene.umbra, name, look[socket])
        in_compositor = setup is not None or compositing.BEFORE in scene
        if in_compositor:
            compositing.remove(scene)
        scene[BEFORE] = {
            "in_compositor": in_compositor,
            "look": look,
            "use_lock_interface": scene.render.use_lock_interface,
        }
        scene.render.use_lock_interface = True  # maps are baked by handlers while rendering
    return []


def _to_compositor(scene: bpy.types.Scene) -> list[str]:
    lens_disk.take_out(scene)
    foreground.remove(scene)
    for camera in lens_camera.cameras_of(scene):
        lens_camera.restore(camera)
    if BEFORE not in scene:
        return []
    before = scene[BEFORE].to_dict()
    scene.render.use_lock_interface = bool(before["use_lock_interface"])
    notes = []
    if before["in_compositor"]:
        notes = compositing.set_up(scene)
        setup = find_setup(scene)
        if setup is not None:
            look = before["look"] | {socket: getattr(scene.umbra, name) for name, socket in SHARED.items()}
            for name, value in look.items():
                if name in setup.group.inputs and not setup.group.inputs[name].is_linked:
                    setup.group.inputs[name].default_value = value
    del scene[BEFORE]
    return notes


def _look(group: bpy.types.Node) -> dict[str, object]:
    """The values that the artist has given the compositor's group."""
    look: dict[str, object] = {}
    for socket in group.inputs:
        if not socket.is_linked and socket.type in {"VALUE", "VECTOR", "ROTATION"}:
            value = socket.default_value
            look[socket.name] = value if isinstance(value, float) else tuple(value)
    return look
