# SPDX-License-Identifier: GPL-3.0-or-later
"""Claims: which process is making which file, so that several, on one machine or many, can fill a folder together.

A claim is a small file beside the one that it is for, made in one step that fails if it is there already (a link, or
O_CREAT with O_EXCL), which network file systems keep to as well; no locks are relied upon. It says who holds it, and
its time is renewed as a sign of life. Whoever claims a file looks first whether that has been made in the meantime, and
files are replaced whole, so that the worst that a mistaken claim can do is work done twice.

A claim is dead if its process is gone, as far as that can be seen on the same machine; or if it has shown no sign of
life for `STALE_AFTER`, by the file system's clock (that of a file made there now) or by the watch of the observer.
Clocks of different machines are never compared. The claim of a dead process stays where it is, and the next
*generation* is claimed beside it, in one step again: so no two processes can take over from the same one.
"""

from __future__ import annotations

import json
import os
import platform
import re
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any

# Seconds between signs of life, and without one until a claim is nobody's.
HEARTBEAT = 5.0
STALE_AFTER = 60.0

# However old a claim looks, it is watched for so long before it is taken over from another machine.
LEAST_WATCH = 2.5 * HEARTBEAT

_NAME = re.compile(r"\.(.+)\.claim\d+")

# Files that this process holds a claim to.
_own: set[Path] = set()


def claim_path(target: Path, generation: int = 1) -> Path:
    """Return where the claim of a file lies, hidden beside it."""
    return target.with_name(f".{target.name}.claim{generation}")


def claimed_name(name: str) -> str | None:
    """Return the name of the file that a claim's file is for; None for any other name."""
    match = _NAME.fullmatch(name)
    return None if match is None else match[1]


@dataclass(frozen=True)
class Holder:
    """Whose a claim is."""

    host: str
    process: int
    machine: str
    """What tells one running system, and container, from any other."""
    started: str
    """When the process began, on its machine; it tells a process from a later one of the same number."""

    @classmethod
    def this(cls) -> Holder:
        """Return this process."""
        return cls(platform.node(), os.getpid(), _machine(), _process_start(os.getpid()) or "")

    @classmethod
    def read(cls, content: bytes) -> Holder | None:
        """Return the holder that a claim names; None if it names none, because it is just being written."""
        try:
            values = json.loads(content)
            return cls(str(values["host"]), int(values["process"]), str(values["machine"]), str(values["started"]))
        except (ValueError, KeyError, TypeError):
            return None

    def to_bytes(self) -> bytes:
        """Return what a claim's file says."""
        return json.dumps(self.__dict__).encode()

    def __str__(self) -> str:
        return f"{self.host or 'another machine'} (process {self.process})"

    def is_gone(self) -> bool:
        """Whether the process has certainly ended; unknown, hence False, on other machines."""
        if self.machine != _machine() or os.name != "posix":
            return False
        try:
            os.kill(self.process, 0)
        except ProcessLookupError:
            return True
        except OSError:
            return False
        start = _process_start(self.process)
        return bool(self.started) and start is not None and start != self.started


@cache
def _machine() -> str:
    """Return what tells this running system from others: containers may share a name, or the numbers of processes."""
    parts = [platform.node()]
    try:
        parts.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip())
        parts.append(os.readlink("/proc/self/ns/pid"))
    except OSError:  # not Linux
        pass
    return " ".join(parts)


def _process_start(process: int) -> str | None:
    """Return when a process began, in the system's own unit; "ended" for a zombie; None if that is unknown."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()  # the name before may hold anything
    return "ended" if fields[0] == "Z" else fields[19]


@dataclass
class _Sighting:
    signature: tuple[int, bytes]
    since: float


@dataclass
class _Held:
    path: Path
    generation: int
    beaten: float


class Claims:
    """The claims that one piece of work holds, and what it knows of those of others. Use `with`: it releases them."""

    def __init__(self) -> None:
        self._held: dict[Path, _Held | None] = {}
        self._sightings: dict[Path, _Sighting] = {}

    def take(self, target: Path, *, watch: bool = True) -> bool:
        """Claim a file; return False while another process, which seems to be alive, has it.

        Parameters
        ----------
        target : Path
            The file to be made. Look whether it is there already once it is claimed.
        watch : bool
            Watch another machine's claim for a while, over several calls, before taking it over; otherwise its age by
            the file system's clock is taken at its word.

        Raises
        ------
        OSError
            When the folder cannot be written to.
        """
        if target in self._held:
            return True
        if target in _own:  # another piece of work of this process: waiting for it would be for ever
            self._held[target] = None
            return True
        generation = 1
        while True:
            path = claim_path(target, generation)
            try:
                _make(path, Holder.this().to_bytes())
            except FileExistsError:
                if not self._is_dead(path, watch):
                    return False
                generation += 1
                continue
            break
        later = claim_path(target, generation + 1)
        if later.exists() and not self._is_dead(later, watch):
            path.unlink(missing_ok=True)  # it was one of a dead process, and has been taken over already
            return False
        self._held[target] = _Held(path, generation, time.monotonic())
        _own.add(target)
        return True

    def owns(self, target: Path) -> bool:
        """Whether a file was claimed by this very piece of work, and not by another one of the same process."""
        return self._held.get(target) is not None

    def is_taken(self, target: Path, *, watch: bool = True) -> bool:
        """Whether a process that seems to be alive has claimed a file; nothing is claimed by asking."""
        if target in _own:
            return True
        generation = 1
        while (path := claim_path(target, generation)).exists():
            if not self._is_dead(path, watch):
                return True
            generation += 1
        return False

    def holder(self, target: Path) -> str:
        """Return whose the claim to a file is, for a message."""
        generation, found = 1, None
        while True:
            try:
                found = Holder.read(claim_path(target, generation).read_bytes())
            except OSError:
                return "another process" if found is None else str(found)
            generation += 1

    def beat(self) -> None:
        """Give a sign of life, if the last one was long enough ago; call it often."""
        now = time.monotonic()
        for held in self._held.values():
            if held is not None and now - held.beaten >= HEARTBEAT:
                held.beaten = now
                try:
                    os.utime(held.path)  # the file server's own time
                except OSError:
                    continue  # it was removed, or the network is away: the work goes on

    def release(self, target: Path) -> None:
        """Give a claim back, and with it those of dead processes that it was taken over from."""
        held = self._held.pop(target, None)
        if held is None:
            return
        _own.discard(target)
        for generation in range(held.generation, 0, -1):
            try:
                claim_path(target, generation).unlink(missing_ok=True)
            except OSError:
                continue  # it will be found dead

    def _is_dead(self, path: Path, watch: bool) -> bool:
        try:
            # opening, unlike asking for the time alone, makes network file systems look what is on the server
            with path.open("rb") as stream:
                content = stream.read()
                changed = os.fstat(stream.fileno()).st_mtime_ns
        except OSError:
            return False  # it is just being given back
        holder = Holder.read(content)
        if holder is not None and holder.is_gone():
            return True
        if holder is not None and holder == Holder.this():
            return True  # this process's own, which `_own` would know if it were in use
        now = time.monotonic()
        sighting = self._sightings.get(path)
        if sighting is None or sighting.signature != (changed, content):
            sighting = self._sightings[path] = _Sighting((changed, content), now)
        quiet = now - sighting.since
        if quiet >= (STALE_AFTER if holder is not None else LEAST_WATCH):
            return True
        if watch and quiet < LEAST_WATCH:
            return False
        return _file_system_time(path.parent) - changed >= STALE_AFTER * 1e9

    def __enter__(self) -> Claims:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: Any, trace: TracebackType | None) -> None:
        """Give all claims back."""
        for target in list(self._held):
            self.release(target)


def _make(path: Path, content: bytes) -> None:
    """Make a claim with its content in one step.

    Raises
    ------
    FileExistsError
        When it is there already.
    """
    target = path.with_name(str(claimed_name(path.name)))
    handle, name = tempfile.mkstemp(prefix=f".{target.stem}.", suffix=f".tmp{target.suffix}", dir=path.parent)
    draft = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        try:
            os.link(draft, path)
        except FileExistsError:
            if not draft.exists() or draft.stat().st_nlink != 2:  # 2: the server did it, and its answer was lost
                raise
        except OSError:  # a file system without links: two steps, and whoever comes between finds no name yet
            with path.open("xb") as stream:
                stream.write(content)
    finally:
        draft.unlink(missing_ok=True)


def _file_system_time(folder: Path) -> int:
    """Return the time, in nanoseconds, that the file system gives a file made now."""
    with tempfile.TemporaryFile(dir=folder) as probe:
        return os.fstat(probe.fileno()).st_mtime_ns
