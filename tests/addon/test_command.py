# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line inside Blender, called as Blender calls it."""

import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from small_scene import add_hole, find_map, run_python


@pytest.fixture
def run(addon_module: Callable[[str], ModuleType]) -> Callable[[str], int]:
    command = addon_module("command.command_line")
    return lambda line: command.run(line.split())


def events(text: str) -> list[dict]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def states(text: str) -> dict[int, str]:
    return {each["frame"]: each["state"] for each in events(text) if each["event"] == "frame"}


def test_bake_status_and_clean(
    scene: bpy.types.Scene, tmp_path: Path, run: Callable[[str], int], capfd: pytest.CaptureFixture[str]
) -> None:
    """Each state that a map can have, told by status, and removed by clean or not."""
    hole = add_hole(scene)
    hole.umbra.spin = 0.5
    assert run("bake --frames 5") == 0
    hole.umbra.spin = 0.6
    assert run("bake --frames 1-4") == 0
    folder = tmp_path / "maps"

    def path(frame: int) -> Path:
        return find_map(folder, f"Scene_Black_Hole_64x36_{frame:04d}.exr")

    damaged = bytearray(path(3).read_bytes())
    damaged[-200] ^= 0xFF
    path(3).write_bytes(damaged)
    path(4).write_text("a text that happens to have this name")
    leftover = folder / f".{path(2).stem}.abcd_123.tmp.exr"
    leftover.write_bytes(b"half")
    bystander = folder / "holiday.exr"
    bystander.write_text("not ours")
    capfd.readouterr()

    assert run("status --frames 1-6 --json") == 1
    told = capfd.readouterr().out
    assert states(told) == {1: "valid", 2: "valid", 3: "damaged", 4: "foreign", 5: "stale", 6: "missing"}
    end = events(told)[-1]
    assert end["event"] == "end"
    assert end["counts"] == {"valid": 2, "missing": 1, "stale": 1, "foreign": 1, "damaged": 1}
    assert end["leftovers"] == [str(leftover)]
    assert run("status --frames 1-2") == 0

    before = sorted(folder.iterdir())
    assert run("clean --frames 1-6 --dry-run") == 0
    assert sorted(folder.iterdir()) == before
    assert run("clean --frames 1-6") == 0
    assert sorted(folder.iterdir()) == sorted([path(1), path(2), bystander])
    assert run("clean --all") == 0
    assert list(folder.iterdir()) == [bystander]


def test_what_bake_tells(
    scene: bpy.types.Scene, tmp_path: Path, run: Callable[[str], int], capfd: pytest.CaptureFixture[str]
) -> None:
    add_hole(scene)
    assert run("bake --frames 2") == 0
    capfd.readouterr()
    assert run("bake --json") == 0
    out, err = capfd.readouterr()
    assert all(line.startswith("{") for line in out.splitlines())
    told = events(out)
    assert [(each["frame"], each["outcome"]) for each in told[:-1]] == [(2, "kept"), (1, "baked"), (3, "baked")]
    assert told[-1]["event"] == "end"
    assert (told[-1]["status"], told[-1]["baked"], told[-1]["kept"]) == (0, 2, 1)
    assert "Frame 3 (3 of 3): baked" in err
    assert run(f"bake --json {tmp_path / 'log.json'}") == 0
    assert events((tmp_path / "log.json").read_text())[-1]["kept"] == 3


@pytest.mark.parametrize(
    ("line", "status", "sentence"),
    [
        ("bake --frames 1-", 2, "not a list of frames"),
        ("fetch", 2, "invalid choice"),
        ("bake --scene Nowhere", 1, 'its scenes are "Scene"'),
        ("bake --view-layer Nowhere", 1, 'no view layer "Nowhere"'),
        ("bake --json /proc/umbra.json", 1, "name another one"),
        ("status", 1, "contains no black hole"),
        ("clean", 1, "contains no black hole"),
    ],
)
def test_failures(
    scene: bpy.types.Scene,
    run: Callable[[str], int],
    capfd: pytest.CaptureFixture[str],
    line: str,
    status: int,
    sentence: str,
) -> None:
    assert run(line) == status
    err = capfd.readouterr().err
    assert sentence in err
    assert "Traceback" not in err


def test_failures_in_json(scene: bpy.types.Scene, run: Callable[[str], int], capfd: pytest.CaptureFixture[str]) -> None:
    assert run("bake --json") == 1
    (end,) = events(capfd.readouterr().out)
    assert end["status"] == 1
    assert "contains no black hole" in end["error"]


def test_help(run: Callable[[str], int], capfd: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0
    assert run("bake --help") == 0
    assert "--frames" in capfd.readouterr().out


def test_nothing_to_bake_is_no_failure(scene: bpy.types.Scene, run: Callable[[str], int]) -> None:
    add_hole(scene)
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    scene.umbra.lens_rays = "IN_SHADER"
    assert run("bake") == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("command", [["bake"], ["bake", "--json"], ["status", "--json"], ["clean"]])
def test_output_that_cannot_be_written(scene: bpy.types.Scene, tmp_path: Path, command: list[str]) -> None:
    """One sentence and status 1: a full device, and a pipe that nobody reads."""
    add_hole(scene)
    blend = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    script = f"""
import os
bpy.ops.wm.open_mainfile(filepath={blend!r})
target = os.open("/dev/full", os.O_WRONLY) if {{full}} else os.pipe()[1]
if not {{full}}:
    reading, target = os.pipe()
    os.close(reading)
os.dup2(target, 1)
from bl_ext.user_default.umbra_black_hole.command import command_line
status = command_line.run({command!r})
sys.stderr.flush()
os._exit(status)
"""
    for full in (True, False):
        result = run_python(script.format(full=full))
        assert result.returncode == 1
        assert "Traceback" not in result.stderr
        assert "[command.standard-output]" in result.stderr
