# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview: a small map and a thumbnail that follow while the artist moves the camera or the hole.

Blender's handlers only note that something has changed; a timer does the work, in slices that leave the window
responsive, and always for the newest state. What is under way is finished first, so that the picture keeps moving
during a long drag. Nothing here runs without a window or during a render.
"""

import time
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from typing import TypeVar

import bpy

from ..core import changes
from ..core.changes import Change
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import SESSION, Life, scene_of
from ..outputs import frames, registry
from ..scene import cameras, frame_setup
from ..settings.scene_properties import ACCURACIES
from . import shown, small_maps, thumbnail

# Seconds that one slice of work may take, and between two of them.
BUDGET, PAUSE = 0.08, 0.001
# Seconds after the last change until Cycles is made to look once more.
SETTLE = 0.3

Result = TypeVar("Result")


@dataclass
class _State:
    """What the preview of one scene has shown, and is at work on."""

    shown: object = None
    """What is shown, or in the making."""
    map_shown: object = None
    """What the World's map was made from."""
    light_shown: object = None
    """What the World's layer of light was made from."""
    steps: Generator[None, None, None] | None = None
    changed: bool = True
    updates: int = 0
    problem: str = ""
    settle_at: float | None = None
    since: float = field(default_factory=time.perf_counter)
    """When the change that is not shown yet was noted."""
    latency: float = 0.0
    """Seconds from the last change shown to its picture being in memory."""


_states = SESSION.per_scene(_State, Life.FILE)
_suspended = SESSION.value(bool, Life.FILE)


def can_run() -> bool:
    """Return whether there is a window to show a preview in, and no render under way."""
    return not bpy.app.background and not _suspended.now


def is_on(scene: bpy.types.Scene) -> bool:
    """Return whether the scene's preview is switched on."""
    return bool(scene.umbra.live_preview)


def state(scene: bpy.types.Scene) -> _State:
    """Return the preview of a scene."""
    return _states.of(scene)


# --- what calls for work --------------------------------------------------------------------------


def on_update(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph) -> None:
    """Something in the scene has changed."""
    if can_run() and is_on(scene):
        _note(scene)


def on_switched(owner: bpy.types.ID) -> None:
    """The artist has switched the preview on or off."""
    if not isinstance(owner, bpy.types.Scene):
        return
    scene = owner
    if is_on(scene):
        if can_run():
            state(scene).shown = state(scene).map_shown = state(scene).light_shown = None
            _note(scene)
        return
    _states.drop(scene)
    thumbnail.forget(scene)
    live = registry.of(scene).live
    if live is None:
        return
    if live.is_shown(scene):
        live.drop(scene)
    else:
        registry.of(scene).point_at_files(scene)  # after a problem it read nothing


def on_output_switched(owner: bpy.types.ID) -> None:
    """The scene's output is another one: a World that is shown should follow the camera."""
    if not isinstance(owner, bpy.types.Scene):
        return
    _states.drop(owner)
    if registry.of(owner).follows_preview and not bpy.app.background:
        owner.umbra.live_preview = True
    elif is_on(owner):
        on_switched(owner)


def start_again() -> None:
    """Show all previews again: after undo, or when a file was opened or saved."""
    for scene in bpy.data.scenes:
        if is_on(scene) and can_run():
            state(scene).shown = state(scene).map_shown = state(scene).light_shown = None
            _note(scene)


def suspend() -> None:
    """Keep away while a render runs: it reads the maps of its frames."""
    _suspended.now = True
    drop_live()


def resume() -> None:
    """The render is over."""
    _suspended.now = False
    start_again()


def drop_live() -> None:
    """Let all scenes read the files of their frames, as a file that is saved should have it."""
    for each in _states:
        each.steps = None
    for scene in bpy.data.scenes:
        live = registry.of(scene).live
        if scene.library is None and live is not None and live.is_shown(scene):
            live.drop(scene)


def forget() -> None:
    """Drop everything: another file was opened, or the add-on is disabled."""
    _suspended.clear()
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
    for scene, now in _states.items():
        if not is_on(scene):
            _states.drop(scene)
            continue
        while can_run() and (now.steps is not None or now.changed):
            try:
                _step(scene, now)
            except physics.BlackHoleError as error:  # the panel says it too
                now.steps, now.problem, now.shown = None, error.for_user(), None
                _show_problem(scene)
            if time.perf_counter() >= end:
                break
        if now.settle_at is not None and time.perf_counter() >= now.settle_at and now.steps is None:
            now.settle_at = None
            live = registry.of(scene).live
            if live is not None:
                live.show_again(scene)
    if any(each.steps is not None or each.changed for each in _states):
        return PAUSE
    return SETTLE if any(each.settle_at is not None for each in _states) else None


def _step(scene: bpy.types.Scene, now: _State) -> None:
    if now.steps is None:
        now.changed = False
        depsgraph = frame_setup.depsgraph_of(scene)
        frame = frames.read(scene, depsgraph, False)
        now.problem = ""
        camera = _camera_of(scene, depsgraph, frame)
        key = (frame.parameters, frame.light, camera, scene.umbra.output, thumbnail.key(scene))
        if key == now.shown:
            return
        now.shown = key
        now.steps = _work(scene.session_uid, frame, camera, now)
        return
    try:
        next(now.steps)
    except StopIteration:
        now.steps = None


def _camera_of(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: frame_setup.FrameSetup
) -> "physics.Camera":
    """What the thumbnail is seen by; for a lens that only the World knows, all directions."""
    data = cameras.active_camera(scene).evaluated_get(depsgraph).data
    try:
        return cameras.camera_model(data, scene.render, scene.render.engine)
    except SceneError:
        return frame.parameters.camera


def _work(
    uid: int,
    frame: frame_setup.FrameSetup,
    camera: "physics.Camera",
    now: _State,
) -> Generator[None, None, None]:
    """Make a map and a thumbnail of a frame; the scene is looked up again after each pause."""
    tolerance, _ = ACCURACIES["DRAFT"]
    draft = replace(frame.parameters, tolerance=tolerance, method=physics.DEFAULT_METHOD, disk=None)
    scene = scene_of(uid)
    live = None if scene is None else registry.of(scene).live
    if scene is not None and live is not None and live.can_show(scene):
        wanted = live.parameters(draft)
        if wanted != now.map_shown or not live.is_shown(scene):
            made = yield from _paused(live.steps(wanted))
            scene = scene_of(uid)
            if scene is None:
                return
            needs_another_look = live.show(scene, made)
            now.map_shown = wanted
            now.settle_at = time.perf_counter() + SETTLE if needs_another_look else None
            now.latency = time.perf_counter() - now.since
            redraw()
            yield
        yield from _light_work(uid, frame, draft, now)
    picture = yield from _paused(thumbnail.steps(uid, replace(draft, camera=camera), frame.light))
    scene = scene_of(uid)
    if picture is not None and scene is not None:
        thumbnail.show(scene, picture)
        now.latency = now.latency or time.perf_counter() - now.since
        redraw()
    now.updates += 1


def _light_work(
    uid: int, frame: frame_setup.FrameSetup, draft: "physics.WarpMapParameters", now: _State
) -> Generator[None, None, None]:
    """Make the layer of light that the output shows, if the frame has a disk."""
    scene = scene_of(uid)
    live = None if scene is None else registry.of(scene).live
    if scene is None or live is None or frame.light is None:
        return
    view = replace(draft, disk=frame.light.view.disk, interpolation=small_maps.DISK_INTERPOLATION)
    wanted = live.light_parameters(replace(frame.light, view=view))
    if wanted == now.light_shown and live.is_shown(scene):
        return
    layer = yield from _paused(shown.light_steps(wanted))
    scene = scene_of(uid)
    if scene is None:
        return
    if live.show_light(scene, layer):
        now.settle_at = time.perf_counter() + SETTLE
    now.light_shown = wanted
    redraw()
    yield


def _paused(steps: Generator[float, None, Result]) -> Generator[None, None, Result]:
    while True:
        try:
            next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        yield


def _show_problem(scene: bpy.types.Scene) -> None:
    """Where there is nothing to show (no hole, no camera), show no older map: the World is magenta."""
    thumbnail.forget(scene)
    output = registry.of(scene)
    if output.live is not None and output.live.can_show(scene) and output.live.is_shown(scene):
        output.live.drop(scene)
        output.take_away(scene)
    redraw()


def redraw() -> None:
    """Let viewports, panels and images be drawn."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"VIEW_3D", "PROPERTIES", "IMAGE_EDITOR"}:
                area.tag_redraw()


# --- registration ---------------------------------------------------------------------------------


def register() -> None:
    """Follow the switch of the preview, and that of the output."""
    changes.subscribe(Change.PREVIEW, on_switched)
    changes.subscribe(Change.SWITCHED, on_output_switched)


def unregister() -> None:
    """Drop the preview: nobody would point the scenes that show it at their files later."""
    changes.unsubscribe(Change.SWITCHED, on_output_switched)
    changes.unsubscribe(Change.PREVIEW, on_switched)
    drop_live()
    forget()
