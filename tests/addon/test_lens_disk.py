# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in front of the Cycles Lens: each pixel is numpy's disk over the same render without it.

LIGHT is that of the disk in front of a sky (`test_disk_rendering`).
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import compositor, links_of, render, run_python, shrink

LIGHT = 1e-4

pytestmark = pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene with a camera above the disk's plane, a World of one color, and maps of its own."""
    scene = bpy.context.scene
    shrink(scene, (96, 54))
    scene.umbra.map_folder = str(tmp_path / "maps")
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene.camera.location, scene.camera.rotation_euler = (0.0, -6.0, 1.5), (math.radians(76.0), 0.0, 0.0)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1.0, location=(2.0, 9.0, 0.5), segments=24, ring_count=12)
    return scene


def add_hole(scene: bpy.types.Scene, output: str = "CYCLES_LENS", **disk: object) -> bpy.types.Object:
    hole = bpy.data.objects.new("Hole", None)
    scene.collection.objects.link(hole)
    hole.umbra.is_black_hole = True
    hole.umbra.mass_scale = 0.12
    scene.umbra.active_hole = hole
    hole.umbra.disk.enabled = True
    for name, value in disk.items():
        setattr(hole.umbra.disk, name, value)
    if output == "CYCLES_LENS":
        assert bpy.ops.umbra.set_output(output=output) == {"FINISHED"}
    return hole


def expected_picture(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType], behind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The disk of the current frame over a picture, by numpy in float64, and the light of the disk in it."""
    physics = addon_module("core.physics_api").physics
    frame = addon_module("outputs.frames").read_at(scene, scene.frame_current)
    layer = physics.read_light_layer(addon_module("outputs.lens.lens_disk").request_of(scene, frame).path)
    light, through = layer.light.astype(np.float64), layer.transmittance[..., None].astype(np.float64)
    light *= 2.0**scene.umbra.active_hole.umbra.disk.exposure
    return np.concatenate([light, 1.0 - through], axis=-1) + through * behind, light


def assert_same(picture: np.ndarray, expected: np.ndarray, light: np.ndarray) -> None:
    brightest = light.max()
    assert (light.max(axis=-1) > 0.01 * brightest).mean() > 0.02, "there should be a disk in the picture"
    np.testing.assert_allclose(picture, expected, atol=LIGHT * max(brightest, 1.0))


def without_disk(scene: bpy.types.Scene, path: Path, exr: ModuleType) -> np.ndarray:
    """The same frame of the lens, compositing switched off."""
    scene.render.use_compositing = False
    try:
        return render(scene, path, exr)
    finally:
        scene.render.use_compositing = True


@pytest.mark.parametrize(
    "view", ["plain", "in_shader", "panorama", "percentage", "crop", "panorama_crop", "film", "samples", "foreground"]
)
def test_disk_is_in_front_of_what_the_lens_shows(scene, tmp_path, exr, addon_module, view) -> None:
    data, settings = scene.camera.data, scene.render
    data.shift_x, data.shift_y = 0.05, -0.03
    if view.startswith("panorama"):
        data.type = "PANO"
        owner = data if hasattr(data, "panorama_type") else data.cycles
        owner.panorama_type = "EQUIRECTANGULAR"
        owner.longitude_min, owner.longitude_max = -1.0, 1.2
        owner.latitude_min, owner.latitude_max = -0.7, 0.6
    if view == "percentage":
        settings.resolution_percentage = 60
    if view.endswith("crop"):
        settings.use_border, settings.use_crop_to_border = True, True
        settings.border_min_x, settings.border_max_x = 0.17, 0.83
        settings.border_min_y, settings.border_max_y = 0.22, 0.9
    if view == "film":
        settings.film_transparent = True
    if view == "samples":
        scene.umbra.supersampling = "2"
    if view == "foreground":
        bpy.ops.mesh.primitive_cube_add(size=0.25, location=(0.3, -4.0, 1.0))
    add_hole(scene)
    if view == "in_shader":
        scene.umbra.lens_rays = "IN_SHADER"
    behind = without_disk(scene, tmp_path / "without.exr", exr)
    if view == "foreground":
        assert bpy.ops.umbra.set_up_foreground() == {"FINISHED"}
    scene.frame_set(7)
    picture = render(scene, tmp_path / "picture.exr", exr)
    assert picture.shape == behind.shape
    expected, light = expected_picture(scene, addon_module, behind)
    if view == "film":
        assert behind[..., 3].min() == 0.0
    if view != "foreground":
        assert_same(picture, expected, light)
        return
    covered = np.abs(picture - expected).max(axis=-1) > LIGHT * light.max()
    assert 10 < covered.sum() < 500, "the cube covers a part of the disk, and nothing else differs"
    assert (light.max(axis=-1) > 0.1)[covered].sum() > 10
    assert bpy.ops.umbra.remove_foreground() == {"FINISHED"}
    assert_same(render(scene, tmp_path / "after.exr", exr), expected, light)


def state_of(scene: bpy.types.Scene, tree: bpy.types.NodeTree | None) -> dict[str, object]:
    """What the disk in a lens changes."""
    if bpy.app.version < (5, 0) and not scene.use_nodes:
        tree = None  # a scene's own tree cannot be removed, only switched off
    render_names = ("use_compositing", "compositor_precision", "compositor_device", "film_transparent")
    return {
        "links": None if tree is None else links_of(tree),
        "nodes": None if tree is None else sorted(node.name for node in tree.nodes),
        "drivers": 0 if tree is None or tree.animation_data is None else len(tree.animation_data.drivers),
        "use_nodes": bpy.app.version >= (5, 0) or scene.use_nodes,
        "groups": sorted(bpy.data.node_groups.keys()),
        "images": sorted(bpy.data.images.keys()),
        **{name: getattr(scene.render, name) for name in render_names if hasattr(scene.render, name)},
    }


def artists_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """A compositor in which the render goes through a glow to the output, and to a viewer."""
    tree = compositor(scene)
    layer = next(node for node in tree.nodes if node.type == "R_LAYERS")
    output = next(node for node in tree.nodes if node.type in ("COMPOSITE", "GROUP_OUTPUT"))
    glow, viewer = tree.nodes.new("CompositorNodeGlare"), tree.nodes.new("CompositorNodeViewer")
    tree.links.new(layer.outputs["Image"], glow.inputs["Image"])
    tree.links.new(glow.outputs["Image"], output.inputs[0])
    tree.links.new(layer.outputs["Image"], viewer.inputs[0])
    return tree


@pytest.mark.parametrize("own_tree", [False, True])
def test_switching_leaves_no_trace(scene, addon_module, own_tree) -> None:
    find_tree, in_use = (
        addon_module("outputs.shared.compositor_tree").find_tree,
        addon_module("outputs.lens.lens_disk").is_in_use,
    )
    scene.render.compositor_precision = "AUTO"
    if own_tree:
        artists_tree(scene)
    without = state_of(scene, find_tree(scene))
    hole = add_hole(scene)
    assert in_use(scene)
    scene.render.resolution_percentage = 50
    addon_module("outputs.refreshing").refresh_disk(scene)
    layer = addon_module("outputs.shared.compositor_tree").find_node(find_tree(scene), "disk_layer")
    assert "_48x27_light_" in layer.image.filepath
    hole.umbra.disk.enabled = False
    assert state_of(scene, find_tree(scene)) == without
    hole.umbra.disk.enabled = True
    hole.umbra.disk.crossings = 5
    assert in_use(scene)
    scene.umbra.output = "COMPOSITOR"
    assert state_of(scene, find_tree(scene)) == without


@pytest.mark.parametrize("own_tree", [False, True])
def test_the_bent_sky_and_its_disk_come_back(scene, addon_module, own_tree) -> None:
    find_tree = addon_module("outputs.shared.compositor_tree").find_tree
    if own_tree:
        artists_tree(scene)
    hole = add_hole(scene, output="COMPOSITOR")
    hole.umbra.disk.keyframe_insert("exposure", frame=1)
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    before = state_of(scene, find_tree(scene))
    assert before["drivers"] > 0
    for _ in range(2):
        scene.umbra.output = "CYCLES_LENS"
        assert addon_module("outputs.lens.lens_disk").is_in_use(scene)
        assert addon_module("outputs.shared.compositor_tree").find_setup(scene) is None
        scene.umbra.output = "COMPOSITOR"
        assert state_of(scene, find_tree(scene)) == before


@pytest.mark.parametrize("disk_first", [True, False])
def test_disk_and_foreground_share_the_compositor(scene, addon_module, disk_first) -> None:
    """Whichever goes first, the other stays, and when both are gone nothing is left."""
    find_tree, find_node = (
        addon_module("outputs.shared.compositor_tree").find_tree,
        addon_module("outputs.shared.compositor_tree").find_node,
    )
    bpy.ops.mesh.primitive_cube_add(size=0.25, location=(0.3, -4.0, 1.0))
    without = state_of(scene, find_tree(scene))
    hole = add_hole(scene)
    hole.umbra.disk.enabled = disk_first
    assert bpy.ops.umbra.set_up_foreground() == {"FINISHED"}
    hole.umbra.disk.enabled = True
    tree = find_tree(scene)
    over, disk = find_node(tree, "foreground_over"), find_node(tree, "disk")
    behind = over.inputs.get("Background") or next(each for each in over.inputs if each.type == "RGBA")
    assert behind.links[0].from_node == disk
    if disk_first:
        hole.umbra.disk.enabled = False
        assert behind.links[0].from_node.type == "R_LAYERS"
        assert bpy.ops.umbra.remove_foreground() == {"FINISHED"}
    else:
        assert bpy.ops.umbra.remove_foreground() == {"FINISHED"}
        assert addon_module("outputs.lens.lens_disk").is_in_use(scene)
        hole.umbra.disk.enabled = False
    assert state_of(scene, find_tree(scene)) == without


def test_animation_in_background_bakes_or_takes_what_is_baked(scene, tmp_path, exr, addon_module) -> None:
    """Two frames of a moving camera and a spin with keyframes, rendered as on a farm, with No Bake too."""
    hole = add_hole(scene)
    scene.umbra.map_folder = "//maps/"
    for frame, height, spin in ((1, 1.5, 0.3), (2, 1.2, 0.95)):
        scene.camera.location.z = height
        scene.camera.keyframe_insert("location", frame=frame)
        hole.umbra.spin = spin
        hole.keyframe_insert("umbra.spin", frame=frame)
    scene.frame_start, scene.frame_end = 1, 2
    blend = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    baked = {path: path.stat().st_mtime_ns for path in (tmp_path / "maps").iterdir()}
    assert len(baked) == 2 * 2
    scene.render.filepath = str(tmp_path / "frame_####.exr")
    bpy.ops.render.render(animation=True)
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "maps").iterdir()} == baked
    pictures = []
    for frame in (1, 2):
        scene.frame_set(frame)
        behind = without_disk(scene, tmp_path / "without.exr", exr)
        pictures.append(exr.read_exr(tmp_path / f"frame_{frame:04d}.exr")[0])
        assert_same(pictures[-1], *expected_picture(scene, addon_module, behind))
    assert np.abs(pictures[0] - pictures[1]).max() > 0.1
    for path in baked:
        path.unlink()
    done = run_python(
        f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r})\n"
        "scene = bpy.context.scene\n"
        "scene.umbra.lens_rays = 'IN_SHADER'\n"
        f"scene.render.filepath = {str(tmp_path / 'farm_####.exr')!r}\n"
        "bpy.ops.render.render(animation=True)\n"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for frame, picture in zip((1, 2), pictures, strict=True):
        there, _ = exr.read_exr(tmp_path / f"farm_{frame:04d}.exr")
        # the shader's own rays are single precision; see `test_lens`
        assert np.abs(there - picture).mean() < 2e-3


def test_a_missing_layer_ends_the_process(scene, tmp_path) -> None:
    add_hole(scene)
    scene.umbra.auto_bake = False
    scene.umbra.lens_rays = "IN_SHADER"
    blend = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    done = run_python(
        f"bpy.ops.wm.open_mainfile(filepath={str(blend)!r})\n"
        f"bpy.context.scene.render.filepath = {str(tmp_path / 'picture.exr')!r}\n"
        "bpy.ops.render.render(write_still=True)\n"
    )
    assert done.returncode == 1
    assert "is missing: bake it" in done.stderr
    assert not (tmp_path / "picture.exr").exists()


def test_what_is_not_drawn_right_is_named(scene, addon_module) -> None:
    hole = add_hole(scene)
    depsgraph = bpy.context.evaluated_depsgraph_get()

    def warnings() -> list[str]:
        depsgraph.update()
        return addon_module("outputs.lens.lens_objects").warnings(
            scene, depsgraph, addon_module("scene.frame_setup").read(scene, depsgraph)
        )

    assert warnings() == []
    scene.render.use_compositing = False
    assert [each[:33] for each in warnings()] == ['The disk of "Hole" is not drawn: ']
    scene.render.use_compositing = True
    bpy.ops.mesh.primitive_cube_add(size=0.2, location=(0.0, 2.5, 0.0))
    hole.umbra.disk.outer_radius = 30.0
    assert [each.partition(":")[0] for each in warnings()] == [
        '"Cube" stands beyond the lens sphere and within the disk\'s outer edge'
    ]


def test_verify_and_clean_know_the_layer_beside_the_exit_map(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    frames, baking = addon_module("outputs.frames"), addon_module("bake.baking")
    add_hole(scene)
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    listing = baking.drain(frames.examine(scene, [scene.frame_current]))
    assert listing.complete
    folder = addon_module("bake.folder").folder(scene).path
    (disk,) = folder.glob("*_light_*.exr")
    assert listing.frames[0].size == sum(each.stat().st_size for each in folder.glob("*.exr"))
    disk.write_bytes(disk.read_bytes()[:-100])
    listing = baking.drain(frames.examine(scene, [scene.frame_current]))
    assert not listing.complete
    assert listing.frames[0].path == disk
    removed = baking.drain(frames.clean(scene, [scene.frame_current])).removed
    assert [each.path for each in removed] == [disk]
    assert list(folder.glob("*_exit_*.exr"))


def test_the_command_bakes_the_disk_of_a_lens_without_maps(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene)
    scene.umbra.lens_rays = "IN_SHADER"
    assert addon_module("command.command_line").run(["bake", f"--frames={scene.frame_current}"]) == 0
    assert list((tmp_path / "maps").glob("*_light_*.exr"))


def test_names_that_look_like_an_exit_maps(scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]) -> None:
    names, kinds = addon_module("bake.names"), addon_module("bake.kinds")
    scene.name = "Airlock_exit_corridor"
    shot = names.shot_name(scene, "Hole")
    pattern = names.name_pattern(shot)
    warp_map = pattern.fullmatch(f"{shot}_64x36_0001.exr")
    exit_map = pattern.fullmatch(f"{shot}_64x36_0001_exit_0123456789ab.exr")
    assert names.kind_of(warp_map) is kinds.WARP_MAP
    assert names.kind_of(exit_map) is kinds.EXIT_MAP
