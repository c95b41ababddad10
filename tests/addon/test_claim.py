# SPDX-License-Identifier: GPL-3.0-or-later
"""Claims: who may make a file, with real processes that live, die and fall silent."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import pytest

from blender_addon.bake import claim
from blender_addon.bake.claim import Claims, claim_path, claimed_name

# Where the module lies: processes import it alone, without Blender.
CLAIM_FOLDER = Path(claim.__file__).parent

HOLD = """
import sys, time
from pathlib import Path
from claim import Claims
claims = Claims()
print(claims.take(Path(sys.argv[1])), flush=True)
while True:
    claims.beat()
    time.sleep(0.05)
"""


@pytest.fixture
def target(tmp_path: Path) -> Path:
    return tmp_path / "map_0001.exr"


@pytest.fixture
def other(target: Path) -> Iterator[subprocess.Popen[str]]:
    """A living process that holds the claim."""
    command = [sys.executable, "-c", HOLD, str(target)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=CLAIM_FOLDER)
    assert process.stdout is not None
    assert process.stdout.readline() == "True\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def successor(target: Path) -> Path:
    """Where a claim is made that is to replace a dead one."""
    path = claim_path(target)
    return path.with_name(f"{path.name}.next")


def leave(path: Path, age: float = 0.0, host: str = "farm-7", process: int | None = None) -> Path:
    """Leave a claim, of another machine by default, that was not renewed for so many seconds."""
    path.write_text(json.dumps({**claim._this_process(), "host": host, "process": process or os.getpid()}))
    moment = time.time() - age
    os.utime(path, (moment, moment))
    return path


def test_one_at_a_time(target: Path) -> None:
    with Claims() as mine:
        assert mine.take(target)
        assert mine.take(target)  # it is mine already
        assert claim_path(target).exists()
        assert Claims().is_taken(target)
    assert not list(target.parent.iterdir())
    assert not Claims().is_taken(target)


def test_another_process_has_it_until_it_is_killed(target: Path, other: subprocess.Popen[str]) -> None:
    with Claims() as mine:
        assert not mine.take(target)
        assert f"(process {other.pid})" in mine.holder(target)
        other.kill()
        other.wait()
        assert mine.take(target)
        assert str(os.getpid()) in mine.holder(target)
    assert not list(target.parent.iterdir())


def test_a_zombie_is_dead(target: Path, other: subprocess.Popen[str]) -> None:
    """A killed process whose parent has not asked for its status still has its number."""
    other.kill()
    os.waitid(os.P_PID, other.pid, os.WEXITED | os.WNOWAIT)
    with Claims() as mine:
        assert mine.take(target)


def test_work_of_the_same_process_does_not_wait_for_itself(target: Path) -> None:
    """A render inside Blender while a bake beside it holds the same frame."""
    with Claims() as bake:
        assert bake.take(target)
        with Claims() as render:
            assert render.take(target)
            assert not render.owns(target)
        assert bake.owns(target)
        assert claim_path(target).exists()


def test_a_process_number_that_was_given_away_again(target: Path) -> None:
    """A claim of this very process that it does not know is that of a former one."""
    leave(claim_path(target), host=claim.platform.node())
    with Claims() as mine:
        assert mine.take(target)


def test_containers_on_one_host_number_processes_themselves(target: Path, other: subprocess.Popen[str]) -> None:
    """Processes of this number may have ended here, or be this very one, and be alive there."""
    other.kill()
    other.wait()
    for process in (other.pid, os.getpid()):
        path = leave(claim_path(target), host=claim.platform.node(), process=process)
        path.write_text(json.dumps(json.loads(path.read_text()) | {"namespace": "pid:[1]"}))
        assert not Claims().take(target)


@pytest.mark.parametrize("sign", [1, -1])
def test_another_machine_is_dead(target: Path, sign: float) -> None:
    """Its claim is old by the file system's clock, or from a future in which that clock will not be for long."""
    path = leave(claim_path(target), age=sign * 0.5 * claim.STALE_AFTER)
    assert not Claims().take(target)
    assert Claims().is_taken(target)
    leave(path, age=sign * 2 * claim.STALE_AFTER)
    assert not Claims().is_taken(target)
    with Claims() as mine:
        assert mine.take(target)


def test_another_machine_shows_signs_of_life(target: Path) -> None:
    path = leave(claim_path(target), age=2 * claim.STALE_AFTER)
    os.utime(path)
    assert not Claims().take(target)


def test_the_second_of_two_that_take_over_is_refused(target: Path) -> None:
    """Both found the claim dead; the second to come finds that it is being replaced."""
    leave(claim_path(target), age=2 * claim.STALE_AFTER)
    leave(successor(target))
    assert not Claims().take(target)
    assert successor(target).exists()


def test_one_that_was_slower_to_take_over(target: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It found the claim dead; before it can replace it, another process has done so."""
    leave(claim_path(target), age=2 * claim.STALE_AFTER)
    create = claim._create

    def late(path: Path, content: bytes) -> bool:
        if path == successor(target):
            leave(claim_path(target))
        return create(path, content)

    monkeypatch.setattr(claim, "_create", late)
    assert not Claims().take(target)
    assert list(target.parent.iterdir()) == [claim_path(target)]


def test_a_process_that_was_killed_while_it_took_over(target: Path) -> None:
    leave(claim_path(target), age=2 * claim.STALE_AFTER)
    leave(successor(target), age=2 * claim.STALE_AFTER)
    with Claims() as mine:
        assert not mine.take(target)
        assert mine.take(target)
    assert not list(target.parent.iterdir())


def test_a_claim_that_was_taken_over_is_not_given_back(target: Path) -> None:
    """A process that was asleep wakes up and gives its claim back, while another one holds the next."""
    with Claims() as mine:
        assert mine.take(target)
        leave(claim_path(target))
    assert not Claims().take(target)
    assert Claims().holder(target).startswith("farm-7")


def test_a_claim_that_cannot_be_read_or_replaced(target: Path) -> None:
    """Another user's, or as here a folder: it blocks until it is dead, and then the work goes on without a claim."""
    path = claim_path(target)
    path.mkdir()
    assert not Claims().take(target)
    os.utime(path, (1.0, 1.0))
    with Claims() as mine:
        assert mine.take(target)
        assert mine.owns(target)
        mine.beat()
    assert list(target.parent.iterdir()) == [path]


@pytest.mark.parametrize("content", ["[", "3", "{}", '{"host": 1, "process": 1e400}', "[" * 100_000, "\udcff"])
def test_claims_of_nonsense(target: Path, content: str) -> None:
    path = claim_path(target)
    path.write_bytes(content.encode("utf-8", "surrogateescape"))
    with Claims() as mine:
        assert not mine.take(target)
        assert mine.holder(target)
        os.utime(path, (1.0, 1.0))
        assert mine.take(target)


def test_a_claim_that_is_just_being_written(target: Path) -> None:
    claim_path(target).write_bytes(b"")
    with Claims() as mine:
        assert not mine.take(target)
        assert mine.holder(target) == "another process"


def test_a_claim_that_was_never_written(target: Path) -> None:
    """Its process was killed between creating and writing it."""
    claim_path(target).write_bytes(b"")
    with Claims() as mine:
        assert not mine.take(target)
        os.utime(claim_path(target), (1.0, 1.0))
        assert mine.take(target)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
def test_a_full_disk_leaves_no_claim(target: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    create = Path.open

    def full(path: Path, mode: str) -> IO[bytes]:
        create(path, mode).close()
        return create(Path("/dev/full"), "wb")

    monkeypatch.setattr(Path, "open", full)
    with Claims() as mine, pytest.raises(OSError, match="No space left"):
        mine.take(target)
    assert not list(target.parent.iterdir())


def test_a_claim_that_somebody_removed_does_not_disturb_its_holder(
    target: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(claim, "HEARTBEAT", 0.0)
    with Claims() as mine:
        assert mine.take(target)
        claim_path(target).unlink()
        mine.beat()


def test_signs_of_life_renew_the_time(target: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claim, "HEARTBEAT", 0.0)
    with Claims() as mine:
        assert mine.take(target)
        os.utime(claim_path(target), (1.0, 1.0))
        mine.beat()
        assert claim_path(target).stat().st_mtime > 1e9


def test_names(target: Path) -> None:
    assert claimed_name(claim_path(target).name) == target.name
    assert claimed_name(successor(target).name) == target.name
    assert claimed_name(f"{claim_path(target).name}1") == target.name  # as version 0.1.0 named them
    assert claimed_name(target.name) is None


RACE = """
import os, sys, time
from pathlib import Path
from claim import Claims
folder = Path(sys.argv[1])
(folder / f"ready_{os.getpid()}").touch()
while not (folder / "go").exists():
    pass
for number in range(200):
    target = folder / f"map_{number:04d}.exr"
    with Claims() as mine:
        if not target.exists() and mine.take(target) and not target.exists():
            with open(folder / f"log_{number:04d}", "a") as log:
                log.write(f"{os.getpid()}\\n")
            target.touch()
"""


def test_racing_processes_make_each_file_once(tmp_path: Path) -> None:
    """Every file was claimed before by a process that is dead, so that each is a race to take over, too."""
    with subprocess.Popen([sys.executable, "-c", ""]) as dead:
        pass
    for number in range(0, 200, 2):
        leave(claim_path(tmp_path / f"map_{number:04d}.exr"), host=claim.platform.node(), process=dead.pid)
    command = [sys.executable, "-c", RACE, str(tmp_path)]
    processes = [subprocess.Popen(command, cwd=CLAIM_FOLDER) for _ in range(3)]
    while len(list(tmp_path.glob("ready_*"))) < 3 and all(process.poll() is None for process in processes):
        time.sleep(0.01)
    (tmp_path / "go").touch()
    assert [process.wait(60) for process in processes] == [0, 0, 0]
    logs = sorted(tmp_path.glob("log_*"))
    # one that was refused goes on to the next file here, so all are made, each by one
    assert [len(log.read_text().splitlines()) for log in logs] == [1] * 200
    workers = {log.read_text() for log in logs}
    assert len(workers) > 1, "one process did everything: nothing was raced for"
    assert not list(tmp_path.glob(".*"))


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root can be two users")
@pytest.mark.parametrize("replacing", [False, True])
def test_a_dead_claim_of_another_user_in_a_shared_folder(target: Path, replacing: bool) -> None:
    """Where only owners may remove their files, as in /tmp, and a process was killed, or killed while it took over."""
    target.parent.chmod(0o1777)
    left = [leave(claim_path(target), claim.STALE_AFTER + 5.0)]
    if replacing:
        left.append(leave(successor(target), claim.STALE_AFTER + 5.0))
    for path in left:
        path.chmod(0o600)
        os.chown(path, 12345, 12345)
    parents = [each for each in target.parents if each.is_relative_to("/tmp")]
    modes = {each: each.stat().st_mode for each in parents}
    try:
        for each in parents:
            each.chmod(modes[each] | 0o711)
        os.seteuid(23456)
        try:
            with Claims() as claims:
                assert claims.take(target)
        finally:
            os.seteuid(0)
    finally:
        for each, mode in modes.items():
            each.chmod(mode)
