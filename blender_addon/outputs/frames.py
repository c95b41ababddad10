# SPDX-License-Identifier: GPL-3.0-or-later
"""The frames of a scene with an output: what each is made of, which maps it needs, and work on those maps.

Long work is a generator that is resumed from Blender's event loop, where undo or a newly loaded file may have replaced
every datablock since the last time. So it holds a scene's number in the session, and looks the scene up each time.
"""

import functools
from collections.abc import Callable, Generator, Iterable
from typing import TypeVar

import bpy

from ..bake import baking, cache, star_sky
from ..bake.request import MapRequest
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import scene_of
from ..scene import drivers, frame_setup, presence
from ..scene.frame_setup import FrameSetup
from ..scene.sky import environment
from ..scene.stepping import frame_kept
from . import registry
from .shared import compositor_tree

Result = TypeVar("Result")

# Work on the maps of some frames.
_Work = Callable[[list[int], baking.RequestsAt, cache.FolderNames], Generator[baking.Progress, None, Result]]


def read(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, measured: bool = True) -> FrameSetup:
    """Return the setup of the frame at which the dependency graph stands; see `frame_setup.read`."""
    output = registry.of(scene)
    return output.complete(scene, depsgraph, frame_setup.read(scene, depsgraph, measured, output.traits))


def read_at(scene: bpy.types.Scene, frame: int, view_layer: bpy.types.ViewLayer | None = None) -> FrameSetup:
    """Return the setup of any frame; the scene is back at its current frame afterwards.

    Parameters
    ----------
    scene : Scene
        The scene.
    frame : int
        The frame to read.
    view_layer : ViewLayer, optional
        The layer whose objects count; the first that is rendered by default.

    Raises
    ------
    physics.BlackHoleError
        See `frame_setup.read`.
    """
    layer = view_layer or next((each for each in scene.view_layers if each.use), scene.view_layers[0])
    with frame_kept(scene):
        scene.frame_set(frame)
        return read(scene, layer.depsgraph)


def check_sky(scene: bpy.types.Scene) -> None:
    """Refuse broken drivers of what is not in the maps: of our nodes in the compositor, and of the World's.

    Raises
    ------
    SceneError
        The sentence names datablock and property.
    """
    frame, tree = scene.frame_current, compositor_tree.find_tree(scene)
    if tree is not None:
        ours = [each.path_from_id() for each in tree.nodes if compositor_tree.ROLE in each]
        drivers.check(tree, frame, prefixes=[f"{path}." for path in ours])
    if scene.world is not None and (scene.umbra.environment_source == "WORLD" or environment.WORLD_BEFORE in scene):
        drivers.check(scene.world, frame)
        drivers.check(scene.world.node_tree, frame)


def requests_of(scene: bpy.types.Scene, frame: FrameSetup) -> list[MapRequest]:
    """Return all maps that a frame needs."""
    return registry.of(scene).map_requests(scene, frame)


def requests_at(scene: bpy.types.Scene, frame: int, view_layer_name: str | None = None) -> list[MapRequest]:
    """Return all maps that any frame needs; the scene is at its current frame afterwards."""
    if presence.is_absent(scene, frame) and frame_setup.find_active_hole(scene) is not None:
        return []  # hidden in renders
    layer = scene.view_layers.get(view_layer_name) if view_layer_name else None
    return requests_of(scene, read_at(scene, frame, layer))


def _requests_later(scene: bpy.types.Scene, view_layer_name: str | None) -> baking.RequestsAt:
    """Return a function that returns a frame's requests, however long it is kept."""
    uid, name = scene.session_uid, scene.name

    def requests(frame: int) -> list[MapRequest]:
        found = scene_of(uid)
        if found is None:
            raise SceneError(f'Scene "{name}" is gone: baking has stopped.', code="map.scene-gone")
        return requests_at(found, frame, view_layer_name)

    return requests


def bake(
    scene: bpy.types.Scene, frames: Iterable[int], view_layer_name: str | None = None
) -> Generator[baking.Progress, None, baking.Summary]:
    """Bake the maps of some frames, those that are missing or not valid, and show them.

    Parameters
    ----------
    scene : Scene
        The scene.
    frames : iterable of int
        Frames in the order of baking.
    view_layer_name : str, optional
        The view layer whose objects count; the first that is rendered by default.

    Raises
    ------
    physics.BlackHoleError
        As one sentence, which names the frame where there are several.
    """
    return _bake(scene.session_uid, list(frames), _requests_later(scene, view_layer_name))


def _bake(uid: int, frames: list[int], requests: baking.RequestsAt) -> Generator[baking.Progress, None, baking.Summary]:
    scene = scene_of(uid)
    try:
        summary = yield from baking.bake_frames(frames, requests)
        if scene is not None:
            star_sky.provide(scene, may_write=True)
            registry.of(scene).prepare_files(scene, may_bake=True)
    except physics.BlackHoleError:
        _show_baked(uid)  # those of the other frames
        raise
    _show_baked(uid)
    return summary


def _show_baked(uid: int) -> None:
    scene = scene_of(uid)
    if scene is not None:
        output = registry.of(scene)
        output.refresh(scene)
        output.forget_loaded_maps(scene)


def examine(
    scene: bpy.types.Scene, frames: Iterable[int], view_layer_name: str | None = None, *, thorough: bool = True
) -> Generator[baking.Progress, None, cache.Listing]:
    """Find out what the map of each frame is; see `cache.examine`."""
    return _with_names(scene, functools.partial(cache.examine, thorough=thorough), frames, view_layer_name)


def clean(
    scene: bpy.types.Scene,
    frames: Iterable[int],
    view_layer_name: str | None = None,
    *,
    everything: bool = False,
    dry_run: bool = False,
) -> Generator[baking.Progress, None, cache.Cleaning]:
    """Remove maps that are not valid, or all; see `cache.clean`."""
    work = functools.partial(cache.clean, everything=everything, dry_run=dry_run)
    return _with_names(scene, work, frames, view_layer_name)


def _with_names(
    scene: bpy.types.Scene, work: _Work[Result], frames: Iterable[int], view_layer_name: str | None
) -> Generator[baking.Progress, None, Result]:
    names = cache.FolderNames(scene, frame_setup.active_hole(scene).name)
    return work(list(frames), _requests_later(scene, view_layer_name), names)
