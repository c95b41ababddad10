# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes that are killed, several at once on one folder, and renders beside them: with real processes."""

import json
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, read, run_python, shrink, start_python

FRAMES = 12

BAKE = """
import importlib
name = "bl_ext.user_default.umbra_black_hole."
command = importlib.import_module(name + "command.command_line")
exr = importlib.import_module(name + "physics.images.exr")
bpy.ops.wm.open_mainfile(filepath={blend!r})
{trap}
sys.exit(command.run({arguments!r}))
"""

# Ends the process, as a power cut would, when something is done for the n-th time.
TRAP = """
import os, signal
def kill_at(owner, name, count, before=lambda *_: None):
    real, calls = getattr(owner, name), []
    def trapped(*args, **settings):
        calls.append(name)
        if len(calls) == count:
            before(*args)
            os.kill(os.getpid(), signal.SIGKILL)
        return real(*args, **settings)
    setattr(owner, name, trapped)
"""


@pytest.fixture
def blend(tmp_path: Path) -> str:
    """A saved file whose camera moves; its maps will be in a folder beside it."""
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene)
    for frame in (1, FRAMES):
        scene.camera.location.z = 4.0 + frame
        scene.camera.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.render.filepath = "//picture_####"
    path = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    return path


def bake(blend: str, trap: str = "", arguments: tuple[str, ...] = ("bake", "--json")) -> str:
    return BAKE.format(blend=blend, trap=trap, arguments=list(arguments))


def events(output: str) -> list[dict]:
    return [json.loads(line) for line in output.splitlines() if line.startswith("{")]


def outcomes(output: str, outcome: str) -> list[int]:
    return [each["frame"] for each in events(output) if each.get("outcome") == outcome]


def check_folder(folder: Path, package: ModuleType) -> dict[str, int]:
    """Every file under a final name is whole; the maps with the times of their last change."""
    found = {}
    for path in folder.glob("*.exr"):
        if path.name.startswith("."):
            continue
        if "_disk" in path.name:
            package.read_disk_pass(path)
        elif "_light_" in path.name:
            package.read_light_layer(path)
        else:
            package.read_warp_map(path)
            found[path.name] = path.stat().st_mtime_ns
    return found


def hidden(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


def test_a_bake_that_is_killed_again_and_again(
    blend: str, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    """Killed with a file half written, before one gets its name, between passes and map, and from outside."""
    bpy.context.scene.umbra.active_hole.umbra.disk.enabled = True
    bpy.context.scene.umbra.disk_passes = True  # five files a frame
    bpy.ops.wm.save_mainfile()
    package = addon_module("core.physics_api").physics
    folder = tmp_path / "umbra_maps"
    half = "lambda path, *_: Path(path).write_bytes(b'half of it')"
    traps = [  # what is to happen, and whether a half file is left
        (TRAP + "from pathlib import Path\nkill_at(exr.os, 'chmod', 6, " + half + ")", True),
        (TRAP + "kill_at(exr.os, 'replace', 7)", True),
        (TRAP + "kill_at(exr, 'replacing', 8)", False),
    ]
    before: dict[str, int] = {}
    for trap, leaves_half in traps:
        result = run_python(bake(blend, trap))
        assert result.returncode == -signal.SIGKILL, result.stderr
        now = check_folder(folder, package)
        assert len(now) > len(before)
        assert {name: now[name] for name in before} == before, "a valid map was baked again"
        assert any(".claim" in name for name in hidden(folder))
        assert not leaves_half or any(".tmp" in name for name in hidden(folder))
        before = now
    with start_python(bake(blend)) as process:
        for line in process.stdout:  # killed at whatever moment that is
            if '"baked"' in line:
                break
        process.kill()
    before = check_folder(folder, package)

    result = run_python(bake(blend))
    assert result.returncode == 0, result.stderr
    assert len(outcomes(result.stdout, "kept")) == len(before) < FRAMES
    assert len(outcomes(result.stdout, "baked")) == FRAMES - len(before)
    now = check_folder(folder, package)
    assert len(now) == FRAMES
    assert {name: now[name] for name in before} == before
    assert len(list(folder.glob("[!.]*.exr"))) == 5 * FRAMES
    assert not hidden(folder)


def test_three_processes_share_a_folder(blend: str, tmp_path: Path, addon_module: Callable[[str], ModuleType]) -> None:
    package = addon_module("core.physics_api").physics
    processes = [start_python(bake(blend, arguments=("bake", "--json", "--frames", "1-40"))) for _ in range(3)]
    outputs = [process.communicate(timeout=300) for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0], outputs
    shares = [outcomes(output, "baked") for output, _errors in outputs]
    assert sorted(frame for share in shares for frame in share) == list(range(1, 41))
    assert len(check_folder(tmp_path / "umbra_maps", package)) == 40
    assert not hidden(tmp_path / "umbra_maps")
    for output, _errors in outputs:  # and each of them saw the whole shot through
        assert len(outcomes(output, "baked")) + len(outcomes(output, "kept")) == 40


def test_being_told_to_stop(blend: str, tmp_path: Path, addon_module: Callable[[str], ModuleType]) -> None:
    """Ctrl-C, or a farm that takes a job back: finished maps stay, claims are given back."""
    process = start_python(bake(blend, arguments=("bake", "--json", "--frames", "1-200")))
    for line in process.stdout:
        if '"baked"' in line:
            break
    process.send_signal(signal.SIGTERM)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "Stopped; the maps that are finished stay." in errors
    assert events(output)[-1]["error"].startswith("Stopped")
    maps = check_folder(tmp_path / "umbra_maps", addon_module("core.physics_api").physics)
    assert 1 <= len(maps) < 200
    assert not hidden(tmp_path / "umbra_maps")


def claim_elsewhere(path: Path, package: ModuleType) -> Path:
    """The claim of another machine."""
    path.parent.mkdir(exist_ok=True)
    made = package.claim_path(path)
    made.write_text(json.dumps({"host": "farm-7", "process": 12}), encoding="utf-8")
    return made


def test_a_render_waits_for_the_map_that_another_machine_is_baking(
    blend: str,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    scene, baking, modules = bpy.context.scene, addon_module("bake.baking"), addon_module("core.physics_api")
    (wanted,) = addon_module("outputs.frames").requests_at(scene, 1)
    path = wanted.path
    claim = claim_elsewhere(path, addon_module("bake.claim"))
    waits = []

    def other_machine(_seconds: float) -> None:
        waits.append(path.exists())
        if len(waits) == 3:
            for _ in baking.bake_map(wanted):
                pass
            claim.unlink()

    monkeypatch.setattr(baking, "time", type(sys)("time"))
    baking.time.sleep = other_machine
    written = []
    save = baking._save
    monkeypatch.setattr(baking, "_save", lambda *all_: (written.append(all_), save(*all_)))
    scene.render.filepath = str(tmp_path / "picture.exr")
    bpy.ops.render.render(write_still=True)
    assert waits == [False, False, False]
    assert len(written) == 1, "the render has baked the map again"
    told = capfd.readouterr().out
    assert "waiting for the warp map of frame 1, which farm-7 (process 12) bakes" in told
    assert np.isfinite(read(tmp_path / "picture.exr", modules.physics)).all()


def test_a_render_that_waits_can_be_stopped(
    blend: str, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    path = addon_module("outputs.frames").requests_at(bpy.context.scene, 1)[0].path
    claim_elsewhere(path, addon_module("bake.claim"))
    render = f"bpy.ops.wm.open_mainfile(filepath={blend!r}); bpy.ops.render.render(animation=True)"
    with start_python(render) as process:
        for line in process.stdout:
            if "waiting for the warp map of frame 1" in line:
                break
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 1
        assert "Frame 1: Stopped while waiting for the warp map of frame 1, which farm-7" in process.stderr.read()
    assert not list(tmp_path.glob("picture_*"))


def test_a_bake_does_other_frames_first_and_then_waits(
    blend: str, addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, baking = bpy.context.scene, addon_module("bake.baking")
    path = addon_module("outputs.frames").requests_at(scene, 1)[0].path
    claim = claim_elsewhere(path, addon_module("bake.claim"))
    monkeypatch.setattr(baking, "POLL", 2 * baking.WAIT)
    texts = []
    for progress in addon_module("outputs.frames").bake(scene, [1, 2, 3]):
        texts.append(progress.text if progress.outcome is None else f"{progress.frame} {progress.outcome}")
        if "waiting" in progress.text and claim.exists():
            claim.unlink()  # the other machine has given up
    assert [text for text in texts if text[1:] in {" baked", " kept"}] == ["2 baked", "3 baked", "1 baked"]
    assert "Frame 1 (1 of 3): waiting for farm-7 (process 12)" in texts


def test_a_frame_that_is_being_baked_is_not_cleaned_away(
    blend: str, tmp_path: Path, addon_module: Callable[[str], ModuleType], capfd: pytest.CaptureFixture[str]
) -> None:
    scene, command = bpy.context.scene, addon_module("command.command_line")
    assert command.run(["bake", "--frames", "1-2"]) == 0
    path = addon_module("outputs.frames").requests_at(scene, 1)[0].path
    claim = claim_elsewhere(path, addon_module("bake.claim"))
    half = path.with_name(f".{path.stem}.abcdefgh.tmp.exr")
    half.write_bytes(b"half")
    assert command.run(["clean", "--all", "--json"]) == 0
    in_use = events(capfd.readouterr().out)[-1]["in_use"]
    assert str(path) in in_use
    assert len(in_use) == 3  # map, half file and claim
    os.utime(claim, (1.0, 1.0))  # its machine has been off for years
    assert command.run(["clean", "--all"]) == 0
    assert not list(path.parent.iterdir())


def test_leftovers_of_valid_maps_go_when_a_bake_finds_them(
    blend: str, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    """A process was killed between writing a map and giving its claim back, and another while it wrote it again."""
    scene, command = bpy.context.scene, addon_module("command.command_line")
    assert command.run(["bake", "--frames", "1-2"]) == 0
    path = addon_module("outputs.frames").requests_at(scene, 1)[0].path
    dead = claim_elsewhere(path, addon_module("bake.claim"))
    os.utime(dead, (1.0, 1.0))
    path.with_name(f".{path.stem}.abcdefgh.tmp.exr").write_bytes(b"half")
    stamp = path.stat().st_mtime_ns
    assert command.run(["bake", "--frames", "1-2"]) == 0
    assert not hidden(path.parent)
    assert path.stat().st_mtime_ns == stamp
