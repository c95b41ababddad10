# SPDX-License-Identifier: GPL-3.0-or-later
"""What production does to a shot: full disks, folders that cannot be written, odd names, libraries, layers, markers."""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import bpy
import numpy as np
import pytest
from small_scene import add_hole, plain_name, read, render, shrink

Run = Callable[[str], int]


@pytest.fixture
def run(addon_module: Callable[[str], ModuleType]) -> Run:
    return lambda line: addon_module("command.command_line").run(line.split())


@pytest.fixture
def modules(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 400 kB of its own, where this process may make one."""
    folder = tmp_path / "small disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("no file system can be mounted here")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def picture(scene: bpy.types.Scene, tmp_path: Path, modules: ModuleType, name: str = "picture.exr") -> np.ndarray:
    """Render without baking anything."""
    scene.umbra.auto_bake = False
    try:
        pixels = render(scene, tmp_path / name, modules.physics)[..., :3]
    finally:
        scene.umbra.auto_bake = True
    assert np.abs(pixels - [1.0, 0.0, 1.0]).max(axis=-1).min() > 0.01, "magenta: it has no map"
    return pixels


@pytest.mark.parametrize("foreseen", [True, False])
def test_a_disk_that_is_full(
    scene: bpy.types.Scene,
    small_disk: Path,
    run: Run,
    addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    foreseen: bool,
) -> None:
    """By the look at the free space before, or while the file is written, because others fill the disk too."""
    add_hole(scene)
    scene.umbra.map_folder = str(small_disk)
    scene.camera.keyframe_insert("location", frame=1)
    scene.camera.location.z += 3.0
    scene.camera.keyframe_insert("location", frame=60)
    if not foreseen:
        usage = SimpleNamespace(total=10**9, used=0, free=10**9)
        monkeypatch.setattr(addon_module("bake.folder").shutil, "disk_usage", lambda _path: usage)
    assert run("bake --frames 1-60") == 1
    error = capfd.readouterr().err
    assert "Frame " in error
    assert "full" in error or "no space left on the device" in error.lower()
    assert "free some space" in error
    baked = files(small_disk)
    assert 3 < len(baked) < 30
    assert all(name.endswith(".exr") and not name.startswith(".") for name in baked), "a half file was left"
    assert run(f"status --frames 1-{len(baked)}") == 0

    (small_disk / baked[0]).unlink()
    (small_disk / baked[1]).unlink()
    (small_disk / baked[2]).unlink()
    (small_disk / baked[3]).unlink()
    assert run("bake --frames 1") == 0  # and goes on when there is room


def test_a_write_that_fails_half_way(
    scene: bpy.types.Scene, tmp_path: Path, run: Run, modules: ModuleType, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Where no small disk can be made, at least the operating system's answer can."""
    add_hole(scene)
    replace, calls = os.replace, []

    def full(*paths: object) -> None:
        calls.append(paths)
        if len(calls) == 2:
            raise OSError(28, "No space left on device")
        replace(*paths)

    monkeypatch.setattr(modules.physics.images.exr.os, "replace", full)
    assert run("bake") == 1
    assert "Frame 2: " in (error := capfd.readouterr().err)
    assert "free some space" in error
    assert [plain_name(each) for each in files(tmp_path / "maps")] == ["Scene_Black_Hole_64x36_0001.exr"]
    assert run("bake") == 0
    assert len(files(tmp_path / "maps")) == 3


def test_a_folder_that_can_only_be_read(
    scene: bpy.types.Scene, small_disk: Path, run: Run, modules: ModuleType, capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:  # fmt: skip
    """What is baked there is verified and rendered; what is missing is refused, and nothing can be cleaned."""
    hole = add_hole(scene)
    scene.umbra.map_folder = str(small_disk)
    assert run("bake --frames 1-2") == 0
    if subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=False, capture_output=True).returncode:
        pytest.skip("nothing can be mounted read-only here")
    assert run("bake --frames 1-2") == 0
    assert run("status --frames 1-2") == 0
    picture(scene, tmp_path, modules)
    capfd.readouterr()
    assert run("bake --frames 1-3") == 1
    assert "Frame 3: The warp map folder" in (error := capfd.readouterr().err)
    assert "cannot be written to (Read-only file system): choose another folder" in error
    hole.umbra.spin = 0.3
    assert run("status --frames 1-2") == 1
    assert run("clean --frames 1-2 --dry-run") == 0
    assert "would remove" in capfd.readouterr().out
    assert run("clean --frames 1-2") == 1
    assert "cannot be written to" in capfd.readouterr().err
    assert len(files(small_disk)) == 2


def test_a_folder_that_is_missing(
    scene: bpy.types.Scene, tmp_path: Path, run: Run, capfd: pytest.CaptureFixture[str]
) -> None:
    add_hole(scene)
    scene.umbra.map_folder = str(tmp_path / "not" / "there")
    assert run("status") == 1
    assert "3 missing" in capfd.readouterr().out
    assert run("clean") == 0
    assert not (tmp_path / "not").exists()
    assert run("bake") == 0
    assert len(files(tmp_path / "not" / "there")) == 3


def test_names_with_spaces_and_letters_of_other_alphabets(
    scene: bpy.types.Scene, tmp_path: Path, run: Run, modules: ModuleType
) -> None:
    hole = add_hole(scene)
    hole.name, scene.name = "Schwarzes Loch é 黑洞", "Szene α 1"
    scene.umbra.map_folder = "//Größe 星 'maps' #1/ü b/"
    folder = tmp_path / "Übung №1 – копия"
    folder.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "Datei ñ 1.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "Datei ñ 1.blend"))
    scene = bpy.context.scene
    assert run("bake") == 0
    assert len(list((folder / "Größe 星 'maps' #1" / "ü b").glob("*.exr"))) == 3
    assert run("status") == 0
    first = picture(scene, tmp_path, modules)
    (tmp_path / "picture.exr").unlink()
    assert run("clean --all") == 0
    assert not list((folder / "Größe 星 'maps' #1" / "ü b").iterdir())
    np.testing.assert_array_equal(render(scene, tmp_path / "b.exr", modules.physics)[..., :3], first)


def library(scene: bpy.types.Scene, tmp_path: Path) -> Path:
    """Save the scene with its hole in a collection of its own, to link from."""
    hole = scene.umbra.active_hole
    collection = bpy.data.collections.new("Holes")
    scene.collection.children.link(collection)
    for each in hole.users_collection:
        each.objects.unlink(hole)
    collection.objects.link(hole)
    hole.umbra.spin = 0.8
    (tmp_path / "library").mkdir()
    path = tmp_path / "library" / "assets.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.mark.parametrize("override", [False, True])
def test_a_hole_from_a_library(
    scene: bpy.types.Scene, tmp_path: Path, run: Run, modules: ModuleType, override: bool
) -> None:
    """Linked directly, or with a library override that gives it another spin and another place."""
    add_hole(scene)
    path = library(scene, tmp_path)
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    scene = bpy.context.scene
    shrink(scene)
    scene.frame_start, scene.frame_end = 1, 2
    scene.umbra.map_folder = str(tmp_path / "maps")
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    with bpy.data.libraries.load(str(path), link=True) as (_source, wanted):
        wanted.collections = ["Holes"]
        wanted.images = [name for name in _source.images if name == "Test Sky"]
    (collection,) = wanted.collections
    if override:
        collection = collection.override_hierarchy_create(scene, bpy.context.view_layer)
        if collection.name not in scene.collection.children:
            scene.collection.children.link(collection)
    else:
        scene.collection.children.link(collection)
    (hole,) = collection.objects
    assert (hole.override_library is not None) == override
    scene.umbra.environment_image, scene.umbra.environment_source = wanted.images[0], "IMAGE"
    scene.umbra.active_hole = hole
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    if override:
        hole.umbra.spin = 0.2
        hole.location.x += 0.5
        bpy.context.view_layer.update()
    assert run("bake") == 0
    assert run("status") == 0
    picture(scene, tmp_path, modules)
    (one, _two) = sorted((tmp_path / "maps").glob("*.exr"))
    assert modules.physics.read_warp_map(one).metadata["parameters"]["spin"] == pytest.approx(0.2 if override else 0.8)


def test_a_scene_from_a_library(scene: bpy.types.Scene, tmp_path: Path, run: Run, modules: ModuleType) -> None:
    """Its maps lie beside its own file, wherever the file is that links it; it is baked and rendered from there."""
    add_hole(scene)
    scene.umbra.map_folder = ""
    scene.name = "Shot"
    path = library(scene, tmp_path)
    (tmp_path / "shots").mkdir()
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shots" / "shot.blend"))
    with bpy.data.libraries.load(str(path), link=True) as (_source, wanted):
        wanted.scenes = ["Shot"]
    (linked,) = wanted.scenes
    assert linked.library is not None
    assert run("bake --scene Shot --frames 1") == 0
    assert len(files(tmp_path / "library" / "umbra_maps")) == 1
    assert not (tmp_path / "shots" / "umbra_maps").exists()
    assert run("status --scene Shot --frames 1") == 0
    linked.render.filepath = str(tmp_path / "linked.exr")
    linked.umbra.auto_bake = False
    bpy.ops.render.render(write_still=True, scene="Shot")
    pixels = read(tmp_path / "linked.exr", modules.physics)[..., :3]
    assert np.abs(pixels - [1.0, 0.0, 1.0]).max(axis=-1).min() > 0.01, "magenta: it has no map"


def test_cameras_bound_to_markers(scene: bpy.types.Scene, tmp_path: Path, run: Run, modules: ModuleType) -> None:
    """The command bakes what the render needs: each frame from the camera that its marker says."""
    add_hole(scene)
    second = scene.camera.copy()
    second.location = (-6.0, -8.0, 2.0)
    second.rotation_euler.z += 2.5
    scene.collection.objects.link(second)
    for frame, camera in ((1, scene.camera), (3, second)):
        scene.timeline_markers.new(f"from {frame}", frame=frame).camera = camera
    assert run("bake") == 0
    positions = [
        tuple(modules.physics.read_warp_map_metadata(path)["parameters"]["camera_position"])
        for path in sorted((tmp_path / "maps").glob("*.exr"))
    ]
    assert positions[0] == positions[1] != positions[2]
    scene.umbra.auto_bake = False
    scene.render.filepath = str(tmp_path / "frame_####")
    bpy.ops.render.render(animation=True)
    assert len(list(tmp_path.glob("frame_*.exr"))) == 3


def test_view_layers(
    scene: bpy.types.Scene, tmp_path: Path, run: Run, modules: ModuleType, capfd: pytest.CaptureFixture[str]
) -> None:
    """A first layer that is not rendered and excludes the hole; the bake follows the one that is rendered."""
    hole = add_hole(scene)
    collection = bpy.data.collections.new("Holes")
    scene.collection.children.link(collection)
    hole.users_collection[0].objects.unlink(hole)
    collection.objects.link(hole)
    first = scene.view_layers[0]
    scene.view_layers.new("Beauty")
    first.layer_collection.children["Holes"].exclude = True
    first.use = False
    tree = scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group
    for node in tree.nodes:
        if node.type == "R_LAYERS":
            node.layer = "Beauty"
    assert run("bake --frames 1") == 0
    picture(scene, tmp_path, modules)
    capfd.readouterr()
    assert run(f"bake --frames 2 --view-layer {first.name}") == 1
    assert f'view layer "{first.name}" excludes' in capfd.readouterr().err


def test_stereo_is_refused(scene: bpy.types.Scene, run: Run, capfd: pytest.CaptureFixture[str]) -> None:
    add_hole(scene)
    scene.render.use_multiview = True
    assert run("bake") == 1
    assert "Frame 1: Stereoscopy is not supported with a black hole: switch it off" in capfd.readouterr().err
    scene.render.use_multiview = False
    assert run("bake") == 0
