# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of frames as text: in the add-on, on Blender's command line, and in the script that farms run without it."""

import runpy
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest

from blender_addon.bake.frame_list import FrameListError, frames_text, parse_frames, ranges
from blender_addon.farm import farm_templates

READABLE = [
    ("7", [7]),
    ("1-4", [1, 2, 3, 4]),
    ("1,5,9-12", [1, 5, 9, 10, 11, 12]),
    ("1-10x3", [1, 4, 7, 10]),
    ("1-9:4", [1, 5, 9]),
    ("-5--3", [-5, -4, -3]),
    ("-1-1, 3", [-1, 0, 1, 3]),
    ("3,1-4,3", [3, 1, 2, 4]),
]
UNREADABLE = [
    ("", "not a list of frames"),
    ("1-", "not a list of frames"),
    ("1..4", "not a list of frames"),
    ("1,,2", "not a list of frames"),
    ("5x2", "not a list of frames"),
    ("9-1", "write 1-9"),
    ("1-9x0", "step of 0"),
    ("1-99999999999", "more than 1000000 frames"),
    ("1-100000000000", "more than 1000000 frames"),
    (",".join(["1-900000"] * 1000), "more than 1000000 frames"),
]


@pytest.mark.parametrize(("text", "frames"), READABLE)
def test_reading(text: str, frames: list[int]) -> None:
    assert parse_frames(text) == frames


@pytest.mark.parametrize(("text", "sentence"), UNREADABLE)
def test_what_cannot_be_read(text: str, sentence: str) -> None:
    begin = time.perf_counter()
    with pytest.raises(FrameListError, match=sentence):
        parse_frames(text)
    assert time.perf_counter() - begin < 1.0


def test_writing() -> None:
    frames = [1, 2, 3, 5, 9, 10, -4]
    assert frames_text(frames) == "1-3,5,9-10,-4"
    assert parse_frames(frames_text(frames)) == frames
    assert list(ranges([])) == []


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """The script that farms run, in a folder of its own."""
    path = tmp_path / "umbra_farm.py"
    path.write_text(farm_templates.script(), encoding="utf-8")
    return path


@pytest.mark.parametrize(("text", "frames"), READABLE)
def test_farms_read_the_same(script: Path, monkeypatch: pytest.MonkeyPatch, text: str, frames: list[int]) -> None:
    monkeypatch.setattr(sys, "argv", ["blender", "--", "check", f"--frames={text}"])
    farm = runpy.run_path(str(script))
    assert farm["frames_of"](farm["arguments"]()) == frames


@pytest.mark.parametrize(("text", "sentence"), UNREADABLE)
def test_all_refuse_with_the_same_sentence(
    script: Path,
    addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    text: str,
    sentence: str,
) -> None:
    with pytest.raises(FrameListError, match=sentence) as caught:
        parse_frames(text)
    assert addon_module("command.command_line").run(["status", f"--frames={text}"]) == 2
    assert f"error: argument --frames: {caught.value}" in capfd.readouterr().err
    for task in ("check", "render", "bake"):
        monkeypatch.setattr(sys, "argv", ["blender", "--", task, f"--frames={text}"])
        monkeypatch.setattr(sys, "stderr", sys.stderr)  # the script replaces it
        with pytest.raises(SystemExit) as end:
            runpy.run_path(str(script), run_name="__main__")
        assert end.value.code == 1
        out, err = capfd.readouterr()
        assert f"openjd_fail: {caught.value}\n" in out
        assert f"Error: Umbra Black Hole: {caught.value}\n" in err


@pytest.mark.parametrize(
    ("words", "frames"),
    [
        ("--frames=5 --count=3 --last=20", [5, 6, 7]),
        ("--frames=5 --count=3 --last=6", [5, 6]),
        ("--frames=5 --count=99999999999 --last=6", [5, 6]),
        ("--frames=-5 --count=2", [-5, -4]),
        ("--frames=1,9-12 --last=10", [1, 9, 10]),
        ("", [2, 4, 6]),
    ],
)
def test_chunks_of_farms(script: Path, monkeypatch: pytest.MonkeyPatch, words: str, frames: list[int]) -> None:
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.frame_step = 2, 7, 2
    monkeypatch.setattr(sys, "argv", ["blender", "--", "check", *words.split()])
    farm = runpy.run_path(str(script))
    assert farm["frames_of"](farm["arguments"]()) == frames


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("--frames=5 --count=99999999999", "more than 1000000 frames"),
        ("--frames=5 --count=0", "must be 1 or more"),
        ("--frames=5 --count=3 --last=4", "no frame to work on"),
    ],
)
def test_chunks_that_are_refused(script: Path, monkeypatch: pytest.MonkeyPatch, words: str, sentence: str) -> None:
    monkeypatch.setattr(sys, "argv", ["blender", "--", "check", *words.split()])
    farm = runpy.run_path(str(script))
    with pytest.raises((farm["Fault"], farm["FrameListError"]), match=sentence):
        farm["frames_of"](farm["arguments"]())


def test_the_script_stands_alone(script: Path) -> None:
    """Nothing of this package is left to import, and it is short enough for a command line of any system."""
    source = script.read_text(encoding="utf-8")
    assert "from ." not in source
    assert "def parse_frames" in source
    assert len(source) < 30_000
