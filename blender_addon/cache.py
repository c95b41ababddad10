# SPDX-License-Identifier: GPL-3.0-or-later
"""The maps of a shot as files: listed, verified and cleaned, from the window and from the command line alike.

Like baking, this is a generator that holds names instead of Blender's data. See `baking`.
"""

import os
import re
from collections import Counter
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from . import baking, maps, shot
from ._physics import exr, map_check, physics
from .errors import SceneError

State = map_check.State

# What a bake would replace.
FAULTY = (State.STALE, State.FOREIGN, State.DAMAGED)

# The folder's copies of maps, while a file is saved for the first time.
_PART = ".part"


@dataclass(frozen=True)
class FrameState:
    """The map of one frame, its disk's passes counted in."""

    frame: int
    path: Path
    state: map_check.State
    fault: str
    size: int
    """Bytes."""
    superseded: tuple[Path, ...] = ()
    """Files of the same frame that its settings have no use for any more."""


@dataclass
class Listing:
    """What was found in the folder."""

    folder: Path
    frames: list[FrameState] = field(default_factory=list)
    leftovers: list[Path] = field(default_factory=list)
    """Half files of processes that were killed."""

    @property
    def counts(self) -> dict[str, int]:
        """Frames by state, every state named."""
        counted = Counter(each.state for each in self.frames)
        return {str(state): counted[state] for state in State}

    @property
    def size(self) -> int:
        """Bytes of the frames' maps and passes."""
        return sum(each.size for each in self.frames)

    @property
    def complete(self) -> bool:
        """Whether every frame's map holds."""
        return all(each.state is State.VALID for each in self.frames)

    def sentence(self) -> str:
        """One sentence for the artist."""
        found = ", ".join(f"{count} {state}" for state, count in self.counts.items() if count)
        text = f"{len(self.frames)} frames: {found or 'none'}; {self.size / 1e6:.1f} MB in {self.folder}"
        if self.leftovers:
            text += f"; {len(self.leftovers)} half files of bakes that were killed"
        return text + "."


@dataclass(frozen=True)
class Removal:
    """A file that was, or would be, removed, and why."""

    path: Path
    reason: str
    size: int


@dataclass
class Cleaning:
    """What cleaning has done."""

    dry_run: bool
    removed: list[Removal] = field(default_factory=list)

    def sentence(self) -> str:
        """One sentence for the artist."""
        if not self.removed:
            return "Nothing to clean."
        size = sum(each.size for each in self.removed) / 1e6
        verb = "Would remove" if self.dry_run else "Removed"
        return f"{verb} {len(self.removed)} file{'' if len(self.removed) == 1 else 's'}, {size:.1f} MB."


class FolderNames:
    """The names in a map folder that are those of one scene's hole."""

    def __init__(self, scene: bpy.types.Scene, hole_name: str) -> None:
        self.folder = maps.folder(scene).path
        self._pattern = re.compile(
            re.escape(maps.names_of(scene, hole_name))
            + r"_(?P<size>\d+x\d+)_(?:disk(?P<crossing>\d+)_)?(?P<number>\d{4,7})(?P<exit>_exit_[0-9a-f]+)?\.exr"
        )
        self.maps: list[str] = []
        """Maps and passes, of whatever size and frame."""
        self.leftovers: list[str] = []
        self._by_frame: dict[tuple[str, int], list[re.Match[str]]] = {}
        try:
            names = sorted(os.listdir(self.folder))
        except FileNotFoundError:
            names = []
        except OSError as error:
            raise maps.explain_reading(error, self.folder) from error
        for name in names:
            match = self._pattern.fullmatch(name)
            if match is not None:
                self.maps.append(name)
                self._by_frame.setdefault((match["size"], int(match["number"])), []).append(match)
            elif self._is_leftover(name):
                self.leftovers.append(name)

    def _is_leftover(self, name: str) -> bool:
        target = exr.target_of(name)
        if target is None and name.startswith(".") and name.endswith(_PART):
            target = name.removeprefix(".").removesuffix(_PART)
        return target is not None and self._pattern.fullmatch(target) is not None

    def superseded(self, path: Path, parameters: "physics.WarpMapParameters") -> tuple[Path, ...]:
        """Files of the same frame, size and kind beside a map that are not its own."""
        match = self._pattern.fullmatch(path.name)
        others = self._by_frame.get((match["size"], int(match["number"])), ())
        own = {path.name, *(each.name for each in maps.pass_paths(path, parameters))}
        lensed = match["exit"] is not None
        return tuple(
            self.folder / each.string
            for each in others
            if each.string not in own and (each["exit"] is not None if lensed else each["crossing"] is not None)
        )


def examine(
    scene_name: str, frames: Iterable[int], view_layer_name: str | None = None, *, thorough: bool = True
) -> Generator[baking.Progress, None, Listing]:
    """Find out what the map of each frame is. Nothing is changed; the scene stands at its own frame.

    Parameters
    ----------
    scene_name : str
        The scene.
    frames : iterable of int
        The frames to list.
    view_layer_name : str, optional
        The view layer whose objects count, as for baking.
    thorough : bool
        Read each file whole and check it; otherwise headers are taken at their word.

    Raises
    ------
    physics.BlackHoleError
        The scene is gone, or a frame is impossible; the sentence names it.
    """
    wanted = list(frames)
    scene = scene_named(scene_name)
    names = FolderNames(scene, shot.active_hole(scene).name)
    listing = Listing(names.folder, leftovers=[names.folder / each for each in names.leftovers])
    for index, frame in enumerate(wanted):
        yield baking.Progress(frame, index / len(wanted), f"Frame {frame} ({index + 1} of {len(wanted)})")
        with baking.naming(frame, len(wanted)):
            path, parameters = baking.map_at(scene_named(scene_name), frame, view_layer_name)
        found = maps.check(path, parameters, thorough=thorough)
        size = sum(_size(each) for each in (path, *maps.pass_paths(path, parameters)))
        superseded = names.superseded(path, parameters)
        listing.frames.append(FrameState(frame, path, found.state, found.fault, size, superseded))
    return listing


def clean(
    scene_name: str,
    frames: Iterable[int],
    view_layer_name: str | None = None,
    *,
    everything: bool = False,
    dry_run: bool = False,
) -> Generator[baking.Progress, None, Cleaning]:
    """Remove the maps of some frames that are stale, foreign or damaged, and half files of processes that were killed.

    Parameters
    ----------
    scene_name, frames, view_layer_name
        As for `examine`.
    everything : bool
        Remove all maps of the scene's hole instead, valid ones too, of every frame, size and output.
    dry_run : bool
        Only say what would be removed.

    Raises
    ------
    physics.BlackHoleError
        As `examine` does; or a file cannot be removed.
    """
    cleaning = Cleaning(dry_run)
    scene = scene_named(scene_name)
    if everything:
        names = FolderNames(scene, shot.active_hole(scene).name)
        yield baking.Progress(scene.frame_current, 0.0, "Cleaning")
        for each in names.maps:
            _remove(cleaning, names.folder / each, "every map was to be removed")
        leftovers = [names.folder / each for each in names.leftovers]
    else:
        listing = yield from examine(scene_name, frames, view_layer_name)
        for each in listing.frames:
            if each.state in FAULTY:
                _remove(cleaning, each.path, each.fault)
            for path in each.superseded:
                _remove(cleaning, path, f"{path} is out of date")
        leftovers = listing.leftovers
    for path in leftovers:
        _remove(cleaning, path, f"{path} was left half written")
    return cleaning


def scene_named(name: str) -> bpy.types.Scene:
    """The scene of a name.

    Raises
    ------
    SceneError
        There is none; the sentence says which there are.
    """
    scene = bpy.data.scenes.get(name)
    if scene is None:
        names = ", ".join(f'"{each.name}"' for each in bpy.data.scenes)
        raise SceneError(f'There is no scene "{name}" in this file: its scenes are {names}.')
    return scene


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _remove(cleaning: Cleaning, path: Path, reason: str) -> None:
    if not path.is_file():
        return
    size = _size(path)
    if not cleaning.dry_run:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise maps.explain(error, path.parent) from error
    cleaning.removed.append(Removal(path, reason, size))
