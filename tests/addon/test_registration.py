# SPDX-License-Identifier: GPL-3.0-or-later
"""Coming and going: the add-on registers, unregisters and registers again, and says so when it cannot."""

from collections.abc import Callable
from types import ModuleType

import addon_utils
import bpy
import pytest
from small_scene import add_hole, run_python, shrink

HANDLERS = (
    "render_init",
    "render_pre",
    "frame_change_post",
    "render_post",
    "render_complete",
    "render_cancel",
    "load_post",
    "save_pre",
)


def attached(addon: ModuleType) -> int:
    return sum(
        handler.__module__.startswith(addon.__name__)
        for name in HANDLERS
        for handler in getattr(bpy.app.handlers, name)
    )


def test_again_and_again(addon: ModuleType) -> None:
    for _ in range(3):
        addon.unregister()
        assert not hasattr(bpy.types.Object, "umbra")
        assert not hasattr(bpy.types, "UMBRA_OT_add_black_hole")
        assert attached(addon) == 0
        addon.register()
        assert attached(addon) == len(HANDLERS)
    shrink(bpy.context.scene)
    add_hole(bpy.context.scene)


def test_twice_is_an_error(addon: ModuleType) -> None:
    with pytest.raises(RuntimeError, match="registered already"):
        addon.register()
    assert attached(addon) == len(HANDLERS)


def test_a_failure_half_way_is_loud_and_undone(
    addon: ModuleType, addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    addon.unregister()

    def fail() -> None:
        raise RuntimeError("no")

    with monkeypatch.context() as patch:
        patch.setattr(addon_module("render.handlers"), "register", fail)
        with pytest.raises(RuntimeError, match="no"):
            addon.register()
    assert not hasattr(bpy.types.Scene, "umbra")
    assert attached(addon) == 0
    addon.register()
    assert hasattr(bpy.types.Scene, "umbra")


def test_disabling_and_enabling_keeps_a_scenes_settings(addon: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene, spin=0.3)
    name = addon.__name__
    addon_utils.disable(name)
    assert not hasattr(hole, "umbra")
    addon_utils.enable(name)
    assert hole.umbra.spin == pytest.approx(0.3)
    assert scene.umbra.active_hole == hole


def test_blender_ends_without_help(addon: ModuleType) -> None:
    """Handlers left behind at the end make Blender 4.5 hang; a script must not have to care."""
    result = run_python("from small_scene import *\nshrink(bpy.context.scene)\nadd_hole(bpy.context.scene)\n")
    assert result.returncode == 0, result.stderr


def test_the_menu_offers_it(addon_module: Callable[[str], ModuleType]) -> None:
    menu = bpy.types.VIEW3D_MT_add
    functions = menu._dyn_ui_initialize()
    assert addon_module("ui.operators").draw_add_menu in functions


def test_the_add_operator(addon: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    scene.cursor.location = (1.0, 2.0, 3.0)
    hole = add_hole(scene)
    assert tuple(hole.location) == (1.0, 2.0, 3.0)
    assert (hole.type, hole.empty_display_type, hole.show_axis) == ("EMPTY", "SPHERE", True)
    horizon = 1.0 + (1.0 - 0.9**2) ** 0.5
    assert hole.empty_display_size == pytest.approx(horizon * hole.umbra.mass_scale, rel=1e-6)
    hole.umbra.spin = 0.0
    assert hole.empty_display_size == pytest.approx(2.0 * hole.umbra.mass_scale, rel=1e-6)
    assert bpy.context.object == hole
    assert scene.umbra.active_hole == hole
