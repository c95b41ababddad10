# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in rendered pictures: each pixel is what numpy's reference says, at any frame, size and look.

The group works in float32, and takes the flux from a table; LIGHT is the share of the disk's light by which it may
differ. Streaks are the steepest part: a texture coordinate is off by 1e-6 of a turn, which is 1/500 texel, of which
neighbors differ by up to a tenth.
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, environment_pixels, render, run_python, shrink

from physics.reference import reference_render

LIGHT = 2e-3
TYPICAL = 2e-5


@pytest.fixture
def modules(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api")


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene with maps of its own."""
    scene = bpy.context.scene
    shrink(scene, (96, 54))
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


def hole_with_disk(scene: bpy.types.Scene, **settings: object) -> bpy.types.Object:
    hole = add_hole(scene)
    hole.umbra.disk.enabled = True
    for name, value in settings.items():
        setattr(hole.umbra.disk, name, value)
    return hole


def expected_picture(
    scene: bpy.types.Scene,
    addon_module: Callable[[str], ModuleType],
    tmp_path: Path,
    size: tuple[int, int],
    texture: np.ndarray | None = None,
    frame: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The picture by numpy in float64, and the light of the disk in it."""
    modules = addon_module("core.physics_api")
    settings = scene.umbra.active_hole.umbra.disk
    frame = scene.frame_current if frame is None else frame
    (wanted,) = addon_module("outputs.frames").requests_at(scene, frame)
    path = wanted.path
    physics = modules.physics
    passes = [physics.read_disk_pass(each) for each in wanted.passes]
    look = addon_module("settings.disk_properties").look_of(settings)
    texture = addon_module("nodes.disk_images").streaks() if texture is None else texture
    time = frame * settings.turning_speed * scene.render.fps_base / scene.render.fps
    period = addon_module("scene.disk_animation").pattern_period(scene, scene.umbra.active_hole)
    light, through = modules.physics.disk_layers(passes, look, texture, time, period)
    sky = modules.physics.render_reference(physics.read_warp_map(path), environment_pixels(), output_size=size).image
    picture = modules.physics.disk_over_sky(sky, light, through)
    return picture, reference_render.resize(light, size)


def assert_same(picture: np.ndarray, expected: np.ndarray, light: np.ndarray) -> None:
    wrong = np.abs(picture[..., :3] - expected[..., :3])
    brightest = light.max()
    assert brightest > 0.1
    assert (light.max(axis=-1) > 0.01 * brightest).mean() > 0.02, "there should be a disk in the picture"
    assert wrong.max() < LIGHT * max(brightest, 1.0)
    assert np.median(wrong) < TYPICAL * max(brightest, 1.0)


@pytest.mark.parametrize("percentage", [100, 50])
def test_default_disk_is_what_numpy_makes(
    scene: bpy.types.Scene,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    modules: ModuleType,
    percentage: int,
) -> None:
    hole_with_disk(scene)
    scene.render.resolution_percentage = percentage
    scene.frame_set(7)
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    size = (96 * percentage // 100, 54 * percentage // 100)
    expected, light = expected_picture(scene, addon_module, tmp_path, size)
    assert picture.shape[:2] == size[::-1]
    assert_same(picture, expected, light)


@pytest.mark.parametrize("preset", ["GARGANTUA", "PHYSICAL", "BLUE_HOT", "EMBER"])
def test_every_preset_is_what_numpy_makes(
    scene: bpy.types.Scene,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    modules: ModuleType,
    preset: str,
) -> None:
    hole = hole_with_disk(scene, retrograde=preset == "EMBER")
    assert bpy.ops.umbra.disk_preset(preset=preset) == {"FINISHED"}
    name = preset.lower().replace("_", " ")
    for field, value in vars(modules.physics.DISK_PRESETS[name]).items():
        found = getattr(addon_module("settings.disk_properties").look_of(hole.umbra.disk), field)
        assert found == (value if isinstance(value, str) else pytest.approx(value, rel=1e-6)), field
    scene.frame_set(40)
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54))
    assert_same(picture, expected, light)


def test_one_color_inside_the_innermost_orbit_with_two_images(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType
) -> None:
    hole_with_disk(
        scene,
        profile="power_law",
        exponent=2.5,
        inner_at_isco=False,
        inner_radius=1.8,
        outer_radius=9.0,
        beaming="MONOCHROMATIC",
        doppler_color=0.3,
        doppler_brightness=0.6,
        crossings=2,
    )
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    assert len(list((tmp_path / "maps").glob("*_disk*.exr"))) == 2
    expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54))
    assert_same(picture, expected, light)


def test_supersampled_passes_are_box_filtered(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType
) -> None:
    hole_with_disk(scene)
    scene.umbra.supersampling = "2"
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54))
    assert_same(picture, expected, light)


@pytest.mark.parametrize("frame", [1, 10_000, -400])
def test_turning_keeps_its_contrast_over_a_long_shot(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType, frame: int
) -> None:
    """Equal to numpy at any frame, where contrast is known to be kept; and sheared no more than at the beginning."""
    hole_with_disk(scene)
    scene.frame_start, scene.frame_end = -1000, 20_000
    scene.frame_set(frame)
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54))
    assert_same(picture, expected, light)
    bright = light.max(axis=-1) > 0.05 * light.max()
    steps = np.abs(np.diff(np.log(light.max(axis=-1) + 1e-9), axis=1))[bright[:, 1:] & bright[:, :-1]]
    assert 0.05 < steps.mean() < 1.0


def test_pictures_of_any_image_without_a_seam(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType
) -> None:
    """A smooth picture that repeats across: brightness may not jump where the azimuth goes from 2 pi to 0."""
    height, width = 16, 64
    row, column = np.mgrid[0:height, 0:width]
    wave = 0.5 + 0.4 * np.cos(2.0 * math.pi * (column + 0.5) / width) * np.cos(0.3 * row)
    values = np.stack([wave, wave[:, ::-1] ** 2], axis=-1).astype(np.float32)
    full = np.ones((height, width, 4), np.float32)
    full[..., :2] = values
    image = bpy.data.images.new("Stripes", width, height, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(full[::-1].ravel())
    image.pack()
    hole = hole_with_disk(scene, texture=image, turning_speed=0.0)
    hole.rotation_euler = (0.2, 0.0, 2.0)
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54), values.astype(np.float64))
    assert_same(picture, expected, light)

    (path,) = (tmp_path / "maps").glob("*_disk1_0001.exr")
    one = modules.physics.read_disk_pass(path)
    across = np.abs(np.diff(one.phi, axis=1)) > math.pi
    across &= np.minimum(one.coverage[:, 1:], one.coverage[:, :-1]) > 0.99
    assert across.sum() > 5, "the seam should be in the picture"
    jump = np.abs(np.diff(picture[..., 0], axis=1))
    inside = np.minimum(one.coverage[:, 1:], one.coverage[:, :-1]) > 0.99
    assert jump[across].mean() < 3.0 * jump[inside].mean()


def test_animated_look_is_that_of_each_frame(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType
) -> None:
    hole = hole_with_disk(scene, profile="novikov_thorne")
    for frame, temperature, streaks in ((1, 3000.0, 0.2), (3, 9000.0, 0.9)):
        hole.umbra.disk.temperature, hole.umbra.disk.streaks = temperature, streaks
        hole.keyframe_insert("umbra.disk.temperature", frame=frame)
        hole.keyframe_insert("umbra.disk.streaks", frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / "frame_####.exr")
    bpy.ops.render.render(animation=True)
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54))
        picture, _ = modules.physics.read_exr(tmp_path / f"frame_{frame:04d}.exr")
        assert_same(picture, expected, light)


KEYFRAMES = {
    "spin, retrograde, Page-Thorne": {"umbra.spin": (0.0, 0.99)},
    "edges": {"umbra.disk.inner_radius": (3.0, 6.0), "umbra.disk.outer_radius": (9.0, 20.0)},
    "amounts": {
        "umbra.disk.doppler_brightness": (0.0, 1.0),
        "umbra.disk.doppler_color": (0.0, 1.0),
        "umbra.disk.opacity": (0.3, 1.0),
        "umbra.disk.exponent": (0.5, 3.0),
        "umbra.disk.exposure": (0.0, 3.0),
    },
}


@pytest.mark.parametrize("what", KEYFRAMES)
def test_keyframes_are_followed_frame_by_frame(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType, what: str
) -> None:
    hole = hole_with_disk(scene, inner_at_isco=what != "edges", turning_speed=200.0)
    if "retrograde" in what:
        hole.umbra.disk.retrograde, hole.umbra.disk.profile = True, "novikov_thorne"
    scene.frame_start, scene.frame_end = 1, 3
    for path, values in KEYFRAMES[what].items():
        owner, _, name = path.rpartition(".")
        for frame, value in zip((1, 3), values, strict=True):
            setattr(hole.path_resolve(owner), name, value)
            hole.keyframe_insert(path, frame=frame)
    scene.render.filepath = str(tmp_path / "frame_####.exr")
    bpy.ops.render.render(animation=True)
    pictures = []
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54))
        pictures.append(modules.physics.read_exr(tmp_path / f"frame_{frame:04d}.exr")[0])
        assert_same(pictures[-1], expected, light)
    assert np.abs(pictures[0] - pictures[1]).max() > 10.0 * LIGHT


def test_one_period_holds_for_all_frames(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType], modules: ModuleType
) -> None:
    """The shortest of all frames: with it no frame's pattern is sheared further than it should be."""
    hole = hole_with_disk(scene)
    scene.frame_start, scene.frame_end = 1, 5
    for frame, spin in ((1, 0.2), (5, 0.9)):
        hole.umbra.spin = spin
        hole.keyframe_insert("umbra.spin", frame=frame)
    period_of = addon_module("scene.disk_animation").pattern_period
    disk = addon_module("settings.disk_properties").disk_of(hole.umbra.disk)
    for frame in (1, 4):
        scene.frame_set(frame)
        spins = [addon_module("scene.disk_animation").value_at(hole, "umbra.spin", each) for each in range(1, 6)]
        expected = min(modules.physics.disk_pattern_period(spin, *disk.radii(spin)) for spin in spins)
        assert period_of(scene, hole) == pytest.approx(expected)


@pytest.mark.parametrize("animated_by", ["strip", "driver"])
def test_a_spin_that_cannot_be_followed_is_refused(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType], animated_by: str
) -> None:
    hole = hole_with_disk(scene)
    if animated_by == "driver":
        hole.driver_add("umbra.spin").driver.expression = "0.2+frame*0.1"
    else:
        for frame, spin in ((1, 0.2), (3, 0.9)):
            hole.umbra.spin = spin
            hole.keyframe_insert("umbra.spin", frame=frame)
        animation = hole.animation_data
        animation.nla_tracks.new().strips.new("Spin", 1, animation.action)
        animation.action = None
    scene.frame_set(1)
    addon_module("outputs.refreshing").refresh_disk(scene)
    parameters = addon_module("scene.frame_setup").read_at(scene, 3).parameters
    with pytest.raises(addon_module("core.errors").SceneError, match=r"driver|cannot follow"):
        addon_module("outputs.shared.disk_sync").check_shot(scene, parameters)


@pytest.mark.parametrize("images", [1, 8])
def test_as_many_images_as_are_asked_for(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType, images: int
) -> None:
    hole = hole_with_disk(scene)
    hole.umbra.disk.crossings = images
    hole.umbra.disk.opacity = 0.3
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    assert len(list((tmp_path / "maps").glob("*_disk*.exr"))) == images
    expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54))
    assert_same(picture, expected, light)
    groups = [each.name for each in bpy.data.node_groups if each.name.startswith("Umbra Disk")]
    assert groups == [f"Umbra Disk {images}", "Umbra Disk Image"]


@pytest.mark.parametrize("kind", ["float", "bytes", "opaque"])
def test_a_picture_gives_the_disk_its_colors(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType, kind: str
) -> None:
    """A picture with alpha of eighths, which bytes and floats hold alike, in all looks that change with the motion."""
    height, width = 16, 64
    row, column = np.mgrid[0:height, 0:width]
    angle = 2.0 * math.pi * (column + 0.5) / width
    color = np.stack([0.5 + 0.4 * np.cos(angle), 0.4 + 0.3 * np.sin(2.0 * angle), 0.1 + 0.05 * row], axis=-1)
    alpha = np.ones((height, width)) if kind == "opaque" else 0.5 + 0.25 * np.round(2.0 * np.cos(3.0 * angle)) * 0.5
    image = bpy.data.images.new("Picture", width, height, float_buffer=kind != "bytes", alpha=kind != "opaque")
    if kind == "bytes":
        encoded = np.round(color * 255.0) / 255.0
        color = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
        alpha = np.round(alpha * 255.0) / 255.0
        pixels = np.concatenate([encoded, alpha[..., None]], axis=-1)
    else:
        image.colorspace_settings.name, image.alpha_mode = "Linear Rec.709", "PREMUL"
        pixels = np.concatenate([color * alpha[..., None], alpha[..., None]], axis=-1)
    image.pixels.foreach_set(pixels[::-1].astype(np.float32).ravel())
    image.pack()
    hole = hole_with_disk(scene, texture=image, texture_use="COLOR")
    if kind != "opaque":
        for name, value in {"doppler_color": 0.8, "doppler_brightness": 1.0, "profile": "novikov_thorne"}.items():
            setattr(hole.umbra.disk, name, value)
    scene.frame_set(30)
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    premultiplied = np.concatenate([color * alpha[..., None], alpha[..., None]], axis=-1)
    expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54), premultiplied)
    assert_same(picture, expected, light)
    rows = addon_module("nodes.disk_images").mean_of_rows(image)
    np.testing.assert_allclose(rows, premultiplied.mean(axis=1), atol=2e-3)
    hole.umbra.disk.texture_use = "DENSITY"
    groups = [each.name for each in bpy.data.node_groups if each.name.startswith("Umbra Disk")]
    assert groups == ["Umbra Disk 3", "Umbra Disk Image"]


def test_objects_stand_in_front_of_the_disk(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], modules: ModuleType
) -> None:
    hole_with_disk(scene)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=scene.camera.location * 0.5)
    picture = render(scene, tmp_path / "picture.exr", modules.physics)
    expected, light = expected_picture(scene, addon_module, tmp_path, (96, 54))
    tree = addon_module("outputs.shared.compositor_tree").find_setup(scene)
    (link,) = tree.group.inputs["Render"].links
    layer = link.from_socket
    for each in list(tree.group.outputs["Image"].links):
        tree.tree.links.new(layer, each.to_socket)
    foreground = render(scene, tmp_path / "foreground.exr", modules.physics)
    covered = foreground[..., 3] == 1.0
    assert (covered & (light.max(axis=-1) > 0.1)).sum() > 20, "the cube should hide a part of the disk"
    np.testing.assert_allclose(picture[covered][:, :3], foreground[covered][:, :3], atol=1e-6)
    clear = foreground[..., 3] == 0.0
    assert np.abs(picture - expected)[clear][:, :3].max() < LIGHT * max(light.max(), 1.0)


def test_saved_file_renders_the_same_without_the_add_on(
    scene: bpy.types.Scene, tmp_path: Path, modules: ModuleType
) -> None:
    hole_with_disk(scene)
    scene.frame_start, scene.frame_end = 5, 6
    blend = tmp_path / "saved.blend"
    scene.umbra.map_folder = "//maps/"
    scene.render.filepath = str(tmp_path / "here_####.exr")
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    bpy.ops.render.render(animation=True)
    there = tmp_path / "there_####.exr"
    code = (
        f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r})\n"
        f"bpy.context.scene.render.filepath = {str(there)!r}\n"
        "bpy.ops.render.render(animation=True)\n"
    )
    done = run_python(code, resources=tmp_path / "plain")
    assert done.returncode == 0, done.stdout + done.stderr
    for frame in (5, 6):
        here, _ = modules.physics.read_exr(tmp_path / f"here_{frame:04d}.exr")
        plain, _ = modules.physics.read_exr(tmp_path / f"there_{frame:04d}.exr")
        np.testing.assert_allclose(plain, here, atol=1e-6)


def test_headless_render_bakes_and_draws_the_disk(scene: bpy.types.Scene, tmp_path: Path, modules: ModuleType) -> None:
    hole_with_disk(scene)
    blend = tmp_path / "saved.blend"
    scene.umbra.map_folder = "//maps/"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    picture = tmp_path / "picture.exr"
    done = run_python(
        f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r})\n"
        f"bpy.context.scene.render.filepath = {str(picture)!r}\n"
        "bpy.ops.render.render(write_still=True)\n"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(list((tmp_path / "maps").glob("*.exr"))) == 4
    pixels, _ = modules.physics.read_exr(picture)
    assert pixels[..., :3].max() > 1.0, "the disk is brighter than the sky"
