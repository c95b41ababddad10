# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake maps: a generator does the work, drained without a window and stepped by a timer in one.

A generator is resumed from Blender's event loop, where undo or a newly loaded file may have replaced every datablock
since the last time. So it holds none, and asks for the requests of each frame when it gets there.
"""

import functools
import re
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from ..core import stopping
from ..core.errors import SceneError
from ..core.physics_api import physics
from . import claim
from . import folder as map_folder
from .check import fault_of, is_valid, stamps
from .frame_list import frames_text
from .kinds import forget_shared_rays
from .request import MapRequest, older_maps
from .reuse import OtherNames

# What comes of a frame: its map was baked here, or was valid already; or there can be none.
BAKED, KEPT, IMPOSSIBLE = "baked", "kept", "impossible"

# Codes of errors that end all of the work: those of files, and these. Others are of one frame alone.
_FATAL_KINDS, _FATAL = ("folder", "file", "command"), ("map.scene-gone",)

# How long a step waits for a map that is being written, and how often a map is looked for that another process is
# baking, seconds.
WAIT, POLL = 0.02, 0.5

# What a message that names its frame begins with.
_NAMED = re.compile(r"Frame -?\d+: ")

Result = TypeVar("Result")

# The requests of a frame, by its number.
RequestsAt = Callable[[int], list[MapRequest]]


@dataclass(frozen=True)
class Progress:
    """How far baking has come."""

    frame: int
    fraction: float
    """Share of all the work that is done, 0 to 1."""
    text: str
    outcome: str | None = None
    """`BAKED`, `KEPT` or `IMPOSSIBLE` where the frame is done."""


@dataclass
class Summary:
    """What was done."""

    baked: list[int] = field(default_factory=list)
    reused: list[int] = field(default_factory=list)
    folder: map_folder.MapFolder | None = None
    unresolved: int = 0
    """Rays that no fate was found for within the allowed number of steps."""
    impossible: "dict[int, physics.BlackHoleError]" = field(default_factory=dict)
    """Frames that cannot be baked, and why."""

    def sentence(self) -> str:
        """Return one sentence for the artist."""
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


def bake_map(wanted: MapRequest) -> Generator[float, None, Any]:
    """Bake one map into its file: yield the fraction done, return the map.

    Raises
    ------
    physics.BlackHoleError
        If the parameters are impossible or the file cannot be written.
    """
    prepare(wanted)
    baked = yield from wanted.kind.steps(wanted.parameters)
    _save(wanted, baked)
    return baked


def prepare(wanted: MapRequest) -> None:
    """Make sure, before any work is done, that a map can be written with its passes; see `folder.prepare`."""
    map_folder.prepare(wanted.path, wanted.parameters.map_size, len(wanted.files))


def _save(wanted: MapRequest, baked: Any) -> None:
    """Write a map; this may run in a thread of its own, and touches nothing of Blender's."""
    wanted.write(baked)
    for older in older_maps(wanted):
        older.unlink(missing_ok=True)


def provide(wanted: MapRequest, *, may_bake: bool) -> dict[Path, object]:
    """Make sure, for a render, that a frame's map is valid; return the stamps of the files that are.

    Raises
    ------
    physics.BlackHoleError
        If it is not, and may not or cannot be baked.
    """
    found = stamps(wanted)
    fault = fault_of(wanted)
    if fault is not None and take_over(wanted, OtherNames(wanted.path.parent)):
        found = stamps(wanted)
        fault = fault_of(wanted)
    if fault is None:
        return found
    if not may_bake:
        raise SceneError(
            f"{fault}: bake it, or switch on Bake When Rendering in the Umbra panel.", code="map.out-of-date"
        )
    prepare(wanted)
    with claim.Claims() as claims:
        if not take(claims, wanted):
            _wait_for_claim(claims, wanted)
        found = stamps(wanted)
        if is_valid(wanted):
            return found
        where = " into a temporary folder (the file is not saved)" if wanted.folder.is_temporary else ""
        print(f"Umbra: baking {wanted.what}{where}", flush=True)
        for _fraction in bake_map(wanted):
            claims.beat()
        return stamps(wanted)


def _wait_for_claim(claims: claim.Claims, wanted: MapRequest) -> None:
    """Claim a map once the process that is baking it has ended, or is found dead.

    Raises
    ------
    SceneError
        If the process is asked to end.
    """
    with stopping.stoppable() as stop:
        print(f"Umbra: waiting for {wanted.what}, which {claims.holder(wanted.path)} bakes", flush=True)
        while not take(claims, wanted):
            if stop.asked:
                raise SceneError(
                    f"Stopped while waiting for {wanted.what}, which {claims.holder(wanted.path)} bakes.",
                    code="command.stopped",
                )
            time.sleep(POLL)


def bake_frames(frames: Iterable[int], requests_at: RequestsAt) -> Generator[Progress, None, Summary]:
    """Bake the maps of some frames: those that are missing or not valid.

    Closing the generator cancels the work; maps that are finished stay.

    Parameters
    ----------
    frames : iterable of int
        Frames in the order of baking.
    requests_at : callable
        Returns the requests of a frame. The scene is at its own frame again when it returns.

    Raises
    ------
    physics.BlackHoleError
        As one sentence, which names the frame where there are several. If frames are impossible, the others are baked
        first.
    """
    wanted = list(frames)
    with claim.Claims() as claims, physics.Background() as writing:
        work = _Work(requests_at, wanted, claims, writing)
        todo, elsewhere = deque(wanted), deque[int]()
        while todo or elsewhere:
            if not todo:
                yield from work.finish_writing()
                yield from work.wait_for(elsewhere[0])
                todo, elsewhere = elsewhere, deque[int]()
            frame = todo.popleft()
            try:
                with naming(frame, len(wanted)):
                    done = yield from work.bake(frame)
            except physics.BlackHoleError as error:
                if is_fatal(error):
                    raise
                yield work.note_impossible(frame, error)
                continue
            if not done:
                elsewhere.append(frame)
        yield from work.finish_writing()
    forget_shared_rays()
    _check_possible(work.summary.impossible, len(wanted))
    return work.summary


def is_fatal(error: "physics.BlackHoleError") -> bool:
    """Whether an error is of more than one frame, so that the work cannot go on with the others."""
    return error.code in _FATAL or error.code.partition(".")[0] in _FATAL_KINDS


def _check_possible(impossible: "dict[int, physics.BlackHoleError]", count: int) -> None:
    if not impossible:
        return
    first = impossible[min(impossible)]
    if len(impossible) == count == 1:
        raise first
    which = f"Frame {min(impossible)} is" if len(impossible) == 1 else f"Frames {frames_text(sorted(impossible))} are"
    left = count - len(impossible)
    others = {0: "no other was asked for", 1: "the other one has its map"}.get(
        left, f"the other {left} have their maps"
    )
    raise SceneError(f"{which} impossible, {others}. {first}", code=first.code)


class _Work:
    """A bake of several frames: while one map is traced, the one before is written."""

    def __init__(
        self, requests_at: RequestsAt, wanted: list[int], claims: claim.Claims, writing: "physics.Background"
    ) -> None:
        self.summary = Summary()
        self._requests_at = requests_at
        self._places = {frame: index + 1 for index, frame in enumerate(wanted)}
        self._count = len(wanted)
        self._fraction = 0.0
        self._claims, self._writing = claims, writing
        self._half_files: dict[str, list[Path]] | None = None
        self._other_names: OtherNames | None = None
        self._being_written: tuple[MapRequest, bool] | None = None
        """The request, and whether it is the frame's last map."""
        self._refused: Path | None = None
        """The last map that another process had claimed."""

    def bake(self, frame: int) -> Generator[Progress, None, bool]:
        """Bake a frame unless its maps are valid; return False where another process is baking it."""
        needed = self._requests_at(frame)
        self.summary.folder = needed[0].folder if needed else None
        yield self._progress(frame)
        stale = [each for each in needed if not is_valid(each)]
        made = False
        for wanted in stale:
            prepare(wanted)
            if not take(self._claims, wanted, self._half_files_beside(wanted.path)):
                self._refused = wanted.path
                return False
            is_last = wanted is stale[-1]
            take_over(wanted, self._other_names_beside(wanted.path))
            if is_valid(wanted):  # it was there by another name, or somebody else has made it in the meantime
                self._claims.release(wanted.path)
                if is_last and made:
                    yield from self.finish_writing()
                    yield self._progress(frame, outcome=BAKED)
                continue
            try:
                baked = yield from self._trace(wanted)
            except physics.BlackHoleError:
                self._claims.release(wanted.path)
                raise
            yield from self.finish_writing()
            self._writing.start(functools.partial(_write, wanted, baked, self._count))
            self._being_written = wanted, is_last
            made = True
        if made:
            self.summary.baked.append(frame)
            return True
        self._sweep(needed)
        self.summary.reused.append(frame)
        yield self._progress(frame, outcome=KEPT)
        return True

    def _sweep(self, needed: list[MapRequest]) -> None:
        """Remove what a killed process has left of maps that are valid all the same."""
        for wanted in needed:
            half_files = self._half_files_beside(wanted.path)
            if claim.claim_path(wanted.path).exists() or any(one.name in half_files for one in wanted.files):
                with suppress(physics.BlackHoleError):  # a folder that can only be read
                    if take(self._claims, wanted, half_files):
                        self._claims.release(wanted.path)

    def _half_files_beside(self, path: Path) -> dict[str, list[Path]]:
        if self._half_files is None:
            self._half_files = map_folder.half_files(path.parent)
        return self._half_files

    def _other_names_beside(self, path: Path) -> OtherNames:
        if self._other_names is None:
            self._other_names = OtherNames(path.parent)
        return self._other_names

    def note_impossible(self, frame: int, error: "physics.BlackHoleError") -> Progress:
        """Leave a frame out that cannot be baked."""
        self.summary.impossible[frame] = error
        return self._progress(frame, outcome=IMPOSSIBLE)

    def _trace(self, wanted: MapRequest) -> Generator[Progress, None, Any]:
        steps = wanted.kind.steps(wanted.parameters)
        while True:
            try:
                fraction = next(steps)
            except StopIteration as end:
                self.summary.unresolved += end.value.counts.get("unresolved", 0)
                return end.value
            self._claims.beat()
            yield self._progress(wanted.frame, fraction)

    def finish_writing(self) -> Generator[Progress, None, None]:
        """Wait for the map that is being written, and give its claim back."""
        if self._being_written is None:
            return
        wanted, is_last = self._being_written
        while not self._writing.wait(WAIT):
            self._claims.beat()
            yield self._progress(wanted.frame, doing=": writing")
        self._being_written = None
        self._claims.release(wanted.path)
        if is_last:
            yield self._progress(wanted.frame, outcome=BAKED)

    def wait_for(self, frame: int) -> Generator[Progress, None, None]:
        """Let some time pass: only frames are left that other processes are baking."""
        who = "another process" if self._refused is None else self._claims.holder(self._refused)
        for _ in range(round(POLL / WAIT)):
            time.sleep(WAIT)
            yield self._progress(frame, doing=f": waiting for {who}")

    def _progress(self, frame: int, fraction: float = 0.0, outcome: str | None = None, doing: str = "") -> Progress:
        done = len(self.summary.baked) + len(self.summary.reused) + len(self.summary.impossible)
        self._fraction = max(self._fraction, min((done + fraction) / self._count, 1.0))
        place = f" ({self._places[frame]} of {self._count})" if self._count > 1 else ""
        return Progress(frame, self._fraction, f"Frame {frame}{place}{doing}", outcome)


def take(claims: claim.Claims, wanted: MapRequest, half_files: dict[str, list[Path]] | None = None) -> bool:
    """Claim a map and remove what a killed process has left of it; return False if another process has it.

    Raises
    ------
    MapFolderError
        If the folder cannot be written to.
    """
    parent = wanted.path.parent
    if half_files is None:
        half_files = map_folder.half_files(parent)
    try:
        if not claims.take(wanted.path):
            return False
        if not claims.owns(wanted.path):  # a bake beside this render is making it: its half files are alive
            return True
        for one in wanted.files:
            for half in half_files.pop(one.name, ()):
                half.unlink(missing_ok=True)
    except OSError as error:
        raise map_folder.explain(error, parent) from error
    return True


def take_over(wanted: MapRequest, others: OtherNames) -> bool:
    """Take a map over from another name; return whether that was possible."""
    with suppress(OSError):  # a folder that cannot be written to is named when the map is baked
        return others.take_over(wanted)
    return False


@contextmanager
def naming(frame: int, count: int) -> Iterator[None]:
    """Name the frame in the message of an error, where there are several frames."""
    try:
        yield
    except physics.BlackHoleError as error:
        if count == 1 or _NAMED.match(str(error)):
            raise
        raise SceneError(f"Frame {frame}: {error}", code=error.code) from error


def _write(wanted: MapRequest, baked: Any, count: int) -> None:
    with naming(wanted.frame, count):
        _save(wanted, baked)


def drain(
    steps: Generator[Progress, None, Result], *, announce: bool = False, doing: str = "Baking warp maps"
) -> Result:
    """Run a bake, or the like, to its end; with `announce`, each tenth of the work is printed."""
    told = -1
    while True:
        try:
            progress = next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        tenth = int(progress.fraction * 10)
        if announce and tenth != told:
            told = tenth
            print(f"Umbra: {doing[0].lower()}{doing[1:]} {progress.fraction:4.0%}  {progress.text}", flush=True)
