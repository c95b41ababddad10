# SPDX-License-Identifier: GPL-3.0-or-later
"""The maps of a shot as files: listed, verified and cleaned, from the window and from the command line alike.

Like baking, these are generators that hold none of Blender's data. See `baking`.
"""

import os
import re
from collections import Counter
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from ..core.physics_api import physics
from . import baking, claim
from . import folder as map_folder
from .check import FAULTY, State, check
from .frame_list import frames_text
from .names import kind_of, name_pattern, shot_name
from .request import MapRequest


@dataclass(frozen=True)
class FrameState:
    """The maps of one frame: one, its disk's passes counted in, or with the Cycles Lens two."""

    frame: int
    path: Path | None
    """None where the frame is impossible."""
    state: str
    """One of `State`, or `baking.IMPOSSIBLE`."""
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
        """Frames by state, every state of a map named."""
        counted = Counter(str(each.state) for each in self.frames)
        return {str(state): 0 for state in State} | counted

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
    impossible: list[int] = field(default_factory=list)
    """Frames of which nobody can say what their maps should be."""
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
        if self.impossible:
            text += f"; maps of frames that are impossible stay: {frames_text(self.impossible)}"
        return text + "."


class FolderNames:
    """The names in a map folder that are those of one scene's hole."""

    def __init__(self, scene: bpy.types.Scene, hole_name: str) -> None:
        self.folder = map_folder.folder(scene).path
        self._pattern = name_pattern(shot_name(scene, hole_name))
        self.maps: list[tuple[str, Path]] = []
        """Maps and passes, of whatever size and frame, and the maps that they belong to."""
        self._by_frame: dict[tuple[str, int], list[re.Match[str]]] = {}
        try:
            names = sorted(os.listdir(self.folder))
        except FileNotFoundError:
            names = []
        except OSError as error:
            raise map_folder.explain_reading(error, self.folder) from error
        for name in names:
            match = self._pattern.fullmatch(name)
            if match is not None:
                self.maps.append((name, self._owner(match)))
                self._by_frame.setdefault((match["size"], int(match["number"])), []).append(match)
        self.leftovers = [
            (path, self._owner(match))
            for target, halves in map_folder.half_files(self.folder).items()
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
        end = match.start("beside")
        whole = match.string if end < 0 else match.string[:end] + match.string[match.end("beside") + 1 :]
        return self.folder / whole

    def superseded(self, wanted: MapRequest) -> tuple[Path, ...]:
        """Files of the same frame and size that the request has no use for: older maps of its kind, passes, layers."""
        match = self._pattern.fullmatch(wanted.path.name)
        if match is None:
            return ()
        others = self._by_frame.get((match["size"], int(match["number"])), ())
        own = {each.name for each in wanted.files}
        return tuple(
            self.folder / each.string
            for each in others
            if each.string not in own
            and (
                kind_of(each).is_layer
                or (kind_of(each) is wanted.kind and (wanted.kind.is_hashed or each["beside"] is not None))
            )
        )


def examine(
    frames: Iterable[int], requests_at: baking.RequestsAt, names: FolderNames, *, thorough: bool = True
) -> Generator[baking.Progress, None, Listing]:
    """Find out what the map of each frame is. Nothing is changed.

    Parameters
    ----------
    frames : iterable of int
        The frames to list.
    requests_at : callable
        Returns the requests of a frame.
    names : FolderNames
        The names in the folder.
    thorough : bool
        Read each file whole and check it; otherwise headers are trusted.

    Raises
    ------
    physics.BlackHoleError
        If the scene is gone, or the folder cannot be used.
    """
    wanted = list(frames)
    claims = claim.Claims()
    listing = Listing(names.folder, leftovers=[path for path, owner in names.leftovers if not claims.is_taken(owner)])
    for index, frame in enumerate(wanted):
        yield baking.Progress(frame, index / len(wanted), f"Frame {frame} ({index + 1} of {len(wanted)})")
        try:
            needed = requests_at(frame)
        except physics.BlackHoleError as error:
            if baking.is_fatal(error):
                raise
            listing.frames.append(FrameState(frame, None, baking.IMPOSSIBLE, str(error), 0))
            continue
        if needed:
            listing.frames.append(_state(frame, needed, names, claims, thorough))
    return listing


def _state(
    frame: int, needed: list[MapRequest], names: FolderNames, claims: claim.Claims, thorough: bool
) -> FrameState:
    """What the maps of a frame are; with several, the state is that of the first which is not valid."""
    found = [(wanted, check(wanted, thorough=thorough)) for wanted in needed]
    first, worst = next((each for each in found if each[1].state is not State.VALID), found[0])
    files = [each for wanted in needed for each in wanted.files]
    own = {each.name for each in files}
    superseded = {each for one in needed for each in names.superseded(one) if each.name not in own}
    taken = worst.state is not State.VALID and claims.is_taken(first.path)
    return FrameState(
        frame,
        first.path,
        worst.state,
        worst.fault,
        sum(_size(each) for each in files),
        tuple(sorted(superseded)),
        claims.holder(first.path) if taken else None,
        tuple((each.path, one.fault) for each, one in found if one.state in FAULTY),
    )


def clean(
    frames: Iterable[int],
    requests_at: baking.RequestsAt,
    names: FolderNames,
    *,
    everything: bool = False,
    dry_run: bool = False,
) -> Generator[baking.Progress, None, Cleaning]:
    """Remove the maps of some frames that are stale, foreign or damaged, and half files of killed processes.

    Parameters
    ----------
    frames, requests_at, names
        As for `examine`.
    everything : bool
        Remove all maps of the scene's hole instead, valid ones too, of every frame, size and output.
    dry_run : bool
        Only say what would be removed.

    Raises
    ------
    physics.BlackHoleError
        As `examine` does; or if a file cannot be removed.
    """
    wanted = list(frames)
    doomed: list[tuple[Path, Path, str]] = []
    impossible: list[int] = []
    if everything:
        yield baking.Progress(wanted[0] if wanted else 0, 0.0, "Cleaning")
        doomed += [(names.folder / each, owner, "every map was to be removed") for each, owner in names.maps]
    else:
        listing = yield from examine(wanted, requests_at, names)
        impossible = [each.frame for each in listing.frames if each.path is None]
        for each in listing.frames:
            if each.path is None:
                continue
            doomed += [(path, path, fault) for path, fault in each.faulty]
            doomed += [(path, each.path, f"{path} is out of date") for path in each.superseded]
    doomed += [(path, owner, f"{path} was left by a process that was killed") for path, owner in names.leftovers]
    return _remove(doomed, Cleaning(dry_run, impossible=impossible))


def _remove(doomed: list[tuple[Path, Path, str]], cleaning: Cleaning) -> Cleaning:
    """Remove files, unless the map that each belongs to is being baked; paths, maps and reasons."""
    dry_run = cleaning.dry_run
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
                raise map_folder.explain(error, path.parent) from error
            cleaning.removed.append(removal)
    return cleaning


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
