# SPDX-License-Identifier: GPL-3.0-or-later
"""Claims: a small file beside each map says which process is baking it, so that several can fill a folder together.

The file is created exclusively, which network file systems support, and its time is renewed during the bake. A claim is
dead if its process has ended on this machine, or if it was not renewed for `STALE_AFTER` by the file system's clock.

A claim only saves work: maps are replaced atomically, and every process checks a map again once it has claimed it. The
worst that a mistaken claim can cause is a map that is baked twice.
"""

import contextlib
import json
import os
import platform
import re
import tempfile
import time
from pathlib import Path
from typing import Any

# Seconds between renewals, and seconds without one after which a claim is dead.
HEARTBEAT = 5.0
STALE_AFTER = 60.0

_NAME = re.compile(r"\.(.+)\.claim(\.next|\d*)")

# Files that this process has claimed.
_own: set[Path] = set()


def claim_path(target: Path) -> Path:
    """Return the path of a file's claim, hidden beside it."""
    return target.with_name(f".{target.name}.claim")


def claimed_name(name: str) -> str | None:
    """Return the name of the file that a claim is for, or None if the name is not that of a claim."""
    match = _NAME.fullmatch(name)
    return None if match is None else match[1]


class Claims:
    """The claims of one bake or render. Use it as a context manager, which releases them."""

    def __init__(self) -> None:
        self._held: dict[Path, bytes | None] = {}
        """Contents of the claims; None where other work of this process has claimed the file."""
        self._renewed = time.monotonic()

    def take(self, target: Path) -> bool:
        """Claim a file; return False while another process that seems to be alive has claimed it.

        Check whether the file exists already once it is claimed.

        Raises
        ------
        OSError
            If the folder cannot be written to.
        """
        if target in self._held:
            return True
        content = None
        if target not in _own:  # waiting for other work of this process would never end
            path, content = claim_path(target), json.dumps({**_this_process(), "time": time.time()}).encode()
            if not _create(path, content) and not _take_over(path, content):
                return False
            _own.add(target)
        self._held[target] = content
        return True

    def owns(self, target: Path) -> bool:
        """Whether this very work has claimed a file, not other work of the same process."""
        return self._held.get(target) is not None

    def is_taken(self, target: Path) -> bool:
        """Whether a process that seems to be alive has claimed a file; nothing is claimed."""
        path = claim_path(target)
        return target in _own or (path.exists() and not _is_dead(path))

    def holder(self, target: Path) -> str:
        """Return who has claimed a file, for a message."""
        found = _read(claim_path(target))
        return f"{found.get('host')} (process {found.get('process')})" if found else "another process"

    def beat(self) -> None:
        """Renew the claims if the last time was `HEARTBEAT` ago; call it often."""
        now = time.monotonic()
        if now - self._renewed < HEARTBEAT:
            return
        self._renewed = now
        for target, content in self._held.items():
            if content is not None:
                with contextlib.suppress(OSError):  # it was removed, or the network is down
                    os.utime(claim_path(target))

    def release(self, target: Path) -> None:
        """Delete a claim, unless another process has taken it over."""
        content = self._held.pop(target, None)
        if content is None:
            return
        _own.discard(target)
        path = claim_path(target)
        with contextlib.suppress(OSError):
            if path.read_bytes() == content:
                path.unlink()

    def __enter__(self) -> "Claims":
        return self

    def __exit__(self, *_error: object) -> None:
        """Release all claims."""
        for target in list(self._held):
            self.release(target)


def _create(path: Path, content: bytes) -> bool:
    """Create a file, or return False if it exists."""
    try:
        stream = path.open("xb")
    except FileExistsError:
        return False
    try:
        with stream:
            stream.write(content)
    except OSError:  # the disk is full
        path.unlink(missing_ok=True)
        raise
    return True


def _take_over(path: Path, content: bytes) -> bool:
    """Replace a claim if it is dead. Only one process at a time can create the file that replaces it."""
    if not _is_dead(path):
        return False
    successor = path.with_name(f"{path.name}.next")
    if not _create(successor, content):
        if _is_dead(successor):  # its process was killed just here
            try:
                successor.unlink(missing_ok=True)
            except OSError:  # another user's, in a folder where only they may remove it: go on without a claim
                return True
        return False
    if not _is_dead(path):  # another process was faster
        successor.unlink(missing_ok=True)
        return False
    try:
        successor.replace(path)
    except OSError:  # another user's claim in a shared folder: go on without one
        successor.unlink(missing_ok=True)
    return True


def _is_dead(path: Path) -> bool:
    found, this = _read(path), _this_process()
    same_machine = all(found.get(key) == this[key] for key in ("host", "namespace"))
    if same_machine and _has_ended(found.get("process")):
        return True
    try:
        changed = path.stat().st_mtime_ns  # up to date on network file systems too, as the file was opened before
    except OSError:
        return False  # it was released just now
    return abs(_file_system_time(path.parent) - changed) >= STALE_AFTER * 1e9


def _read(path: Path) -> dict[str, Any]:
    """Return what a claim says; nothing if it cannot be read, or is just being written."""
    try:
        found = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _this_process() -> dict[str, Any]:
    try:
        namespace = os.readlink("/proc/self/ns/pid")  # containers on one host number their processes themselves
    except OSError:  # not Linux
        namespace = ""
    return {"host": platform.node(), "namespace": namespace, "process": os.getpid()}


def _has_ended(process: Any) -> bool:
    """Whether a process of this machine has certainly ended."""
    if process == os.getpid():  # a former one of the same number: what this one has claimed is in `_own`
        return True
    if os.name != "posix":
        return False
    try:
        os.kill(process, 0)
        status = Path(f"/proc/{process}/stat").read_text(encoding="ascii", errors="replace")
    except ProcessLookupError:
        return True
    except (OSError, OverflowError, TypeError):  # another user's process, not Linux, or not a number
        return False
    return status.rpartition(")")[2].split()[0] == "Z"  # killed, but its parent has not asked for its exit status


def _file_system_time(folder: Path) -> int:
    """Return the time, in nanoseconds, that the file system gives to a file created now."""
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            return os.fstat(probe.fileno()).st_mtime_ns
    except OSError:  # a folder that can only be read
        return time.time_ns()
