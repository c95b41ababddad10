# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cycles Lens in a scene: what it asks for, what it says, and that it leaves no trace."""

import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from lens_scene import add_ball, add_lens, in_the_dark
from small_scene import render, run_python

pytestmark = pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    return in_the_dark(tmp_path / "maps")


def test_switching_back_restores_the_camera(scene) -> None:
    data = scene.camera.data
    data.shift_x, data.sensor_fit, data.dof.use_dof, data.lens = 0.1, "VERTICAL", True, 33.0

    def state() -> dict[str, object]:
        kinds = {"FLOAT", "ENUM", "BOOLEAN", "STRING"}
        names = [each.identifier for each in data.bl_rna.properties if each.type in kinds]
        return {name: str(getattr(data, name)) for name in names} | {"keys": sorted(data.keys())}

    before = state(), scene.render.use_lock_interface
    add_lens(scene)
    assert data.type == "CUSTOM"
    scene.umbra.output = "COMPOSITOR"
    assert (state(), scene.render.use_lock_interface) == before
    assert not list(data.cycles_custom.keys())


def test_the_compositor_comes_back_with_its_look(scene, addon_module) -> None:
    assert bpy.ops.umbra.add_black_hole() == {"FINISHED"}
    find = addon_module("outputs.shared.compositor_tree").find_setup
    find(scene).group.inputs["Exposure"].default_value = 1.5
    find(scene).group.inputs["Redshift Color"].default_value = 0.25
    scene.umbra.output = "CYCLES_LENS"
    assert find(scene) is None
    assert scene.umbra.redshift_color == pytest.approx(0.25)
    scene.umbra.redshift_color = 0.5
    scene.umbra.output = "COMPOSITOR"
    assert find(scene).group.inputs["Exposure"].default_value == pytest.approx(1.5)
    assert find(scene).group.inputs["Redshift Color"].default_value == pytest.approx(0.5)


def test_nearer_objects_come_in_front(scene, tmp_path, exr) -> None:
    near = add_ball((-0.5, -4.0, 0.2), 0.3)
    add_lens(scene, 0.2, spin=0.5)
    scene.umbra.sphere_radius = 9.0
    without = render(scene, tmp_path / "without.exr", exr)[..., 0]
    assert bpy.ops.umbra.set_up_foreground() == {"FINISHED"}
    assert list(scene.umbra.foreground.objects) == [near]
    picture = render(scene, tmp_path / "with.exr", exr)[..., 0]
    # the ball's middle through the unbent camera: 50 mm, 36 mm, 160 pixels
    x, y = int(80 - 0.5 / 2.0 * 50.0 / 36.0 * 160.0), int(45 - 0.2 / 2.0 * 50.0 / 36.0 * 160.0)
    assert without[y, x] == 0.0
    assert picture[y, x] == pytest.approx(1.0)
    assert bpy.ops.umbra.remove_foreground() == {"FINISHED"}
    assert len(bpy.data.scenes) == 1
    np.testing.assert_array_equal(render(scene, tmp_path / "after.exr", exr)[..., 0], without)


def test_objects_inside_the_sphere_are_named(scene, addon_module) -> None:
    ball = add_ball((0.0, 1.0, 0.0), 0.2)
    ball.name = "Probe"
    add_lens(scene)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    frame = addon_module("outputs.frames").read(scene, depsgraph)
    (sentence,) = addon_module("outputs.lens.lens_objects").warnings(scene, depsgraph, frame)
    assert sentence.startswith('"Probe" reaches into the lens sphere')


def test_bytecode_names_no_place(addon_module) -> None:
    """It is saved with the camera, and must be the same in every session."""
    for uses_map in (False, True):
        code, _ = addon_module("outputs.lens.lens_shader").bytecode(uses_map=uses_map)
        assert "shader umbra_lens" in code
        assert "/" not in code
        assert "\\" not in code.replace("\\n", "")


def test_another_engine_is_refused(scene) -> None:
    scene.render.engine = "BLENDER_WORKBENCH"
    with pytest.raises(RuntimeError, match="needs the render engine Cycles"):
        bpy.ops.umbra.set_output(output="CYCLES_LENS")
    assert scene.umbra.output == "COMPOSITOR"


def test_a_missing_map_ends_the_process(tmp_path) -> None:
    result = run_python(f"""
from small_scene import shrink
scene = bpy.context.scene
shrink(scene)
bpy.ops.umbra.add_black_hole()
scene.umbra.map_folder = {str(tmp_path)!r}
bpy.ops.umbra.set_output(output="CYCLES_LENS")
scene.umbra.auto_bake = False
scene.render.filepath = {str(tmp_path / "picture.exr")!r}
bpy.ops.render.render(write_still=True)
""")
    assert result.returncode == 1
    assert "The exit map" in result.stderr
    assert "is missing: bake it" in result.stderr
    assert not (tmp_path / "picture.exr").exists()


def test_an_animation_follows_the_camera_that_a_marker_binds(scene, tmp_path, exr) -> None:
    """Two frames with two cameras, of which one moves: each is what it is when it is rendered alone."""
    for place, radius in (((0.7, 6.0, 0.3), 1.0), ((-3.0, 20.0, 2.0), 3.0)):
        add_ball(place, radius)
    first = scene.camera
    second = bpy.data.objects.new("Second", bpy.data.cameras.new("Second"))
    scene.collection.objects.link(second)
    second.location, second.rotation_euler = (1.0, -7.0, 0.5), (math.pi / 2, 0.0, 0.1)
    for frame, height in ((1, 0.0), (3, 1.0)):
        second.location.z = height
        second.keyframe_insert("location", frame=frame)
    for frame, camera in ((1, first), (2, second)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    add_lens(scene, 0.2, spin=0.9)
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / "frame_####.exr")
    bpy.ops.render.render(animation=True)
    pictures = [exr.read_exr(tmp_path / f"frame_{frame:04d}.exr")[0] for frame in (1, 2, 3)]
    assert np.abs(pictures[1] - pictures[2]).mean() > 1e-3
    for frame, picture in enumerate(pictures, start=1):
        scene.frame_set(frame)
        alone = render(scene, tmp_path / "alone.exr", exr)
        assert np.abs(alone - picture).mean() < 1e-4
    assert first.data.type == "CUSTOM"
    scene.umbra.output = "COMPOSITOR"
    assert (first.data.type, second.data.type) == ("PERSP", "PERSP")


def test_a_gpu_without_shaders_is_named_and_the_cpu_renders_if_it_may(scene, tmp_path, exr, addon_module) -> None:
    shader = addon_module("outputs.lens.lens_shader")
    preferences = bpy.context.preferences.addons["cycles"].preferences
    kinds = [each[0] for each in preferences.get_device_types(bpy.context)]
    others = [kind for kind in kinds if kind not in shader.DEVICES_WITH_SHADERS]
    if not others:
        pytest.skip("this Blender knows no GPU but through OptiX")
    add_ball((0.7, 6.0, 0.3), 1.0)
    add_lens(scene, 0.2)
    before = preferences.compute_device_type
    try:
        preferences.compute_device_type, scene.cycles.device = others[0], "GPU"
        assert "cannot run camera shaders: only OptiX can" in str(shader.device_problem(scene))
        scene.umbra.cpu_fallback = True
        assert render(scene, tmp_path / "cpu.exr", exr)[..., 0].max() > 0.5
        assert scene.cycles.device == "GPU"
    finally:
        preferences.compute_device_type = before


def test_the_viewport_follows_the_camera_and_the_hole(scene, addon_module) -> None:
    """What a viewport's update does: the camera's shader gets the new places, and an update that changes nothing of
    them leaves the camera alone."""
    hole = add_lens(scene, 0.2, spin=0.5)
    shown = scene.camera.data.cycles_custom
    scene.camera.location = (1.0, -8.0, 0.5)
    bpy.context.view_layer.update()
    assert tuple(shown["place"]) == pytest.approx((5.0, -40.0, 2.5), rel=1e-5)
    hole.umbra.spin = 0.7
    bpy.context.view_layer.update()
    assert shown["spin"] == pytest.approx(0.7)
    assert shown["broken"] == 0
    updates = []
    bpy.app.handlers.depsgraph_update_post.append(lambda *_: updates.append(1))
    try:
        scene.cursor.location = (1.0, 2.0, 3.0)
        for _ in range(3):
            bpy.context.view_layer.update()
        assert len(updates) <= 3
    finally:
        bpy.app.handlers.depsgraph_update_post.pop()
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.camera.location.x = 2.0
    bpy.context.view_layer.update()
    assert shown["broken"] == 1
