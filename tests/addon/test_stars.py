# SPDX-License-Identifier: GPL-3.0-or-later
"""Stars as points in the compositor's picture: added to the sky, of its rotation and exposure, and under the scene."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from compositor_scene import GroupRenderer
from small_scene import add_hole, compositor, find_map, read, render

import physics
from physics.reference import reference_render

OLD_FILE = Path(__file__).resolve().parents[1] / "data" / "saved_files" / "0.1.0.blend"

# Of the brightest pixel: single precision in a few operations.
TOLERANCE = 1e-5
# Of the larger of pixel and mean light: the Milky Way is in half precision, with steps of 0.8 %.
OF_THE_SKY = 1e-2


def ours(scene: bpy.types.Scene) -> dict[str, bpy.types.Node]:
    """The add-on's nodes by their roles."""
    return {node["umbra_role"]: node for node in compositor(scene).nodes if "umbra_role" in node}


def layer_of(scene: bpy.types.Scene, frame: int = 1) -> physics.StarLayer:
    width, height = scene.render.resolution_x, scene.render.resolution_y
    name = f"Scene_Black_Hole_{width}x{height}_stars_{frame:04d}.exr"
    return physics.read_stars(find_map(Path(scene.umbra.map_folder), name))


def map_of(scene: bpy.types.Scene, frame: int = 1) -> physics.WarpMap:
    width, height = scene.render.resolution_x, scene.render.resolution_y
    return physics.read_warp_map(
        find_map(Path(scene.umbra.map_folder), f"Scene_Black_Hole_{width}x{height}_{frame:04d}.exr")
    )


def plain_sky(value: float) -> bpy.types.Image:
    """A sky that looks the same in all directions, whatever is done to it."""
    image = bpy.data.images.new("Even Sky", 8, 4, float_buffer=True)
    image.pixels.foreach_set(np.full(8 * 4 * 4, value, np.float32))
    image.pack()
    return image


@pytest.fixture
def over_own_sky(scene: bpy.types.Scene) -> bpy.types.Scene:
    """Points over a black panorama."""
    scene.umbra.environment_image, scene.umbra.environment_source = plain_sky(0.0), "IMAGE"
    add_hole(scene, sky=False)
    scene.umbra.stars = "ON"
    return scene


def test_the_built_in_sky_has_its_stars_as_points_and_not_twice(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType
) -> None:
    add_hole(scene, sky=False)
    assert scene.umbra.environment_image.name == "Umbra Star Sky"
    assert ours(scene)["sky"].image.name == "Umbra Milky Way"
    picture = render(scene, tmp_path / "picture.exr", exr)[..., :3]
    layer = layer_of(scene)
    gain = 2.0 ** ours(scene)["group"].inputs["Exposure"].default_value
    assert gain > 1.0
    sky = reference_render.render(map_of(scene), physics.milky_way_sky(1024)).sky[..., :3] * gain
    stars = layer.image * gain
    error = np.abs(picture - sky - stars) / np.maximum(sky + stars, sky.mean())
    assert np.quantile(error, 0.99) < OF_THE_SKY
    assert stars.sum() > 0.2 * sky.sum()
    chosen = physics.load_stars()
    assert layer.counts["stars"] == len(chosen.flux)
    # Fainter ones are in neither.
    scene.umbra.star_limit = 3.0
    picture = render(scene, tmp_path / "picture.exr", exr)[..., :3]
    assert layer_of(scene).counts["stars"] == np.count_nonzero(chosen.magnitude <= 3.0)
    error = np.abs(picture - sky - layer_of(scene).image * gain) / np.maximum(sky, sky.mean())
    assert np.quantile(error, 0.99) < OF_THE_SKY
    # Without points the texture has the stars again, and nothing is baked.
    scene.umbra.stars = "OFF"
    assert ours(scene)["sky"].image.name == "Umbra Star Sky"
    assert "stars" not in ours(scene)
    scene.umbra.stars = "AUTO"
    assert ours(scene)["sky"].image.name == "Umbra Milky Way"
    bpy.ops.umbra.set_output(output="WORLD")
    assert all(
        node.image.name != "Umbra Milky Way" for node in scene.world.node_tree.nodes if node.type == "TEX_ENVIRONMENT"
    )


def test_points_follow_an_animated_rotation_in_step(over_own_sky: bpy.types.Scene, tmp_path: Path) -> None:
    """In an animation, from another frame than the current one, on the sky's own keyframes."""
    scene = over_own_sky
    group = ours(scene)["group"]
    rotation = group.inputs["Environment Rotation"]
    group.inputs["Redshift Color"].default_value = 0.25
    for frame, angle in ((1, 0.0), (3, 0.4)):
        rotation.default_value = (0.1, 0.0, angle)
        rotation.keyframe_insert("default_value", frame=frame)
    scene.frame_set(1)
    scene.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    turned = []
    for frame in (1, 2, 3):
        layer, picture = layer_of(scene, frame), read(tmp_path / f"frame_{frame:04d}.exr", physics)
        turned.append(layer.metadata["stars"]["rotation"][2])
        assert layer.metadata["stars"]["color_amount"] == 0.25
        np.testing.assert_allclose(picture[..., :3], layer.image, atol=TOLERANCE * layer.image.max())
        assert layer.image.max() > 0.0
    assert turned == pytest.approx([0.0, 0.2, 0.4], abs=1e-6)
    # The bake of any frame asks for the same layers: all are there.
    times = [path.stat().st_mtime_ns for path in sorted(Path(scene.umbra.map_folder).glob("*_stars_*.exr"))]
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    assert [path.stat().st_mtime_ns for path in sorted(Path(scene.umbra.map_folder).glob("*_stars_*.exr"))] == times


def test_a_catalog_of_ones_own_under_the_scene(over_own_sky: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    scene = over_own_sky
    table = tmp_path / "stars.csv"
    many = np.random.default_rng(1)
    longitude, height = many.uniform(0.0, 360.0, 500), np.degrees(np.arcsin(many.uniform(-1.0, 1.0, 500)))
    table.write_text("\n".join(f"{a:.4f},{d:.4f},1.0,0.6" for a, d in zip(longitude, height, strict=True)))
    scene.umbra.star_catalog = str(table)
    group = ours(scene)["group"]
    bare = render(scene, tmp_path / "bare.exr", exr)[..., :3]
    layer = layer_of(scene)
    assert layer.counts["stars"] == 500
    assert layer.metadata["stars"]["catalog"] == "stars.csv"
    np.testing.assert_allclose(bare, layer.image, atol=TOLERANCE * layer.image.max())
    # Brightness and exposure do not bake anything; strength counts as for the sky.
    group.inputs["Exposure"].default_value, group.inputs["Star Brightness"].default_value = 1.0, -3.0
    group.inputs["Environment Strength"].default_value = 2.0
    dimmed = render(scene, tmp_path / "dimmed.exr", exr)[..., :3]
    np.testing.assert_allclose(dimmed, 0.5 * bare, atol=TOLERANCE * layer.image.max())
    # What is in front covers them by its alpha.
    bpy.ops.mesh.primitive_plane_add(size=1.2, location=scene.camera.location * 0.5)
    plane = bpy.context.object
    plane.rotation_euler = scene.camera.rotation_euler
    picture = render(scene, tmp_path / "covered.exr", exr)
    tree = compositor(scene)
    tree.links.new(next(n for n in tree.nodes if n.type == "R_LAYERS").outputs["Image"], output_of(tree))
    front = render(scene, tmp_path / "front.exr", exr)
    assert front[..., 3].max() == 1.0
    expected = front[..., :3] + (1.0 - front[..., 3:]) * dimmed
    np.testing.assert_allclose(picture[..., :3], expected, atol=TOLERANCE * layer.image.max())
    assert dimmed[front[..., 3] == 1.0].max() > 0.0
    # Another content makes the layer stale, and a catalog that cannot be read is an error.
    table.write_text("10,20,1,0.6\n")
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    assert layer_of(scene).counts["stars"] == 1
    table.unlink()
    with pytest.raises(RuntimeError, match=r"star catalog .* does not exist"):
        bpy.ops.umbra.bake_frame()


def output_of(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    return next(node for node in tree.nodes if node.type in ("COMPOSITE", "GROUP_OUTPUT")).inputs[0]


def test_a_missing_layer_is_magenta_and_samples_do_not_matter(
    over_own_sky: bpy.types.Scene, tmp_path: Path, exr: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    scene = over_own_sky
    render(scene, tmp_path / "picture.exr", exr)
    before = layer_of(scene)
    scene.umbra.supersampling, scene.umbra.quality = "2", "DRAFT"
    (path,) = Path(scene.umbra.map_folder).glob("*_stars_*.exr")
    time = path.stat().st_mtime_ns
    picture = render(scene, tmp_path / "picture.exr", exr)
    assert path.stat().st_mtime_ns == time
    np.testing.assert_allclose(picture[..., :3], before.image, atol=TOLERANCE * before.image.max())
    # A frame that is checked while it has no layer, and a Blender that has not got the add-on.
    scene.umbra.auto_bake = False
    path.unlink()
    handlers = addon_module("render.handlers")
    names = ("render_init", "render_pre", "frame_change_post", "render_post", "render_complete")
    taken = [
        (name, each)
        for name in names
        for each in getattr(bpy.app.handlers, name)
        if each.__module__ == handlers.__name__
    ]
    for name, each in taken:
        getattr(bpy.app.handlers, name).remove(each)
    try:
        picture = render(scene, tmp_path / "picture.exr", exr)
    finally:
        for name, each in taken:
            getattr(bpy.app.handlers, name).append(each)
    np.testing.assert_array_equal(picture[..., :3], np.broadcast_to((1.0, 0.0, 1.0), picture[..., :3].shape))


def test_the_viewport_leaves_points_out_while_it_shows_maps_in_memory(
    over_own_sky: bpy.types.Scene, tmp_path: Path, exr: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    scene = over_own_sky
    maps = addon_module("outputs.registry").of(scene).viewport
    frames = addon_module("outputs.frames")
    layer = scene.view_layers[0]
    layer.update()
    view = frames.read(scene, layer.depsgraph)
    assert view.star_settings is not None
    maps.show(scene, exr.bake(view.parameters))
    node = ours(scene)["stars"]
    assert tuple(node.image.size) == (1, 1)
    assert list(node.image.pixels) == [0.0, 0.0, 0.0, 1.0]
    maps.drop(scene)
    assert node.image.source == "SEQUENCE"
    assert render(scene, tmp_path / "picture.exr", exr)[..., :3].max() > 0.0


def test_files_of_before_keep_the_stars_in_their_texture(
    tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(OLD_FILE))
    scene = bpy.context.scene
    assert scene.umbra.stars == "OFF"
    assert "Stars" in ours(scene)["group"].inputs
    bpy.ops.wm.read_homefile(use_empty=False)
    scene = bpy.context.scene
    add_hole(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "new.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "new.blend"))
    assert bpy.context.scene.umbra.stars == "AUTO"


def test_a_farm_copy_brings_the_catalog_along(over_own_sky: bpy.types.Scene, tmp_path: Path) -> None:
    scene = over_own_sky
    table = tmp_path / "elsewhere" / "bright.csv"
    table.parent.mkdir()
    table.write_text("10,20,1,0.6\n")
    (tmp_path / "shot").mkdir()
    scene.umbra.star_catalog, scene.umbra.map_folder = str(table), "//maps/"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot" / "shot.blend"))
    assert bpy.ops.umbra.save_farm_copy() == {"FINISHED"}
    assert scene.umbra.star_catalog == str(table)
    table.unlink()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot" / "shot_farm.blend"))
    scene = bpy.context.scene
    assert scene.umbra.star_catalog == "//shot_farm_bright.csv"
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    (path,) = (tmp_path / "shot" / "maps").glob("*_stars_0001.exr")
    assert physics.read_stars(path).counts["stars"] == 1


def test_a_layer_of_another_size_fills_the_picture(addon_module: Callable[[str], ModuleType], tmp_path: Path) -> None:
    """As in the viewport, whose maps in memory come with a single pixel without stars."""
    group = GroupRenderer(addon_module("nodes.black_hole_group"), tmp_path)
    flat = np.full((9, 16, 4), (1.0, 2.0, 1.0, 1.0), np.float32)
    sky = np.full((2, 4, 4), 0.5, np.float32)
    for light in (0.0, 0.25):
        stars = np.full((1, 1, 4), (light, light, light, 1.0), np.float32)
        picture = group.render((16, 9), warp_map=flat, environment=sky, stars=stars)
        np.testing.assert_allclose(picture[..., :3], 0.5 + light, atol=1e-6)
