# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewport's compositor without a window: Blender's updates call the handlers, which are told that there is one.

A viewport cannot be drawn here; what it would draw is the compositor of the scene with the images that it reads.
"""

import dataclasses
import math
from collections.abc import Callable
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, render

pytestmark = pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")

MASS = 0.2
PLACE, TILT = (0.0, -6.0, 1.0), 1.42


@pytest.fixture
def viewport(addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module, as if there were a window; timers do not fire in background, so tests call `settle`."""
    live_preview = addon_module("preview.live_preview")
    module = addon_module("preview.viewport")
    module.forget()
    live_preview.forget()
    monkeypatch.setattr(live_preview, "can_run", lambda: not live_preview._suspended.now)
    monkeypatch.setattr(module, "LONGEST", math.inf)  # the machine may be busy
    monkeypatch.setattr(module, "REST", 0.0)
    monkeypatch.setattr(module, "PAUSE_OF_DISK", 0.0)
    yield module
    module.forget()
    live_preview.forget()


@pytest.fixture
def hole(scene: bpy.types.Scene, viewport: ModuleType) -> bpy.types.Object:
    """A hole at the origin, seen by the scene's camera in a viewport that follows."""
    scene.camera.location, scene.camera.rotation_euler = PLACE, (TILT, 0.0, 0.0)
    made = add_hole(scene, spin=0.9, mass_scale=MASS)
    made.location = (0.0, 0.0, 0.0)
    assert press() == {"FINISHED"}
    viewport.advance(0.0)
    return made


def area() -> bpy.types.Area:
    return next(each for each in bpy.context.screen.areas if each.type == "VIEW_3D")


def press(kind: str = "VIEW_3D") -> set[str]:
    """Press the button in the viewport, or in another editor."""
    where = next(each for each in bpy.context.screen.areas if each.type == kind)
    with bpy.context.temp_override(area=where):
        return bpy.ops.umbra.show_in_viewport()


def settle(viewport: ModuleType) -> None:
    """Let things rest."""
    bpy.context.view_layer.update()
    for _ in range(1000):
        if viewport.advance(1.0) is None:
            return
    raise AssertionError("the viewport goes on and on")


def update() -> None:
    """What Blender does before each draw."""
    bpy.context.view_layer.update()


def node(scene: bpy.types.Scene, role: str = "map") -> bpy.types.Node:
    tree = scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group
    return next(each for each in tree.nodes if each.get("umbra_role") == role)


def pixels(image: bpy.types.Image) -> np.ndarray:
    """An image's pixels, row 0 at the top."""
    width, height = image.size
    flat = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(height, width, 4)[::-1]


def panel(addon_module: Callable[[str], ModuleType]) -> str:
    """What the panel says."""
    return " ".join(line.text for line in addon_module("ui.status").lines(bpy.context))


def by_hand(scene: bpy.types.Scene, exr: ModuleType, size: tuple[int, int], *, spin: float = 0.9, disk: object = None):
    """Every pixel of the scene's map traced, of a camera that is only tilted about x, for a hole at the origin."""
    tilt = scene.camera.rotation_euler.x
    up, back = (0.0, math.cos(tilt), math.sin(tilt)), (0.0, -math.sin(tilt), math.cos(tilt))
    parameters = exr.WarpMapParameters(
        spin=spin,
        camera=exr.PerspectiveCamera(*size, focal_length=scene.camera.data.lens),
        camera_position=tuple(each / MASS for each in scene.camera.location),
        camera_to_hole=((1.0, up[0], back[0]), (0.0, up[1], back[1]), (0.0, up[2], back[2])),
        interpolation=0.0,
        disk=disk,
    )
    return exr.bake(parameters)


def directions(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def agrees(shown: np.ndarray, made: object) -> bool:
    """Whether an image is a map: directions to what the draft is allowed, but for a few pixels beside the shadow."""
    assert shown.shape[:2] == made.theta.shape
    sky = np.minimum(shown[..., 3], made.visibility) == 1.0
    off = np.linalg.norm(directions(shown[..., 0], shown[..., 1]) - directions(made.theta, made.phi), axis=-1)
    dark = np.abs(shown[..., 3] - made.visibility)
    return bool(np.quantile(off[sky], 0.98) < 3e-3 and dark.max() < 0.05 and (made.visibility == 0.0).sum() > 5)


def test_the_map_follows_in_the_update_itself(scene, hole, viewport, exr) -> None:
    size = (64, 36)
    assert agrees(pixels(node(scene).image), by_hand(scene, exr, size))
    scene.camera.location.x = 1.5
    update()
    image = node(scene).image
    assert agrees(pixels(image), by_hand(scene, exr, size))
    hole.umbra.spin = 0.1
    update()
    assert agrees(pixels(image), by_hand(scene, exr, size, spin=0.1))
    assert not agrees(pixels(image), by_hand(scene, exr, size, spin=0.9))
    assert node(scene).image == image, "each change makes an image of its own"
    scene.camera.keyframe_insert("location", frame=1)
    scene.camera.location.x = -2.0
    scene.camera.keyframe_insert("location", frame=2)
    scene.frame_set(2)
    assert agrees(pixels(image), by_hand(scene, exr, size, spin=0.1))


def test_the_map_that_follows_is_small_and_the_one_at_rest_full(scene, hole, viewport, exr) -> None:
    scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
    update()
    assert tuple(node(scene).image.size) == (480, 270)
    scene.render.resolution_x, scene.render.resolution_y = 500, 1000
    update()
    assert tuple(node(scene).image.size) == (255, 509)
    settle(viewport)
    assert tuple(node(scene).image.size) == (500, 1000)


def test_on_a_slow_machine_the_map_has_fewer_pixels(scene, hole, viewport, monkeypatch) -> None:
    scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
    sizes = []
    for longest in (1e-9, 1e-9, math.inf, math.inf):
        monkeypatch.setattr(viewport, "LONGEST", longest)
        scene.camera.location.x += 0.1
        update()
        sizes.append(tuple(node(scene).image.size))
    assert sizes == [(480, 270), (320, 180), (320, 180), (351, 197)]


def test_what_is_traced_once_is_not_traced_again(scene, hole, viewport, monkeypatch) -> None:
    traced = []
    monkeypatch.setattr(viewport.physics, "bake", traced.append)
    bpy.data.objects["Light"].location.x += 1.0
    scene.umbra.redshift_color = 0.5  # the nodes are given their files
    update()
    assert traced == []
    assert node(scene).image.source == "GENERATED"


def test_the_disk_follows_when_the_change_pauses(scene, hole, viewport, exr, monkeypatch, addon_module) -> None:
    hole.umbra.disk.enabled = True
    hole.umbra.disk.crossings = 1
    update()
    assert not viewport.disk_lags(scene), "the first disk would be magenta"
    settle(viewport)
    before = pixels(node(scene, "disk_layer").image)
    scene.camera.location = (0.0, -5.0, 2.0)
    update()
    assert np.array_equal(pixels(node(scene, "disk_layer").image), before)
    assert viewport.disk_lags(scene)
    assert "The viewport's disk is of an earlier state" in panel(addon_module)
    made = by_hand(scene, exr, (64, 36), disk=exr.Disk(crossings=1, outer_radius=18.0))
    view = exr.WarpMapParameters.from_metadata(made.metadata["parameters"])
    light = addon_module("outputs.frames").read_at(scene, scene.frame_current).light
    layer = exr.render_matter(dataclasses.replace(light, view=view), exr.DiskPasses.of(made))
    for rest, tolerance in ((math.inf, 0.05), (0.0, 5e-3)):
        monkeypatch.setattr(viewport, "REST", rest)
        viewport.advance(10.0)
        assert not viewport.disk_lags(scene)
        after = pixels(node(scene, "disk_layer").image)
        assert (layer.transmittance < 0.7).sum() > 100
        assert np.abs(after[..., :3] - layer.light).sum() < tolerance * layer.light.sum()
        assert np.abs(after[..., 3] - layer.transmittance).mean() < tolerance
        assert agrees(pixels(node(scene).image), made)
    assert viewport.state(scene).shows is viewport.Shows.FULL
    assert "disk is of" not in panel(addon_module)
    assert "traced in memory and not baked" in panel(addon_module)
    area().spaces.active.use_local_camera = True
    area().spaces.active.camera = bpy.data.objects["Light"]
    assert "local camera" in panel(addon_module)


def test_a_baked_frame_is_read_from_its_file(scene, hole, viewport) -> None:
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    settle(viewport)
    assert node(scene).image.source == "SEQUENCE"
    scene.camera.location.x = 1.0
    update()
    assert node(scene).image.source == "GENERATED"
    scene.camera.location.x = 0.0
    update()
    settle(viewport)
    assert node(scene).image.source == "SEQUENCE"
    scene.camera.keyframe_insert("location", frame=1)
    scene.camera.location.x = 1.0
    scene.camera.keyframe_insert("location", frame=2)
    for frame, source in ((2, "GENERATED"), (1, "SEQUENCE")):
        scene.frame_set(frame)  # without rest: as it is played
        assert node(scene).image.source == source


def test_a_render_reads_the_file(scene, hole, viewport, exr, tmp_path) -> None:
    scene.camera.location.x = 1.0
    settle(viewport)
    live = node(scene).image
    live.pixels.foreach_set(np.ones(len(live.pixels), np.float32))  # the picture would be of one color
    beside = render(scene, tmp_path / "beside.exr", exr)
    settle(viewport)
    assert press() == {"FINISHED"}
    assert bpy.app.timers.is_registered(viewport._tick)
    viewport.advance(0.0)
    assert not [each.name for each in bpy.data.images if each.name.startswith("Umbra Live")]
    assert np.array_equal(beside, render(scene, tmp_path / "alone.exr", exr))
    assert beside[..., :3].std() > 0.05


def test_a_saved_file_has_no_live_map_and_goes_on(scene, hole, viewport, tmp_path) -> None:
    settle(viewport)
    hole.umbra.disk.enabled = True
    settle(viewport)
    bpy.ops.ed.undo_push(message="before")
    scene.camera.location.x = 1.0
    update()
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    settle(viewport)
    shown = pixels(node(scene).image)
    path = str(tmp_path / "file.blend")
    drawn = []

    def thumbnail(*_given: object) -> None:  # in a window Blender draws the scene for it, after all handlers
        scene.camera.update_tag()
        update()
        drawn.append(node(scene).image.source)

    bpy.app.handlers.save_pre.append(thumbnail)
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    assert node(scene).image.source == node(scene, "disk_layer").image.source == "GENERATED"
    assert np.array_equal(pixels(node(scene).image), shown), "saving has dropped the map"
    with pytest.raises(RuntimeError):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "no" / "file.blend"), copy=True)
    assert node(scene).image.source == "GENERATED"
    assert set(drawn) == {"SEQUENCE"}
    bpy.app.handlers.save_pre.remove(thumbnail)
    with bpy.data.libraries.load(path) as (found, _wanted):
        assert not [name for name in found.images if name.startswith("Umbra Live")]
        assert "Umbra Warp Map" in found.images


def test_a_file_that_blender_saves_by_itself_is_given_its_files(scene, hole, viewport, tmp_path, monkeypatch) -> None:
    path = str(tmp_path / "file.blend")
    monkeypatch.setattr(viewport, "before_saving", lambda: None)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    monkeypatch.undo()  # there is no window either
    bpy.ops.wm.open_mainfile(filepath=path)
    image = node(bpy.context.scene).image
    assert image.source == "SEQUENCE"
    assert bpy.path.basename(image.filepath).startswith("file_Scene_Black_Hole")
    assert not [each.name for each in bpy.data.images if each.name.startswith("Umbra Live")]


def test_undo_and_redo(scene, hole, viewport, exr) -> None:
    update()
    bpy.ops.ed.undo_push(message="before")
    scene.camera.location.x = 2.0
    update()
    bpy.ops.ed.undo_push(message="moved")
    for step, x in ((bpy.ops.ed.undo, 0.0), (bpy.ops.ed.redo, 2.0)):
        step()
        scene = bpy.context.scene
        update()
        assert scene.camera.location.x == x
        assert agrees(pixels(node(scene).image), by_hand(scene, exr, (64, 36)))


def test_a_hidden_hole_bends_nothing_and_no_camera_is_magenta(scene, hole, viewport) -> None:
    hole.hide_render = True
    update()
    shown = pixels(node(scene).image)
    camera = scene.camera
    corners = [
        camera.matrix_world.to_3x3() @ each for each in camera.data.view_frame(scene=scene)
    ]  # from the top right
    across = np.array(corners[0] - corners[3]) / 64
    down = np.array(corners[1] - corners[0]) / 36
    first = np.array(corners[3]) + 0.5 * across + 0.5 * down
    i, j = np.meshgrid(np.arange(64), np.arange(36))
    expected = first + i[..., None] * across + j[..., None] * down
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(directions(shown[..., 0], shown[..., 1]), expected, atol=1e-5)
    assert (shown[..., 2:] == 1.0).all()
    hole.hide_render = False
    scene.camera = None
    update()
    assert bpy.path.basename(node(scene).image.filepath) == "no_warp_map_0001.exr"
    scene.camera = camera
    update()
    assert node(scene).image.source == "GENERATED"


def test_the_button_gives_the_viewport_back(scene, viewport) -> None:
    space = area().spaces.active
    space.shading.type = "SOLID"
    before = space.shading.type, space.shading.use_compositor, space.region_3d.view_perspective
    with pytest.raises(RuntimeError, match="Set Up Compositor"):
        press()
    assert (space.shading.type, space.shading.use_compositor, space.region_3d.view_perspective) == before
    add_hole(scene)
    turned = space.region_3d.view_rotation.copy()
    assert press("PROPERTIES") == {"FINISHED"}
    assert (space.shading.type, space.shading.use_compositor) == ("RENDERED", "CAMERA")
    assert space.region_3d.view_perspective == "CAMERA"
    assert press() == {"FINISHED"}
    assert (space.shading.type, space.shading.use_compositor, space.region_3d.view_perspective) == before
    assert space.region_3d.view_rotation == turned
    space.shading.type = "MATERIAL"
    assert press() == {"FINISHED"}
    assert space.shading.type == "MATERIAL"


def test_without_a_viewport_that_shows_it_nothing_is_traced(scene, hole, viewport) -> None:
    area().spaces.active.shading.type = "SOLID"
    scene.camera.location.x = 1.0
    settle(viewport)
    assert viewport.state(scene) is None
    assert node(scene).image.source == "SEQUENCE"
    assert bpy.ops.umbra.remove_compositor() == {"FINISHED"}
    assert not [each.name for each in bpy.data.images if each.name.startswith("Umbra")]
