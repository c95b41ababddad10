# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says about a scene, from Blender and the maps' headers: cheap enough for drawing."""

import textwrap
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ..bake import baking, maps
from ..core.physics_api import metric, physics
from ..outputs.compositor.compositor_sync import takes_sky_from_settings
from ..outputs.lens import lens_objects, lens_shader, lens_sync
from ..outputs.shared.compositor_tree import find_setup
from ..outputs.world import world_sync
from ..scene import environment, frame_setup
from ..settings.hole_properties import CAMERA_ANIMATION

# How many characters a line of a panel shows: its width less margins and icon, over a character's mean width, in
# pixels at an interface scale of 1.
MARGIN, CHARACTER_WIDTH = 50.0, 6.0
SHORTEST_LINE, ORDINARY_LINE = 20, 40

# Seconds for which the number of maps in the folder is not counted anew.
COUNT_INTERVAL = 1.0
_counted: dict[tuple[object, ...], tuple[float, int]] = {}


@dataclass(frozen=True)
class Line:
    """A line of the panel."""

    text: str
    icon: str = "NONE"


def _line_width() -> int:
    region = bpy.context.region
    if region is None:
        return ORDINARY_LINE
    scale = bpy.context.preferences.system.ui_scale
    return max(int((region.width / scale - MARGIN) / CHARACTER_WIDTH), SHORTEST_LINE)


def wrapped(text: str, icon: str) -> tuple[Line, ...]:
    """A sentence as lines that fit the panel being drawn, the icon in front of the first."""
    parts = textwrap.wrap(text, _line_width())
    return tuple(Line(part, icon if index == 0 else "BLANK1") for index, part in enumerate(parts))


def sky_problem(scene: bpy.types.Scene) -> str | None:
    """Why the sky cannot be read, if so."""
    setup = find_setup(scene)
    if setup is not None and not takes_sky_from_settings(setup):
        return None
    try:
        environment.check_image(environment.read(scene).image)
    except physics.BlackHoleError as error:
        return str(error)
    return None


def lines(context: bpy.types.Context) -> tuple[Line, ...]:
    """The state of the scene's black hole at the current frame."""
    scene = context.scene
    if frame_setup.find_active_hole(scene) is None and scene.umbra.active_hole is None and not frame_setup.holes(scene):
        return wrapped("This scene has no black hole.", "INFO")
    try:
        # drawing must not step the scene to other frames, so the camera's own velocity is not measured here
        depsgraph = context.evaluated_depsgraph_get()
        now = frame_setup.read(scene, depsgraph, velocity=np.zeros(3))
        lensed = lens_sync.is_on(scene)
        if lensed:
            lens_sync.check(scene)
    except physics.BlackHoleError as error:
        return wrapped(str(error), "ERROR")
    found: list[Line] = []
    if lensed:
        found += _lens_lines(scene, depsgraph, now)
    elif world_sync.is_on(scene):
        found += _world_lines(scene, now)
    elif find_setup(scene) is None:
        found += wrapped("The compositor is not set up: a render shows no black hole.", "ERROR")
    for path, parameters in baking.maps_of(scene, now):
        found += _map_lines(scene, now, path, parameters)
    found += _place_lines(now)
    others = len(frame_setup.holes(scene)) - 1
    if others > 0:
        found += wrapped(f"{others} more black hole{'s' if others > 1 else ''} in this scene: not rendered.", "INFO")
    return tuple(found)


def _lens_lines(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, now: frame_setup.Shot) -> list[Line]:
    found: list[Line] = []
    problem = lens_shader.device_problem(scene)
    if problem is not None:
        found += wrapped(problem, "INFO" if scene.umbra.cpu_fallback else "ERROR")
    for warning in lens_objects.warnings(scene, depsgraph, now):
        found += wrapped(warning, "INFO")
    if frame_setup.active_hole(scene).umbra.motion == CAMERA_ANIMATION:
        found += wrapped("The viewport shows the lens without the camera's speed; a render has it.", "INFO")
    return found


def _world_lines(scene: bpy.types.Scene, now: frame_setup.Shot) -> list[Line]:
    found: list[Line] = []
    try:
        world_sync.check(scene)
    except physics.BlackHoleError as error:
        found += wrapped(str(error), "ERROR")
    for warning in world_sync.warnings(scene, now):
        found += wrapped(warning, "ERROR")
    return found


def _map_lines(
    scene: bpy.types.Scene, now: frame_setup.Shot, path: Path, parameters: "physics.WarpMapParameters"
) -> list[Line]:
    folder = maps.folder(scene)
    noun = maps.kind_of(path).noun
    found: list[Line] = []
    if not path.is_file():
        found += wrapped(f"This frame's {noun} is not baked.", "RADIOBUT_OFF")
    elif frame_setup.active_hole(scene).umbra.motion == CAMERA_ANIMATION:
        found += wrapped(f"This frame's {noun} is baked; rendering checks it.", "CHECKMARK")
    elif maps.is_fresh(path, parameters, thorough=False):
        found += wrapped(f"This frame's {noun} is up to date.", "CHECKMARK")
    else:
        found += wrapped(f"This frame's {noun} is out of date.", "FILE_REFRESH")
    frames = maps.frames_of(scene)
    found.append(Line(f"{_baked(scene, now, frames, path, parameters)} of {len(frames)} frames baked", "SEQUENCE"))
    if folder.is_temporary:
        found += wrapped("This file is not saved: its maps are in a temporary folder.", "INFO")
    return found


def _baked(
    scene: bpy.types.Scene, now: frame_setup.Shot, frames: range, path: Path, parameters: "physics.WarpMapParameters"
) -> int:
    size = parameters.map_size
    kind = maps.kind_of(path)
    key = (maps.folder(scene).path, maps.stem(scene, now.hole_name, size), frames, kind.noun)
    moment, number = _counted.get(key, (-COUNT_INTERVAL, 0))
    if time.monotonic() - moment >= COUNT_INTERVAL:
        number = maps.count_baked(scene, now.hole_name, size, frames, kind)
        if len(_counted) > 1:
            _counted.clear()
        _counted[key] = (time.monotonic(), number)
    return number


def _place_lines(now: frame_setup.Shot) -> list[Line]:
    parameters = now.parameters
    distance = now.distance
    found = [Line(f"Camera at {distance:.4g} M", "CAMERA_DATA")]
    polar_angle = float(np.arccos(np.clip(parameters.camera_position[2] / distance, -1.0, 1.0)))
    if distance < metric.ergosphere_radius(parameters.spin, polar_angle):
        found += wrapped("inside the ergosphere: nothing can be at rest here", "INFO")
    elif distance < metric.isco_radius(parameters.spin):
        found += wrapped("inside the innermost stable circular orbit", "INFO")
    warning = physics.unstable_orbit_warning(parameters)
    if warning is not None:
        found += wrapped(warning, "INFO")
    return found
