# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that earlier versions of the add-on saved: opened, brought up to date, and rendered as they were."""

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from compositor_scene import MapArrays
from saved_scene import (
    ARTISTS_NODE,
    GROUP,
    HOLE,
    PLAIN_COLOR,
    PLAIN_STRENGTH,
    ROTATION,
    SCENE,
    SIZE,
    build,
    build_world,
    compositor_of,
    sky_pixels,
)
from small_scene import render

import physics
from physics.images import exr
from physics.reference import reference_render

SAVED = Path(__file__).resolve().parents[1] / "data" / "saved_files"
FILES = [path for path in sorted(SAVED.glob("*.blend")) if not path.stem.startswith(("animated", "world"))]

# What group_1 is: the first whole version of the add-on, whose node group had no input for a disk.
FIRST = SAVED / "group_1.blend"
LATEST = SAVED / "0.1.0.blend"
WORLD = SAVED / "world_3.blend"

LARGEST_FILE = 400_000
MACHINE_PATH = re.compile(rb"(?:/home/|/Users/|/work/|/var/|/opt/|[A-Z]:\\Users)[ -~]*")


def opened(path: Path, tmp_path: Path) -> bpy.types.Scene:
    """The scene of a file, with maps of its own folder: nothing is written beside the fixture."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


def group_of(scene: bpy.types.Scene) -> bpy.types.Node:
    (found,) = [node for node in compositor_of(scene).nodes if node.get("umbra_role") == "group"]
    return found


def links_of(scene: bpy.types.Scene) -> set[tuple[str, str, str, str]]:
    return {
        (link.from_node.bl_idname, link.from_socket.name, link.to_node.bl_idname, link.to_socket.name)
        for link in compositor_of(scene).links
    }


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_settings_and_links_are_kept_and_groups_brought_up_to_date(
    addon_module: Callable[[str], ModuleType], tmp_path: Path, path: Path
) -> None:
    scene = opened(path, tmp_path)
    hole = scene.umbra.active_hole
    assert {name: getattr(hole.umbra, name) for name in HOLE} == pytest.approx(HOLE)
    assert {name: getattr(scene.umbra, name) for name in SCENE} == SCENE
    group = group_of(scene)
    assert {name: group.inputs[name].default_value for name in GROUP} == pytest.approx(GROUP)
    assert tuple(group.inputs["Environment Rotation"].default_value) == pytest.approx(ROTATION)
    node_group = addon_module("nodes.black_hole_group")
    assert node_group.is_current(group.node_tree)
    assert group.node_tree[node_group.VERSION_KEY] == node_group.GROUP_VERSION
    assert [tree.name for tree in bpy.data.node_groups if node_group.is_group(tree)] == [node_group.GROUP_NAME]
    assert "Disk" in group.inputs
    links = links_of(scene)
    assert ("CompositorNodeRLayers", "Image", "CompositorNodeGroup", "Render") in links
    assert ("CompositorNodeGroup", "Image", "CompositorNodeExposure", "Image") in links
    assert compositor_of(scene).nodes[ARTISTS_NODE].outputs["Image"].is_linked
    # Opened once more after saving, nothing changes any more.
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "again.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "again.blend"))
    assert links_of(bpy.context.scene) == links
    assert node_group.is_current(group_of(bpy.context.scene).node_tree)


def test_the_first_version_really_is_of_another_group(addon_module: Callable[[str], ModuleType]) -> None:
    """Without this the test above might test nothing: what the file itself holds, without its handlers."""
    with bpy.data.libraries.load(str(FIRST)) as (source, target):
        target.node_groups = [name for name in source.node_groups if name.startswith("Umbra Black Hole")]
        target.scenes = source.scenes[:1] if not target.node_groups else []
    groups = [tree for tree in bpy.data.node_groups if "umbra_version" in tree]
    assert [tree["umbra_version"] for tree in groups] == [1]
    assert not any(item.name == "Disk" for item in groups[0].interface.items_tree)
    assert addon_module("nodes.black_hole_group").GROUP_VERSION > 1


def test_the_first_version_renders_as_numpy_does(tmp_path: Path) -> None:
    """Every pixel, against the reference in float64 from the map that is baked and the sky that is packed."""
    scene = opened(FIRST, tmp_path)
    picture = render(scene, tmp_path / "picture.exr", exr)
    (path,) = (tmp_path / "maps").glob("*.exr")
    warp_map = physics.read_warp_map(path)
    planes = np.stack([warp_map.theta, warp_map.phi, warp_map.one_plus_z, warp_map.visibility], axis=-1)
    expected = reference_render.render(
        MapArrays.of(planes),
        sky_pixels(),
        rotation=[float(np.float32(angle)) for angle in ROTATION],
        strength=GROUP["Environment Strength"],
        exposure=GROUP["Exposure"],
        color_amount=GROUP["Redshift Color"],
        brightness_amount=GROUP["Redshift Brightness"],
        temperature=GROUP["Sky Temperature"],
        output_size=(scene.render.resolution_x, scene.render.resolution_y),
    ).image
    # float32 in a dozen operations and in texture coordinates, of colors up to 10
    np.testing.assert_allclose(picture[..., :3], expected[..., :3], rtol=0.0, atol=2e-4)
    assert picture[..., :3].max() > 0.5


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_it_renders_as_the_same_scene_does_that_is_new(tmp_path: Path, path: Path) -> None:
    """The scene is built again with this version: disk, artist's node and all."""
    old = render(opened(path, tmp_path), tmp_path / "old.exr", exr)
    scene = build(disk=path != FIRST)
    scene.umbra.map_folder = str(tmp_path / "new maps")
    scene.umbra.sky_filter = "OFF"  # as in files from before there was one
    new = render(scene, tmp_path / "new.exr", exr)
    # Blender 5 keeps what the older one wrote; colors agree to float32's rounding.
    np.testing.assert_allclose(old[..., :3], new[..., :3], rtol=1e-5, atol=1e-5)
    assert np.ptp(old[..., 0]) > 0.1


def test_a_lensed_world_gets_the_temperatures_of_its_colors(
    addon_module: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    """Version 3 of its group multiplied all colors by one Tint; numpy has each color of each Background by its own."""
    with bpy.data.libraries.load(str(WORLD)) as (source, target):
        target.node_groups = [name for name in source.node_groups if name.startswith("Umbra World")]
    (former,) = target.node_groups
    assert "Tint" in [item.name for item in former.interface.items_tree]

    scene = opened(WORLD, tmp_path)
    world_group, world_tint = addon_module("nodes.world_group"), addon_module("nodes.world_tint")
    (node,) = [each for each in scene.world.node_tree.nodes if "Lensed Light" in each.inputs]
    assert world_group.is_current(node.node_tree)
    (tint,) = [tree for tree in bpy.data.node_groups if world_tint.GROUP.owns(tree)]
    assert (tint.users, world_tint.GROUP.is_current(tint)) == (2, True)
    assert {name: node.inputs[name].default_value for name in GROUP if name in node.inputs} == pytest.approx(
        {name: value for name, value in GROUP.items() if name in node.inputs}
    )
    picture = render(scene, tmp_path / "picture.exr", exr)[..., :3]

    (path,) = (tmp_path / "maps").glob("*_world_*.exr")
    width, height = SIZE
    lens = scene.camera.data
    camera = physics.PerspectiveCamera(width, height, focal_length=lens.lens, sensor_width=lens.sensor_width)
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    axes = np.array(scene.camera.matrix_world, dtype=np.float64)[:3, :3]
    looking = camera.directions(column.ravel(), row.ravel()) @ axes.T
    origin, one_plus_z, visible = physics.read_world_map(path).look_up(looking)
    amounts = GROUP["Redshift Color"], GROUP["Redshift Brightness"], GROUP["Sky Temperature"]
    expected = np.zeros((width * height, 3))
    for color, strength in (
        (reference_render.sample_environment(sky_pixels(), origin), 1.0),
        (np.broadcast_to(PLAIN_COLOR[:3], expected.shape), PLAIN_STRENGTH),
    ):
        expected += strength * color * physics.redshift_gain(one_plus_z, *amounts, color)
    expected *= 2.0 ** GROUP["Exposure"] * visible[:, np.newaxis]
    # Blender's own look-up reaches over the poles, within a texel.
    where = visible & (np.abs(origin[:, 2]) < np.cos(np.pi / 16))
    assert 0.2 < where.mean() < 0.95
    found = (np.abs(picture.reshape(-1, 3) - expected) / np.maximum(expected, 0.1)).max(axis=-1)[where]
    assert np.median(found) < 2e-6  # single precision
    assert np.quantile(found, 0.98) < 1e-4
    assert (found > 1e-2).sum() <= 2, "a ray may fall on the other side of the edge"

    scene = build_world()
    scene.umbra.map_folder = str(tmp_path / "new maps")
    new = render(scene, tmp_path / "new.exr", exr)[..., :3]
    np.testing.assert_allclose(picture, new, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("path", [*FILES, WORLD, SAVED / "animated_4.5.blend"], ids=lambda path: path.stem)
def test_files_are_small_and_name_no_machine(tmp_path: Path, path: Path) -> None:
    assert path.stat().st_size < LARGEST_FILE
    bpy.ops.wm.open_mainfile(filepath=str(path))
    texts = [image.filepath for image in bpy.data.images] + [scene.render.filepath for scene in bpy.data.scenes]
    texts += [library.filepath for library in bpy.data.libraries]
    assert not any(MACHINE_PATH.search(text.encode()) for text in texts)
