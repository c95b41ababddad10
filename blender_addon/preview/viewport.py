# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport's compositor follows the hole: a small map at once, the full one when things rest.

While a 3D viewport shows a scene through its compositor, each change traces a map of 480 x 270 in Blender's own
handler, so that map and scene change in one draw; from a timer the hole would lag behind its objects. The disk, which
takes as long again, follows when the change pauses. When nothing has changed for a while, the files of the frame take
their place if they are up to date, else a map in memory of the render's size, traced in slices.

A viewport is noticed when it is drawn. Nothing here runs without a window or during a render, and renders and saved
files are given the nodes as they are without it.
"""

import enum
import math
import time
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..bake import check
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..outputs import frames, registry
from ..outputs.protocol import ViewportMaps
from ..scene import frame_setup, presence, stepping
from ..scene.frame_setup import FrameSetup
from . import live_preview, plain_map, small_maps, views

# Seconds without a change after which the disk follows, and after which things rest.
PAUSE_OF_DISK, REST = 0.1, 0.3
# Seconds that a map may add to a draw: where it takes longer, the next one has fewer pixels; else by so much more.
LONGEST, GROWTH = 0.06, 1.2
# Seconds that one slice of work may take, or as long as a draw takes but not more than the second; and between two.
BUDGET, LARGEST_BUDGET, PAUSE = 0.08, 0.5, 0.001


class Shows(enum.Enum):
    """What a scene's picture in the viewport is made from."""

    NOTHING = enum.auto()
    """Not known yet: what it was made from before."""
    FAILED = enum.auto()
    """No map: it is magenta."""
    FILES = enum.auto()
    SMALL = enum.auto()
    FULL = enum.auto()
    PLAIN = enum.auto()
    """A map that bends nothing: the hole is hidden or deleted."""


@dataclass
class State:
    """What the viewport shows of one scene."""

    shows: Shows = Shows.NOTHING
    wanted: object = None
    """What the current frame's picture is made from."""
    disk_of: object = None
    """What the disk's passes in memory were made for."""
    frame: FrameSetup | None = None
    changed_at: float = 0.0
    steps: Generator[float, None, Any] | None = None
    """A map in the making."""
    is_full: bool = False
    """Whether that is the full one."""
    stamps: dict[Path, object] | None = None
    """The files, as Blender has read them."""
    told: Shows = Shows.NOTHING
    """What the panel says."""
    pixels: float = small_maps.SMALL_PIXELS
    """Of the next small map."""
    cost: float = 0.0
    """Seconds of the main thread for the last small map, from the change to the image."""


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
        if maps is not None and now.shows in _IN_MEMORY and live_preview.can_run():
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

_IN_MEMORY = (Shows.SMALL, Shows.FULL, Shows.PLAIN)


def _follow(scene: bpy.types.Scene, now: State, depsgraph: bpy.types.Depsgraph) -> None:
    """Show the frame at which the dependency graph stands."""
    maps = registry.of(scene).viewport
    if maps is None or not maps.can_show(scene):
        _states.drop(scene)
        return
    began = time.thread_time()
    try:
        if presence.is_absent(scene):
            _show_plain(scene, now, maps, depsgraph)
            return
        frame = frames.read(scene, depsgraph, False)
        if frame.parameters == now.wanted and (now.shows in _IN_MEMORY) == maps.is_shown(scene):
            return
        if _show_frame(scene, now, maps, frame):
            now.cost = time.thread_time() - began
            pixels = now.pixels * min(LONGEST / now.cost, GROWTH)
            now.pixels = min(max(pixels, small_maps.LEAST_PIXELS), small_maps.SMALL_PIXELS)
    except physics.BlackHoleError:  # the panel says it
        maps.show_nothing(scene)
        now.shows, now.wanted, now.frame, now.steps = Shows.FAILED, None, None, None


def _show_frame(scene: bpy.types.Scene, now: State, maps: ViewportMaps, frame: FrameSetup) -> bool:
    """Show the files where they are up to date, else a small map; return whether one was traced."""
    same = frame.parameters == now.wanted
    moved_on = now.frame is None or now.frame.frame != frame.frame
    may_be_baked = moved_on or same or now.shows is not Shows.SMALL
    now.wanted, now.frame = frame.parameters, frame
    if may_be_baked and _show_files(scene, now, maps):
        return False
    if same and now.shows in _IN_MEMORY and maps.show_again(scene):
        return False  # a change of settings had given the nodes their files
    if now.shows is Shows.FAILED:
        maps.show_files(scene)  # those of the disk
    alone = frame.parameters.disk is None or _has_disk(scene, maps, frame)
    if alone:
        maps.show(scene, physics.bake(small_maps.small(frame.parameters, now.pixels)))
    else:
        maps.show(scene, physics.bake(small_maps.small_with_disk(frame.parameters)))
        now.disk_of = frame.parameters
    now.shows, now.steps, now.changed_at = Shows.SMALL, None, time.perf_counter()
    wake()
    return alone


def _has_disk(scene: bpy.types.Scene, maps: ViewportMaps, frame: FrameSetup) -> bool:
    """Whether there is a disk to be seen meanwhile, if only an older one."""
    if maps.has_disk(scene):
        return True
    requests = small_maps.requests_of(scene, frame)
    return bool(requests) and all(path.is_file() for each in requests for path in each.passes)


def _show_plain(scene: bpy.types.Scene, now: State, maps: ViewportMaps, depsgraph: bpy.types.Depsgraph) -> None:
    wanted = plain_map.read(scene, depsgraph)
    if wanted != now.wanted or not maps.is_shown(scene):
        maps.show(scene, plain_map.make(wanted))
    now.shows, now.wanted, now.frame, now.steps = Shows.PLAIN, wanted, None, None


def _show_files(scene: bpy.types.Scene, now: State, maps: ViewportMaps) -> bool:
    """Show the current frame's files; return False where they are missing or out of date."""
    assert now.frame is not None
    requests = small_maps.requests_of(scene, now.frame)
    if not requests or not all(check.is_valid(each, thorough=False) for each in requests):
        return False
    stamps = {path: stamp for each in requests for path, stamp in check.stamps(each).items()}
    known = now.stamps
    if known is None or any(known.get(path, stamp) != stamp for path, stamp in stamps.items()):
        registry.of(scene).forget_loaded_maps(scene)
    now.stamps = {**(known or {}), **stamps}
    if now.shows is not Shows.FILES or maps.is_shown(scene):
        maps.show_files(scene)
    now.shows, now.steps = Shows.FILES, None
    return True


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
        maps.show(scene, done.value)
        now.steps, now.disk_of = None, now.wanted
        if not now.is_full:
            return PAUSE
        now.shows = Shows.FULL
        return math.inf
    return PAUSE


def _next_step(scene: bpy.types.Scene, now: State, maps: ViewportMaps) -> float:
    """Begin with what is due; if nothing is, return in how many seconds something will be."""
    assert now.frame is not None
    parameters, age = now.frame.parameters, time.perf_counter() - now.changed_at
    lags = parameters.disk is not None and now.disk_of != now.wanted
    if age >= REST:
        if _show_files(scene, now, maps):
            return math.inf
        now.steps, now.is_full = physics.bake_steps(small_maps.full(parameters)), True
    elif lags and age >= PAUSE_OF_DISK:
        now.steps, now.is_full = physics.bake_steps(small_maps.small_with_disk(parameters)), False
    return (PAUSE_OF_DISK if lags else REST) - age


def disk_lags(scene: bpy.types.Scene) -> bool:
    """Return whether the disk in the viewport is of an earlier state than the rest."""
    now = _states.find(scene)
    if now is None or now.shows is not Shows.SMALL or now.frame is None:
        return False
    return now.frame.parameters.disk is not None and now.disk_of != now.wanted


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
