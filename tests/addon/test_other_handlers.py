# SPDX-License-Identifier: GPL-3.0-or-later
"""Other add-ons whose handlers move camera or hole in a render: sky and scene are of one place, or refused.

What is refused ends its process; the other renders share one.
"""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import refused, run_python

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
bpy.ops.umbra.set_output(output={output!r})
scene.world.cycles.sampling_method = "NONE"  # a table of the sky's light would take longer than the render
handlers = bpy.app.handlers
def move(scene, *_):
    scene.camera.location = (5.0 + scene.frame_current, -7.0, 5.0)
"""

RENDER = "bpy.ops.render.render(animation=True)\n"
END = """
for f in (move, ours):
    while f in handlers.frame_change_post:
        handlers.frame_change_post.remove(f)
sys.stdout.flush()
os._exit(0)
"""

OURS = "ours = handlers.frame_change_post[0]\n"
EXPECTED = [(6.0, -7.0, 5.0), (7.0, -7.0, 5.0)]

Places = Callable[[], list[tuple[float, ...]]]
Play = Callable[..., str]


@pytest.fixture
def places(addon_module: Callable[[str], ModuleType], tmp_path: Path) -> Places:
    """A function that says where, in the hole's frame, the camera of each baked map is."""
    physics = addon_module("core.physics_api").physics

    def read() -> list[tuple[float, ...]]:
        maps = sorted((tmp_path / "maps").glob("*.exr"))
        return [tuple(physics.read_warp_map_metadata(each)["parameters"]["camera_position"]) for each in maps]

    return read


@pytest.fixture
def told(addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Sentences of renders that are refused; without a window they would end the process."""
    shown: list[str] = []
    monkeypatch.setattr(addon_module("core.messages"), "popup", shown.append)
    monkeypatch.setattr(addon_module("core.messages"), "without_window", lambda: False)
    return shown


def script(folder: Path, change: str, output: str) -> str:
    """Render two frames with a change before."""
    return BEGIN.format(folder=str(folder), output=output) + OURS + change + RENDER


@pytest.fixture
def play(told: list[str], capfd: pytest.CaptureFixture[str]) -> Play:
    """A function that runs the script in a new file, and says why a frame is refused, or nothing."""

    def run(folder: Path, change: str, output: str = "COMPOSITOR") -> str:
        bpy.ops.wm.read_homefile(use_factory_startup=True)  # removes the handlers of the time before
        told.clear()
        exec(script(folder, change, output), {"bpy": bpy})
        error = capfd.readouterr().err
        assert "Traceback" not in error, error
        return " ".join(told)

    return run


def refusal(folder: Path, change: str) -> str:
    """Run the script in a process of its own, which has to be refused; the error."""
    result = run_python(script(folder, change, "COMPOSITOR") + END)
    assert "Traceback" not in result.stderr, result.stderr
    assert refused(result)
    return result.stderr


@pytest.mark.parametrize("output", ["COMPOSITOR", "WORLD", "CYCLES_LENS"])
def test_a_handler_that_moves_the_camera(tmp_path: Path, play: Play, output: str) -> None:
    """Blender renders from the new place, and so the map is of that place: the only one that is baked."""
    assert not play(tmp_path, "handlers.frame_change_post.append(move)\n", output)
    assert len(list((tmp_path / "maps").glob("*.exr"))) == 2
    again = "scene.umbra.auto_bake = False\ncamera = scene.camera\n"
    again += "for frame in (1, 2):\n    camera.location = (5.0 + frame, -7.0, 5.0)\n"
    again += "    camera.keyframe_insert('location', frame=frame)\n"
    assert not play(tmp_path, again, output)


@pytest.mark.parametrize(
    "change",
    [
        "handlers.frame_change_post.insert(0, move)\n",
        "handlers.render_pre.append(lambda *_: handlers.frame_change_post.append(move))\n",
        "scene.render.use_persistent_data = True\nhandlers.frame_change_post.append(move)\n",
        "handlers.frame_change_post.append(lambda *_: None)\nhandlers.depsgraph_update_post.append(move)\n",
        """
target = bpy.data.objects.new("Target", None)
scene.collection.objects.link(target)
scene.camera.constraints.new("COPY_LOCATION").target = target
def carry(scene, *_):
    target.location = (5.0 + scene.frame_current, -7.0, 5.0)
handlers.frame_change_post.append(carry)
""",
        """
def carry(scene, *_):
    scene.camera.location = (6.0, -7.0, 5.0)
    hole.location.x = 1.0 - scene.frame_current
handlers.frame_change_post.append(carry)
""",
    ],
    ids=["before ours", "attached late", "persistent data", "update", "constraint", "hole"],
)
def test_other_ways_to_move(tmp_path: Path, play: Play, places: Places, change: str) -> None:
    assert not play(tmp_path, change)
    np.testing.assert_allclose(places(), EXPECTED, rtol=1e-6)


@pytest.mark.parametrize(
    "change",
    [
        """
def last(*_):
    if handlers.frame_change_post[-1] is not last:
        handlers.frame_change_post.remove(last)
        handlers.frame_change_post.append(last)
    move(scene)
handlers.frame_change_post.append(last)
""",
        """
def insist(*_):
    if handlers.frame_change_post.count(insist) < 20:
        handlers.frame_change_post.append(insist)
    scene.camera.location.x += 0.1
handlers.frame_change_post.append(insist)
""",
        """
def lift(*_):
    scene.camera.location.z += 1.0
handlers.render_stats.append(lift)
""",
    ],
    ids=["moves itself", "always last", "while rendering"],
)
def test_what_cannot_be_followed_is_refused(tmp_path: Path, change: str) -> None:
    assert "[render." in refusal(tmp_path, change)


def test_persistent_data_keeps_what_changes(tmp_path: Path, play: Play, exr: ModuleType) -> None:
    """Cycles updates only what it is told of: an object that moves is not left where it was in the frame before."""
    change = """
scene.render.use_persistent_data = {persistent}
bpy.ops.mesh.primitive_cube_add(size=3.0)
cube = bpy.context.object
for frame, x in ((1, -2.0), (2, 2.0)):
    cube.location.x = x
    cube.keyframe_insert("location", frame=frame)
handlers.frame_change_post.append(move)
"""
    pictures = []
    for persistent in (False, True):
        folder = tmp_path / str(persistent)
        folder.mkdir()
        assert not play(folder, change.format(persistent=persistent))
        pictures.append([exr.read_exr(each)[0] for each in sorted(folder.glob("picture_*.exr"))])
    plain, kept = pictures
    assert np.abs(plain[0] - plain[1]).max() > 0.1
    np.testing.assert_allclose(kept, plain, atol=1e-3)


def test_a_second_view_layer_from_elsewhere(tmp_path: Path) -> None:
    """The handler is called for each layer, and moves on each time."""
    change = """
scene.view_layers.new("Second")
calls = []
def carry(scene, *_):
    calls.append(1)
    scene.camera.location.x += 0.5
handlers.frame_change_post.append(carry)
"""
    assert "[render.moved]" in refusal(tmp_path, change)


@pytest.mark.parametrize("output", ["COMPOSITOR", "WORLD", "CYCLES_LENS"])
@pytest.mark.parametrize("event", ["render_pre", "frame_change_post"])
def test_a_handler_that_renames_the_scene(tmp_path: Path, play: Play, output: str, event: str, exr: ModuleType) -> None:
    """What is remembered of a scene goes by its number in the session, not by its name."""
    change = "def rename(scene, *_):\n    scene.name = f'S {scene.frame_current}'\n"
    pictures = []
    for name, more in (("plain", ""), ("renamed", change + f"handlers.{event}.append(rename)\n")):
        folder = tmp_path / name
        folder.mkdir()
        error = play(folder, more, output)
        if more and "[render.renamed]" in error and output == "COMPOSITOR" and bpy.app.version < (5, 0):
            return  # whose compositor does not find the picture
        assert not error
        pictures.append([exr.read_exr(each)[0] for each in sorted(folder.glob("picture_*.exr"))])
    np.testing.assert_array_equal(*pictures)
    assert bpy.context.scene.name.startswith("S ")
