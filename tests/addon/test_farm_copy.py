# SPDX-License-Identifier: GPL-3.0-or-later
"""Machines that render without the add-on: every frame is the picture that the add-on renders, or is refused."""

import shlex
import subprocess
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from mathutils import Vector
from small_scene import add_hole, find_map, read, run_python, shrink

from blender_addon.farm import farm_templates

FRAMES = (1, 2)
# Keyframes hold single precision, the drivers whose place they take double.
ROUNDING = 1e-5

pytestmark = pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene with a hole, two frames long, whose camera moves."""
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene)
    scene.frame_start, scene.frame_end = FRAMES
    scene.umbra.map_folder = "//umbra_maps/"
    for frame, x in zip(FRAMES, (7.4, 6.0), strict=True):
        scene.camera.location.x = x
        scene.camera.keyframe_insert("location", frame=frame)
    return scene


def animate_exposure(scene: bpy.types.Scene) -> None:
    """Give the hole a disk that fades."""
    disk = scene.umbra.active_hole.umbra.disk
    disk.enabled = True
    for frame, exposure in zip(FRAMES, (0.0, -3.0), strict=True):
        disk.exposure = exposure
        disk.keyframe_insert("exposure", frame=frame)


def use_lens(scene: bpy.types.Scene) -> None:
    """Bend the camera's rays, with a spin that is animated; the second frame is another camera's."""
    hole = scene.umbra.active_hole
    for frame, spin in zip(FRAMES, (0.9, 0.5), strict=True):
        hole.umbra.spin = spin
        hole.umbra.keyframe_insert("spin", frame=frame)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=3.0, location=(-9.0, 9.0, -6.0))
    second = bpy.data.objects.new("Second", bpy.data.cameras.new("Second"))
    second.location = (0.0, 0.0, 12.0)
    scene.collection.objects.link(second)
    for frame, camera in zip(FRAMES, (scene.camera, second), strict=True):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    assert bpy.ops.umbra.set_output(output="CYCLES_LENS") == {"FINISHED"}
    scene.world.cycles.sampling_method = "NONE"  # a table of the sky's light would take longer than the render
    scene.umbra.lens_rays = "IN_SHADER"


def use_lens_with_foreground(scene: bpy.types.Scene) -> None:
    """Zoom on a ball nearer than the hole, which a second scene renders unbent."""
    scene.camera.animation_data_clear()
    for frame, lens in zip(FRAMES, (50.0, 90.0), strict=True):
        scene.camera.data.lens = lens
        scene.camera.data.keyframe_insert("lens", frame=frame)
    bpy.context.view_layer.update()
    place = scene.camera.matrix_world @ Vector((0.0, 0.0, -1.5))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.2, location=place)
    assert bpy.ops.umbra.set_output(output="CYCLES_LENS") == {"FINISHED"}
    scene.world.cycles.sampling_method = "NONE"  # a table of the sky's light would take longer than the render
    scene.umbra.lens_rays = "IN_SHADER"
    assert bpy.ops.umbra.set_up_foreground() == {"FINISHED"}
    assert len(scene.umbra.foreground.objects) == 1


def save(tmp_path: Path) -> Path:
    blend = tmp_path / "shot.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    return blend


def render_all(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> list[np.ndarray]:
    scene.render.filepath = str(tmp_path / "with_####")
    bpy.ops.render.render(animation=True)
    return [read(tmp_path / f"with_{frame:04d}.exr", exr) for frame in FRAMES]


def run_without_addon(*runs: tuple[Path, str]) -> subprocess.CompletedProcess[str]:
    """The script with files and arguments, in a Blender where the extension is not installed."""
    script = runs[0][0].with_name("umbra_farm.py")
    script.write_text(farm_templates.script(), encoding="utf-8")
    return run_python(
        "import runpy\n"
        "assert not hasattr(bpy.types.Scene, 'umbra')\n"
        f"for blend, *arguments in {[(str(blend), *shlex.split(words)) for blend, words in runs]!r}:\n"
        "    bpy.ops.wm.open_mainfile(filepath=blend)\n"
        "    sys.argv[1:] = ['--', *arguments]\n"
        "    status = 0\n"
        "    try:\n"
        f"        runpy.run_path({str(script)!r}, run_name='__main__')\n"
        "    except SystemExit as end:\n"
        "        status = end.code\n"
        "    print('status', status)\n",
        resources=runs[0][0].parent / "empty",
    )


def statuses(result: subprocess.CompletedProcess[str]) -> list[int]:
    return [int(line.split()[1]) for line in result.stdout.splitlines() if line.startswith("status ")]


def without_addon(blend: Path, tmp_path: Path, exr: ModuleType) -> list[np.ndarray]:
    result = run_without_addon((blend, f"render --output={tmp_path / 'without_####'}"))
    assert statuses(result) == [0], result.stderr
    assert "openjd_progress: 100.0" in result.stdout
    return [read(tmp_path / f"without_{frame:04d}.exr", exr) for frame in FRAMES]


def differ(pictures: list[np.ndarray]) -> bool:
    """Whether each picture differs visibly from the one after it."""
    return all(np.abs(a - b).max() > 0.05 for a, b in pairwise(pictures))


def test_a_disk_that_stays_needs_no_copy(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    scene.umbra.active_hole.umbra.disk.enabled = True
    save(tmp_path)
    pictures = render_all(scene, tmp_path, exr)
    bpy.ops.wm.save_mainfile()
    assert differ(pictures)
    for ours, theirs in zip(pictures, without_addon(tmp_path / "shot.blend", tmp_path, exr), strict=True):
        np.testing.assert_array_equal(theirs, ours)


@pytest.mark.parametrize("change", [animate_exposure, use_lens, use_lens_with_foreground])
def test_the_copy_renders_alike(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, change: Callable[[bpy.types.Scene], None]
) -> None:
    change(scene)
    save(tmp_path)
    pictures = render_all(scene, tmp_path, exr)
    assert differ(pictures)
    bpy.ops.wm.save_mainfile()
    assert bpy.ops.umbra.save_farm_copy() == {"FINISHED"}
    for ours, theirs in zip(pictures, without_addon(tmp_path / "shot_farm.blend", tmp_path, exr), strict=True):
        np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("change", [animate_exposure, use_lens])
def test_what_would_be_wrong_is_refused(
    scene: bpy.types.Scene, tmp_path: Path, change: Callable[[bpy.types.Scene], None]
) -> None:
    """The original of such a file, and frames that the copy does not have."""
    change(scene)
    blend = save(tmp_path)
    assert bpy.ops.umbra.save_farm_copy() == {"FINISHED"}
    refused = run_without_addon((blend, "check --frames=1"), (tmp_path / "shot_farm.blend", "check --frames=2-3"))
    assert statuses(refused) == [1, 1], refused.stderr
    sentences = [line for line in refused.stdout.splitlines() if line.startswith("openjd_fail: ")]
    assert len(sentences) == 2
    assert "This file needs the add-on in each frame" in sentences[0]
    assert "Frame 3 is not in this farm copy, which has 1 to 2: save it anew." in sentences[1]


@pytest.mark.parametrize("change", [animate_exposure, use_lens])
def test_the_open_file_stays_as_it_is(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, change: Callable[[bpy.types.Scene], None]
) -> None:
    """Same actions, drivers and pictures, and nothing left over; the copy renders alike with the add-on too."""
    change(scene)
    save(tmp_path)
    before = render_all(scene, tmp_path, exr)
    actions = {each.name: each.users for each in bpy.data.actions}
    assert bpy.ops.umbra.save_farm_copy() == {"FINISHED"}
    assert {each.name: each.users for each in bpy.data.actions} == actions
    assert "umbra_farm_frames" not in scene
    np.testing.assert_array_equal(render_all(scene, tmp_path, exr), before)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot_farm.blend"))
    np.testing.assert_allclose(render_all(bpy.context.scene, tmp_path, exr), before, rtol=0.0, atol=ROUNDING)
    with pytest.raises(RuntimeError, match="a farm copy already: open the file that it was made from"):
        bpy.ops.umbra.save_farm_copy()


def test_what_cannot_be_copied_is_said(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="not saved yet"):
        bpy.ops.umbra.save_farm_copy()
    world = scene.world.driver_add("color", 0).driver
    variable = world.variables.new()
    variable.name = "spin"
    variable.targets[0].id, variable.targets[0].data_path = scene.umbra.active_hole, "umbra.spin"
    world.expression = "spin * 2"
    save(tmp_path)
    with pytest.raises(RuntimeError, match=r"The driver of .* works with settings of the black hole"):
        bpy.ops.umbra.save_farm_copy()


def test_a_light_that_cannot_follow_is_refused(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """Its mesh is made anew for each frame by the add-on alone."""
    animate_exposure(scene)
    scene.umbra.active_hole.umbra.disk.light = True
    blend = save(tmp_path)
    with pytest.raises(RuntimeError, match="lights the scene, and its settings are animated"):
        bpy.ops.umbra.save_farm_copy()
    refused = run_without_addon((blend, "check"))
    assert statuses(refused) == [1], refused.stderr
    assert "lights the scene, and its settings are animated: render with the add-on" in refused.stdout


@pytest.mark.parametrize("harm", ["missing", "damaged"])
def test_a_map_that_is_not_there_is_no_magenta_success(scene: bpy.types.Scene, tmp_path: Path, harm: str) -> None:
    blend = save(tmp_path)
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    bpy.ops.wm.save_mainfile()
    lost = find_map(tmp_path / "umbra_maps", "Scene_Black_Hole_64x36_0002.exr")
    if harm == "missing":
        lost.unlink()
    else:
        lost.write_bytes(b"not a picture")
    tried = run_without_addon((blend, f"render --output={tmp_path / 'without_####'}"), (blend, "check --frames=1"))
    assert statuses(tried) == [1, 0], tried.stderr
    assert f"openjd_fail: Frame 2: the map {lost} is {harm}" in tried.stdout
    assert not list(tmp_path.glob("without_*"))
