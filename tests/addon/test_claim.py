# SPDX-License-Identifier: GPL-3.0-or-later
"""Claims: who may make a file, with real processes that live, die and fall silent."""

import errno
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from blender_addon.bake import claim
from blender_addon.bake.claim import Claims, Holder, claim_path, claimed_name

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


def elsewhere(target: Path, generation: int = 1, age: float = 0.0) -> Path:
    """Leave a claim of another machine, which has not been renewed for so many seconds."""
    path = claim_path(target, generation)
    path.write_bytes(Holder("farm-7", os.getpid(), "another machine", "").to_bytes())
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
        assert claim_path(target, 2).exists()
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
    started = Holder.this()
    former = Holder(started.host, started.process, started.machine, "long ago")
    claim_path(target).write_bytes(former.to_bytes())
    with Claims() as mine:
        assert mine.take(target)


def test_another_machine_shows_signs_of_life(target: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its claim looks old by our clock, because its clock is wrong; but it is renewed."""
    now = 1000.0
    monkeypatch.setattr(claim.time, "monotonic", lambda: now)
    path = elsewhere(target, age=86400.0)
    with Claims() as mine:
        for _ in range(40):
            assert not mine.take(target)
            now += claim.HEARTBEAT
            moment = path.stat().st_mtime + claim.HEARTBEAT
            os.utime(path, (moment, moment))


@pytest.mark.parametrize(
    ("age", "quiet"),
    [
        (2 * claim.STALE_AFTER, claim.LEAST_WATCH),  # old by the file system's clock, and silent while watched
        (-86400.0, claim.STALE_AFTER),  # from the future: only watching it tells
    ],
)
def test_another_machine_is_dead(target: Path, monkeypatch: pytest.MonkeyPatch, age: float, quiet: float) -> None:
    now = 1000.0
    monkeypatch.setattr(claim.time, "monotonic", lambda: now)
    elsewhere(target, age=age)
    with Claims() as mine:
        assert not mine.take(target)
        now += 0.9 * quiet
        assert not mine.take(target)
        now += 0.1 * quiet + 0.01
        assert mine.take(target)


def test_cleaning_trusts_the_age(target: Path) -> None:
    elsewhere(target, age=0.5 * claim.STALE_AFTER)
    assert not Claims().take(target, watch=False)
    elsewhere(target, age=2 * claim.STALE_AFTER)
    with Claims() as mine:
        assert mine.take(target, watch=False)


def test_the_second_of_two_that_take_over_is_refused(target: Path) -> None:
    """Both found the first generation dead; the second to come finds the next one taken."""
    elsewhere(target, age=2 * claim.STALE_AFTER)
    elsewhere(target, generation=2)
    assert not Claims().take(target, watch=False)


def test_a_claim_that_was_taken_over_and_left_a_gap(target: Path) -> None:
    """A process that was asleep wakes up and gives its claim back, while another one holds the next."""
    elsewhere(target, generation=2)
    with Claims() as mine:
        assert not mine.take(target)
    assert not claim_path(target).exists()


def test_a_claim_that_is_just_being_written(target: Path) -> None:
    claim_path(target).write_bytes(b"")
    with Claims() as mine:
        assert not mine.take(target)
        assert mine.holder(target) == "another process"


def test_a_claim_that_was_never_written(target: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its process was killed between the two steps that a file system without links takes."""
    now = 1000.0
    monkeypatch.setattr(claim.time, "monotonic", lambda: now)
    claim_path(target).write_bytes(b"")
    with Claims() as mine:
        assert not mine.take(target)
        now += claim.LEAST_WATCH
        assert mine.take(target)


def test_a_file_system_without_links(
    target: Path, other: subprocess.Popen[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.EOPNOTSUPP, "not supported")

    monkeypatch.setattr(claim.os, "link", refuse)
    with Claims() as mine:
        assert not mine.take(target)
        other.kill()
        other.wait()
        assert mine.take(target)
        assert str(os.getpid()) in mine.holder(target)
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
    assert claimed_name(claim_path(target, 12).name) == target.name
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
    dead = json.loads(Holder.this().to_bytes()) | {"started": "long ago"}
    for number in range(0, 200, 2):
        claim_path(tmp_path / f"map_{number:04d}.exr").write_text(json.dumps(dead))
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
