# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps verified and cleaned from the Umbra tab, for both outputs."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from modal_stand_in import ESCAPE, TIMER, Window
from small_scene import add_hole, find_map, plain_name


@pytest.fixture
def panel(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    module = addon_module("ui.cache_panel")
    module._told.clear()
    return module


def told(panel: ModuleType, scene: bpy.types.Scene) -> str:
    return "; ".join(line.text for line in panel.lines(scene))


def test_verify_and_clean(
    scene: bpy.types.Scene, tmp_path: Path, panel: ModuleType, capfd: pytest.CaptureFixture[str]
) -> None:
    add_hole(scene)
    assert told(panel, scene) == "Not verified yet"
    scene.frame_set(2)
    bpy.ops.umbra.bake_frame()
    scene.frame_set(1)
    bpy.ops.umbra.bake_frame()
    path = find_map(tmp_path / "maps", "Scene_Black_Hole_64x36_0002.exr")
    path.write_bytes(path.read_bytes()[:-50])
    assert bpy.ops.umbra.verify_maps() == {"FINISHED"}
    assert told(panel, scene).startswith("3 frames, 0.0 MB at ")
    assert told(panel, scene).endswith("1 valid; 1 missing; 1 damaged")
    assert "3 frames: 1 valid, 1 missing, 1 damaged" in capfd.readouterr().out
    assert bpy.ops.umbra.clean_maps() == {"FINISHED"}
    assert not path.exists()
    assert told(panel, scene) == "Not verified yet"
    bpy.ops.umbra.bake_animation()
    bpy.ops.umbra.verify_maps()
    assert told(panel, scene).endswith("3 valid")
    assert bpy.ops.umbra.clean_maps(everything=True) == {"FINISHED"}
    assert not list((tmp_path / "maps").iterdir())


def test_exit_maps(scene: bpy.types.Scene, tmp_path: Path, panel: ModuleType) -> None:
    """An exit map's name has its settings' hash; that of other settings beside it is stale, a warp map is not."""
    hole = add_hole(scene)
    bpy.ops.umbra.bake_frame()
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    bpy.ops.umbra.bake_animation()
    (first,) = (tmp_path / "maps").glob("*_0001_exit_*.exr")
    bpy.ops.umbra.verify_maps()
    assert told(panel, scene).endswith("3 valid")
    hole.umbra.spin = 0.3
    bpy.ops.umbra.verify_maps()
    assert told(panel, scene).endswith("3 stale")
    copy = first.read_bytes()
    bpy.ops.umbra.bake_animation()
    assert not first.exists()  # baking has replaced it
    first.write_bytes(copy)  # as another machine with other settings would
    bpy.ops.umbra.verify_maps()
    assert told(panel, scene).endswith("3 valid")
    bpy.ops.umbra.clean_maps()
    assert not first.exists()
    assert len(list((tmp_path / "maps").glob("*.exr"))) == 4


def test_passes_that_are_not_needed_any_more(scene: bpy.types.Scene, tmp_path: Path) -> None:
    hole = add_hole(scene)
    scene.frame_end = 1
    hole.umbra.disk.enabled = scene.umbra.disk_passes = True
    bpy.ops.umbra.bake_animation()
    hole.umbra.disk.enabled = False
    bpy.ops.umbra.bake_animation()
    assert len(list((tmp_path / "maps").iterdir())) == 5
    bpy.ops.umbra.clean_maps()
    assert [plain_name(path) for path in (tmp_path / "maps").iterdir()] == ["Scene_Black_Hole_64x36_0001.exr"]


def test_beside_the_interface(
    scene: bpy.types.Scene,
    panel: ModuleType,
    addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With progress, and Esc; the stand-in is there because Blender makes operators only in windows."""
    monkeypatch.setattr(addon_module("ui.bake_operators"), "SLICE", 0.0)  # one step at a time
    add_hole(scene)
    bpy.ops.umbra.bake_animation()
    reports: list[str] = []

    class Stand(panel.CacheOperator):
        doing, stopped = panel.UMBRA_OT_verify_maps.doing, panel.UMBRA_OT_verify_maps.stopped
        work, _report = panel.UMBRA_OT_verify_maps.work, panel.UMBRA_OT_verify_maps._report

        def report(self, _kind: set[str], text: str) -> None:
            reports.append(text)

    operator, window = Stand(), Window(scene)
    assert operator._begin(window) == {"RUNNING_MODAL"}
    assert operator.modal(window, TIMER) == {"PASS_THROUGH"}
    assert window.status.startswith("Verifying maps: Frame 1 (1 of 3), 0% done")
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert reports == ["Verifying was stopped."]
    assert told(panel, scene) == "Not verified yet"
    operator._begin(window)
    while (result := operator.modal(window, TIMER)) == {"PASS_THROUGH"}:
        pass
    assert result == {"FINISHED"}
    assert told(panel, scene).endswith("3 valid")


def test_a_scene_without_a_hole(scene: bpy.types.Scene) -> None:
    for operator in (bpy.ops.umbra.verify_maps, bpy.ops.umbra.clean_maps):
        with pytest.raises(RuntimeError, match="contains no black hole"):
            operator()
