# SPDX-License-Identifier: GPL-3.0-or-later
"""The built-in sky: a file beside the maps, found wherever those are found."""

import math
import shutil
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from mathutils import Vector
from small_scene import add_hole, environment_image, read, render, run_python, shrink

MAPS = "//umbra_maps/"
HEIGHT = 256  # the picture itself has tests of its own


@pytest.fixture
def star_sky(addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    module = addon_module("bake.star_sky")
    monkeypatch.setattr(module, "HEIGHT", HEIGHT)
    monkeypatch.setattr(module, "FILE", f"umbra_stars_{HEIGHT}.exr")
    monkeypatch.setattr(module, "MILKY_WAY_HEIGHT", HEIGHT)
    monkeypatch.setattr(module, "MILKY_WAY_FILE", f"umbra_milky_way_{HEIGHT}.exr")
    return module


@pytest.fixture
def scene(star_sky: ModuleType) -> bpy.types.Scene:
    """A new file with a hole in front of the built-in sky, which is filtered."""
    scene = bpy.context.scene
    shrink(scene)
    scene.umbra.map_folder = MAPS
    scene.umbra.sky_filter = "FAST"
    add_hole(scene, sky=False)
    return scene


def save(path: Path, **options: bool) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), **options)
    return path


def opened(path: Path) -> bpy.types.Scene:
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def sky_of(scene: bpy.types.Scene) -> bpy.types.Image:
    image = scene.umbra.environment_image
    assert image.packed_file is None
    return image


def place_of(scene: bpy.types.Scene) -> Path:
    image = sky_of(scene)
    return Path(bpy.path.abspath(image.filepath, library=image.library)).resolve()


def test_the_file_names_the_sky_and_does_not_carry_it(
    scene: bpy.types.Scene, star_sky: ModuleType, tmp_path: Path
) -> None:
    """Before it is saved the sky is in a temporary folder, and then beside the maps of whatever it is saved as."""
    unsaved = place_of(scene)
    assert unsaved.is_file()
    blend = save(tmp_path / "one" / "shot.blend")
    assert sky_of(scene).filepath == MAPS + star_sky.FILE
    assert place_of(scene) == tmp_path / "one" / "umbra_maps" / star_sky.FILE
    assert place_of(scene).read_bytes() == unsaved.read_bytes()
    content = place_of(scene).read_bytes()
    assert content[len(content) // 2 :][:64] not in blend.read_bytes()
    save(tmp_path / "two" / "copy.blend", copy=True)
    assert place_of(scene) == tmp_path / "one" / "umbra_maps" / star_sky.FILE
    save(tmp_path / "three" / "as.blend")
    for name in ("two/copy.blend", "three/as.blend", "one/shot.blend"):
        again = opened(tmp_path / name)
        assert sky_of(again).filepath == MAPS + star_sky.FILE, name
        assert place_of(again).is_file(), name
    again.umbra.map_folder = "//elsewhere/"
    assert sky_of(again).filepath == "//elsewhere/" + star_sky.FILE
    assert place_of(again).is_file()


def test_moved_appended_linked_and_on_a_farm_it_is_found(
    scene: bpy.types.Scene, star_sky: ModuleType, tmp_path: Path, exr: ModuleType
) -> None:
    save(tmp_path / "first" / "shot.blend")
    scene.name = "Shot"
    save(tmp_path / "first" / "shot.blend")
    picture = render(scene, tmp_path / "picture.exr", exr)
    assert picture[..., :3].max() > 0.1
    assert not (picture[..., :3] == (1.0, 0.0, 1.0)).all(axis=-1).any()
    bpy.ops.wm.save_mainfile()
    shutil.move(tmp_path / "first", tmp_path / "moved")
    blend = tmp_path / "moved" / "shot.blend"
    # a Blender without the add-on, from the maps that are baked
    code = (
        f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r})\n"
        "assert not hasattr(bpy.types.Scene, 'umbra')\n"
        "if bpy.app.version >= (5, 0): bpy.context.scene.render.compositor_device = 'CPU'\n"
        f"bpy.context.scene.render.filepath = {str(tmp_path / 'farm.exr')!r}\n"
        "bpy.ops.render.render(write_still=True)\n"
    )
    run_python(code, resources=tmp_path / "empty").check_returncode()
    np.testing.assert_array_equal(read(tmp_path / "farm.exr", exr), picture)
    np.testing.assert_array_equal(render(opened(blend), tmp_path / "moved.exr", exr), picture)
    for how in ("append", "link"):
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        other = bpy.context.scene
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / f"{how}.blend"))
        getattr(bpy.ops.wm, how)(directory=f"{blend}/Scene/", filename="Shot")
        brought = next(each for each in bpy.data.scenes if each != other)
        bpy.context.window.scene = brought
        np.testing.assert_array_equal(render(brought, tmp_path / f"{how}.exr", exr), picture)
        assert place_of(brought).is_file()


def test_a_missing_sky_is_made_again_or_refused(
    scene: bpy.types.Scene,
    star_sky: ModuleType,
    tmp_path: Path,
    exr: ModuleType,
    addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    blend = save(tmp_path / "shot.blend")
    picture = render(scene, tmp_path / "picture.exr", exr)
    bpy.ops.wm.save_mainfile()
    for path in (tmp_path / "umbra_maps").glob("umbra_s*.exr"):  # the sky and its levels
        path.unlink()
    scene = opened(blend)
    assert not place_of(scene).exists()  # opening a file writes nothing
    said = addon_module("outputs.registry").of(scene).sky_problem(scene)
    assert said is not None
    assert f"The built-in sky is missing ({place_of(scene)})" in said
    assert "sky.stars-missing" in said
    ended: list[str] = []
    monkeypatch.setattr(addon_module("core.messages"), "end_process", ended.append)
    scene.umbra.auto_bake = False
    render(scene, tmp_path / "refused.exr", exr)
    assert "sky.stars-missing" in ended[0]
    assert not place_of(scene).exists()
    ended.clear()
    scene.umbra.auto_bake = True
    np.testing.assert_array_equal(render(scene, tmp_path / "again.exr", exr), picture)
    assert not ended
    assert place_of(scene).is_file()


def test_a_folder_that_cannot_be_written_to_is_refused(
    star_sky: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is changed then. Without a folder of the extension's own, the sky is made where it belongs."""
    scene = bpy.context.scene
    (tmp_path / "file").touch()
    scene.umbra.map_folder = str(tmp_path / "file" / "maps")
    with pytest.raises(RuntimeError, match=r"warp map folder .*file/maps cannot be written to.*folder\.not-writable"):
        add_hole(scene, sky=False)
    assert scene.umbra.environment_image is None
    assert scene.umbra.active_hole is None
    assert star_sky.STAR_SKY_NAME not in bpy.data.images
    monkeypatch.setattr(star_sky, "_kept", lambda _name: None)
    scene.umbra.map_folder = str(tmp_path / "maps")
    add_hole(scene, sky=False)
    assert place_of(scene) == tmp_path / "maps" / star_sky.FILE
    assert tuple(sky_of(scene).size) == (2 * HEIGHT, HEIGHT)


def test_space_is_black_and_stars_shine(star_sky: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What an artist's camera sees away from the Milky Way, with all settings as a new hole has them."""
    monkeypatch.setattr(star_sky, "HEIGHT", 1024)
    monkeypatch.setattr(star_sky, "FILE", "umbra_stars_1024.exr")
    scene = bpy.context.scene
    shrink(scene, (480, 270))
    scene.umbra.map_folder = str(tmp_path / "maps")
    for name in ("sky_filter", "glare", "stars"):
        scene.umbra.property_unset(name)
    hole = add_hole(scene, sky=False, mass_scale=1e-3, motion="STATIC")
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "8"
    scene.world.cycles.sampling_method = "NONE"

    def seen(ascension: float, declination: float, transform: str) -> np.ndarray:
        """The brightest of each pixel's three values, 0 to 255, in a view of 40 degrees."""
        ra, dec = math.radians(ascension), math.radians(declination)
        ahead = Vector((math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)))
        scene.camera.location = (0.0, 0.0, 0.0)
        scene.camera.rotation_euler = ahead.to_track_quat("-Z", "Y").to_euler()
        hole.location = ahead * -30.0  # behind the camera, and small
        scene.view_settings.view_transform = transform
        scene.render.filepath = str(tmp_path / "seen.png")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        values = np.empty((270 * 480, 4), np.float32)
        image.pixels.foreach_get(values.ravel())
        bpy.data.images.remove(image)
        return values[:, :3].max(axis=1) * 255.0

    for transform in ("AgX", "Standard"):
        away = seen(60.0, -20.0, transform)  # at 46 degrees of galactic latitude, by the pole at 192.86, 27.13
        assert np.median(away) <= 12.0, transform
        assert (away > 200.0).sum() >= 20, transform
    assert np.median(seen(266.4, -28.9, transform)) > 3.0 * np.median(away)  # the center of the Galaxy


def test_a_sky_that_is_packed_stays_packed(star_sky: ModuleType, tmp_path: Path) -> None:
    """As files of before have it."""
    image = environment_image(name=star_sky.STAR_SKY_NAME)
    content = bytes(image.packed_file.data)
    add_hole(bpy.context.scene, sky=False)
    scene = opened(save(tmp_path / "shot.blend"))
    assert bpy.ops.umbra.use_star_sky() == {"FINISHED"}
    assert bytes(scene.umbra.environment_image.packed_file.data) == content
    assert not list(tmp_path.rglob(star_sky.FILE))
