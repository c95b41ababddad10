# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps are baked, read, verified and rendered whatever OpenEXR the process has, or are refused in one sentence.

In Blender's executable its own libraries are in the global scope; as a Python module it keeps them to itself. The
wheel's OpenEXR must call its own functions there too, although Blender's have the same names. It can also be missing,
or another add-on can have loaded one before.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has one scope of names for all libraries")

GLOBAL = """
import os, sys
sys.setdlopenflags(os.RTLD_GLOBAL | os.RTLD_NOW)
import bpy
sys.setdlopenflags(os.RTLD_LOCAL | os.RTLD_NOW)
"""

HIDDEN = """
import importlib.abc, os, sys
class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in {hidden!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Hidden())
import bpy
"""

# As another add-on would, before this one is enabled, without any care.
FOREIGN = "import OpenEXR\n"
OLD = """
import types
sys.modules["OpenEXR"] = types.SimpleNamespace(InputFile=object, OutputFile=object, __version__="1.3.9")
"""

SCENE = """
sys.path.insert(0, {tools!r})
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.umbra_black_hole")
from importlib import import_module
from pathlib import Path
from small_scene import add_hole, shrink
import bl_ext.user_default.umbra_black_hole as umbra
physics = import_module(umbra.__name__ + ".physics")
folder = Path({folder!r})
scene = bpy.context.scene
shrink(scene)
scene.umbra.map_folder = str(folder / "maps")
add_hole(scene)
scene.frame_start, scene.frame_end = 1, 2
"""

WORK = """
import json
assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
(first, second) = sorted((folder / "maps").glob("*.exr"))
warp_map = physics.read_warp_map(first)
assert warp_map.visibility.min() == 0.0
assert bpy.ops.umbra.verify_maps() == {"FINISHED"}
scene.render.filepath = str(folder / "picture.exr")
assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
picture = physics.read_exr(folder / "picture.exr")[0]
header = physics.read_exr_header(first)
header.pop("capDate", None)  # 4.5's OpenImageIO writes an empty one
with open(folder / "result.json", "w") as file:
    json.dump({"library": physics.exr_library(), "header": header, "theta": warp_map.theta.tolist(),
               "picture": picture.tolist()}, file)
print("all done", flush=True)
os._exit(0)
"""


def run(before: str, work: str, folder: Path) -> subprocess.CompletedProcess[str]:
    script = before + SCENE.format(tools=str(Path(__file__).parent), folder=str(folder)) + work
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=False)


def result_of(before: str, folder: Path) -> dict:
    """What a process made of its scene; all must have gone well and without a word on the error stream."""
    folder.mkdir(exist_ok=True)
    result = run(before, WORK, folder)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "all done" in result.stdout
    assert "2 frames: 2 valid" in result.stdout
    assert result.stderr == ""
    return json.loads((folder / "result.json").read_text())


@pytest.fixture(scope="module")
def plain(addon: object, tmp_path_factory: pytest.TempPathFactory) -> dict:
    """The same of a process that has nothing special: the wheel, and Blender's libraries to itself."""
    found = result_of("import os, sys\nimport bpy\n", tmp_path_factory.mktemp("plain"))
    assert found["library"].startswith("OpenEXR 3.")
    return found


def assert_same(found: dict, expected: dict) -> None:
    """Bit by bit, and with the same header."""
    for name in ("theta", "picture"):
        np.testing.assert_array_equal(np.array(found[name]), np.array(expected[name]))
    assert found["header"] == expected["header"]


@ON_LINUX
def test_with_blenders_libraries_in_the_global_scope(plain: dict, tmp_path: Path) -> None:
    found = result_of(GLOBAL, tmp_path / "work")
    assert found["library"].startswith("OpenEXR 3.")
    assert_same(found, plain)


@ON_LINUX
def test_where_another_add_on_has_loaded_openexr_before(plain: dict, tmp_path: Path) -> None:
    """It calls Blender's functions, so that it cannot be used, and a second one cannot be loaded."""
    found = result_of(GLOBAL + FOREIGN, tmp_path / "work")
    assert found["library"].startswith("OpenImageIO 3.")
    assert_same(found, plain)


@ON_LINUX
def test_where_another_add_on_has_loaded_an_old_openexr_before(plain: dict, tmp_path: Path) -> None:
    found = result_of(GLOBAL + OLD, tmp_path / "work")
    assert found["library"].startswith("OpenEXR 3.")
    assert_same(found, plain)


def test_without_the_wheel(plain: dict, tmp_path: Path) -> None:
    found = result_of(HIDDEN.format(hidden={"OpenEXR"}), tmp_path / "work")
    assert found["library"].startswith("OpenImageIO 3.")
    assert_same(found, plain)


NOTHING = """
assert "umbra_black_hole" in " ".join(bpy.context.preferences.addons.keys())
print("enabled", flush=True)
def refused(operator, **arguments):
    try:
        operator(**arguments)
    except RuntimeError as error:
        text = str(error)
    else:
        raise SystemExit(f"{operator.idname()} was not refused")
    assert "[file.no-library]" in text and "Traceback" not in text, text
    assert "install Umbra Black Hole again" in text, text
for operator in (bpy.ops.umbra.bake_animation, bpy.ops.umbra.bake_frame, bpy.ops.umbra.clean_maps):
    refused(operator)
status = import_module(umbra.__name__ + ".ui.status")
assert "neither read nor written" in " ".join(each.text for each in status.lines(bpy.context))
print("panel says it", flush=True)
scene.render.filepath = str(folder / "picture.exr")
other = bpy.data.scenes.new("Other")
star_sky = import_module(umbra.__name__ + ".bake.star_sky")
kept = Path(bpy.utils.extension_path_user(umbra.__name__, create=True))
(kept / star_sky.FILE).unlink(missing_ok=True)  # of an earlier test
with bpy.context.temp_override(scene=other):
    refused(bpy.ops.umbra.add_black_hole)  # with its sky of stars, which is a file
bpy.ops.render.render(write_still=True)
print("rendered")
"""


def test_without_any_library_the_extension_says_so(addon: object, tmp_path: Path) -> None:
    """It is enabled, says one sentence, and refuses every operation; a render ends with status 1."""
    result = run(HIDDEN.format(hidden={"OpenEXR", "OpenImageIO"}), NOTHING, tmp_path)
    assert result.returncode == 1
    assert result.stdout.count("panel says it") == 1, result.stdout + result.stderr
    assert "rendered" not in result.stdout
    lines = result.stderr.strip().splitlines()
    assert lines[0].startswith("Umbra: EXR files can be neither read nor written")
    assert lines[-1].startswith("Error: Umbra Black Hole: ")
    assert "install Umbra Black Hole again" in lines[-1]
    assert "Traceback" not in result.stderr
    assert not list(tmp_path.rglob("*.exr"))
