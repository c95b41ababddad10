# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview: a small map and a thumbnail that follow while the artist moves the camera or the hole.

Blender's handlers only note that something has changed; a timer does the work, in slices that leave the window
responsive, and always for the newest state. What is under way is finished first, so that the picture keeps moving
during a long drag. Nothing here runs without a window or during a render.
"""

import time
from collections.abc import Generator
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from ..core.errors import SceneError
from ..core.physics_api import physics, world_map
from ..outputs.lens import lens_sync
from ..outputs.world import lensed_world, world_sync
from ..scene import frame_setup
from ..settings.scene_properties import ACCURACIES
from . import thumbnail

# Seconds that one slice of work may take, and between two of them.
BUDGET, PAUSE = 0.08, 0.001
# Seconds after the last change until Cycles is made to look once more.
SETTLE = 0.3


@dataclass
class _State:
    """What the preview of one scene has shown, and is at work on."""

    shown: object = None
    """What is shown, or in the making."""
    map_shown: object = None
    """What the World's map was made from."""
    steps: Generator[None, None, None] | None = None
    changed: bool = True
    updates: int = 0
    problem: str = ""
    settle_at: float | None = None
    since: float = field(default_factory=time.perf_counter)
    """When the change that is not shown yet was noted."""
    latency: float = 0.0
    """Seconds from the last change shown to its picture being in memory."""


_states: dict[str, _State] = {}
_suspended = False


def can_run() -> bool:
    """Whether there is a window to show a preview in, and no render under way."""
    return not bpy.app.background and not _suspended


def is_on(scene: bpy.types.Scene) -> bool:
    """Whether the scene's preview is switched on."""
    return scene.umbra.live_preview


def state(scene: bpy.types.Scene) -> _State:
    """The preview of a scene."""
    return _states.setdefault(scene.name, _State())


# --- what calls for work --------------------------------------------------------------------------


def on_update(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph) -> None:
    """Something in the scene has changed."""
    if can_run() and is_on(scene):
        _note(scene)


def on_switched(scene: bpy.types.Scene) -> None:
    """The artist has switched the preview on or off."""
    if is_on(scene):
        if can_run():
            state(scene).shown = state(scene).map_shown = None
            _note(scene)
        return
    _states.pop(scene.name, None)
    thumbnail.forget(scene.name)
    if world_sync.shows_live(scene):
        world_sync.drop_live(scene)
    elif world_sync.is_on(scene):
        world_sync.point_at_files(scene)  # after a problem it read nothing


def on_output_switched(scene: bpy.types.Scene) -> None:
    """The scene's output is another one: a World that is shown should follow the camera."""
    _states.pop(scene.name, None)
    if world_sync.is_on(scene) and not bpy.app.background:
        scene.umbra.live_preview = True
    elif is_on(scene):
        on_switched(scene)


def start_again() -> None:
    """Show all previews anew: after undo, or when a file was opened or saved."""
    for scene in bpy.data.scenes:
        if is_on(scene) and can_run():
            state(scene).shown = state(scene).map_shown = None
            _note(scene)


def suspend() -> None:
    """Keep away while a render runs: it reads the maps of its frames."""
    global _suspended
    _suspended = True
    drop_live()


def resume() -> None:
    """The render is over."""
    global _suspended
    _suspended = False
    start_again()


def drop_live() -> None:
    """Let all Worlds read the files of their frames, as a file that is saved should have it."""
    for each in list(_states.values()):
        each.steps = None
    for scene in bpy.data.scenes:
        if scene.library is None and world_sync.shows_live(scene):
            world_sync.drop_live(scene)


def forget() -> None:
    """Drop everything: another file was opened, or the add-on goes."""
    global _suspended
    _suspended = False
    _states.clear()
    thumbnail.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def _note(scene: bpy.types.Scene) -> None:
    now = state(scene)
    if not now.changed or now.steps is None:
        now.since = time.perf_counter() if now.steps is None else now.since
    now.changed = True
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=0.0)


# --- the work -------------------------------------------------------------------------------------


def _tick() -> float | None:
    """The timer: one slice of work; again soon while there is more."""
    return advance(BUDGET)


def advance(budget: float) -> float | None:
    """Work for about `budget` seconds; return after how many seconds to go on, None when all is done."""
    if not can_run():
        return None
    end = time.perf_counter() + budget
    for name in list(_states):
        scene = bpy.data.scenes.get(name)
        if scene is None or not is_on(scene):
            del _states[name]
            continue
        now = _states[name]
        while can_run() and (now.steps is not None or now.changed):
            try:
                _step(scene, now)
            except physics.BlackHoleError as error:  # the panel says it too
                now.steps, now.problem, now.shown = None, str(error), None
                _show_problem(scene)
            if time.perf_counter() >= end:
                break
        if now.settle_at is not None and time.perf_counter() >= now.settle_at and now.steps is None:
            now.settle_at = None
            world_sync.show_again(scene)
    if any(each.steps is not None or each.changed for each in _states.values()):
        return PAUSE
    return SETTLE if any(each.settle_at is not None for each in _states.values()) else None


def _step(scene: bpy.types.Scene, now: _State) -> None:
    if now.steps is None:
        now.changed = False
        depsgraph = lens_sync.depsgraph_of(scene)
        frame = frame_setup.read(scene, depsgraph, velocity=np.zeros(3))
        now.problem = ""
        camera = _camera_of(scene, depsgraph, frame)
        key = (frame.parameters, camera, scene.umbra.output, thumbnail.key(scene))
        if key == now.shown:
            return
        now.shown = key
        now.steps = _work(scene.name, frame, camera, now)
        return
    try:
        next(now.steps)
    except StopIteration:
        now.steps = None


def _camera_of(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: frame_setup.Shot
) -> "physics.PerspectiveCamera | physics.PanoramaCamera":
    """What the thumbnail is seen by; for a lens that only the World knows, all directions."""
    data = scene.camera.evaluated_get(depsgraph).data
    try:
        return frame_setup.camera_model(data, scene.render, scene.render.engine)
    except SceneError:
        return frame.parameters.camera


def _work(
    name: str, frame: frame_setup.Shot, camera: "physics.PerspectiveCamera | physics.PanoramaCamera", now: _State
) -> Generator[None, None, None]:
    """Make a map and a thumbnail of a shot; the scene is looked up anew after each pause."""
    tolerance, _ = ACCURACIES["DRAFT"]
    draft = replace(frame.parameters, tolerance=tolerance, method=physics.DEFAULT_METHOD, disk=None)
    scene = bpy.data.scenes.get(name)
    wanted = world_map.world_parameters(draft, world_map.PREVIEW)
    is_lensed = scene is not None and lensed_world.lensed_world(scene) is not None
    if is_lensed and (wanted != now.map_shown or not world_sync.shows_live(scene)):
        made = yield from _paused(world_map.world_map_steps(wanted))
        scene = bpy.data.scenes.get(name)
        if scene is None:
            return
        world_sync.show_live(scene, made)
        now.map_shown = wanted
        now.settle_at = time.perf_counter() + SETTLE if world_sync.needs_turns(scene) else None
        now.latency = time.perf_counter() - now.since
        _redraw()
        yield
    picture = yield from _paused(thumbnail.steps(name, replace(draft, camera=camera)))
    if picture is not None:
        thumbnail.show(name, picture)
        now.latency = now.latency or time.perf_counter() - now.since
        _redraw()
    now.updates += 1


def _paused(steps: Generator[float, None, object]) -> Generator[None, None, object]:
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
        yield


def _show_problem(scene: bpy.types.Scene) -> None:
    """Where there is nothing to show (no hole, no camera), show no older map: the World is magenta."""
    thumbnail.forget(scene.name)
    if lensed_world.lensed_world(scene) is not None and world_sync.shows_live(scene):
        world_sync.drop_live(scene)
        world_sync.point_at_nothing(scene)
    _redraw()


def _redraw() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES", "IMAGE_EDITOR"}:
                area.tag_redraw()
