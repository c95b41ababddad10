# SPDX-License-Identifier: GPL-3.0-or-later
"""The job template, run by the reference implementation of Open Job Description.

Where there is no Blender executable, a stand-in with the same command line drives the bpy module: one that has the
extension bakes, one that has not renders.
"""

import json
import os
import shlex
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import PROCESS_TIMEOUT, add_hole, read, shrink

OPENJD = Path(sys.executable).with_name("openjd")
STAND_IN = Path(__file__).with_name("blender_stand_in.py")

pytestmark = [
    pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning"),
    pytest.mark.skipif(sys.platform == "win32", reason="the stand-in is a shell script"),
]


def executable(path: Path, resources: Path) -> Path:
    """A Blender with user resources of its own."""
    words = [f"BLENDER_USER_RESOURCES={resources}", sys.executable, str(STAND_IN)]
    path.write_text(f'#!/bin/sh\nexec env {shlex.join(words)} "$@"\n', encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


@pytest.fixture
def programs(addon: ModuleType, tmp_path: Path) -> dict[str, str]:
    (tmp_path / "bin").mkdir()
    (tmp_path / "no add-on").mkdir()
    return {
        "BakingBlender": str(executable(tmp_path / "bin" / "umbra", Path(os.environ["BLENDER_USER_RESOURCES"]))),
        "Blender": str(executable(tmp_path / "bin" / "plain", tmp_path / "no add-on")),
    }


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A shot of three frames with its templates, in a folder with an unusual name."""
    folder = tmp_path / "Schwärze 1"
    folder.mkdir()
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene)
    scene.umbra.map_folder = "//umbra_maps/"
    for frame, x in ((1, 7.4), (3, 6.0)):
        scene.camera.location.x = x
        scene.camera.keyframe_insert("location", frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = "//pictures/shot_###"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    assert bpy.ops.umbra.save_farm_templates(directory=str(folder / "farm")) == {"FINISHED"}
    return folder


def run_job(folder: Path, **parameters: object) -> subprocess.CompletedProcess[str]:
    """`openjd run` of both steps with the parameters that were saved, and those given."""
    (folder / "more.json").write_text(json.dumps(parameters), encoding="utf-8")
    files = (folder / "farm" / "umbra_openjd_parameters.json", folder / "more.json")
    given = [word for path in files for word in ("--job-param", f"file://{path}")]
    return subprocess.run(
        [OPENJD, "run", folder / "farm" / "umbra_openjd.yaml", *given],
        capture_output=True,
        text=True,
        timeout=PROCESS_TIMEOUT,
        check=False,
    )


def shares(log: str) -> list[float]:
    """How far openjd was told that tasks are, in per cent."""
    return [float(line.split()[-1]) for line in log.splitlines() if "openjd_progress: " in line]


def test_bakes_then_renders(folder: Path, programs: dict[str, str], addon_module: Callable[[str], ModuleType]) -> None:
    result = run_job(folder, FramesPerTask=2, **programs)
    assert result.returncode == 0, result.stdout + result.stderr
    baking, rendering = result.stdout.split("Running step 'Render'")
    assert "Running step 'Bake'" in baking
    assert shares(baking) == [50.0, 100.0, 100.0]  # two chunks, of two frames and of one
    assert shares(rendering) == [50.0, 100.0, 100.0]
    assert [line.split()[-1] for line in rendering.splitlines() if "openjd_status: Rendered" in line] == ["1", "2", "3"]
    exr = addon_module("core.physics_api").physics
    pictures = [read(folder / "pictures" / f"shot_{frame:03d}.exr", exr) for frame in (1, 2, 3)]
    assert len(list((folder / "umbra_maps").glob("*_64x36_0*.exr"))) == 3

    # the pictures are those that the add-on renders
    scene = bpy.context.scene
    scene.render.filepath = str(folder / "own_###")
    bpy.ops.render.render(animation=True)
    for frame, picture in zip((1, 2, 3), pictures, strict=True):
        np.testing.assert_array_equal(picture, read(folder / f"own_{frame:03d}.exr", exr))


def orthographic() -> None:
    bpy.context.scene.camera.data.type = "ORTHO"


def movie() -> None:
    if bpy.app.version >= (5, 0):
        bpy.context.scene.render.image_settings.media_type = "VIDEO"
    bpy.context.scene.render.image_settings.file_format = "FFMPEG"


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [(orthographic, "rthographic"), (movie, "a movie, which cannot be rendered in chunks: choose an image format.")],
)
def test_a_broken_scene_fails_with_its_sentence(
    folder: Path, programs: dict[str, str], spoil: Callable[[], None], sentence: str
) -> None:
    spoil()
    bpy.ops.wm.save_mainfile()
    result = run_job(folder, LastFrame=1, **programs)
    assert result.returncode != 0
    (failure,) = [line for line in result.stdout.splitlines() if "openjd_fail: " in line]
    assert sentence in failure
    assert not (folder / "pictures").exists()


def test_a_blender_that_is_not_there_is_named(folder: Path, programs: dict[str, str]) -> None:
    result = run_job(folder, LastFrame=1, **programs | {"BakingBlender": "/nowhere/blender"})
    assert result.returncode != 0
    assert "Blender could not be started as /nowhere/blender (No such file or directory)" in result.stdout


def test_the_template_needs_no_extension(folder: Path) -> None:
    """Any scheduler that takes the 2023-09 specification takes it; and the summary shows its steps and tasks."""
    template = folder / "farm" / "umbra_openjd.yaml"
    command = [OPENJD, "check", template, "--extensions", ""]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    parameters = folder / "farm" / "umbra_openjd_parameters.json"
    summary = subprocess.run(
        [OPENJD, "summary", template, "--output", "json", "-p", f"file://{parameters}", "-p", "FramesPerTask=2"],
        capture_output=True,
        text=True,
        check=False,
    )
    steps = json.loads(summary.stdout)["steps"]
    assert [step["name"] for step in steps] == ["Bake", "Render"]
    assert [step["total_tasks"] for step in steps] == [2, 2]


def test_templates_need_a_saved_file_and_a_folder(tmp_path: Path) -> None:
    add_hole(bpy.context.scene)
    with pytest.raises(RuntimeError, match="not saved yet"):
        bpy.ops.umbra.save_farm_templates(directory=str(tmp_path))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(RuntimeError, match="choose another folder"):
        bpy.ops.umbra.save_farm_templates(directory=str(tmp_path / "file" / "farm"))
    assert bpy.ops.umbra.save_farm_templates(directory=str(tmp_path / "farm")) == {"FINISHED"}
    assert sorted(path.name for path in (tmp_path / "farm").iterdir()) == [
        "umbra_black_hole.js",
        "umbra_farm.py",
        "umbra_openjd.yaml",
        "umbra_openjd_parameters.json",
    ]
