# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion blur and depth of field: what each output refuses, or says that it leaves sharp."""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from lens_scene import add_lens, in_the_dark
from small_scene import add_hole, environment_image, refused, render, run_python, shrink, world_sky


def animate(each: bpy.types.Object, x: float = 0.3, frames: tuple[int, ...] = (1, 11)) -> None:
    """Let an object go on along x."""
    for index, frame in enumerate(frames):
        each.location.x += index * x
        each.keyframe_insert("location", frame=frame)


@pytest.fixture
def read(addon_module: Callable[[str], ModuleType]) -> Callable[[int], object]:
    """A function that reads a frame as a render does."""
    return lambda frame: addon_module("outputs.frames").read_at(bpy.context.scene, frame)


@pytest.fixture
def panel(addon_module: Callable[[str], ModuleType]) -> Callable[[], str]:
    """A function that returns what the panel says, in one line."""

    def text() -> str:
        bpy.context.view_layer.update()
        return " ".join(line.text for line in addon_module("ui.status").lines(bpy.context))

    return text


@pytest.fixture
def lens(tmp_path: Path) -> bpy.types.Scene:
    scene = in_the_dark(tmp_path)
    add_lens(scene)
    scene.render.use_motion_blur = True
    return scene


def hole_of(scene: bpy.types.Scene) -> bpy.types.Object:
    return scene.umbra.active_hole


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_the_lens_refuses_a_camera_or_a_hole_that_moves(
    lens: bpy.types.Scene, read: Callable[[int], object], panel: Callable[[], str], exr: ModuleType
) -> None:
    ball = bpy.data.objects.new("Ball", bpy.data.meshes.new("Ball"))
    lens.collection.objects.link(ball)
    animate(ball)
    read(5)  # objects may move
    animate(lens.camera)
    for frame, is_moving in ((5, True), (20, False)):  # the keyframes end at 11
        lens.frame_set(frame)
        if is_moving:
            with pytest.raises(exr.BlackHoleError, match='"Camera" moves while the shutter is open') as error:
                read(frame)
            assert error.value.code == "lens.motion-blur"
        else:
            read(frame)
        assert ("while the shutter is open" in panel()) is is_moving
    lens.render.motion_blur_position = "START"
    with pytest.raises(exr.BlackHoleError):
        read(10)
    read(11)
    lens.render.motion_blur_position = "END"
    with pytest.raises(exr.BlackHoleError):
        read(11)
    lens.render.use_motion_blur = False
    read(5)

    lens.render.use_motion_blur = True
    lens.camera.animation_data_clear()
    animate(hole_of(lens))
    with pytest.raises(exr.BlackHoleError, match='"Hole" moves'):
        read(5)


def test_what_moves_it_may_be_a_parent_a_driver_or_a_path(
    lens: bpy.types.Scene, read: Callable[[int], object], exr: ModuleType
) -> None:
    lens.camera.parent = bpy.data.objects.new("Dolly", None)
    lens.collection.objects.link(lens.camera.parent)
    animate(lens.camera.parent)
    with pytest.raises(exr.BlackHoleError, match='"Camera" moves'):
        read(5)
    lens.camera.parent.animation_data_clear()
    curve = lens.camera.driver_add("location", 0)
    curve.driver.expression = "max(frame-10,0)*0.1"
    read(5)
    with pytest.raises(exr.BlackHoleError, match='"Camera" moves'):
        read(15)


def test_a_render_without_a_window_fails(tmp_path: Path) -> None:
    result = run_python(
        f"""
from pathlib import Path
from lens_scene import add_lens, in_the_dark
scene = in_the_dark(Path({str(tmp_path)!r}))
add_lens(scene)
scene.umbra.lens_rays = "IN_SHADER"
scene.render.use_motion_blur = True
for frame in (1, 3):
    scene.camera.location.x = 0.1 * frame
    scene.camera.keyframe_insert("location", frame=frame)
scene.frame_set(2)
bpy.ops.render.render()
"""
    )
    assert refused(result)
    assert "[lens.motion-blur]" in result.stderr


def test_the_compositors_panel_says_what_stays_sharp(scene: bpy.types.Scene, panel: Callable[[], str]) -> None:
    add_hole(scene)
    scene.render.use_motion_blur = True
    assert "stay sharp" not in panel()
    animate(scene.camera)
    scene.frame_set(5)
    assert "Motion Blur is on" in panel()
    scene.render.use_motion_blur = False
    scene.camera.data.dof.use_dof = True
    assert "Depth of Field is on" in panel()
    assert "Motion Blur" not in panel()


def test_the_compositors_sky_stays_sharp(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    add_hole(scene)
    animate(scene.camera, 2.0)
    scene.frame_set(5)
    sharp = render(scene, tmp_path / "sharp.exr", exr)
    scene.render.use_motion_blur = True
    np.testing.assert_array_equal(render(scene, tmp_path / "blurred.exr", exr), sharp)


def test_the_world_is_blurred_by_a_turn_and_not_by_a_shift(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, panel: Callable[[], str]
) -> None:
    """Against the mean of pictures at moments within the shutter, and against the one of its middle."""
    shrink(scene, (32, 18))
    scene.cycles.samples, scene.cycles.pixel_filter_type, scene.cycles.filter_width = 64, "BOX", 1.0
    world_sky(scene, environment_image())
    add_hole(scene, sky=False, mass_scale=0.3)
    assert bpy.ops.umbra.set_output(output="WORLD") == {"FINISHED"}
    scene.world.cycles.sampling_method = "NONE"  # a map of its brightness takes two seconds a render
    camera = scene.camera
    camera.location, camera.rotation_euler = (0.0, -6.0, 0.0), (math.pi / 2.0, 0.0, 0.0)
    half = 0.06  # radians, some 2 pixels

    def stills(turns: np.ndarray) -> np.ndarray:
        pictures = []
        for turn in turns:
            camera.rotation_euler.z = turn
            pictures.append(render(scene, tmp_path / "still.exr", exr)[..., :3])
        return np.mean(pictures, axis=0)

    middle, mean = stills(np.zeros(1)), stills(half * np.array((-2.0, 0.0, 2.0)) / 3.0)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
    for frame, turn in ((0, -2.0 * half), (2, 2.0 * half)):  # the shutter is open from 0.5 to 1.5
        camera.rotation_euler.z = turn
        camera.keyframe_insert("rotation_euler", frame=frame)
    for curve in camera.animation_data.action.layers[0].strips[0].channelbags[0].fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    scene.frame_set(1)
    turned = render(scene, tmp_path / "turned.exr", exr)[..., :3]
    effect = rms(mean - middle)
    assert effect > 0.03  # of the shadow's edge, mostly
    assert rms(turned - mean) < 0.35 * effect  # three moments, and the noise of 64 samples
    assert "its way past the hole" in panel()

    camera.animation_data_clear()
    camera.rotation_euler.z = 0.0
    for frame, x in ((0, -0.4), (2, 0.4)):
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    shifted = render(scene, tmp_path / "shifted.exr", exr)[..., :3]
    assert rms(shifted - middle) < 0.2 * effect


def test_the_panel_names_what_is_behind_the_hole(scene: bpy.types.Scene, panel: Callable[[], str]) -> None:
    add_hole(scene)
    camera = np.array(scene.camera.matrix_world)
    forward, right = -camera[:3, 2], camera[:3, 0]

    def put(name: str, place: np.ndarray) -> None:
        bpy.ops.mesh.primitive_cube_add(size=0.2, location=tuple(place))
        bpy.context.object.name = name

    put("Before", -2.0 * forward)
    put("Beside the Frame", 5.0 * forward + 30.0 * right)
    assert "behind the hole" not in panel()
    for name in ("A", "B", "C"):
        put(name, 5.0 * forward)
    assert '"A", "B", "C" reach behind the hole' in panel()
    put("D", 6.0 * forward)
    put("E", 6.0 * forward)
    assert '"A", "B", "C" and 2 more reach behind the hole' in panel()
