# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame that is impossible stands in nobody's way: the others are baked, listed and cleaned."""

import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from small_scene import add_hole

Run = Callable[[str], int]


@pytest.fixture
def run(addon_module: Callable[[str], ModuleType]) -> Run:
    return lambda line: addon_module("command.command_line").run(line.split())


@pytest.fixture
def shot(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Five frames; in the second and third the camera is inside of the horizon."""
    add_hole(scene)
    for frame, x in ((1, 9.0), (2, 0.01), (3, 0.02), (4, 8.0), (5, 7.0)):
        scene.camera.location = (x, 0.0, 0.0)
        scene.camera.keyframe_insert("location", frame=frame)
    scene.frame_end = 5
    return scene


def numbers(folder: Path) -> list[int]:
    return sorted(int(path.stem[-4:]) for path in folder.glob("[!.]*.exr"))


def events(text: str) -> list[dict]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def test_the_command(shot: bpy.types.Scene, tmp_path: Path, run: Run, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("bake --json") == 1
    out, err = capfd.readouterr()
    assert numbers(tmp_path / "maps") == [1, 4, 5]
    assert "Frames 2-3 are impossible, the other 3 have their maps. Frame 2: " in err
    assert "[camera.inside-hole]" in err
    told = events(out)
    assert {each["frame"]: each["outcome"] for each in told[:-1]} == {
        1: "baked", 2: "impossible", 3: "impossible", 4: "baked", 5: "baked",
    }  # fmt: skip
    assert told[-1]["status"] == 1
    assert not list((tmp_path / "maps").glob(".*")), "a claim was left"

    assert run("status --json") == 1
    out, err = capfd.readouterr()
    rows = {each["frame"]: each for each in events(out)[:-1]}
    assert {frame: each["state"] for frame, each in rows.items()} == {
        1: "valid", 2: "impossible", 3: "impossible", 4: "valid", 5: "valid",
    }  # fmt: skip
    assert "horizon" in rows[2]["fault"]
    assert "horizon" in err
    assert events(out)[-1]["counts"]["impossible"] == 2

    shot.umbra.active_hole.umbra.spin = 0.3
    assert run("clean") == 0
    assert not numbers(tmp_path / "maps")
    assert run("bake --frames 2") == 1
    assert "Frame 2" not in capfd.readouterr().err.replace("Frame 2 of", ""), "one frame needs no name"


def test_the_buttons(shot: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Frames 2-3 are impossible"):
        bpy.ops.umbra.bake_animation()
    assert numbers(tmp_path / "maps") == [1, 4, 5]
    assert bpy.ops.umbra.verify_maps() == {"FINISHED"}
    shot.umbra.active_hole.umbra.spin = 0.3
    assert bpy.ops.umbra.clean_maps() == {"FINISHED"}
    assert not numbers(tmp_path / "maps")


def test_a_frame_whose_rays_cannot_be_traced(
    shot: bpy.types.Scene, tmp_path: Path, run: Run, addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """It fails in the work, and not before."""
    kinds = addon_module("bake.kinds")
    error = addon_module("core.errors").SceneError
    steps = kinds._baker.now.steps

    def failing(parameters):
        if parameters.camera_position[0] > 8.5:
            yield 0.5
            raise error("It went wrong.", code="map.unresolved")
        return (yield from steps(parameters))

    monkeypatch.setattr(kinds._baker.now, "steps", failing)
    shot.umbra.active_hole.umbra.mass_scale = 1.0
    shot.camera.animation_data_clear()
    for frame, x in ((1, 9.0), (2, 8.0), (3, 7.0)):
        shot.camera.location.x = x
        shot.camera.keyframe_insert("location", frame=frame)
    assert run("bake --frames 1-3") == 1
    assert numbers(tmp_path / "maps") == [2, 3]
    assert not list((tmp_path / "maps").glob(".*")), "a claim was left"
