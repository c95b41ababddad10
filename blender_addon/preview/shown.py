# SPDX-License-Identifier: GPL-3.0-or-later
"""What the viewport's compositor shows of a scene: its files where they are up to date, else a map in memory."""

import enum
import time
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..bake import check
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..outputs import registry
from ..outputs.protocol import ViewportMaps
from ..scene.frame_setup import FrameSetup
from . import plain_map, small_maps


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
    view: object = None
    """What the map in memory was made for."""
    light_of: object = None
    """What the layer of light in memory was made for."""
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


IN_MEMORY = (Shows.SMALL, Shows.FULL, Shows.PLAIN)


# Traces once what the layers of light in the viewport have in common.
_light_baker = SESSION.value(physics.LightBaker, Life.FILE)


def show_frame(scene: bpy.types.Scene, now: State, maps: ViewportMaps, frame: FrameSetup) -> bool:
    """Show the files where they are up to date, else a small map; return whether that was traced, and it alone."""
    wanted = wanted_of(frame)
    same = wanted == now.wanted
    moved_on = now.frame is None or now.frame.frame != frame.frame
    may_be_baked = moved_on or same or now.shows is not Shows.SMALL
    same_view = now.shows in IN_MEMORY and frame.parameters == now.view
    now.wanted, now.frame = wanted, frame
    if may_be_baked and show_files_of_frame(scene, now, maps):
        return False
    if same and now.shows in IN_MEMORY and maps.show_again(scene):
        return False  # a change of settings had given the nodes their files
    if now.shows is Shows.FAILED:
        maps.show_files(scene)  # those of the disk
    if same_view:
        maps.show_again(scene)
    else:
        maps.show(scene, physics.bake(small_maps.small(frame.parameters, now.pixels)))
        now.view = frame.parameters
    # Another look of a thin disk is quick; else an older layer is seen meanwhile, if there is one.
    at_once = frame.light is not None and (
        (same_view and frame.light.look.thickness == 0.0) or not _has_light(scene, maps, frame)
    )
    if at_once:
        assert frame.light is not None
        maps.show_light(scene, physics.drain(light_steps(small_maps.small_light(frame.light))))
        now.light_of = frame.light
    now.shows, now.steps, now.changed_at = Shows.SMALL, None, time.perf_counter()
    return not same_view and not at_once


def wanted_of(frame: FrameSetup) -> object:
    """Return all that a frame's picture is made from."""
    return frame.parameters, frame.light


def light_steps(light: "physics.LightParameters") -> Generator[float, None, "physics.LightLayer"]:
    """Make a layer of light step by step; what it shares with the one before is not traced again."""
    return (yield from _light_baker.now.steps(light))


def full_steps(frame: FrameSetup) -> Generator[float, None, "tuple[physics.WarpMap, physics.LightLayer | None]"]:
    """Make the full map, and the full layer of light if there is a disk, step by step."""
    made = yield from physics.bake_steps(small_maps.full(frame.parameters))
    if frame.light is None:
        return made, None
    return made, (yield from light_steps(small_maps.full_light(frame.light)))


def _has_light(scene: bpy.types.Scene, maps: ViewportMaps, frame: FrameSetup) -> bool:
    """Whether there is a disk to be seen meanwhile, if only an older one."""
    if maps.has_light(scene):
        return True
    requests = small_maps.requests_of(scene, frame)
    return bool(requests) and all(each.path.is_file() for each in requests)


def show_plain(scene: bpy.types.Scene, now: State, maps: ViewportMaps, depsgraph: bpy.types.Depsgraph) -> None:
    """Show the sky unbent."""
    wanted = plain_map.read(scene, depsgraph)
    if wanted != now.wanted or not maps.is_shown(scene):
        maps.show(scene, plain_map.make(wanted))
    now.shows, now.wanted, now.view, now.frame, now.steps = Shows.PLAIN, wanted, None, None, None


def show_files_of_frame(scene: bpy.types.Scene, now: State, maps: ViewportMaps) -> bool:
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
