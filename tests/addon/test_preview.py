# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview without a window: its timer is called by hand, and told that there is a window to show it in."""

import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import environment_image, render, shrink, world_sky

pytestmark = pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")


@pytest.fixture
def preview(addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module, as if there were a window; timers do not fire in background, so tests call `settle`."""
    module = addon_module("preview.live_preview")
    module.forget()
    monkeypatch.setattr(module, "can_run", lambda: not module._suspended.now)
    monkeypatch.setattr(module, "SETTLE", 0.0)
    yield module
    module.forget()


@pytest.fixture
def world_sync(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("outputs.world.world_sync")


@pytest.fixture
def thumbnail(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("preview.thumbnail")


@pytest.fixture
def physics(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api")


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    return prepare(bpy.context.scene, tmp_path)


def prepare(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    shrink(scene, (96, 54))
    scene.umbra.map_folder = str(tmp_path / "maps")
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    world_sky(scene, environment_image())
    scene.camera.location, scene.camera.rotation_euler = (0.0, -6.0, 1.0), (1.42, 0.0, 0.0)
    hole = bpy.data.objects.new("Hole", None)
    scene.collection.objects.link(hole)
    hole.umbra.is_black_hole = True
    hole.umbra.spin, hole.umbra.mass_scale = 0.95, 0.2
    scene.umbra.active_hole = hole
    return scene


def start(scene: bpy.types.Scene, preview: ModuleType, output: str = "WORLD") -> None:
    if output != "COMPOSITOR":
        assert bpy.ops.umbra.set_output(output=output) == {"FINISHED"}
    scene.umbra.live_preview = True
    settle(preview)


def settle(preview: ModuleType) -> int:
    """Call the timer until it has nothing more to do; how often it was called."""
    bpy.context.view_layer.update()
    for count in range(1000):
        if preview._tick() is None:
            return count
    raise AssertionError("the preview goes on and on")


def shown(scene: bpy.types.Scene, world_sync: ModuleType) -> np.ndarray:
    """The pixels that the World reads."""
    image = world_sync._shown_live(scene)
    texture = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(texture)
    return texture.reshape(image.size[1], image.size[0], 4)


def expected(scene: bpy.types.Scene, physics: ModuleType, addon_module) -> np.ndarray:
    """The map as numpy makes it for where the camera is now."""
    frame = addon_module("outputs.frames").read(scene, bpy.context.evaluated_depsgraph_get(), np.zeros(3))
    draft = replace(frame.parameters, tolerance=1e-4)
    api = physics.physics
    steps = api.bake_world_map_steps(api.world_map_parameters(draft, api.WORLD_MAP_PREVIEW_GRID))
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value.texture


def test_the_map_follows_the_camera_and_the_hole(scene, preview, world_sync, physics, addon_module) -> None:
    start(scene, preview)
    hole = scene.umbra.active_hole
    before = shown(scene, world_sync)
    assert np.array_equal(before, expected(scene, physics, addon_module))
    changes = (
        lambda: setattr(scene.camera, "location", (1.0, -5.0, 2.0)),
        lambda: setattr(hole.umbra, "spin", 0.2),
        lambda: setattr(hole.umbra, "mass_scale", 0.3),
        lambda: setattr(hole.umbra, "motion", "CIRCULAR"),
        lambda: setattr(hole, "rotation_euler", (0.5, 0.2, 0.1)),
    )
    for change in changes:
        change()
        settle(preview)
        after = shown(scene, world_sync)
        assert np.array_equal(after, expected(scene, physics, addon_module))
        assert not np.array_equal(after, before)
        before = after


def test_turning_the_camera_traces_no_new_map(scene, preview, world_sync, monkeypatch) -> None:
    start(scene, preview)
    traced = []
    monkeypatch.setattr(world_sync, "show_live", lambda *made: traced.append(made))
    scene.camera.rotation_euler.z += 0.3
    settle(preview)
    assert traced == []
    scene.camera.location.x += 0.3
    settle(preview)
    assert sum(bool(made.metadata) for _scene, made in traced) == 1  # the other is shown again, for Cycles


def test_handlers_only_note_and_many_changes_are_one_map(scene, preview, world_sync, monkeypatch) -> None:
    start(scene, preview)
    reads = []
    read = preview.frames.read
    monkeypatch.setattr(preview.frames, "read", lambda *given, **named: (reads.append(1), read(*given, **named))[1])
    updates = preview.state(scene).updates
    for step in range(50):
        scene.camera.location.x = 0.1 * step
        bpy.context.view_layer.update()
    assert reads == [], "a handler has read the scene"
    assert bpy.app.timers.is_registered(preview._tick)
    settle(preview)
    assert preview.state(scene).updates == updates + 1


def test_a_slice_of_work_ends_with_its_budget(scene, preview) -> None:
    """With no time at all each call does one step, and the rest is left for the next."""
    start(scene, preview)
    scene.camera.location.x += 0.2
    bpy.context.view_layer.update()
    calls = 0
    while preview.advance(0.0) is not None:
        calls += 1
    assert calls >= 4


@pytest.mark.parametrize("engine", ["CYCLES", "EEVEE"])
def test_a_hundred_changes_leave_no_images_behind(scene, preview, physics, engine, monkeypatch) -> None:
    monkeypatch.setattr(physics.physics, "WORLD_MAP_PREVIEW_GRID", (16, 15))
    monkeypatch.setattr(preview.thumbnail, "SIDE", 16)
    if engine == "EEVEE":
        scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
    start(scene, preview)
    scene.camera.location.x += 0.01
    settle(preview)
    count = len(bpy.data.images)
    live = [image.name for image in bpy.data.images if image.name.startswith("Umbra Live Map")]
    # Cycles reads an image that has changed only if it is another one than before
    assert len(live) == (2 if engine == "CYCLES" else 1)
    for _ in range(100):
        scene.camera.location.x += 0.01
        settle(preview)
    assert len(bpy.data.images) == count
    assert preview.state(scene).updates >= 100
    scene.umbra.live_preview = False
    assert [image.name for image in bpy.data.images if image.name.startswith("Umbra Live Map")] == []


def test_switched_off_with_the_add_on_it_leaves_worlds_that_read_files(scene, preview, world_sync) -> None:
    start(scene, preview)
    assert world_sync.shows_live(scene)
    preview.unregister()
    try:
        assert not world_sync.shows_live(scene)
        assert [image.name for image in bpy.data.images if image.name.startswith("Umbra Live Map")] == []
        assert "world_" in bpy.path.basename(world_sync._file_image(scene).filepath)
    finally:
        preview.register()


def test_the_thumbnail_shows_what_the_camera_sees(scene, preview, thumbnail, physics, tmp_path) -> None:
    """Against a render of the World: both are pictures of the same sky, the thumbnail smaller and for screens."""
    start(scene, preview)
    small = thumbnail.pixels(scene)
    assert small.shape == (108, 192, 4)
    scene.render.resolution_x, scene.render.resolution_y = 192, 108
    picture = render(scene, tmp_path / "picture.exr", physics.physics)
    linear = np.clip(picture[::-1, :, :3], 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.quantile(np.abs(small[..., :3] - encoded), 0.95) < 0.03
    assert 0.02 < (small[..., :3].max(axis=-1) == 0.0).mean() < 0.5


@pytest.mark.parametrize("output", ["COMPOSITOR", "CYCLES_LENS"])
def test_the_thumbnail_needs_no_world_output(scene, preview, thumbnail, output) -> None:
    start(scene, preview, output)
    before = thumbnail.pixels(scene)
    scene.umbra.active_hole.umbra.mass_scale = 0.4
    settle(preview)
    after = thumbnail.pixels(scene)
    assert (after[..., :3].max(axis=-1) == 0.0).sum() > (before[..., :3].max(axis=-1) == 0.0).sum()
    scene.umbra.live_preview = False
    assert thumbnail.pixels(scene) is None


def test_a_render_reads_files_and_the_preview_comes_back(scene, preview, world_sync, physics, tmp_path) -> None:
    scene.cycles.filter_width = 0.01
    assert bpy.ops.umbra.set_output(output="WORLD") == {"FINISHED"}
    alone = render(scene, tmp_path / "alone.exr", physics.physics)
    start(scene, preview)
    assert world_sync.shows_live(scene)
    assert np.array_equal(render(scene, tmp_path / "beside.exr", physics.physics), alone)
    settle(preview)
    assert world_sync.shows_live(scene)


def test_the_preview_stays_away_without_a_window(scene, addon_module, world_sync) -> None:
    preview = addon_module("preview.live_preview")
    start(scene, preview)
    scene.camera.location.x += 0.3
    bpy.context.view_layer.update()
    assert not bpy.app.timers.is_registered(preview._tick)
    assert not world_sync.shows_live(scene)


def test_a_deleted_hole_or_camera_shows_no_older_map(scene, preview, world_sync, thumbnail, tmp_path) -> None:
    start(scene, preview)
    camera = scene.camera
    scene.camera = None
    settle_after_change(scene, preview)
    assert "has no camera" in preview.state(scene).problem
    assert not world_sync.shows_live(scene)
    assert thumbnail.icon(scene) == 0
    scene.camera = camera
    settle_after_change(scene, preview)
    assert preview.state(scene).problem == ""
    assert world_sync.shows_live(scene)
    bpy.data.objects.remove(scene.umbra.active_hole)
    settle_after_change(scene, preview)
    assert "no black hole" in preview.state(scene).problem
    assert not world_sync.shows_live(scene)
    bpy.data.objects.remove(camera)
    settle_after_change(scene, preview)


def settle_after_change(scene: bpy.types.Scene, preview: ModuleType) -> None:
    preview.on_update(scene, None)
    settle(preview)


def test_undo_and_redo_while_it_is_on(scene, preview, world_sync, physics, addon_module) -> None:
    start(scene, preview)
    bpy.ops.ed.undo_push(message="before")
    scene.camera.location.x = 2.0
    settle(preview)
    bpy.ops.ed.undo_push(message="moved")
    moved = shown(scene, world_sync)
    bpy.ops.ed.undo()
    settle(preview)
    scene = bpy.context.scene
    assert scene.camera.location.x == 0.0
    assert np.array_equal(shown(scene, world_sync), expected(scene, physics, addon_module))
    bpy.ops.ed.redo()
    settle(preview)
    assert np.array_equal(shown(bpy.context.scene, world_sync), moved)
    assert len([image for image in bpy.data.images if image.name.startswith("Umbra Live Map")]) <= 2


def test_a_file_is_saved_without_the_preview_and_opened_with_it(scene, preview, world_sync, tmp_path) -> None:
    start(scene, preview)
    path = str(tmp_path / "file.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    settle(preview)
    assert world_sync.shows_live(scene), "saving has ended the preview"
    copy = shutil.copy(path, tmp_path / "copy.blend")
    with bpy.data.libraries.load(str(copy)) as (found, _wanted):
        assert not [name for name in found.images if name.startswith("Umbra Live Map")]
        assert "Umbra World Map" in found.images
    bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    assert not world_sync.shows_live(scene)
    settle(preview)
    assert world_sync.shows_live(scene)


def test_each_scene_has_a_preview_of_its_own(scene, preview, world_sync, tmp_path, physics, addon_module) -> None:
    start(scene, preview)
    first = shown(scene, world_sync)
    bpy.ops.scene.new(type="FULL_COPY")
    other = bpy.context.scene
    assert other != scene
    other.umbra.live_preview = True
    other.camera.location.x = 3.0
    settle_after_change(other, preview)
    assert world_sync.shows_live(other)
    assert np.array_equal(shown(other, world_sync), expected(other, physics, addon_module))
    assert np.array_equal(shown(scene, world_sync), first)
    bpy.data.scenes.remove(other)
    settle_after_change(scene, preview)
    assert [each.name for each, _state in preview._states.items()] == [scene.name]


def test_switching_the_output_back_ends_the_preview_of_the_world(scene, preview, world_sync) -> None:
    images = {image.name for image in bpy.data.images}
    start(scene, preview)
    assert math.isfinite(preview.state(scene).latency)
    assert bpy.ops.umbra.set_output(output="COMPOSITOR") == {"FINISHED"}
    settle(preview)
    assert {image.name for image in bpy.data.images} == images
