# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendering: what is missing is baked, and each pixel is what the numpy reference says."""

import shutil
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import (
    ROOT,
    add_hole,
    environment_image,
    environment_pixels,
    find_map,
    plain_name,
    read,
    render,
    run_python,
    shrink,
    world_sky,
)

# The compositor works in float32 and looks the sky up by float32 coordinates.
PIXEL_TOLERANCE = 1e-4


@pytest.fixture
def physics(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api").physics


@pytest.fixture
def reference(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api").physics


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene with maps of its own."""
    scene = bpy.context.scene
    shrink(scene)
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


def map_files(tmp_path: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in sorted((tmp_path / "maps").glob("*.exr"))}


def test_one_click_and_render(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, physics: ModuleType, reference: ModuleType
) -> None:
    """In front of the sky, the default cube; the foreground is taken from a render without the set-up."""
    scene.cycles.seed, scene.cycles.samples = 3, 4
    scene.render.film_transparent = True
    foreground = render(scene, tmp_path / "foreground.exr", exr)
    scene.umbra.environment_image = environment_image()
    scene.umbra.environment_source = "IMAGE"
    assert bpy.ops.umbra.add_black_hole() == {"FINISHED"}
    scene.umbra.hide_behind = False  # the hole is inside the cube
    picture = render(scene, tmp_path / "picture.exr", exr)
    (name,) = map_files(tmp_path)
    assert plain_name(name) == "Scene_Black_Hole_64x36_0001.exr"
    warp_map = physics.read_warp_map(tmp_path / "maps" / name)
    expected = reference.render_reference(warp_map, environment_pixels(), foreground=foreground)
    np.testing.assert_allclose(picture[..., :3], expected.image[..., :3], atol=PIXEL_TOLERANCE)
    assert np.ptp(foreground[..., 3]) == 1.0  # the cube and the sky are both in the picture
    assert (warp_map.visibility == 0.0).any()


@pytest.mark.parametrize("samples", ["1", "2"])
@pytest.mark.parametrize("percentage", [100, 50])
def test_sizes_and_samples(
    scene: bpy.types.Scene,
    tmp_path: Path,
    exr: ModuleType,
    physics: ModuleType,
    reference: ModuleType,
    percentage: int,
    samples: str,
) -> None:
    add_hole(scene)
    scene.render.resolution_percentage = percentage
    scene.umbra.supersampling = samples
    picture = render(scene, tmp_path / "picture.exr", exr)
    (name,) = map_files(tmp_path)
    warp_map = physics.read_warp_map(tmp_path / "maps" / name)
    height, width = picture.shape[:2]
    assert (width, height) == (64 * percentage // 100, 36 * percentage // 100)
    assert warp_map.theta.shape == (height * int(samples), width * int(samples))
    expected = reference.render_reference(warp_map, environment_pixels(), output_size=(width, height))
    np.testing.assert_allclose(picture[..., :3], expected.image[..., :3], atol=PIXEL_TOLERANCE)


def test_a_test_at_half_the_size_keeps_what_was_baked(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    add_hole(scene)
    full = render(scene, tmp_path / "full.exr", exr)
    before = map_files(tmp_path)
    scene.render.resolution_percentage = 50
    render(scene, tmp_path / "half.exr", exr)
    scene.render.resolution_percentage = 100
    again = render(scene, tmp_path / "again.exr", exr)
    after = map_files(tmp_path)
    assert len(after) == 2
    assert before.items() <= after.items()
    np.testing.assert_array_equal(again, full)


def test_maps_are_reused_until_something_that_matters_changes(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType
) -> None:
    hole = add_hole(scene)
    first = render(scene, tmp_path / "a.exr", exr)
    baked = map_files(tmp_path)
    # the look, the sky and the objects in front do not matter
    scene.umbra.environment_image = environment_image(environment_pixels() * 0.5, "Dark Sky")
    dark = render(scene, tmp_path / "b.exr", exr)
    assert map_files(tmp_path) == baked
    np.testing.assert_allclose(dark[..., :3], first[..., :3] * 0.5, atol=PIXEL_TOLERANCE)

    for change in (
        lambda: setattr(hole.umbra, "spin", 0.3),
        lambda: setattr(hole.umbra, "motion", "STATIC"),
        lambda: setattr(scene.camera, "location", (6.0, -6.0, 5.0)),
        lambda: setattr(scene.camera.data, "lens", 40.0),
        lambda: setattr(hole, "rotation_euler", (0.5, 0.0, 0.0)),
        lambda: setattr(scene.umbra, "quality", "DRAFT"),
    ):
        change()
        picture = render(scene, tmp_path / "c.exr", exr)
        now = map_files(tmp_path)
        assert now.keys() == baked.keys()
        assert now != baked
        baked = now
        assert not np.array_equal(picture, dark)
        dark = picture


def test_a_damaged_or_foreign_map_is_baked_again(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    add_hole(scene)
    first = render(scene, tmp_path / "a.exr", exr)
    (path,) = (tmp_path / "maps").glob("*.exr")
    path.write_bytes(path.read_bytes()[:200])
    np.testing.assert_array_equal(render(scene, tmp_path / "b.exr", exr), first)
    shutil.copy(tmp_path / "a.exr", path)
    np.testing.assert_array_equal(render(scene, tmp_path / "c.exr", exr), first)


def test_an_animation_with_marker_cameras(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, physics: ModuleType, reference: ModuleType
) -> None:
    hole = add_hole(scene, motion="CAMERA_ANIMATION", speed_of_light=50.0)
    for frame, x in ((0, 0.0), (3, 0.3)):
        hole.location.x = x
        hole.keyframe_insert("location", frame=frame)
        hole.umbra.spin = 0.5 + x
        hole.umbra.keyframe_insert("spin", frame=frame)
    second = bpy.data.objects.new("Second", bpy.data.cameras.new("Second"))
    second.location = (0.0, 0.0, 12.0)
    scene.collection.objects.link(second)
    for frame, camera in ((0, scene.camera), (2, second)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    scene.frame_start, scene.frame_end = 0, 3
    scene.frame_set(7)
    scene.render.filepath = str(tmp_path / "frame_####")
    bpy.ops.render.render(animation=True)
    assert scene.frame_current == 7
    assert [plain_name(each) for each in map_files(tmp_path)] == [
        f"Scene_Black_Hole_64x36_{frame:04d}.exr" for frame in range(4)
    ]
    distances = []
    for frame in range(4):
        warp_map = physics.read_warp_map(find_map(tmp_path / "maps", f"Scene_Black_Hole_64x36_{frame:04d}.exr"))
        picture = read(tmp_path / f"frame_{frame:04d}.exr", exr)
        expected = reference.render_reference(warp_map, environment_pixels())
        np.testing.assert_allclose(picture[..., :3], expected.image[..., :3], atol=PIXEL_TOLERANCE)
        distances.append(float(np.linalg.norm(warp_map.metadata["parameters"]["camera_position"])))
    assert abs(distances[1] - distances[2]) > 1.0  # the cut

    # what the operator would bake is what the render baked
    before = map_files(tmp_path)
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    assert map_files(tmp_path) == before


@pytest.mark.parametrize("frame", [-3, 0, 12345])
def test_unusual_frames(
    scene: bpy.types.Scene,
    tmp_path: Path,
    exr: ModuleType,
    physics: ModuleType,
    reference: ModuleType,
    frame: int,
) -> None:
    add_hole(scene)
    scene.frame_set(frame)
    picture = render(scene, tmp_path / "picture.exr", exr)
    (name,) = map_files(tmp_path)
    assert plain_name(name) == f"Scene_Black_Hole_64x36_{frame % 1_000_000:04d}.exr"
    expected = reference.render_reference(physics.read_warp_map(tmp_path / "maps" / name), environment_pixels())
    np.testing.assert_allclose(picture[..., :3], expected.image[..., :3], atol=PIXEL_TOLERANCE)


def test_the_worlds_rotation_and_strength(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, physics: ModuleType, reference: ModuleType
) -> None:
    nodes = world_sky(scene, environment_image())
    nodes["mapping"].inputs["Rotation"].default_value = (0.4, -0.3, 1.2)
    strength = nodes["background"].inputs["Strength"]
    for frame, value in ((1, 0.5), (3, 1.5)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    add_hole(scene, sky=False)
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / "frame_####")
    bpy.ops.render.render(animation=True)
    for frame, value in ((1, 0.5), (3, 1.5)):
        warp_map = physics.read_warp_map(find_map(tmp_path / "maps", f"Scene_Black_Hole_64x36_{frame:04d}.exr"))
        expected = reference.render_reference(warp_map, environment_pixels(), rotation=(0.4, -0.3, 1.2), strength=value)
        picture = read(tmp_path / f"frame_{frame:04d}.exr", exr)
        np.testing.assert_allclose(picture[..., :3], expected.image[..., :3], atol=PIXEL_TOLERANCE)


def wide_lens(scene: bpy.types.Scene) -> None:
    data = scene.camera.data
    data.lens, data.shift_x, data.shift_y = 12.0, 0.2, -0.15
    scene.render.pixel_aspect_y = 1.4


def panorama(scene: bpy.types.Scene) -> None:
    data = scene.camera.data
    data.type = "PANO"
    owner = data if hasattr(data, "panorama_type") else data.cycles
    owner.panorama_type = "EQUIRECTANGULAR"
    owner.latitude_min, owner.latitude_max = -0.9, 1.3
    owner.longitude_min, owner.longitude_max = -2.0, 2.5


@pytest.mark.parametrize("change_camera", [wide_lens, panorama])
def test_a_far_away_hole_shows_the_world_as_cycles_does(
    scene: bpy.types.Scene,
    tmp_path: Path,
    exr: ModuleType,
    change_camera: Callable[[bpy.types.Scene], None],
) -> None:
    """Mass towards 0: what is left is the World itself, rotation, strength and camera included."""
    change_camera(scene)
    nodes = world_sky(scene, environment_image(environment_pixels(64)))
    nodes["mapping"].inputs["Rotation"].default_value = (0.4, -0.3, 1.2)
    nodes["background"].inputs["Strength"].default_value = 1.7
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene.cycles.filter_width = 0.01  # Cycles looks the World up at the pixel's center
    own = render(scene, tmp_path / "own.exr", exr)
    add_hole(scene, sky=False, mass_scale=1e-7)
    ours = render(scene, tmp_path / "ours.exr", exr)
    np.testing.assert_allclose(ours[..., :3], own[..., :3], atol=2e-3)


def test_a_baked_file_needs_no_addon(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    nodes = world_sky(scene, environment_image())
    strength = nodes["background"].inputs["Strength"]
    for frame, value in ((1, 0.5), (2, 1.5)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    add_hole(scene, sky=False)
    scene.umbra.map_folder = "//umbra_maps/"
    scene.frame_start, scene.frame_end = 1, 2
    blend = tmp_path / "file.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    scene.render.filepath = str(tmp_path / "with_####")
    bpy.ops.render.render(animation=True)
    bpy.ops.wm.save_mainfile()
    moved = tmp_path / "moved"
    moved.mkdir()
    shutil.move(blend, moved / "file.blend")
    shutil.move(tmp_path / "umbra_maps", moved / "umbra_maps")
    result = run_python(
        f"bpy.ops.wm.open_mainfile(filepath={str(moved / 'file.blend')!r})\n"
        "assert not hasattr(bpy.types.Scene, 'umbra')\n"
        f"bpy.context.scene.render.filepath = {str(tmp_path / 'without_####')!r}\n"
        "bpy.ops.render.render(animation=True)\n",
        resources=tmp_path / "empty",
    )
    assert result.returncode == 0, result.stderr
    for frame in (1, 2):
        ours = read(tmp_path / f"with_{frame:04d}.exr", exr)
        theirs = read(tmp_path / f"without_{frame:04d}.exr", exr)
        np.testing.assert_array_equal(theirs, ours)


def test_saving_and_loading(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene, motion="STATIC")
    scene.umbra.map_folder = "//umbra_maps/"
    picture = render(scene, tmp_path / "before.exr", exr)
    temporary = Path(bpy.path.abspath(addon_module("bake.folder").folder(scene).blender_path))
    assert addon_module("bake.folder").folder(scene).is_temporary
    assert len(list(temporary.glob("*.exr"))) >= 1
    blend = tmp_path / "saved" / "file.blend"
    blend.parent.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    # the maps that were baked before saving come along
    adopted = find_map(blend.parent / "umbra_maps", "Scene_Black_Hole_64x36_0001.exr")
    assert adopted.is_file()
    stamp = adopted.stat().st_mtime_ns

    # a file from an older version of the add-on: the group's version is stamped on it
    addon_module("outputs.shared.compositor_tree").find_setup(scene).group.node_tree["umbra_version"] = 0
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    assert scene.umbra.active_hole.umbra.motion == "STATIC"
    setup = addon_module("outputs.shared.compositor_tree").find_setup(scene)
    assert setup.group.node_tree["umbra_version"] == addon_module("nodes.black_hole_group").GROUP_VERSION
    assert setup.map.image.filepath == f"//umbra_maps/{adopted.name}"
    np.testing.assert_array_equal(render(scene, tmp_path / "after.exr", exr), picture)
    assert adopted.stat().st_mtime_ns == stamp
    assert scene.render.compositor_precision == "FULL"


def test_the_compositor_device_is_set_back(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    if not hasattr(scene.render, "compositor_device"):
        pytest.skip("this Blender has no compositor device")
    add_hole(scene)
    scene.render.compositor_device = "GPU"  # without OpenGL Blender would end the process
    render(scene, tmp_path / "picture.exr", exr)
    assert scene.render.compositor_device == "GPU"


def test_a_muted_group_needs_no_map(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, addon_module) -> None:
    add_hole(scene)
    addon_module("outputs.shared.compositor_tree").find_setup(scene).group.mute = True
    render(scene, tmp_path / "picture.exr", exr)
    assert not map_files(tmp_path)


def test_a_scene_without_a_hole_is_none_of_our_business(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType
) -> None:
    assert render(scene, tmp_path / "picture.exr", exr).shape == (36, 64, 4)
    assert not (tmp_path / "maps").exists()


def test_the_source_has_no_machine_paths() -> None:
    for path in sorted((ROOT / "blender_addon").glob("*.py")):
        assert "sys.path" not in path.read_text(encoding="utf-8"), path
