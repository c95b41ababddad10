# SPDX-License-Identifier: GPL-3.0-or-later
"""In Blender's executable its own libraries are in the global scope; as a Python module it keeps them to itself.

The wheel's OpenEXR must call its own functions there too, although Blender's have the same names.
"""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import os, sys
sys.setdlopenflags(os.RTLD_GLOBAL | os.RTLD_NOW)
import bpy
sys.setdlopenflags(os.RTLD_LOCAL | os.RTLD_NOW)
sys.path.insert(0, {tools!r})
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.umbra_black_hole")
from pathlib import Path
from small_scene import add_hole, shrink
import bl_ext.user_default.umbra_black_hole as umbra
folder = Path({folder!r})
scene = bpy.context.scene
shrink(scene)
scene.umbra.map_folder = str(folder / "maps")
add_hole(scene)
scene.frame_start, scene.frame_end = 1, 2
assert bpy.ops.umbra.bake_animation() == {{"FINISHED"}}
(first, second) = sorted((folder / "maps").glob("*.exr"))
scene.render.filepath = str(folder / "picture.exr")
assert bpy.ops.render.render(write_still=True) == {{"FINISHED"}}
from importlib import import_module
physics = import_module(umbra.__name__ + ".physics")
assert physics.read_warp_map(first).visibility.min() == 0.0
assert first.read_bytes() and second.read_bytes()
print("all done", flush=True)
os._exit(0)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has one scope of names for all libraries")
def test_maps_are_baked_read_and_rendered_where_blenders_libraries_are_global(addon: object, tmp_path: Path) -> None:
    script = SCRIPT.format(tools=str(Path(__file__).parent), folder=str(tmp_path))
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "all done" in result.stdout
    assert result.stderr == ""
    assert (tmp_path / "picture.exr").stat().st_size > 0
