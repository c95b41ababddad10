# SPDX-License-Identifier: GPL-3.0-or-later
"""The job type for Flamenco: its tasks, what they depend on, and that their command lines do what they should.

Node runs the script, with a stand-in for what Flamenco's Manager gives it.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from small_scene import PROCESS_TIMEOUT, add_hole, shrink

NODE = shutil.which("node")
STAND_IN = Path(__file__).with_name("flamenco_stand_in.js")
BLENDER = Path(__file__).with_name("blender_stand_in.py")

pytestmark = [
    pytest.mark.skipif(NODE is None, reason="node, which runs the job type's JavaScript, is not installed"),
    pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning"),
]

SETTINGS = {
    "frames": "1-5, 8",
    "chunk_size": 3,
    "bake": True,
    "bake_task_type": "blender",
    "render_output_path": "/renders/shot/{timestamp}/######",
    "blendfile": "/shots/shot.blend",
    "format": "OPEN_EXR",
}


@pytest.fixture
def script(tmp_path: Path) -> Path:
    """The job type as the operator writes it."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "empty.blend"))
    assert bpy.ops.umbra.save_farm_templates(directory=str(tmp_path)) == {"FINISHED"}
    return tmp_path / "umbra_black_hole.js"


def run_script(script: Path, **settings: object) -> subprocess.CompletedProcess[str]:
    job = json.dumps({"settings": SETTINGS | settings})
    return subprocess.run(
        [NODE, STAND_IN, script], input=job, capture_output=True, text=True, timeout=PROCESS_TIMEOUT, check=False
    )


def compiled(script: Path, **settings: object) -> dict:
    result = run_script(script, **settings)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def arguments(task: dict) -> list[str]:
    """Blender's command line, as Flamenco's workers put it together."""
    (command,) = task["commands"]
    assert command["name"] == "blender-render"
    given = command["parameters"]
    assert (given["exe"], given["exeArgs"]) == ("{blender}", "{blenderArgs}")
    return [*given["argsBefore"], given["blendfile"], *given["args"]]


def test_each_chunk_is_baked_then_rendered(script: Path) -> None:
    tasks = compiled(script)["tasks"]
    assert [(task["name"], task["type"], task["dependencies"]) for task in tasks] == [
        ("bake-1-3", "blender", []),
        ("render-1-3", "blender", ["bake-1-3"]),
        ("bake-4,5,8", "blender", []),
        ("render-4,5,8", "blender", ["bake-4,5,8"]),
    ]
    assert arguments(tasks[2]) == [
        *("--background", "/shots/shot.blend", "--command", "umbra", "bake", "--frames=4,5,8"),
    ]
    words = arguments(tasks[1])
    assert words[:4] == ["--background", "/shots/shot.blend", "--python-exit-code", "1"]
    assert words[words.index("--render-frame") + 1] == "1..3"
    assert words[words.index("--render-output") + 1] == "/renders/shot/2026-11-22_120000/######"
    assert words[words.index("--render-format") + 1] == "OPEN_EXR"
    assert words[-3:] == ["--", "check", "--frames=1-3"]
    assert words[words.index("--python-expr") + 1] == (script.parent / "umbra_farm.py").read_text(encoding="utf-8")


def test_settings(script: Path) -> None:
    """Types that Flamenco knows, and expressions that Blender can evaluate as its add-on does."""
    settings = compiled(script)["jobType"]["settings"]
    assert {each["type"] for each in settings} <= {"bool", "int32", "float", "string"}
    assert {each["key"] for each in settings if each.get("required")} <= set(SETTINGS) | {"render_output_root"}

    class Chosen:
        render_output_root = "/renders"

    known = {"C": bpy.context, "Path": Path, "abspath": Path, "settings": Chosen, "jobname": "shot"}
    values = {each["key"]: eval(each["eval"], known) for each in settings if "eval" in each}
    assert values == {
        "frames": "1-250",
        "render_output_path": str(Path("/renders/shot/{timestamp}/######")),
        "format": bpy.context.scene.render.image_settings.file_format,
    }


def test_rendering_alone_and_workers_that_bake(script: Path) -> None:
    tasks = compiled(script, bake=False)["tasks"]
    assert [(task["name"], task["dependencies"]) for task in tasks] == [("render-1-3", []), ("render-4,5,8", [])]
    assert [task["type"] for task in compiled(script, bake_task_type="umbra")["tasks"][:2]] == ["umbra", "blender"]


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"format": "FFMPEG"}, "choose an image format"),
        ({"render_output_path": ""}, "There is no folder for the pictures"),
        ({"frames": "first to last"}, "invalid range"),
    ],
)
def test_what_cannot_be_rendered_is_refused(script: Path, settings: dict, sentence: str) -> None:
    result = run_script(script, **settings)
    assert result.returncode == 1
    assert sentence in result.stderr


def test_the_command_lines_bake_and_render(script: Path, tmp_path: Path) -> None:
    """Each task's line, run by the bpy module in a process of its own: baking with the add-on, rendering without."""
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene)
    scene.umbra.map_folder = "//umbra_maps/"
    blend = tmp_path / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    output = tmp_path / "pictures" / "######"
    bake, render = compiled(script, frames="4,6", blendfile=str(blend), render_output_path=str(output))["tasks"]
    alone = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "none")}
    (tmp_path / "none").mkdir()

    def run(task: dict, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, BLENDER, *arguments(task)]
        return subprocess.run(
            command, capture_output=True, text=True, env=environment, timeout=PROCESS_TIMEOUT, check=False
        )

    refused = run(render, alone)
    assert refused.returncode == 1
    assert "Frame 4: the map" in refused.stderr
    assert not (tmp_path / "pictures").exists()
    assert run(bake).returncode == 0
    rendered = run(render, alone)
    assert rendered.returncode == 0, rendered.stderr
    assert sorted(path.name for path in (tmp_path / "pictures").iterdir()) == ["000004.exr", "000006.exr"]
