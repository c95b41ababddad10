# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says about a scene, from Blender and the maps' headers: cheap enough for drawing."""

import time
from dataclasses import dataclass

import bpy
import numpy as np

from ..bake.check import count_baked, is_valid
from ..bake.request import MapRequest
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..outputs import frames, registry
from ..outputs.shared import drawing
from ..preview import viewport, views
from ..preview.shown import Shows
from ..scene import frame_setup, instanced_hole, presence
from ..scene.frame_setup import FrameSetup
from ..settings.hole_properties import CAMERA_ANIMATION

# Seconds for which the number of maps in the folder is not counted again.
COUNT_INTERVAL = 1.0


@dataclass
class _Count:
    """How many maps were counted, of what, and when."""

    of_what: object = None
    moment: float = -COUNT_INTERVAL
    number: int = 0


_counts = SESSION.per_scene(dict[str, _Count], Life.FILE)


@dataclass(frozen=True)
class Line:
    """A line of the panel."""

    text: str
    icon: str = "NONE"
    operator: str = ""
    """Draw this operator's button instead."""


def wrapped(text: str, icon: str) -> tuple[Line, ...]:
    """Return a sentence as lines that fit the panel being drawn, the icon in front of the first."""
    return tuple(Line(part, icon if index == 0 else "BLANK1") for index, part in enumerate(drawing.wrapped(text)))


def lines(context: bpy.types.Context) -> tuple[Line, ...]:
    """The state of the scene's black hole at the current frame."""
    scene = context.scene
    if frame_setup.find_active_hole(scene) is None and scene.umbra.active_hole is None and not frame_setup.holes(scene):
        try:
            instanced_hole.check(scene)
        except SceneError as error:
            return wrapped(error.for_user(), "ERROR")
        return wrapped("This scene has no black hole.", "INFO")
    if presence.is_absent(scene):
        plain = wrapped("The black hole is hidden in renders or deleted: pictures show the plain scene.", "INFO")
        return plain + tuple(_viewport_lines(scene, None))
    try:
        # drawing must not step the scene to other frames, so the camera's own velocity is not measured here
        depsgraph = context.evaluated_depsgraph_get()
        now = frames.read(scene, depsgraph, False)
        frames.check_sky(scene)
        notices = registry.of(scene).notices(scene, depsgraph, now)
    except physics.BlackHoleError as error:
        return wrapped(error.for_user(), "ERROR")
    found: list[Line] = []
    for notice in notices:
        found += wrapped(notice.text, notice.icon)
        if notice.operator:
            found.append(Line("", operator=notice.operator))
    for wanted in frames.requests_of(scene, now):
        found += _map_lines(scene, now, wanted)
    found += _viewport_lines(scene, now)
    found += _place_lines(now)
    others = len(frame_setup.holes(scene)) - 1
    if others > 0:
        found += wrapped(f"{others} more black hole{'s' if others > 1 else ''} in this scene: not rendered.", "INFO")
    return tuple(found)


def _map_lines(scene: bpy.types.Scene, now: FrameSetup, wanted: MapRequest) -> list[Line]:
    noun = wanted.kind.noun
    found: list[Line] = []
    if not wanted.path.is_file():
        found += wrapped(f"This frame's {noun} is not baked.", "RADIOBUT_OFF")
    elif frame_setup.active_hole(scene).umbra.motion == CAMERA_ANIMATION:
        found += wrapped(f"This frame's {noun} is baked; rendering checks it.", "CHECKMARK")
    elif is_valid(wanted, thorough=False):
        found += wrapped(f"This frame's {noun} is up to date.", "CHECKMARK")
    else:
        found += wrapped(f"This frame's {noun} is out of date.", "FILE_REFRESH")
    every = frame_setup.frames_of(scene)
    found.append(Line(f"{_baked(scene, now, every, wanted)} of {len(every)} frames baked", "SEQUENCE"))
    if wanted.folder.is_temporary:
        found += wrapped("This file is not saved: its maps are in a temporary folder.", "INFO")
    return found


_IN_VIEWPORT = {
    Shows.FILES: "The viewport follows: this frame's map, as it is baked.",
    Shows.SMALL: "The viewport follows with a small map; the full one comes when things rest.",
    Shows.FULL: "The viewport follows: this frame's map, traced in memory and not baked.",
    Shows.PLAIN: "The viewport follows: it shows the sky unbent.",
}


def _viewport_lines(scene: bpy.types.Scene, frame: FrameSetup | None) -> list[Line]:
    """What the viewport's compositor shows, where it is on."""
    state = viewport.state(scene)
    shown_in = views.spaces_of(scene)
    if state is None or state.shows not in _IN_VIEWPORT or not shown_in:
        return []
    found = [*wrapped(_IN_VIEWPORT[state.shows], "VIEW_CAMERA")]
    if any(views.is_through_another_camera(space, scene) for _window, space in shown_in):
        text = "A viewport has a local camera other than the scene's, for which the hole is not where it should be."
        found += wrapped(text, "ERROR")
    if frame is None or state.shows not in (Shows.SMALL, Shows.FULL):
        return found
    if viewport.disk_lags(scene):
        found += wrapped("The viewport's disk is of an earlier state; it follows when the change pauses.", "INFO")
    if frame_setup.active_hole(scene).umbra.motion == CAMERA_ANIMATION:
        found += wrapped("The viewport shows the camera as carried by space; a baked frame shows its motion.", "INFO")
    return found


def _baked(scene: bpy.types.Scene, now: FrameSetup, every: range, wanted: MapRequest) -> int:
    count = _counts.of(scene).setdefault(wanted.kind.noun, _Count())
    of_what = (wanted.folder.path, now.hole_name, wanted.parameters.map_size, every)
    if count.of_what != of_what or time.monotonic() - count.moment >= COUNT_INTERVAL:
        count.of_what, count.moment = of_what, time.monotonic()
        count.number = count_baked(scene, now.hole_name, wanted, every)
    return count.number


def _place_lines(now: FrameSetup) -> list[Line]:
    parameters = now.parameters
    distance = now.distance
    found = [Line(f"Camera at {distance:.4g} M", "CAMERA_DATA")]
    polar_angle = float(np.arccos(np.clip(parameters.camera_position[2] / distance, -1.0, 1.0)))
    if distance < physics.ergosphere_radius(parameters.spin, polar_angle):
        found += wrapped("inside the ergosphere: nothing can be at rest here", "INFO")
    elif distance < physics.isco_radius(parameters.spin):
        found += wrapped("inside the innermost stable circular orbit", "INFO")
    warning = physics.unstable_orbit_warning(parameters)
    if warning is not None:
        found += wrapped(warning, "INFO")
    return found
