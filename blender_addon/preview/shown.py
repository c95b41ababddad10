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


IN_MEMORY = (Shows.SMALL, Shows.FULL, Shows.PLAIN)


def show_frame(scene: bpy.types.Scene, now: State, maps: ViewportMaps, frame: FrameSetup) -> bool:
    """Show the files where they are up to date, else a small map; return whether one was traced."""
    same = frame.parameters == now.wanted
    moved_on = now.frame is None or now.frame.frame != frame.frame
    may_be_baked = moved_on or same or now.shows is not Shows.SMALL
    now.wanted, now.frame = frame.parameters, frame
    if may_be_baked and show_files_of_frame(scene, now, maps):
        return False
    if same and now.shows in IN_MEMORY and maps.show_again(scene):
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
    return alone


def _has_disk(scene: bpy.types.Scene, maps: ViewportMaps, frame: FrameSetup) -> bool:
    """Whether there is a disk to be seen meanwhile, if only an older one."""
    if maps.has_disk(scene):
        return True
    requests = small_maps.requests_of(scene, frame)
    return bool(requests) and all(path.is_file() for each in requests for path in each.passes)


def show_plain(scene: bpy.types.Scene, now: State, maps: ViewportMaps, depsgraph: bpy.types.Depsgraph) -> None:
    """Show the sky unbent."""
    wanted = plain_map.read(scene, depsgraph)
    if wanted != now.wanted or not maps.is_shown(scene):
        maps.show(scene, plain_map.make(wanted))
    now.shows, now.wanted, now.frame, now.steps = Shows.PLAIN, wanted, None, None


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
