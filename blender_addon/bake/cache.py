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

from ..core.errors import SceneError
from ..core.physics_api import map_check, physics
from ..scene import frame_setup
from . import baking, claim, maps

State = map_check.State

# What a bake would replace.
FAULTY = (State.STALE, State.FOREIGN, State.DAMAGED)


@dataclass(frozen=True)
class FrameState:
    """The maps of one frame: one, its disk's passes counted in, or with the Cycles Lens two."""

    frame: int
    path: Path
    state: map_check.State
    fault: str
    size: int
    """Bytes."""
    superseded: tuple[Path, ...] = ()
    """Files of the same frame that its settings have no use for any more."""
    baker: str | None = None
    """The process that is baking it now."""
    faulty: tuple[tuple[Path, str], ...] = ()
    """Maps that a bake would replace, and why."""


@dataclass
class Listing:
    """What was found in the folder."""

    folder: Path
    frames: list[FrameState] = field(default_factory=list)
    leftovers: list[Path] = field(default_factory=list)
    """What processes that were killed have left: half files, and claims."""

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
            text += f"; {len(self.leftovers)} files that killed bakes have left"
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
    in_use: list[Path] = field(default_factory=list)
    """Files that stay, because a process is baking their frames."""

    @property
    def size(self) -> int:
        """Bytes that were, or would be, freed."""
        return sum(each.size for each in self.removed)

    def sentence(self) -> str:
        """One sentence for the artist."""
        if not self.removed:
            text = "Nothing to clean"
        else:
            verb = "Would remove" if self.dry_run else "Removed"
            text = f"{verb} {len(self.removed)} file{'' if len(self.removed) == 1 else 's'}, {self.size / 1e6:.1f} MB"
        if self.in_use:
            text += f"; {len(self.in_use)} stay, because their frames are being baked"
        return text + "."


class FolderNames:
    """The names in a map folder that are those of one scene's hole."""

    def __init__(self, scene: bpy.types.Scene, hole_name: str) -> None:
        self.folder = maps.folder(scene).path
        self._pattern = re.compile(
            re.escape(maps.names_of(scene, hole_name))
            + r"_(?P<size>\d+x\d+)_(?:disk(?P<crossing>\d+)_|world_)?(?P<number>\d{4,7})(?P<exit>_exit_[0-9a-f]+)?\.exr"
        )
        self.maps: list[tuple[str, Path]] = []
        """Maps and passes, of whatever size and frame, and the maps that they belong to."""
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
                self.maps.append((name, self._owner(match)))
                self._by_frame.setdefault((match["size"], int(match["number"])), []).append(match)
        self.leftovers = [
            (path, self._owner(match))
            for target, halves in maps.half_files(self.folder).items()
            if (match := self._pattern.fullmatch(target))
            for path in halves
        ] + [
            (self.folder / name, self._owner(match))
            for name in names
            if (target := claim.claimed_name(name)) and (match := self._pattern.fullmatch(target))
        ]
        """Half files and claims, of processes that live or not, and the maps that they belong to."""

    def _owner(self, match: re.Match[str]) -> Path:
        """The map that a file is one with: a disk's pass is its map's."""
        crossing = f"_disk{match['crossing']}_"
        return self.folder / match.string.replace(crossing, "_", 1 if match["crossing"] else 0)

    def superseded(self, path: Path, parameters: "physics.WarpMapParameters") -> tuple[Path, ...]:
        """Files of the same frame, size and kind beside a map that are not its own."""
        if maps.kind_of(path) is maps.WORLD_MAP:
            return ()
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
    names = FolderNames(scene, frame_setup.active_hole(scene).name)
    claims = claim.Claims()
    listing = Listing(names.folder, leftovers=[path for path, owner in names.leftovers if not claims.is_taken(owner)])
    for index, frame in enumerate(wanted):
        yield baking.Progress(frame, index / len(wanted), f"Frame {frame} ({index + 1} of {len(wanted)})")
        with baking.naming(frame, len(wanted)):
            needed = baking.maps_at(scene_named(scene_name), frame, view_layer_name)
        if needed:
            listing.frames.append(_state(frame, needed, names, claims, thorough))
    return listing


def _state(
    frame: int,
    needed: "list[tuple[Path, physics.WarpMapParameters]]",
    names: FolderNames,
    claims: claim.Claims,
    thorough: bool,
) -> FrameState:
    """What the maps of a frame are; with several, the state is that of the first which does not hold."""
    found = [(path, maps.check(path, parameters, thorough=thorough)) for path, parameters in needed]
    path, worst = next((each for each in found if each[1].state is not State.VALID), found[0])
    files = [each for path, parameters in needed for each in (path, *maps.pass_paths(path, parameters))]
    own = {each.name for each in files}
    superseded = {each for one in needed for each in names.superseded(*one) if each.name not in own}
    taken = worst.state is not State.VALID and claims.is_taken(path)
    return FrameState(
        frame,
        path,
        worst.state,
        worst.fault,
        sum(_size(each) for each in files),
        tuple(sorted(superseded)),
        claims.holder(path) if taken else None,
        tuple((each, one.fault) for each, one in found if one.state in FAULTY),
    )


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
    scene = scene_named(scene_name)
    names = FolderNames(scene, frame_setup.active_hole(scene).name)
    doomed: list[tuple[Path, Path, str]] = []
    if everything:
        yield baking.Progress(scene.frame_current, 0.0, "Cleaning")
        doomed += [(names.folder / each, owner, "every map was to be removed") for each, owner in names.maps]
    else:
        listing = yield from examine(scene_name, frames, view_layer_name)
        for each in listing.frames:
            doomed += [(path, path, fault) for path, fault in each.faulty]
            doomed += [(path, each.path, f"{path} is out of date") for path in each.superseded]
    doomed += [(path, owner, f"{path} was left by a process that was killed") for path, owner in names.leftovers]
    return _remove(doomed, dry_run)


def _remove(doomed: list[tuple[Path, Path, str]], dry_run: bool) -> Cleaning:
    """Remove files, unless the map that each belongs to is being baked; paths, maps and reasons."""
    cleaning = Cleaning(dry_run)
    with claim.Claims() as claims:
        for path, owner, reason in doomed:
            if not path.is_file():
                continue
            removal = Removal(path, reason, _size(path))
            try:
                if claims.is_taken(owner) if dry_run else not claims.take(owner):
                    cleaning.in_use.append(path)
                    continue
                if not dry_run:
                    path.unlink(missing_ok=True)
                    claims.release(owner)
            except OSError as error:
                raise maps.explain(error, path.parent) from error
            cleaning.removed.append(removal)
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
