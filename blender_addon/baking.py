# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake warp maps: a generator does the work, drained without a window and stepped by a timer in one.

A generator is resumed from Blender's event loop, where undo or a newly loaded file may have replaced every
datablock since the last time. So it holds names, and looks the scene up each time.
"""

import functools
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from . import lens_disk, lens_sync, maps, shot, sync
from ._physics import exit_map, exit_map_file, physics
from .errors import SceneError

# What the maps of one bake or render have in common is kept here.
_baker = physics.MapBaker()

# How long a step waits for a map that is being written, seconds.
WAIT = 0.02


@dataclass(frozen=True)
class Progress:
    """How far baking has come."""

    frame: int
    fraction: float
    """Share of all the work that is done, 0..1."""
    text: str


@dataclass
class Summary:
    """What was done."""

    baked: list[int] = field(default_factory=list)
    reused: list[int] = field(default_factory=list)
    folder: maps.MapFolder | None = None
    unresolved: int = 0
    """Rays that no fate was found for within the allowed number of steps."""

    def sentence(self) -> str:
        """One sentence for the artist."""
        parts = []
        if self.baked:
            parts.append(f"baked {_count(len(self.baked), 'warp map')}")
        if self.reused:
            parts.append(
                f"{_count(len(self.reused), 'map')} still {'holds' if len(self.reused) == 1 else 'hold'}"
            )
        text = (", ".join(parts) or "Nothing to bake").capitalize()
        if self.folder is not None and self.folder.is_temporary:
            text += f"; this file is not saved yet, so the maps are in a temporary folder: {self.folder.path}"
        return text + "."


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def bake_map(
    path: Path, parameters: "physics.WarpMapParameters"
) -> Generator[float, None, "physics.WarpMap | exit_map.ExitMap"]:
    """Bake one map, of the kind that its path says, into a file; yields the fraction done, and returns the map.

    Raises
    ------
    physics.BlackHoleError
        The parameters are impossible, or the file cannot be written.
    """
    baked = yield from _steps(path, parameters)
    _save(path, baked)
    return baked


def _steps(
    path: Path, parameters: "physics.WarpMapParameters"
) -> Generator[float, None, "physics.WarpMap | exit_map.ExitMap"]:
    """Bake a map of the kind that its path says, once it is sure that it can be written."""
    maps.prepare(path, parameters.map_size, 1 + len(maps.pass_paths(path, parameters)))
    if maps.kind_of(path) is maps.EXIT_MAP:
        return (yield from exit_map.bake_exit_map_steps(parameters))
    return (yield from _baker.steps(parameters))


def _save(path: Path, baked: "physics.WarpMap | exit_map.ExitMap") -> None:
    """Write a map of either kind; this may run in a thread of its own, and touches nothing of Blender's."""
    if not isinstance(baked, exit_map.ExitMap):
        _write_all(path, baked)
        return
    exit_map_file.write_exit_map(path, baked)
    for older in maps.older_exit_maps(path):
        older.unlink(missing_ok=True)


def _write_all(path: Path, warp_map: "physics.WarpMap") -> None:
    """Write a map and its disk's passes; the map comes last, so that where it holds they are there."""
    for one in warp_map.disk_passes:
        physics.write_disk_pass(maps.pass_path(path, one.metadata["crossing"]), one)
    physics.write_warp_map(path, warp_map)


def forget_shared_rays() -> None:
    """Free the memory of what maps have in common, when a bake or a render is over."""
    global _baker
    _baker = physics.MapBaker()


def provide_map(
    scene: bpy.types.Scene, path: Path, parameters: "physics.WarpMapParameters", frame: int
) -> None:
    """Make sure, for a render, that a frame's map holds.

    Raises
    ------
    physics.BlackHoleError
        It does not, and may not or cannot be baked.
    """
    fault = maps.fault_of(path, parameters)
    if fault is None:
        return
    if not scene.umbra.auto_bake:
        raise SceneError(f"{fault}: bake it, or switch on Bake When Rendering in the Umbra panel.")
    where = " into a temporary folder (the file is not saved)" if maps.folder(scene).is_temporary else ""
    print(f"Umbra: baking the {maps.kind_of(path).noun} of frame {frame}{where}", flush=True)
    for _fraction in bake_map(path, parameters):
        pass


def parameters_of(scene: bpy.types.Scene, frame_shot: shot.Shot) -> "physics.WarpMapParameters":
    """What the map of a shot is made from, for the scene's output."""
    parameters = frame_shot.parameters
    return lens_sync.exit_parameters(parameters) if lens_sync.is_on(scene) else parameters


def maps_of(scene: bpy.types.Scene, frame_shot: shot.Shot) -> "list[tuple[Path, physics.WarpMapParameters]]":
    """All that a shot needs baked: where it lies, and what it is made from."""
    needed = []
    if not lens_sync.is_on(scene) or lens_sync.uses_maps(scene):
        needed.append((path_of(scene, frame_shot), parameters_of(scene, frame_shot)))
    if lens_sync.is_on(scene) and frame_shot.parameters.disk is not None and lens_disk.is_in_use(scene):
        needed.append((lens_disk.path_of(scene, frame_shot), lens_disk.parameters_of(scene, frame_shot)))
    return needed


def path_of(scene: bpy.types.Scene, frame_shot: shot.Shot) -> Path:
    """Where the map of a shot lies, or will lie."""
    if lens_sync.is_on(scene):
        return maps.exit_map_path(scene, frame_shot.hole_name, parameters_of(scene, frame_shot), frame_shot.frame)
    return maps.map_path(scene, frame_shot.hole_name, frame_shot.parameters.map_size, frame_shot.frame)


def bake_frames(
    scene_name: str, frames: Iterable[int], view_layer_name: str | None = None
) -> Generator[Progress, None, Summary]:
    """Bake the maps of some frames of a scene, those that do not hold any more or are missing.

    The scene stands at its own frame whenever the generator yields. Closing the generator cancels the work;
    maps that are finished stay.

    Parameters
    ----------
    scene_name : str
        The scene.
    frames : iterable of int
        Frames in the order of baking.
    view_layer_name : str, optional
        The view layer whose objects count; the scene's first by default.

    Raises
    ------
    physics.BlackHoleError
        As one sentence, which names the frame where there are several.
    """
    wanted = list(frames)
    summary = Summary()
    with physics.Background() as writing:
        for index, frame in enumerate(wanted):
            scene = bpy.data.scenes.get(scene_name)
            if scene is None:
                raise SceneError(f'Scene "{scene_name}" is gone: baking has stopped.')
            text = f"Frame {frame}" + (f" ({index + 1} of {len(wanted)})" if len(wanted) > 1 else "")
            with _naming(frame, len(wanted)):
                layer = scene.view_layers.get(view_layer_name) if view_layer_name else None
                frame_shot = shot.read_at(scene, frame, layer)
                needed = maps_of(scene, frame_shot)
                summary.folder = maps.folder(scene)
                yield Progress(frame, index / len(wanted), text)
                stale = [each for each in needed if not maps.is_fresh(*each)]
            for number, (path, parameters) in enumerate(stale):
                with _naming(frame, len(wanted)):
                    steps = _steps(path, parameters)
                    while True:
                        try:
                            fraction = next(steps)
                        except StopIteration as end:
                            baked = end.value
                            break
                        yield Progress(frame, (index + (number + fraction) / len(stale)) / len(wanted), text)
                summary.unresolved += baked.counts.get("unresolved", 0)
                while not writing.wait(WAIT):
                    yield Progress(frame, (index + (number + 1) / len(stale)) / len(wanted), text)
                writing.start(functools.partial(_write, path, baked, frame, len(wanted)))
            (summary.baked if stale else summary.reused).append(frame)
        while not writing.wait(WAIT):
            yield Progress(wanted[-1], 1.0, "Writing")
    finish(scene_name)
    return summary


@contextmanager
def _naming(frame: int, count: int) -> Iterator[None]:
    """Name the frame in what goes wrong, where there are several."""
    try:
        yield
    except physics.BlackHoleError as error:
        prefix = f"Frame {frame}: "
        if count == 1 or str(error).startswith(prefix):
            raise
        raise SceneError(prefix + str(error)) from error


def _write(path: Path, baked: "physics.WarpMap | exit_map.ExitMap", frame: int, count: int) -> None:
    with _naming(frame, count):
        _save(path, baked)


def finish(scene_name: str) -> None:
    """Let the compositor see new maps."""
    forget_shared_rays()
    scene = bpy.data.scenes.get(scene_name)
    if scene is not None:
        if lens_sync.is_on(scene):
            lens_disk.point_at_passes(scene)
        else:
            sync.refresh(scene)
        sync.forget_loaded_map(scene)


def drain(steps: Generator[Progress, None, Summary], *, announce: bool = False) -> Summary:
    """Run a bake to its end; with `announce`, each tenth of the work is printed."""
    told = -1
    while True:
        try:
            progress = next(steps)
        except StopIteration as end:
            return end.value
        tenth = int(progress.fraction * 10)
        if announce and tenth != told:
            told = tenth
            print(f"Umbra: baking warp maps {progress.fraction:4.0%}  {progress.text}", flush=True)
