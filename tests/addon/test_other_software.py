# SPDX-License-Identifier: GPL-3.0-or-later
"""Beside other software: the sequencer, a studio's colors, another processor, and a Blender without this add-on."""

import platform
import sys
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, read, render, run_python

BEGIN = """
import os
from pathlib import Path
from small_scene import add_hole, shrink
folder = Path({folder!r})
scene = bpy.context.scene
shrink(scene)
scene.frame_start, scene.frame_end = 1, 2
scene.umbra.map_folder = str(folder / "maps")
scene.render.filepath = str(folder / "picture_")
hole = add_hole(scene, mass_scale=1.0)
"""

ACES = "ocio://cg-config-v2.1.0_aces-v1.3_ocio-v2.3"


def chooses_kernels() -> bool:
    """Whether numpy's OpenBLAS can be told here to calculate as on a newer, and as on an older processor."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return False
    flags = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    return "avx2" in flags and "fma" in flags


def test_a_strip_in_the_sequencer_is_named(tmp_path: Path) -> None:
    """Blender renders the strips alone: it may do so, or the refusal says that they are the reason."""
    change = """
editor = scene.sequence_editor_create()
strips = editor.strips if hasattr(editor, "strips") else editor.sequences
end = {"length": 10} if bpy.app.version >= (5, 0) else {"frame_end": 10}
strips.new_effect("Title", "COLOR", 1, 1, **end)
print("the strip is there", flush=True)
bpy.ops.render.render(write_still=True)
os._exit(0)
"""
    result = run_python(BEGIN.format(folder=str(tmp_path)) + change)
    if "the strip is there" not in result.stdout:
        pytest.fail(result.stderr)
    assert result.returncode == 0 or "sequencer" in result.stderr.lower(), result.stderr


def test_a_hole_with_a_studios_color_configuration(monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenColorIO's own ACES configuration, which Blender loads by its name."""
    monkeypatch.setenv("OCIO", ACES)
    result = run_python("""
import os
settings = bpy.context.scene.umbra
settings.environment_image = bpy.data.images.new("Sky", 8, 4, float_buffer=True)
settings.environment_source = "IMAGE"
print(bpy.context.scene.sequencer_colorspace_settings.name, flush=True)
print(bpy.ops.umbra.add_black_hole(), flush=True)
os._exit(0)
""")
    if "ACES" not in result.stdout:
        pytest.fail(f"The script did not get to the hole with this configuration: {result.stdout}{result.stderr}")
    assert result.returncode == 0, result.stderr
    assert "FINISHED" in result.stdout


@pytest.mark.skipif(not chooses_kernels(), reason="only OpenBLAS on such processors can be told which they are")
def test_a_map_still_holds_on_another_processor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blend = str(tmp_path / "shot.blend")
    save = f"hole.rotation_euler = 0.3, 0.7, 0.1\nbpy.ops.wm.save_as_mainfile(filepath={blend!r})\nos._exit(0)\n"
    run_python(BEGIN.format(folder=str(tmp_path)) + save).check_returncode()
    bake = f"import os\nbpy.ops.wm.open_mainfile(filepath={blend!r})\nbpy.ops.umbra.bake_frame()\nos._exit(0)\n"
    written = []
    for kernels in ("Haswell", "Nehalem", "Sandybridge"):
        monkeypatch.setenv("OPENBLAS_CORETYPE", kernels)
        run_python(bake).check_returncode()
        (path,) = (tmp_path / "maps").glob("*.exr")
        written.append(path.stat().st_mtime_ns)
    assert len(set(written)) == 1


def test_an_older_version_of_a_file_shows_its_own_picture_without_the_addon(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType
) -> None:
    """The second version, saved under another name in the same folder, must not write over the first one's maps."""
    hole = add_hole(scene, spin=0.1)
    scene.umbra.map_folder = "//maps/"
    first = str(tmp_path / "shot_v001.blend")
    bpy.ops.wm.save_as_mainfile(filepath=first)
    own = render(scene, tmp_path / "own.exr", exr)
    bpy.ops.wm.save_mainfile()
    scene.camera.location.x += 3.0
    hole.umbra.spin = 0.9
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot_v002.blend"))
    bpy.ops.umbra.bake_frame()
    script = f"""
import os
bpy.ops.wm.open_mainfile(filepath={first!r})
bpy.context.scene.render.filepath = {str(tmp_path / "plain.exr")!r}
bpy.ops.render.render(write_still=True)
os._exit(0)
"""
    run_python(script, resources=tmp_path / "resources").check_returncode()
    np.testing.assert_allclose(read(tmp_path / "plain.exr", exr), own, rtol=1e-4, atol=1e-4)
