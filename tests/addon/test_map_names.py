# SPDX-License-Identifier: GPL-3.0-or-later
"""Two shots never share a file, and one shot never bakes twice what is there under another name."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, compositor, plain_name, read, render, run_python, shrink

RENDER_WITHOUT_ADDON = """
import os
bpy.ops.wm.open_mainfile(filepath={blend!r})
bpy.context.scene.render.filepath = {picture!r}
bpy.ops.render.render(write_still=True)
os._exit(0)
"""


def save(blend: Path, **options: object) -> None:
    blend.parent.mkdir(exist_ok=True)
    assert bpy.ops.wm.save_as_mainfile(filepath=str(blend), **options) == {"FINISHED"}


def maps(folder: Path) -> dict[str, int]:
    """The maps in a folder, and when they were written."""
    return {path.name: path.stat().st_mtime_ns for path in sorted(folder.glob("*.exr"))}


def without_addon(blend: Path, tmp_path: Path, exr: ModuleType) -> np.ndarray:
    picture = tmp_path / f"plain_{blend.stem}.exr"
    script = RENDER_WITHOUT_ADDON.format(blend=str(blend), picture=str(picture))
    run_python(script, resources=tmp_path / "resources").check_returncode()
    return read(picture, exr)


def map_path(scene: bpy.types.Scene) -> str:
    return next(node.image.filepath for node in compositor(scene).nodes if node.name == "Umbra Warp Map")


def test_names_that_look_alike_are_those_of_different_files(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    shot_name = addon_module("bake.names").shot_name
    seen = set()
    for scene_name, hole_name in (("A", "B C"), ("A B", "C"), ("Shot A", "H"), ("Shot_A", "H"), ("shot a", "H")):
        scene.name = scene_name
        seen.add(shot_name(scene, hole_name).casefold())
    assert len(seen) == 5


@pytest.mark.parametrize("name", ["x" * 63, "\u9ed1\u6d1e" * 10, "a/b\\c:d*e"])
def test_long_and_strange_names(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, addon_module: Callable[[str], ModuleType], name: str
) -> None:
    """A file of 200 characters, with a scene and a hole of as many as Blender allows."""
    hole = add_hole(scene)
    scene.name = hole.name = name
    scene.umbra.map_folder = "//maps/"
    save(tmp_path / f"{'s' * 200}.blend")
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    (path,) = (tmp_path / "maps").glob("*.exr")
    assert len(os.fsencode(path.name)) < 200
    assert render(scene, tmp_path / "picture.exr", exr)[..., :3].max() > 0.0
    assert maps(tmp_path / "maps") == {path.name: path.stat().st_mtime_ns}


def test_another_version_of_a_file(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    """It has the maps of the first from the beginning, and changes none of them."""
    hole = add_hole(scene, spin=0.1)
    scene.umbra.map_folder = "//maps/"
    first, second = tmp_path / "shot_v001.blend", tmp_path / "shot_v002.blend"
    save(first)
    own = render(scene, tmp_path / "own.exr", exr)
    baked = maps(tmp_path / "maps")
    save(first)
    save(second)
    assert maps(tmp_path / "maps").items() >= baked.items()
    assert len(maps(tmp_path / "maps")) == 2
    assert set(maps(tmp_path / "maps").values()) == set(baked.values())  # not baked again
    for blend in (first, second):
        np.testing.assert_allclose(without_addon(blend, tmp_path, exr), own, rtol=1e-4, atol=1e-4)
    scene.camera.location.x += 3.0
    hole.umbra.spin = 0.9
    save(second)
    other = render(scene, tmp_path / "other.exr", exr)
    assert np.abs(other - own).max() > 0.1
    bpy.ops.umbra.clean_maps(everything=True)
    assert maps(tmp_path / "maps").items() >= baked.items()
    np.testing.assert_allclose(without_addon(first, tmp_path, exr), own, rtol=1e-4, atol=1e-4)


def test_versions_reuse_maps_that_agree(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """Both versions are changed in the same way: the second one takes what the first has baked."""
    hole = add_hole(scene)
    hole.umbra.disk.enabled = True
    scene.umbra.map_folder = "//maps/"
    first, second = tmp_path / "shot_v001.blend", tmp_path / "shot_v002.blend"
    save(first)
    save(second)
    bpy.ops.wm.open_mainfile(filepath=str(first))
    bpy.context.scene.umbra.active_hole.umbra.spin = 0.7
    bpy.ops.umbra.bake_frame()
    written = set(maps(tmp_path / "maps").values())
    count = len(maps(tmp_path / "maps"))
    bpy.ops.wm.open_mainfile(filepath=str(second))
    bpy.context.scene.umbra.active_hole.umbra.spin = 0.7
    bpy.ops.umbra.bake_frame()
    assert set(maps(tmp_path / "maps").values()) == written
    assert len(maps(tmp_path / "maps")) == 2 * count > 2


def test_a_file_that_was_copied_by_hand(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    add_hole(scene)
    scene.umbra.map_folder = "//maps/"
    save(tmp_path / "one.blend")
    bpy.ops.umbra.bake_frame()
    save(tmp_path / "one.blend")
    before = maps(tmp_path / "maps")
    shutil.copy(tmp_path / "one.blend", tmp_path / "two.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "two.blend"))
    assert set(maps(tmp_path / "maps").values()) == set(before.values())
    bpy.context.scene.umbra.active_hole.umbra.spin = 0.3
    bpy.ops.umbra.bake_frame()
    after = maps(tmp_path / "maps")
    assert after.items() > before.items()
    assert len(set(after.values())) == 2


@pytest.mark.parametrize("what", ["scene", "hole"])
def test_renaming_loses_no_map(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, what: str) -> None:
    hole = add_hole(scene)
    scene.umbra.map_folder = "//maps/"
    save(tmp_path / "shot.blend")
    own = render(scene, tmp_path / "own.exr", exr)
    save(tmp_path / "shot.blend")
    (stamp,) = maps(tmp_path / "maps").values()
    (scene if what == "scene" else hole).name = "Renamed"
    render(scene, tmp_path / "again.exr", exr)
    assert set(maps(tmp_path / "maps").values()) == {stamp}
    save(tmp_path / "shot.blend")
    ((name, kept),) = maps(tmp_path / "maps").items()  # the old name is gone with the old file
    assert kept == stamp
    assert "Renamed" in name
    np.testing.assert_allclose(without_addon(tmp_path / "shot.blend", tmp_path, exr), own, rtol=1e-4, atol=1e-4)


def test_saving_into_another_directory(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    """The file refers to the folder beside itself, where its maps are too."""
    add_hole(scene)
    scene.umbra.map_folder = "//maps/"
    save(tmp_path / "here" / "shot.blend")
    own = render(scene, tmp_path / "own.exr", exr)
    here = maps(tmp_path / "here" / "maps")
    there = tmp_path / "there" / "shot.blend"
    save(there)
    assert map_path(scene).startswith("//maps/")
    assert maps(tmp_path / "there" / "maps") == here == maps(tmp_path / "here" / "maps")
    shutil.rmtree(tmp_path / "here")
    np.testing.assert_allclose(without_addon(there, tmp_path, exr), own, rtol=1e-4, atol=1e-4)


def test_saving_a_copy_leaves_the_open_file_as_it_is(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    add_hole(scene)
    scene.umbra.map_folder = "//maps/"
    save(tmp_path / "shot.blend")
    own = render(scene, tmp_path / "own.exr", exr)
    path, known = map_path(scene), scene.umbra.map_names
    save(tmp_path / "copy.blend", copy=True)
    assert (map_path(scene), scene.umbra.map_names) == (path, known)
    np.testing.assert_allclose(without_addon(tmp_path / "copy.blend", tmp_path, exr), own, rtol=1e-4, atol=1e-4)


def test_two_unsaved_files_in_one_folder(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """Each process has names of its own, and takes a map that agrees."""
    script = """
import os
from small_scene import add_hole, shrink
scene = bpy.context.scene
shrink(scene)
hole = add_hole(scene, spin={spin})
scene.umbra.map_folder = {folder!r}
bpy.ops.umbra.bake_frame()
os._exit(0)
"""
    stamps = []
    for spin in (0.1, 0.9, 0.1):
        run_python(script.format(spin=spin, folder=str(tmp_path))).check_returncode()
        stamps.append(maps(tmp_path))
    assert stamps[0].items() < stamps[1].items() < stamps[2].items()
    assert len(stamps[2]) == 3
    assert len(set(stamps[2].values())) == 2
    assert {plain_name(each) for each in stamps[2]} == {"Scene_Black_Hole_64x36_0001.exr"}


def test_a_new_file_has_no_maps_of_the_unsaved_one_before(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """File > New in one process: what the first file has baked does not go where the second is saved."""
    for frame in (1, 2):
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        scene = bpy.context.scene
        shrink(scene)
        add_hole(scene)
        scene.umbra.map_folder = "//maps/"
        scene.frame_set(frame)
        assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    save(tmp_path / "second.blend")
    assert [plain_name(each) for each in maps(tmp_path / "maps")] == ["Scene_Black_Hole_64x36_0002.exr"]


def test_maps_of_version_0_1_0_are_adopted(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], capfd: pytest.CaptureFixture[str]
) -> None:
    """They are named by scene and hole alone, and their hash is of all digits, as in the released version."""
    physics = addon_module("core.physics_api").physics
    identity = addon_module("core.physics_api").physics.shot.identity
    add_hole(scene)
    scene.umbra.map_folder = "//maps/"
    save(tmp_path / "old.blend")
    parameters = addon_module("outputs.frames").read_at(scene, 1).parameters
    baked = physics.bake(parameters)
    baked.metadata["hash"] = identity._digest(parameters.to_metadata(), 1)
    assert baked.metadata["hash"] != parameters.hash
    physics.write_warp_map(tmp_path / "maps" / "Scene_Black_Hole_64x36_0001.exr", baked)
    scene.umbra.map_names = ""
    addon_module("outputs.saving").on_load(scene)
    assert "names of this file" in capfd.readouterr().out
    before = maps(tmp_path / "maps")
    assert len(before) == 2
    bpy.ops.umbra.bake_frame()
    assert maps(tmp_path / "maps") == before
