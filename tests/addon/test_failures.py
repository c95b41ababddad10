# SPDX-License-Identifier: GPL-3.0-or-later
"""Without a window, a frame that cannot be right ends the process with status 1, one sentence, and no picture."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, render, run_python, shrink

SCENE = """
from pathlib import Path
from small_scene import add_hole, shrink
folder = Path({folder!r})
scene = bpy.context.scene
shrink(scene)
scene.umbra.map_folder = str(folder / "maps")
hole = add_hole(scene)
scene.render.filepath = str(folder / "frame_####")
scene.frame_start, scene.frame_end = 1, 3
"""

RENDER = """
bpy.ops.render.render(animation=True)
print("the script went on")
"""


def fails(tmp_path: Path, change: str, sentence: str, frames: list[int]) -> None:
    """A script that renders three frames ends with this sentence, after these frames."""
    result = run_python(SCENE.format(folder=str(tmp_path)) + change + RENDER)
    assert result.returncode == 1, result.stdout + result.stderr
    lines = [line for line in result.stderr.splitlines() if line.startswith("Error: Umbra Black Hole:")]
    assert len(lines) == 1, result.stderr
    assert sentence in lines[0]
    assert "Traceback" not in result.stderr
    assert "went on" not in result.stdout
    written = sorted(int(path.stem[-4:]) for path in tmp_path.glob("frame_*.exr"))
    assert written == frames


def test_a_script_whose_frames_are_right_goes_on(tmp_path: Path) -> None:
    result = run_python(SCENE.format(folder=str(tmp_path)) + RENDER)
    assert result.returncode == 0, result.stderr
    assert "the script went on" in result.stdout
    assert len(list(tmp_path.glob("frame_*.exr"))) == 3


def test_camera_falls_into_the_hole(tmp_path: Path) -> None:
    """Frames before the fall stay."""
    change = """
for frame, x in ((1, 9.0), (2, 5.0), (3, 0.1)):
    scene.camera.location = (x, 0.0, 0.0)
    scene.camera.keyframe_insert("location", frame=frame)
"""
    fails(tmp_path, change, "horizon", [1, 2])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("scene.camera.data.type = 'ORTHO'", "orthographic"),
        ("hole.scale = (1.0, 1.0, 2.0)", "different scale"),
        ("scene.umbra.map_folder = '/proc/umbra'", "cannot be written to"),
        ("scene.umbra.auto_bake = False", "0001.exr is missing: bake it"),
        ("bpy.ops.umbra.bake_animation(); scene.umbra.auto_bake = False; hole.umbra.spin = 0.5", "is out of date"),
        ("bpy.ops.umbra.bake_animation(); scene.umbra.auto_bake = False\n"
         "for each in folder.rglob('*_0001.exr'): each.write_bytes(each.read_bytes()[:-9])",
         "0001.exr is cut short"),
        ("scene.umbra.method = 'cash-karp-printed'; scene.umbra.quality = 'REFERENCE'\n"
         "scene.camera.location = (0, 0, 9); scene.camera.rotation_euler = (0.0, 0.0, 0.0)",
         "could not be resolved by the method \"Boyer-Lindquist\""),
        ("scene.umbra.environment_image = None", "no environment"),
        ("scene.umbra.environment_source = 'WORLD'", "no environment"),
        ("hole.umbra.motion = 'CAMERA_ANIMATION'; hole.umbra.speed_of_light = 1e-5\n"
         "for f, x in ((1, 9.0), (3, 5.0)):\n"
         "    scene.camera.location.x = x; scene.camera.keyframe_insert('location', frame=f)",
         "Frame 1: camera \"Camera\" moves at"),
        ("scene.render.use_multiview = True", "Stereoscopy"),
        ("scene.view_layers[0].use = False", "is not rendered"),
    ],
)  # fmt: skip
def test_wrong_pictures_are_not_written(tmp_path: Path, change: str, sentence: str) -> None:
    fails(tmp_path, change, sentence, [])


def test_a_sky_whose_file_is_gone(tmp_path: Path) -> None:
    change = f"""
image = bpy.data.images.new("Sky", 8, 4, float_buffer=True)
image.file_format = "OPEN_EXR"
image.filepath_raw = {str(tmp_path / "sky.exr")!r}
image.save()
loaded = bpy.data.images.load({str(tmp_path / "sky.exr")!r})
(folder / "sky.exr").unlink()
loaded.reload()
scene.umbra.environment_image = loaded
"""
    fails(tmp_path, change, "cannot be loaded", [])


def test_a_fault_of_our_own_is_not_swallowed(tmp_path: Path) -> None:
    change = """
import importlib
importlib.import_module("bl_ext.user_default.umbra_black_hole.scene.frame_setup").read = lambda *_: 1 / 0
"""
    fails(tmp_path, change, "ZeroDivisionError", [])


def test_with_a_window_the_picture_is_magenta(
    tmp_path: Path, addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The handlers' other branch: say it, and show it, whatever older map there is."""
    scene = bpy.context.scene
    shrink(scene)
    scene.umbra.map_folder = str(tmp_path / "maps")
    hole = add_hole(scene)
    exr = addon_module("core.physics_api").physics
    good = render(scene, tmp_path / "good.exr", exr)
    shown: list[str] = []
    monkeypatch.setattr(addon_module("core.messages"), "popup", shown.append)
    monkeypatch.setattr(addon_module("core.messages"), "without_window", lambda: False)
    hole.scale = (1.0, 1.0, 2.0)
    picture = render(scene, tmp_path / "bad.exr", exr)
    assert len(shown) == 1
    assert "different scale" in shown[0]
    np.testing.assert_array_equal(picture[..., :3], np.broadcast_to([1.0, 0.0, 1.0], (36, 64, 3)))
    hole.scale = (1.0, 1.0, 1.0)
    np.testing.assert_array_equal(render(scene, tmp_path / "again.exr", exr), good)
