# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in rendered pictures: each pixel is the layer of light over the bent sky, at any frame, size and look.

The layer itself is checked in tests/physics/matter. Here it is read from the file that the render has baked, and must
be that of the settings at the frame. The group works in float32: LIGHT is the share of the brightest light by which a
pixel may differ.
"""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, environment_pixels, render, run_python, shrink

LIGHT = 1e-4
SIZE = (96, 54)


@pytest.fixture
def physics(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api").physics


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene with maps of its own."""
    scene = bpy.context.scene
    shrink(scene, SIZE)
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


def hole_with_disk(scene: bpy.types.Scene, **settings: object) -> bpy.types.Object:
    hole = add_hole(scene)
    hole.umbra.disk.enabled = True
    for name, value in settings.items():
        setattr(hole.umbra.disk, name, value)
    return hole


def layer_of(scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]) -> object:
    """The layer of the scene's frame from its file, which says that it was made from the settings of the frame."""
    physics = addon_module("core.physics_api").physics
    _, wanted = addon_module("outputs.frames").requests_at(scene, scene.frame_current)
    layer = physics.read_light_layer(wanted.path)
    settings = scene.umbra.active_hole.umbra.disk
    time = scene.frame_current * settings.turning_speed * scene.render.fps_base / scene.render.fps
    assert layer.metadata["time"] == pytest.approx(time)
    for name, value in layer.metadata["look"].items():
        row, found = physics.MATTER_SETTINGS[name], getattr(settings, name)
        if name == "exposure":
            assert value == 0.0, "the compositor's"
        elif row.choices:
            assert found == row.identifier(value)
        else:
            assert found == pytest.approx(value, rel=1e-6), name
    return layer


def expected_picture(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType], size: tuple[int, int] = SIZE
) -> np.ndarray:
    """The picture by numpy in float64: the layer over the bent sky, with the live controls as they are now."""
    physics = addon_module("core.physics_api").physics
    layer, settings = layer_of(scene, addon_module), scene.umbra.active_hole.umbra.disk
    warp_map, _ = addon_module("outputs.frames").requests_at(scene, scene.frame_current)
    sky = physics.render_reference(physics.read_warp_map(warp_map.path), environment_pixels(), output_size=size).image
    light = layer.light.astype(np.float64) * (np.array(settings.tint) * 2.0**settings.exposure * settings.opacity)
    hides = (1.0 - layer.transmittance.astype(np.float64)) * settings.opacity
    picture = sky.copy()
    picture[..., :3] = light + (1.0 - hides)[..., None] * sky[..., :3]
    return picture


def assert_same(picture: np.ndarray, expected: np.ndarray) -> None:
    brightest = max(expected[..., :3].max(), 1.0)
    np.testing.assert_allclose(picture[..., :3], expected[..., :3], atol=LIGHT * brightest)


@pytest.mark.parametrize(
    ("percentage", "samples", "settings"),
    [
        (100, "1", {}),
        (50, "1", {"crossings": 1, "retrograde": True}),
        (100, "2", {"exposure": 1.0, "opacity": 0.6, "tint": (0.5, 1.0, 0.25)}),
        (100, "1", {"thickness": 0.1, "inner_at_isco": False, "inner_radius": 3.0, "outer_radius": 9.0}),
    ],
)
def test_the_layer_is_over_the_bent_sky(
    scene: bpy.types.Scene,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    physics: ModuleType,
    percentage: int,
    samples: str,
    settings: dict[str, object],
) -> None:
    hole_with_disk(scene, **settings)
    scene.render.resolution_percentage, scene.umbra.supersampling = percentage, samples
    scene.frame_set(7)
    picture = render(scene, tmp_path / "picture.exr", physics)
    size = (SIZE[0] * percentage // 100, SIZE[1] * percentage // 100)
    assert picture.shape[:2] == size[::-1]
    expected = expected_picture(scene, addon_module, size)
    assert_same(picture, expected)
    layer = layer_of(scene, addon_module)
    assert (layer.transmittance < 0.7).mean() > 0.02, "there should be a disk in the picture"
    assert not list((tmp_path / "maps").glob("*_disk1_*.exr")), "passes are made only if they are asked for"


def test_presets_are_those_of_the_table(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType], physics: ModuleType
) -> None:
    hole = hole_with_disk(scene)
    properties = addon_module("settings.disk_properties")
    for name, look in physics.MATTER_PRESETS.items():
        assert bpy.ops.umbra.disk_preset(preset=name.upper().replace(" ", "_")) == {"FINISHED"}
        found = vars(properties.look_of(hole.umbra.disk)) | {"exposure": hole.umbra.disk.exposure}
        for field, value in vars(look).items():
            assert found[field] == (value if isinstance(value, str) else pytest.approx(value, rel=1e-6)), (name, field)


def keyframes(hole: bpy.types.Object, values: dict[str, tuple[float, float]]) -> None:
    for path, pair in values.items():
        owner, _, name = path.rpartition(".")
        for frame, value in zip((1, 3), pair, strict=True):
            setattr(hole.path_resolve(owner) if owner else hole, name, value)
            hole.keyframe_insert(path, frame=frame)


def drivers(hole: bpy.types.Object, values: dict[str, tuple[float, float]]) -> None:
    for path, (first, last) in values.items():
        hole.driver_add(path).driver.expression = f"{first}+(frame-1)*{0.5 * (last - first)}"


def strips(hole: bpy.types.Object, values: dict[str, tuple[float, float]]) -> None:
    keyframes(hole, values)
    animation = hole.animation_data
    animation.nla_tracks.new().strips.new("Strip", 1, animation.action)
    animation.action = None


ANIMATED = {
    "umbra.spin": (0.0, 0.99),
    "umbra.disk.outer_radius": (9.0, 20.0),
    "umbra.disk.temperature": (3000.0, 9000.0),
    "umbra.disk.smoke": (0.2, 0.9),
    "umbra.disk.exposure": (-1.0, 1.0),
    "umbra.disk.opacity": (0.3, 1.0),
}


@pytest.mark.parametrize("animate", [keyframes, drivers, strips])
def test_whatever_moves_a_setting_is_followed_frame_by_frame(
    scene: bpy.types.Scene,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    physics: ModuleType,
    animate: Callable[[bpy.types.Object, dict[str, tuple[float, float]]], None],
) -> None:
    hole = hole_with_disk(scene, turning_speed=200.0)
    animate(hole, ANIMATED)
    addon_module("outputs.refreshing").refresh_disk(scene)
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / "frame_####.exr")
    bpy.ops.render.render(animation=True)
    pictures = []
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        pictures.append(physics.read_exr(tmp_path / f"frame_{frame:04d}.exr")[0])
        assert_same(pictures[-1], expected_picture(scene, addon_module))
    assert np.abs(pictures[0] - pictures[1]).max() > 100.0 * LIGHT


@pytest.mark.parametrize("kind", ["float", "bytes"])
def test_an_artists_picture_is_on_the_disk(
    scene: bpy.types.Scene,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    physics: ModuleType,
    kind: str,
) -> None:
    """Of one color, all of it dense: so is the disk, where its light is even."""
    image = bpy.data.images.new("Picture", 8, 4, float_buffer=kind == "float", alpha=True)
    if kind == "float":
        image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(np.tile(np.float32([0.25, 0.5, 0.75, 1.0]), 32))
    image.pack()
    even = {"falloff": 0.0, "doppler_brightness": 0.0, "doppler_color": 0.0, "band": "BOLOMETRIC", "depth": 1e4}
    hole_with_disk(scene, texture=image, texture_use="COLOR", limb_darkening=0.0, **even)
    render(scene, tmp_path / "picture.exr", physics)
    layer = layer_of(scene, addon_module)
    color = np.array([0.25, 0.5, 0.75])
    if kind == "bytes":
        encoded = np.round(color * 255.0) / 255.0
        color = ((encoded + 0.055) / 1.055) ** 2.4
    opaque = layer.transmittance < 1e-4
    assert opaque.sum() > 50
    np.testing.assert_allclose(layer.light[opaque], np.tile(color, (opaque.sum(), 1)), rtol=2e-3)


def test_objects_stand_in_front_of_the_disk(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], physics: ModuleType
) -> None:
    hole_with_disk(scene)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=scene.camera.location * 0.5)
    picture = render(scene, tmp_path / "picture.exr", physics)
    expected = expected_picture(scene, addon_module)
    scene.render.use_compositing = False
    foreground = render(scene, tmp_path / "foreground.exr", physics)
    scene.render.use_compositing = True
    covered = foreground[..., 3] == 1.0
    assert (covered & (layer_of(scene, addon_module).transmittance < 0.7)).sum() > 20, "the cube hides some of the disk"
    np.testing.assert_allclose(picture[covered][:, :3], foreground[covered][:, :3], atol=1e-6)
    clear = foreground[..., 3] == 0.0
    assert_same(picture[clear], expected[clear])


def test_saved_file_renders_the_same_without_the_add_on(
    scene: bpy.types.Scene, tmp_path: Path, physics: ModuleType
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
        "import pathlib\n"
        f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r})\n"
        f"bpy.context.scene.render.filepath = {str(there)!r}\n"
        "bpy.ops.render.render(animation=True)\n"
        f"for each in pathlib.Path({str(tmp_path / 'maps')!r}).glob('*_light_*.exr'): each.unlink()\n"
        f"bpy.context.scene.render.filepath = {str(tmp_path / 'missing.exr')!r}\n"
        "bpy.context.scene.frame_set(6)\n"
        "for each in bpy.data.images: each.reload()\n"
        "bpy.ops.render.render(write_still=True)\n"
    )
    done = run_python(code, resources=tmp_path / "plain")
    assert done.returncode == 0, done.stdout + done.stderr
    for frame in (5, 6):
        here, _ = physics.read_exr(tmp_path / f"here_{frame:04d}.exr")
        plain, _ = physics.read_exr(tmp_path / f"there_{frame:04d}.exr")
        np.testing.assert_allclose(plain, here, atol=1e-6)
    # Where nothing checks, a layer that is missing is seen to be.
    missing, _ = physics.read_exr(tmp_path / "missing.exr")
    np.testing.assert_allclose(missing[..., :3], np.broadcast_to((1.0, 0.0, 1.0), missing[..., :3].shape), atol=1e-6)


def test_headless_render_bakes_and_draws_the_disk(scene: bpy.types.Scene, tmp_path: Path, physics: ModuleType) -> None:
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
    assert len(list((tmp_path / "maps").glob("*.exr"))) == 2
    pixels, _ = physics.read_exr(picture)
    (path,) = (tmp_path / "maps").glob("*_light_0001.exr")
    lit = physics.read_light_layer(path).light.max(axis=-1) > 0.3
    assert pixels[lit][:, :3].max() > 0.3
