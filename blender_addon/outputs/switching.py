# SPDX-License-Identifier: GPL-3.0-or-later
"""The switch between the outputs: the compositor, the camera that bends its rays, and the World."""

import bpy

from ..core import messages
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..preview import live_preview
from ..scene import frame_setup
from ..settings.scene_properties import COMPOSITOR, CYCLES_LENS, WORLD
from .compositor import compositing
from .lens import foreground, lens_camera, lens_disk, lens_shader, lens_sync
from .shared import disk_sync
from .shared.compositor_tree import find_setup, find_tree
from .world import lensed_world, world_sync

# On the scene, while its output is another than the compositor: what to put back.
BEFORE = "umbra_lens_before"

# The scene's settings and the group's sockets that say the same.
SHARED = {
    "redshift_color": "Redshift Color",
    "redshift_brightness": "Redshift Brightness",
    "sky_temperature": "Sky Temperature",
}

# What the image of a lensed World is placed by, and the sockets of the compositor's group that say the same.
PLACEMENT = {"Rotation": "Environment Rotation", "Strength": "Environment Strength"}
CARRIED = ("Exposure", *PLACEMENT.values())

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
    notes = {COMPOSITOR: _to_compositor, CYCLES_LENS: _to_lens, WORLD: _to_world}[wanted](scene)
    _switching = True
    try:
        scene.umbra.output = wanted
    finally:
        _switching = False
    if wanted == CYCLES_LENS:
        lens_sync.show_live(scene)
        disk_sync.refresh(scene)
    if wanted == WORLD:
        world_sync.refresh(scene)
    live_preview.on_output_switched(scene)
    return notes


def present(scene: bpy.types.Scene) -> str:
    """The output that the scene is set up for."""
    if lensed_world.IS_BENT in scene:
        return WORLD
    return CYCLES_LENS if BEFORE in scene else COMPOSITOR


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
            scene.umbra.output = present(scene)
        finally:
            _switching = False


def _to_lens(scene: bpy.types.Scene) -> list[str]:
    lens_sync.check(scene)
    tree, hole = find_tree(scene), frame_setup.find_active_hole(scene)
    if tree is not None and hole is not None and hole.umbra.disk.enabled:
        compositing.check_shared(scene, tree)
    lens_sync.camera_of(scene)
    lens_shader.bytecode(uses_map=False)
    for camera in lens_camera.cameras_of(scene):
        lens_camera.convert(camera)
    look = _leave_world(scene)
    _leave_compositor(scene)
    for name, socket in SHARED.items():
        if socket in look:
            setattr(scene.umbra, name, look[socket])
    return []


def _to_world(scene: bpy.types.Scene) -> list[str]:
    is_new = lensed_world.lensed_world(scene) is None
    node = lensed_world.install(scene)
    lens_disk.take_out(scene)
    foreground.remove(scene)
    for camera in lens_camera.cameras_of(scene):
        lens_camera.restore(camera)
    _leave_compositor(scene)
    if not is_new:  # the artist's own values stay
        return []
    look = scene[BEFORE].to_dict()["look"]
    world_sync.set_inputs(node, look)
    if PLACEMENT["Rotation"] in look:
        lensed_world.place(scene, look[PLACEMENT["Rotation"]], look[PLACEMENT["Strength"]])
    world_sync.set_inputs(node, {socket: getattr(scene.umbra, name) for name, socket in SHARED.items()})
    return []


def _leave_world(scene: bpy.types.Scene) -> dict[str, float]:
    """Put the scene's World back; return the values that the artist has given the group."""
    node = lensed_world.group_node(lensed_world.lensed_world(scene))
    look = {} if node is None else world_sync.inputs_of(node)
    look |= {PLACEMENT[name]: value for name, value in lensed_world.placement(scene).items()}
    lensed_world.remove(scene)
    return look


def _leave_compositor(scene: bpy.types.Scene) -> None:
    """Take the set-up out of the compositor, unless another output has done so before."""
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


def _to_compositor(scene: bpy.types.Scene) -> list[str]:
    lens_disk.take_out(scene)
    foreground.remove(scene)
    for camera in lens_camera.cameras_of(scene):
        lens_camera.restore(camera)
    world_look = _leave_world(scene)
    for name, socket in SHARED.items():
        if socket in world_look:
            setattr(scene.umbra, name, world_look[socket])
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
            look |= {name: world_look[name] for name in CARRIED if name in world_look}
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
