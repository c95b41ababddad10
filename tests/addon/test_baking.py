# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking by operator: at once without a window, step by step beside one."""

import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import bpy
import numpy as np
import pytest
from modal_stand_in import ESCAPE, MOUSE, TIMER, Window
from small_scene import add_hole, find_map, plain_name, render


def maps_in(tmp_path: Path) -> dict[str, int]:
    return {plain_name(path): path.stat().st_mtime_ns for path in sorted((tmp_path / "maps").glob("*.exr"))}


def move_camera(scene: bpy.types.Scene) -> None:
    for frame in (1, 3):
        scene.camera.location.z = 4.0 + frame
        scene.camera.keyframe_insert("location", frame=frame)


def test_one_frame(scene: bpy.types.Scene, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    add_hole(scene)
    scene.frame_set(2)
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    assert list(maps_in(tmp_path)) == ["Scene_Black_Hole_64x36_0002.exr"]
    assert "Umbra: baking warp maps" in capfd.readouterr().out
    assert scene.frame_current == 2


def bake_and_count(package: ModuleType, monkeypatch: pytest.MonkeyPatch) -> int:
    """Bake the animation; return how many maps were traced, and not made from another by a rotation."""
    traced = []
    steps = package.maps.sharing.bake_steps

    def counted(parameters: object) -> object:
        traced.append(parameters)
        return steps(parameters)

    with monkeypatch.context() as patch:
        patch.setattr(package.maps.sharing, "bake_steps", counted)
        assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    return len(traced)


def test_an_orbits_frames_share_one_trace(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The camera is carried round the hole's tilted axis by a parent, and tracks the hole by it."""
    hole = add_hole(scene, motion="CIRCULAR")
    hole.rotation_euler = (0.3, 0.2, 0.0)
    arm = bpy.data.objects.new("Arm", None)
    scene.collection.objects.link(arm)
    arm.parent = hole
    scene.camera.parent = arm
    for frame, angle in ((1, 0.0), (3, 1.5)):
        arm.rotation_euler.z = angle
        arm.keyframe_insert("rotation_euler", frame=frame)
    package = addon_module("core.physics_api").physics
    traced = bake_and_count(package, monkeypatch)
    assert len(maps_in(tmp_path)) == 3
    assert traced == 1

    shot = addon_module("outputs.frames").read_at(scene, 3)
    baked = package.read_warp_map(find_map(tmp_path / "maps", "Scene_Black_Hole_64x36_0003.exr"))
    assert baked.metadata["hash"] == shot.parameters.hash
    expected = package.bake(shot.parameters)
    assert baked.visibility == pytest.approx(expected.visibility, abs=1e-4)
    # single precision of Blender's matrices, 1e-7, which the sky amplifies some hundred times beside the edge
    error = np.abs(baked.theta - expected.theta)
    assert np.quantile(error, 0.99) < 1e-5
    assert error.max() < 1e-3


def test_animation_bakes_what_is_missing_or_stale(scene: bpy.types.Scene, tmp_path: Path) -> None:
    hole = add_hole(scene)
    move_camera(scene)
    scene.frame_set(2)
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    assert scene.frame_current == 2
    first = maps_in(tmp_path)
    assert len(first) == 3

    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    assert maps_in(tmp_path) == first

    # only frame 3 is changed by this key
    hole.umbra.keyframe_insert("spin", frame=2)
    hole.umbra.spin = 0.1
    hole.umbra.keyframe_insert("spin", frame=3)
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    changed = {name for name, stamp in maps_in(tmp_path).items() if first[name] != stamp}
    assert changed == {"Scene_Black_Hole_64x36_0003.exr"}


def test_rendering_uses_what_was_baked(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene)
    move_camera(scene)
    bpy.ops.umbra.bake_animation()
    before = maps_in(tmp_path)
    scene.render.filepath = str(tmp_path / "frame_####")
    scene.umbra.auto_bake = False
    bpy.ops.render.render(animation=True)
    assert maps_in(tmp_path) == before


def test_a_rebaked_map_of_the_same_frame_is_seen(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    hole = add_hole(scene)
    exr = addon_module("core.physics_api").physics
    bpy.ops.umbra.bake_frame()
    first = render(scene, tmp_path / "a.exr", exr)
    hole.umbra.mass_scale *= 1.5
    bpy.ops.umbra.bake_frame()
    second = render(scene, tmp_path / "b.exr", exr)
    assert np.abs(second - first).max() > 0.1


def test_errors_become_reports_that_name_the_frame(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="contains no black hole"):
        bpy.ops.umbra.bake_frame()
    add_hole(scene)
    scene.camera.location = (0.05, 0.0, 0.0)
    with pytest.raises(RuntimeError, match="horizon"):
        bpy.ops.umbra.bake_frame()
    with pytest.raises(RuntimeError, match=r"Frame 1: .*horizon"):
        bpy.ops.umbra.bake_animation()
    assert not maps_in(tmp_path)


def test_folders_that_cannot_be_used(scene: bpy.types.Scene, tmp_path: Path) -> None:
    add_hole(scene)
    (tmp_path / "file").write_text("not a folder")
    scene.umbra.map_folder = str(tmp_path / "file" / "maps")
    with pytest.raises(RuntimeError, match=r"cannot be written to .*choose another folder"):
        bpy.ops.umbra.bake_frame()
    scene.umbra.map_folder = "/proc/umbra"
    with pytest.raises(RuntimeError, match="cannot be written to"):
        bpy.ops.umbra.bake_frame()


def test_a_full_disk(
    scene: bpy.types.Scene,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    add_hole(scene)
    usage = SimpleNamespace(total=10, used=10, free=1000)
    monkeypatch.setattr(addon_module("bake.folder").shutil, "disk_usage", lambda _path: usage)
    with pytest.raises(RuntimeError, match=r"disk of the warp map folder .* is full"):
        bpy.ops.umbra.bake_frame()
    assert not maps_in(tmp_path)


def test_steps_yield_often_and_leave_the_scene_at_its_frame(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene)
    move_camera(scene)
    scene.frame_set(2)
    steps = addon_module("outputs.frames").bake(scene, [1, 2, 3])
    fractions = []
    for progress in steps:
        assert scene.frame_current == 2
        fractions.append(progress.fraction)
    assert fractions == sorted(fractions)
    assert fractions[0] == 0.0
    assert fractions[-1] <= 1.0
    assert len(maps_in(tmp_path)) == 3


def test_closing_the_generator_cancels_and_keeps_finished_maps(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene)
    steps = addon_module("outputs.frames").bake(scene, [1, 2, 3])
    while next(steps).frame == 1:
        pass
    steps.close()
    assert list(maps_in(tmp_path)) == ["Scene_Black_Hole_64x36_0001.exr"]


def test_a_scene_that_vanishes_ends_the_bake(scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]) -> None:
    add_hole(scene)
    steps = addon_module("outputs.frames").bake(scene, [1, 2, 3])
    next(steps)
    scene.name = "Renamed"
    next(steps)  # a new name is no reason to stop
    bpy.data.scenes.new("Another")
    bpy.data.scenes.remove(scene)
    with pytest.raises(addon_module("core.errors").SceneError, match='"Scene" is gone'):
        list(steps)


@pytest.fixture
def modal(addon_module: Callable[[str], ModuleType]) -> SimpleNamespace:
    """The operator's methods on a stand-in, because Blender makes operators only in windows."""
    operators = addon_module("ui.bake_operators")
    reports: list[tuple[set[str], str]] = []

    class Stand(operators.BakeOperator):
        frames = operators.UMBRA_OT_bake_animation.frames

        def report(self, kind: set[str], text: str) -> None:
            reports.append((kind, text))

    return SimpleNamespace(operator=Stand(), reports=reports, module=operators)


def test_modal_bake(scene: bpy.types.Scene, tmp_path: Path, modal: SimpleNamespace) -> None:
    add_hole(scene)
    window = Window(scene)
    assert modal.operator._begin(window) == {"RUNNING_MODAL"}
    assert modal.module.running() is not None
    assert not bpy.ops.umbra.bake_frame.poll()
    assert modal.operator.modal(window, MOUSE) == {"PASS_THROUGH"}  # the interface stays usable
    while (result := modal.operator.modal(window, TIMER)) == {"PASS_THROUGH"}:
        assert "Esc" in window.status
    assert result == {"FINISHED"}
    assert len(maps_in(tmp_path)) == 3
    assert modal.reports[-1][1].startswith("Baked 3 warp maps")
    assert modal.module.running() is None
    assert window.removed == 1
    assert window.status is None


def test_a_tick_works_for_a_while(scene: bpy.types.Scene, modal: SimpleNamespace) -> None:
    """Blender draws its window after each tick, which takes longer than a step: there are few."""
    add_hole(scene)
    window = Window(scene)
    modal.operator._begin(window)
    begin, ticks = time.perf_counter(), 1
    while modal.operator.modal(window, TIMER) == {"PASS_THROUGH"}:
        ticks += 1
    taken = time.perf_counter() - begin
    assert ticks <= taken / modal.module.SLICE + 1.0


def test_modal_escape(
    scene: bpy.types.Scene, tmp_path: Path, modal: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(modal.module, "SLICE", 0.0)  # one step
    add_hole(scene)
    window = Window(scene)
    modal.operator._begin(window)
    modal.operator.modal(window, TIMER)
    assert modal.operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert modal.module.running() is None
    assert not maps_in(tmp_path)
    assert "stopped" in modal.reports[-1][1]


def test_modal_error(scene: bpy.types.Scene, modal: SimpleNamespace) -> None:
    add_hole(scene)
    window = Window(scene)
    modal.operator._begin(window)
    scene.camera.data.type = "ORTHO"
    while (result := modal.operator.modal(window, TIMER)) == {"PASS_THROUGH"}:
        pass
    assert result == {"CANCELLED"}
    assert modal.reports[-1][0] == {"ERROR"}
    assert "orthographic" in modal.reports[-1][1]
    assert modal.module.running() is None


def test_the_panel_tells_the_state(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    status = addon_module("ui.status")

    def text() -> str:
        status._counts.clear()
        return " ".join(line.text for line in status.lines(bpy.context))

    assert "no black hole" in text()
    hole = add_hole(scene)
    assert "is not baked" in text()
    assert "0 of 3 frames baked" in text()
    bpy.ops.umbra.bake_frame()
    assert "is up to date" in text()
    assert "1 of 3 frames baked" in text()
    assert "Camera at 32.16 M" in text()
    hole.umbra.spin = 0.2
    assert "is out of date" in text()
    hole.umbra.mass_scale = 3.0
    assert "inside the innermost stable circular orbit" in text()
    hole.umbra.motion = "CIRCULAR"
    assert "unstable" in text()
    scene.camera.data.type = "ORTHO"
    assert "orthographic" in text()
    scene.camera.data.type = "PERSP"
    bpy.ops.umbra.remove_compositor()
    assert "not set up" in text()
