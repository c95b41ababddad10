# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens when a scene with the Cycles Lens is rendered; `handlers` calls it."""

import bpy

from ...bake import baking
from ...core import messages
from ...core.errors import SceneError
from ...scene import frame_setup
from ..shared import disk_sync
from . import foreground, lens_disk, lens_objects, lens_shader, lens_sync

# The devices of scenes that are rendered on the CPU in place of a GPU, to be set back.
_devices: dict[str, str] = {}


def begin(scene: bpy.types.Scene) -> None:
    """A render begins.

    Raises
    ------
    SceneError
        It cannot be rendered like this.
    """
    lens_sync.check(scene)
    disk_sync.refresh(scene)
    problem = lens_shader.device_problem(scene)
    if problem is not None:
        if not scene.umbra.cpu_fallback:
            raise SceneError(problem)
        messages.warn(f"{problem} This render is made on the CPU.")
        _devices[scene.name] = scene.cycles.device
        scene.cycles.device = "CPU"


def end(scene: bpy.types.Scene) -> None:
    """The render is over: the viewport sees the scene again, and needs no map."""
    device = _devices.pop(scene.name, None)
    if device is not None:
        scene.cycles.device = device
    lens_sync.show_live(scene)


def take_away(scene: bpy.types.Scene) -> None:
    """Let neither camera nor disk show anything until `provide` has seen to the frame."""
    lens_sync.break_camera(scene)
    lens_disk.point_at_nothing(scene)


def forget() -> None:
    """Drop what was to be set back, in a file that is gone."""
    _devices.clear()


def provide(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: frame_setup.Shot) -> None:
    """Make sure that the camera of the frame being rendered has the right parameters, and its map.

    Raises
    ------
    physics.BlackHoleError
        There is no map and it may not, or cannot, be baked; or the camera cannot bend its rays; or the disk's settings
        are animated in a way that cannot be followed.
    """
    for path, parameters in baking.maps_of(scene, frame):
        baking.provide_map(scene, path, parameters, frame.frame)
    if lens_disk.is_in_use(scene):
        disk_sync.check_shot(scene, frame.parameters)
        lens_disk.point_at_passes(scene)
    for warning in lens_objects.warnings(scene, depsgraph, frame):
        messages.warn(warning)
    if scene.umbra.foreground_scene is not None:
        foreground.copy_lens(scene.umbra.foreground_scene, scene.camera.evaluated_get(depsgraph).data)
    lens_sync.show(scene, frame, baking.path_of(scene, frame) if lens_sync.uses_maps(scene) else None)
