# SPDX-License-Identifier: GPL-3.0-or-later
"""F12 bakes what is missing beside the interface, and starts the render when that is done."""

from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import bpy
import pytest
from modal_stand_in import ESCAPE, MOUSE, TIMER, Window
from small_scene import add_hole

KEYS = {("umbra.render_frame", False), ("umbra.render_animation", True)}


@pytest.fixture
def operators(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("ui.render_operators")


@pytest.fixture
def rendered() -> Iterator[list[int]]:
    """The frames that Blender renders, with no map baked by a render itself."""
    frames: list[int] = []

    def note(scene: bpy.types.Scene, *_: object) -> None:
        frames.append(scene.frame_current)

    bpy.app.handlers.render_post.append(note)
    yield frames
    bpy.app.handlers.render_post.remove(note)


@pytest.fixture
def stand(operators: ModuleType, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The operator of an animation on a stand-in that notes the renders it starts."""
    reports: list[tuple[set[str], str]] = []
    renders: list[dict[str, bool]] = []
    monkeypatch.setattr(operators, "start_render", lambda **how: renders.append(how))

    class Stand(operators.RenderOperator):
        frames = operators.UMBRA_OT_render_animation.frames
        animation = True
        by_key = False

        def report(self, kind: set[str], text: str) -> None:
            reports.append((kind, text))

    return SimpleNamespace(operator=Stand(), reports=reports, renders=renders)


def maps_in(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / "maps").glob("[!.]*.exr"))


def keys_of_ours() -> set[tuple[str, bool]]:
    keymap = bpy.context.window_manager.keyconfigs.addon.keymaps.get("Screen")
    items = [] if keymap is None else keymap.keymap_items
    return {(each.idname, bool(each.ctrl)) for each in items if each.idname.startswith("umbra.") and each.type == "F12"}


def test_without_a_window_it_bakes_and_renders(
    scene: bpy.types.Scene, tmp_path: Path, rendered: list[int], capfd: pytest.CaptureFixture[str]
) -> None:
    add_hole(scene)
    scene.frame_set(2)
    assert bpy.ops.umbra.render_frame() == {"FINISHED"}
    assert rendered == [2]
    assert len(maps_in(tmp_path)) == 1
    scene.render.filepath = str(tmp_path / "frame_####")
    assert bpy.ops.umbra.render_animation() == {"FINISHED"}
    assert rendered == [2, 1, 2, 3]
    assert len(maps_in(tmp_path)) == 3
    assert len(list(tmp_path.glob("frame_*.exr"))) == 3
    assert "Umbra: baking the warp map" not in capfd.readouterr().out  # which a render says of its own bakes


@pytest.mark.parametrize("reason", ["no hole", "no bake", "no maps"])
def test_with_nothing_to_bake_it_renders(
    scene: bpy.types.Scene, operators: ModuleType, stand: SimpleNamespace, reason: str
) -> None:
    if reason != "no hole":
        add_hole(scene)
        assert operators.may_bake(scene)
    if reason == "no bake":
        scene.umbra.auto_bake = False
    if reason == "no maps":
        assert bpy.ops.umbra.set_output(output="CYCLES_LENS") == {"FINISHED"}
        scene.umbra.lens_rays = "IN_SHADER"
    assert not operators.may_bake(scene)
    assert stand.operator.execute(Window(scene)) == {"FINISHED"}
    assert stand.renders == [{"animation": True, "beside_interface": False}]


def test_in_a_window_a_key_goes_on_to_blenders_own_where_there_is_nothing_to_bake(
    scene: bpy.types.Scene, operators: ModuleType, stand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_window = SimpleNamespace(background=False, is_job_running=lambda _kind: False)
    monkeypatch.setattr(operators, "bpy", SimpleNamespace(app=in_window))
    assert stand.operator.invoke(Window(scene), TIMER) == {"FINISHED"}
    assert stand.renders == [{"animation": True, "beside_interface": True}]
    stand.operator.by_key = True
    assert stand.operator.invoke(Window(scene), TIMER) == {"PASS_THROUGH"}
    assert len(stand.renders) == 1
    add_hole(scene)
    in_window.is_job_running = lambda kind: kind == "RENDER"
    assert stand.operator.invoke(Window(scene), TIMER) == {"PASS_THROUGH"}
    in_window.is_job_running = lambda _kind: False
    window = Window(scene)
    assert stand.operator.invoke(window, TIMER) == {"RUNNING_MODAL"}
    assert stand.operator.invoke(window, TIMER) == {"CANCELLED"}  # the key once more
    assert "being baked" in stand.reports[-1][1]
    assert stand.operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert len(stand.renders) == 1
    monkeypatch.setattr(operators, "SLICE", 60.0)
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    assert stand.operator.invoke(Window(scene), TIMER) == {"PASS_THROUGH"}
    stand.operator.by_key = False
    assert stand.operator.invoke(Window(scene), TIMER) == {"FINISHED"}
    assert len(stand.renders) == 2


def test_the_render_starts_when_the_maps_are_there(
    scene: bpy.types.Scene, tmp_path: Path, stand: SimpleNamespace
) -> None:
    add_hole(scene)
    for expected in (3, 0):
        window = Window(scene)
        assert stand.operator._begin(window) == {"RUNNING_MODAL"}
        assert stand.operator.modal(window, MOUSE) == {"PASS_THROUGH"}
        stand.renders.clear()
        stand.reports.clear()
        while (result := stand.operator.modal(window, TIMER)) == {"PASS_THROUGH"}:
            assert "for the render" in window.status
            assert not stand.renders
        assert result == {"FINISHED"}
        assert stand.renders == [{"animation": True, "beside_interface": True}]
        assert len(maps_in(tmp_path)) == 3
        assert window.removed == 1
        assert window.status is None
        assert [text.startswith(f"Baked {expected} warp maps") for _, text in stand.reports] == [True] * bool(expected)


@pytest.mark.parametrize("end", ["escape", "error", "another scene"])
def test_no_render_starts_otherwise(scene: bpy.types.Scene, stand: SimpleNamespace, end: str) -> None:
    add_hole(scene)
    window = Window(scene)
    stand.operator._begin(window)
    if end == "error":
        scene.camera.data.type = "ORTHO"
    if end == "another scene":
        window.scene = bpy.data.scenes.new("Another")
    if end == "escape":
        stand.operator.modal(window, ESCAPE)
    else:
        while stand.operator.modal(window, TIMER) == {"PASS_THROUGH"}:
            pass
    assert not stand.renders
    kind, text = stand.reports[-1]
    expected = {"escape": "not started", "error": "orthographic", "another scene": "another scene"}[end]
    assert expected in text
    assert kind == {"escape": {"INFO"}, "error": {"ERROR"}, "another scene": {"WARNING"}}[end]


def test_what_blender_says_of_its_render_is_reported(scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.camera = None
    with pytest.raises(RuntimeError, match="camera"):
        bpy.ops.umbra.render_frame()


def test_keys_and_menu_come_and_go(addon: ModuleType, operators: ModuleType) -> None:
    assert keys_of_ours() == KEYS
    addon.unregister()
    assert not keys_of_ours()
    assert operators.draw_render_menu not in bpy.types.TOPBAR_MT_render._dyn_ui_initialize()
    addon.register()
    assert keys_of_ours() == KEYS
    assert bpy.types.TOPBAR_MT_render._dyn_ui_initialize()[0].__name__ == "draw_render_menu"
