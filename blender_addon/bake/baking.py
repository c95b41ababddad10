# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake warp maps: a generator does the work, drained without a window and stepped by a timer in one.

A generator is resumed from Blender's event loop, where undo or a newly loaded file may have replaced every
datablock since the last time. So it holds names, and looks the scene up each time.
"""

import functools
import re
import time
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import bpy

from ..core import stopping
from ..core.errors import SceneError
from ..core.physics_api import exit_map, exit_map_file, physics, world_map, world_map_file
from ..outputs.compositor import compositor_sync
from ..outputs.lens import lens_disk, lens_sync
from ..outputs.world import world_sync
from ..scene import frame_setup
from . import claim, maps

Baked = physics.WarpMap | exit_map.ExitMap | world_map.WorldMap

# What the maps of one bake or render have in common is kept here.
_baker = physics.MapBaker()

# What comes of a frame: its map was baked here, or held already.
BAKED, KEPT = "baked", "kept"

# How long a step waits for a map that is being written, and how often a map is looked for that another process is
# baking, seconds.
WAIT, POLL = 0.02, 0.5

# What a message that names its frame begins with.
_NAMED = re.compile(r"Frame -?\d+: ")

Result = TypeVar("Result")


@dataclass(frozen=True)
class Progress:
    """How far baking has come."""

    frame: int
    fraction: float
    """Share of all the work that is done, 0..1."""
    text: str
    outcome: str | None = None
    """`BAKED` or `KEPT` where the frame is done."""


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
            parts.append(f"{_count(len(self.reused), 'map')} still {'holds' if len(self.reused) == 1 else 'hold'}")
        text = (", ".join(parts) or "Nothing to bake").capitalize()
        if self.folder is not None and self.folder.is_temporary:
            text += f"; this file is not saved yet, so the maps are in a temporary folder: {self.folder.path}"
        return text + "."


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def bake_map(path: Path, parameters: "physics.WarpMapParameters") -> Generator[float, None, Baked]:
    """Bake one map, of the kind that its path says, into a file; yields the fraction done, and returns the map.

    Raises
    ------
    physics.BlackHoleError
        The parameters are impossible, or the file cannot be written.
    """
    baked = yield from _steps(path, parameters)
    _save(path, baked)
    return baked


def _steps(path: Path, parameters: "physics.WarpMapParameters") -> Generator[float, None, Baked]:
    """Bake a map of the kind that its path says, once it is sure that it can be written."""
    prepare(path, parameters)
    if maps.kind_of(path) is maps.EXIT_MAP:
        return (yield from exit_map.bake_exit_map_steps(parameters))
    if maps.kind_of(path) is maps.WORLD_MAP:
        return (yield from world_map.world_map_steps(parameters))
    return (yield from _baker.steps(parameters))


def prepare(path: Path, parameters: "physics.WarpMapParameters") -> None:
    """Make sure, before any work is done, that a map can be written with its passes; see `maps.prepare`."""
    maps.prepare(path, parameters.map_size, 1 + len(maps.pass_paths(path, parameters)))


def _save(path: Path, baked: Baked) -> None:
    """Write a map of any kind; this may run in a thread of its own, and touches nothing of Blender's."""
    if isinstance(baked, world_map.WorldMap):
        world_map_file.write_world_map(path, baked)
        return
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


def provide_map(scene: bpy.types.Scene, path: Path, parameters: "physics.WarpMapParameters", frame: int) -> None:
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
    prepare(path, parameters)
    noun = maps.kind_of(path).noun
    with claim.Claims() as claims:
        if not take(claims, path, parameters):
            _wait_for_claim(claims, path, parameters, f"the {noun} of frame {frame}")
        if maps.is_fresh(path, parameters):
            return
        where = " into a temporary folder (the file is not saved)" if maps.folder(scene).is_temporary else ""
        print(f"Umbra: baking the {noun} of frame {frame}{where}", flush=True)
        for _fraction in bake_map(path, parameters):
            claims.beat()


def _wait_for_claim(claims: claim.Claims, path: Path, parameters: "physics.WarpMapParameters", what: str) -> None:
    """Claim a map once the process that is baking it has ended, or is found dead.

    Raises
    ------
    SceneError
        The process was asked to end.
    """
    with stopping.stoppable() as stop:
        print(f"Umbra: waiting for {what}, which {claims.holder(path)} bakes", flush=True)
        while not take(claims, path, parameters):
            if stop.asked:
                raise SceneError(f"Stopped while waiting for {what}, which {claims.holder(path)} bakes.")
            time.sleep(POLL)


def parameters_of(scene: bpy.types.Scene, frame_shot: frame_setup.Shot) -> "physics.WarpMapParameters":
    """What the map of a shot is made from, for the scene's output."""
    parameters = frame_shot.parameters
    if world_sync.is_on(scene):
        return world_map.world_parameters(parameters)
    return lens_sync.exit_parameters(parameters) if lens_sync.is_on(scene) else parameters


def needs_maps(scene: bpy.types.Scene) -> bool:
    """Whether a scene's output reads any maps: a lens that traces its rays itself does for its disk alone."""
    return not lens_sync.is_on(scene) or lens_sync.uses_maps(scene) or lens_disk.is_in_use(scene)


def maps_of(scene: bpy.types.Scene, frame_shot: frame_setup.Shot) -> "list[tuple[Path, physics.WarpMapParameters]]":
    """All that a shot needs baked: where it lies, and what it is made from."""
    needed = []
    if not lens_sync.is_on(scene) or lens_sync.uses_maps(scene):
        needed.append((path_of(scene, frame_shot), parameters_of(scene, frame_shot)))
    if lens_sync.is_on(scene) and frame_shot.parameters.disk is not None and lens_disk.is_in_use(scene):
        needed.append((lens_disk.path_of(scene, frame_shot), lens_disk.parameters_of(scene, frame_shot)))
    return needed


def path_of(scene: bpy.types.Scene, frame_shot: frame_setup.Shot) -> Path:
    """Where the map of a shot lies, or will lie."""
    if lens_sync.is_on(scene):
        return maps.exit_map_path(scene, frame_shot.hole_name, parameters_of(scene, frame_shot), frame_shot.frame)
    if world_sync.is_on(scene):
        size = parameters_of(scene, frame_shot).map_size
        return maps.folder(scene).path / maps.world_map_name(scene, frame_shot.hole_name, size, frame_shot.frame)
    return maps.map_path(scene, frame_shot.hole_name, frame_shot.parameters.map_size, frame_shot.frame)


def maps_at(
    scene: bpy.types.Scene, frame: int, view_layer_name: str | None = None
) -> "list[tuple[Path, physics.WarpMapParameters]]":
    """All that any frame needs baked, as `maps_of` says; see `shot.read_at`."""
    layer = scene.view_layers.get(view_layer_name) if view_layer_name else None
    return maps_of(scene, frame_setup.read_at(scene, frame, layer))


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
        The view layer whose objects count; the first that is rendered by default.

    Raises
    ------
    physics.BlackHoleError
        As one sentence, which names the frame where there are several.
    """
    wanted = list(frames)
    with claim.Claims() as claims, physics.Background() as writing:
        work = _Work(scene_name, view_layer_name, wanted, claims, writing)
        todo, elsewhere = deque(wanted), deque[int]()
        while todo or elsewhere:
            if not todo:
                yield from work.finish_writing()
                yield from work.wait_for(elsewhere[0])
                todo, elsewhere = elsewhere, deque[int]()
            frame = todo.popleft()
            with naming(frame, len(wanted)):
                done = yield from work.bake(frame)
            if not done:
                elsewhere.append(frame)
        yield from work.finish_writing()
    finish(scene_name)
    return work.summary


class _Work:
    """A bake of several frames: while one map is traced, the one before is written."""

    def __init__(
        self,
        scene_name: str,
        view_layer_name: str | None,
        wanted: list[int],
        claims: claim.Claims,
        writing: physics.Background,
    ) -> None:
        self.summary = Summary()
        self._scene_name, self._view_layer_name = scene_name, view_layer_name
        self._places = {frame: index + 1 for index, frame in enumerate(wanted)}
        self._count = len(wanted)
        self._fraction = 0.0
        self._claims, self._writing = claims, writing
        self._half_files: dict[str, list[Path]] | None = None
        self._being_written: tuple[int, Path, bool] | None = None
        """Frame, path, and whether it is the frame's last map."""
        self._refused: Path | None = None
        """The last map that another process had claimed."""

    def bake(self, frame: int) -> Generator[Progress, None, bool]:
        """Bake a frame unless its map holds; return False where another process is doing it."""
        scene = bpy.data.scenes.get(self._scene_name)
        if scene is None:
            raise SceneError(f'Scene "{self._scene_name}" is gone: baking has stopped.')
        needed = maps_at(scene, frame, self._view_layer_name)
        self.summary.folder = maps.folder(scene)
        yield self._progress(frame)
        stale = [each for each in needed if not maps.is_fresh(*each)]
        made = False
        for path, parameters in stale:
            prepare(path, parameters)
            if self._half_files is None:
                self._half_files = maps.half_files(path.parent)
            if not take(self._claims, path, parameters, self._half_files):
                self._refused = path
                return False
            if maps.is_fresh(path, parameters):  # somebody else has made it in the meantime
                self._claims.release(path)
                if path == stale[-1][0] and made:
                    yield from self.finish_writing()
                    yield self._progress(frame, outcome=BAKED)
                continue
            baked = yield from self._trace(frame, path, parameters)
            yield from self.finish_writing()
            self._writing.start(functools.partial(_write, path, baked, frame, self._count))
            self._being_written = frame, path, path == stale[-1][0]
            made = True
        if made:
            self.summary.baked.append(frame)
            return True
        self.summary.reused.append(frame)
        yield self._progress(frame, outcome=KEPT)
        return True

    def _trace(
        self, frame: int, path: Path, parameters: "physics.WarpMapParameters"
    ) -> Generator[Progress, None, "physics.WarpMap | exit_map.ExitMap"]:
        steps = _steps(path, parameters)
        while True:
            try:
                fraction = next(steps)
            except StopIteration as end:
                self.summary.unresolved += end.value.counts.get("unresolved", 0)
                return end.value
            self._claims.beat()
            yield self._progress(frame, fraction)

    def finish_writing(self) -> Generator[Progress, None, None]:
        """Wait for the map that is being written, and give its claim back."""
        if self._being_written is None:
            return
        frame, path, is_last = self._being_written
        while not self._writing.wait(WAIT):
            self._claims.beat()
            yield self._progress(frame, doing=": writing")
        self._being_written = None
        self._claims.release(path)
        if is_last:
            yield self._progress(frame, outcome=BAKED)

    def wait_for(self, frame: int) -> Generator[Progress, None, None]:
        """Let some time pass: only frames are left that other processes are baking."""
        who = self._claims.holder(self._refused)
        for _ in range(round(POLL / WAIT)):
            time.sleep(WAIT)
            yield self._progress(frame, doing=f": waiting for {who}")

    def _progress(self, frame: int, fraction: float = 0.0, outcome: str | None = None, doing: str = "") -> Progress:
        done = len(self.summary.baked) + len(self.summary.reused)
        self._fraction = max(self._fraction, min((done + fraction) / self._count, 1.0))
        place = f" ({self._places[frame]} of {self._count})" if self._count > 1 else ""
        return Progress(frame, self._fraction, f"Frame {frame}{place}{doing}", outcome)


def take(
    claims: claim.Claims,
    path: Path,
    parameters: "physics.WarpMapParameters",
    half_files: dict[str, list[Path]] | None = None,
) -> bool:
    """Claim a frame's map, and remove what a process that was killed has left of it; False if another one has it.

    Raises
    ------
    MapFolderError
        The folder cannot be written to.
    """
    if half_files is None:
        half_files = maps.half_files(path.parent)
    try:
        if not claims.take(path):
            return False
        if not claims.owns(path):  # a bake beside this render is making it: its half files are alive
            return True
        for one in (path, *maps.pass_paths(path, parameters)):
            for half in half_files.pop(one.name, ()):
                half.unlink(missing_ok=True)
    except OSError as error:
        raise maps.explain(error, path.parent) from error
    return True


@contextmanager
def naming(frame: int, count: int) -> Iterator[None]:
    """Name the frame in what goes wrong, where there are several."""
    try:
        yield
    except physics.BlackHoleError as error:
        if count == 1 or _NAMED.match(str(error)):
            raise
        raise SceneError(f"Frame {frame}: {error}") from error


def _write(path: Path, baked: Baked, frame: int, count: int) -> None:
    with naming(frame, count):
        _save(path, baked)


def finish(scene_name: str) -> None:
    """Let the compositor see new maps."""
    forget_shared_rays()
    scene = bpy.data.scenes.get(scene_name)
    if scene is not None:
        if lens_sync.is_on(scene):
            lens_disk.point_at_passes(scene)
        else:
            compositor_sync.refresh(scene)
        compositor_sync.forget_loaded_map(scene)
    if scene is not None and world_sync.is_on(scene):
        world_sync.refresh(scene)
        world_sync.forget_loaded_map(scene)


def drain(
    steps: Generator[Progress, None, Result], *, announce: bool = False, doing: str = "Baking warp maps"
) -> Result:
    """Run a bake, or the like, to its end; with `announce`, each tenth of the work is printed."""
    told = -1
    while True:
        try:
            progress = next(steps)
        except StopIteration as end:
            return end.value
        tenth = int(progress.fraction * 10)
        if announce and tenth != told:
            told = tenth
            print(f"Umbra: {doing[0].lower()}{doing[1:]} {progress.fraction:4.0%}  {progress.text}", flush=True)
