# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport's compositor follows the hole: a small map at once, the full one when things rest.

While a 3D viewport shows a scene through its compositor, each change traces a map of 480 x 270 in Blender's own
handler, so that map and scene change in one draw; from a timer the hole would lag behind its objects. The disk, which
takes as long again, follows when the change pauses. When nothing has changed for a while, the files of the frame take
their place if they are up to date, else a map in memory of the render's size, traced in slices.

A viewport is noticed when it is drawn. Nothing here runs without a window or during a render, and renders and saved
files are given the nodes as they are without it.
"""

import math
import time

import bpy

from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..outputs import frames, registry
from ..outputs.protocol import ViewportMaps
from ..scene import presence, stepping
from . import live_preview, small_maps, views
from .shown import (
    IN_MEMORY,
    Shows,
    State,
    full_steps,
    light_steps,
    show_files_of_frame,
    show_frame,
    show_plain,
    wanted_of,
)

# Seconds without a change after which the disk follows, and after which things rest.
PAUSE_OF_DISK, REST = 0.1, 0.3
# Seconds that a map may add to a draw: where it takes longer, the next one has fewer pixels; else by so much more.
LONGEST, GROWTH = 0.06, 1.2
# Seconds that one slice of work may take, or as long as a draw takes but not more than the second; and between two.
BUDGET, LARGEST_BUDGET, PAUSE = 0.08, 0.5, 0.001


_states = SESSION.per_scene(State, Life.FILE)
# True while a file is saved: Blender draws the scene for the file's thumbnail, and updates it for that.
_is_saving = SESSION.value(bool, Life.FILE)


def state(scene: bpy.types.Scene) -> State | None:
    """Return what the viewport shows of a scene; None where no viewport shows its compositor."""
    return _states.find(scene)


# --- what calls for work --------------------------------------------------------------------------


def on_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Something in the scene has changed, or its frame: show it in the same draw."""
    now = _states.find(scene)
    if now is None or _is_saving.now or not live_preview.can_run() or stepping.is_stepping.now:
        return
    shown_in = views.spaces_of(scene)
    if not shown_in:
        wake()  # the timer clears up
    elif any(window.view_layer.name == depsgraph.view_layer.name for window, _space in shown_in):
        _follow(scene, now, depsgraph)


def on_draw() -> None:
    """A viewport is drawn: look after its scene, if it shows the compositor and nobody does yet."""
    context = bpy.context
    if context.scene is not None and views.shows_composite(context.space_data):
        notice(context.scene)


def notice(scene: bpy.types.Scene) -> None:
    """Begin to follow a scene that a viewport shows."""
    maps = registry.of(scene).viewport
    if _states.find(scene) is None and live_preview.can_run() and maps is not None and maps.can_show(scene):
        _states.of(scene)
        wake()


def start_again() -> None:
    """Look at all scenes again: after undo or a render, or when a file was opened."""
    for scene, now in _states.items():
        _states.put(scene, State(stamps=now.stamps, told=now.told, pixels=now.pixels))
        wake()


def show_files() -> None:
    """Let all scenes read the files of their frames, as a render should have it."""
    for scene in bpy.data.scenes:
        maps = registry.of(scene).viewport
        if scene.library is None and maps is not None and maps.is_shown(scene):
            maps.show_files(scene)


def before_saving() -> None:
    """Let all scenes read their files, until the file is saved."""
    _is_saving.now = True
    show_files()


def after_saving() -> None:
    """The file is saved, or could not be: show what was shown before."""
    _is_saving.now = False
    for scene, now in _states.items():
        maps = registry.of(scene).viewport
        if maps is not None and now.shows in IN_MEMORY and live_preview.can_run():
            maps.show_again(scene)


def drop() -> None:
    """Let all scenes read their files, and free all maps in memory."""
    for scene in bpy.data.scenes:
        maps = registry.of(scene).viewport
        if scene.library is None and maps is not None:
            maps.drop(scene)


def forget() -> None:
    """Drop everything: another file was opened, or the add-on is disabled."""
    _states.clear()
    _is_saving.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def wake() -> None:
    """Let the timer look after all scenes soon."""
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=0.0)


# --- following ------------------------------------------------------------------------------------


def _follow(scene: bpy.types.Scene, now: State, depsgraph: bpy.types.Depsgraph) -> None:
    """Show the frame at which the dependency graph stands."""
    maps = registry.of(scene).viewport
    if maps is None or not maps.can_show(scene):
        _states.drop(scene)
        return
    began = time.thread_time()
    try:
        if presence.is_absent(scene):
            show_plain(scene, now, maps, depsgraph)
            return
        frame = frames.read(scene, depsgraph, False)
        if wanted_of(frame) == now.wanted and (now.shows in IN_MEMORY) == maps.is_shown(scene):
            return
        if show_frame(scene, now, maps, frame):
            now.cost = time.thread_time() - began
            pixels = now.pixels * min(LONGEST / now.cost, GROWTH)
            now.pixels = min(max(pixels, small_maps.LEAST_PIXELS), small_maps.SMALL_PIXELS)
        if now.shows is Shows.SMALL:
            wake()
    except physics.BlackHoleError:  # the panel says it
        maps.show_nothing(scene)
        now.shows, now.wanted, now.frame, now.steps = Shows.FAILED, None, None, None


# --- when things rest -----------------------------------------------------------------------------


# When the timer's last slice of work ended, if more was to do.
_ended = SESSION.value(lambda: math.inf, Life.FILE)


def _tick() -> float | None:
    """The timer: one slice of work, no shorter than the draw before it, or slow draws would make it last."""
    draw = time.perf_counter() - _ended.now
    wait = advance(min(max(BUDGET, draw), LARGEST_BUDGET))
    _ended.now = time.perf_counter() if wait == PAUSE else math.inf
    return wait


def advance(budget: float) -> float | None:
    """Work for about `budget` seconds; return after how many seconds to go on, None when all is done."""
    if not live_preview.can_run():
        return None
    end = time.perf_counter() + budget
    waits: list[float] = []
    for scene, now in _states.items():
        maps = registry.of(scene).viewport
        shown_in = views.spaces_of(scene)
        if maps is None or not maps.can_show(scene) or not shown_in:
            _states.drop(scene)
            if maps is not None and scene.library is None:
                maps.drop(scene)
            continue
        if now.shows is Shows.NOTHING:
            layer = shown_in[0][0].view_layer
            layer.update()
            _follow(scene, now, layer.depsgraph)
        if now.shows is Shows.SMALL:
            waits.append(_settle(scene, now, maps, end))
        if now.told is not now.shows:
            now.told = now.shows
            live_preview.redraw()
    waits = [each for each in waits if math.isfinite(each)]
    return min(waits) if waits else None


def _settle(scene: bpy.types.Scene, now: State, maps: ViewportMaps, end: float) -> float:
    """Let the disk follow, then put the full map in the small one's place; return when there is more to do."""
    if now.steps is None:
        left = _next_step(scene, now, maps)
        if now.steps is None:
            return left
    try:
        while time.perf_counter() < end:
            next(now.steps)
    except StopIteration as done:
        made, layer = done.value if now.is_full else (None, done.value)
        if made is not None:
            maps.show(scene, made)
        if layer is not None:
            maps.show_light(scene, layer)
        now.steps, now.light_of = None, None if now.frame is None else now.frame.light
        if made is None:
            return PAUSE
        now.shows = Shows.FULL
        return math.inf
    return PAUSE


def _next_step(scene: bpy.types.Scene, now: State, maps: ViewportMaps) -> float:
    """Begin with what is due; if nothing is, return in how many seconds something will be."""
    assert now.frame is not None
    light, age = now.frame.light, time.perf_counter() - now.changed_at
    lags = _lags(now)
    if age >= REST:
        if show_files_of_frame(scene, now, maps):
            return math.inf
        now.steps, now.is_full = full_steps(now.frame), True
    elif light is not None and lags and age >= PAUSE_OF_DISK:
        now.steps, now.is_full = light_steps(small_maps.small_light(light)), False
    return (PAUSE_OF_DISK if lags else REST) - age


def _lags(now: State) -> bool:
    light = None if now.frame is None else now.frame.light
    return light is not None and now.light_of != light


def disk_lags(scene: bpy.types.Scene) -> bool:
    """Return whether the disk in the viewport is of an earlier state than the rest."""
    now = _states.find(scene)
    return now is not None and now.shows is Shows.SMALL and _lags(now)


# --- registration ---------------------------------------------------------------------------------

_drawing: list[object] = []


def register() -> None:
    """Notice viewports when they are drawn."""
    if not bpy.app.background:
        _drawing.append(bpy.types.SpaceView3D.draw_handler_add(on_draw, (), "WINDOW", "PRE_VIEW"))


def unregister() -> None:
    """Give all nodes back to their files."""
    while _drawing:
        bpy.types.SpaceView3D.draw_handler_remove(_drawing.pop(), "WINDOW")
    drop()
    forget()
