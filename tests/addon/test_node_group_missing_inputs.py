# SPDX-License-Identifier: GPL-3.0-or-later
"""Missing and foreign files: magenta where the map is none, and never a crash."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from compositor_scene import (
    FloatArray,
    GroupRenderer,
    MapArrays,
    compositor_tree,
    empty_scene,
    full_sphere_map,
    image_node,
    render_pixels,
    smooth_environment,
    write_exr,
)

from physics.reference import reference_render

SIZE = (48, 27)
MAGENTA = (1.0, 0.0, 1.0, 1.0)
NEUTRAL = {"Image": MAGENTA, "Sky": MAGENTA, "Shadow": (0.0, 0.0, 0.0, 1.0), "Redshift": (1.0, 1.0, 1.0, 1.0)}


@pytest.fixture
def node_group(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("nodes.black_hole_group")


@pytest.fixture
def group(node_group: ModuleType, tmp_path: Path) -> GroupRenderer:
    return GroupRenderer(node_group, tmp_path)


def missing_image(tree: bpy.types.NodeTree, kind: str, folder: Path) -> bpy.types.Node:
    """An Image node without an image, with a missing file, or with a sequence that lacks this frame."""
    if kind == "missing frame":
        node = image_node(tree, write_exr(folder / "map_0099.exr", np.ones((27, 48, 4), dtype=np.float32)))
        node.image.source = "SEQUENCE"
        node.frame_duration, node.frame_start = 200, 1
        return node
    node = tree.nodes.new("CompositorNodeImage")
    if kind == "missing file":
        node.image = bpy.data.images.new("Missing", 8, 8)
        node.image.source = "FILE"
        node.image.filepath = str(folder / "not_there.exr")
    return node


@pytest.mark.parametrize("output", list(NEUTRAL))
@pytest.mark.parametrize("kind", ["no image", "missing file", "missing frame", "not linked"])
def test_missing_map_is_magenta(node_group: ModuleType, tmp_path: Path, kind: str, output: str) -> None:
    scene = empty_scene(*SIZE)
    tree, target = compositor_tree(scene)
    node = node_group.add_group_node(tree)
    if kind != "not linked":
        tree.links.new(missing_image(tree, kind, tmp_path).outputs["Image"], node.inputs["Warp Map"])
    sky = image_node(tree, write_exr(tmp_path / "sky.exr", smooth_environment(64, 32)))
    tree.links.new(sky.outputs["Image"], node.inputs["Environment"])
    # Whatever the controls say, and even behind an opaque render.
    front = np.full((SIZE[1], SIZE[0], 4), 1.0, dtype=np.float32)
    opaque = image_node(tree, write_exr(tmp_path / "front.exr", front))
    tree.links.new(opaque.outputs["Image"], node.inputs["Render"])
    node.inputs["Environment Strength"].default_value = 0.0
    node.inputs["Exposure"].default_value = -5.0
    tree.links.new(node.outputs[output], target)
    picture = render_pixels(scene, tmp_path / "picture.exr")
    assert picture.shape == (SIZE[1], SIZE[0], 4)
    np.testing.assert_array_equal(picture, np.broadcast_to(np.float32(NEUTRAL[output]), picture.shape))


@pytest.mark.parametrize("kind", ["no image", "missing file"])
def test_missing_environment_is_black(node_group: ModuleType, tmp_path: Path, kind: str) -> None:
    scene = empty_scene(*SIZE)
    tree, target = compositor_tree(scene)
    node = node_group.add_group_node(tree)
    warp_map = image_node(tree, write_exr(tmp_path / "map.exr", full_sphere_map(*SIZE)))
    tree.links.new(warp_map.outputs["Image"], node.inputs["Warp Map"])
    tree.links.new(missing_image(tree, kind, tmp_path).outputs["Image"], node.inputs["Environment"])
    tree.links.new(node.outputs["Image"], target)
    picture = render_pixels(scene, tmp_path / "picture.exr")
    np.testing.assert_array_equal(picture, np.broadcast_to(np.float32((0, 0, 0, 1)), picture.shape))


def test_plain_color_as_environment(group: GroupRenderer) -> None:
    warp_map = full_sphere_map(*SIZE)
    picture = group.render(SIZE, warp_map=warp_map, values={"Environment": (0.2, 0.3, 0.4, 1.0)})
    np.testing.assert_allclose(picture, np.broadcast_to((0.2, 0.3, 0.4, 1.0), picture.shape), rtol=0.0, atol=1e-7)


def foreign_pixels() -> FloatArray:
    """Pixels that no map can hold, in the order theta, phi, 1 + z, visibility."""
    return np.array(
        [
            (0.0, 0.0, 0.0, 0.0),
            (0.5, 0.5, 0.0, 1.0),
            (0.5, 0.5, -1.0, 1.0),
            (-0.1, 0.5, 1.0, 1.0),
            (3.2, 0.5, 1.0, 1.0),
            (0.5, -3.0, 1.0, 1.0),
            (0.5, 6.4, 1.0, 1.0),
            (0.5, 0.5, 1.0, -0.5),
            (0.5, 0.5, 1.0, 2.0),
            (np.nan, 0.5, 1.0, 1.0),
            (0.5, np.nan, 1.0, 1.0),
            (0.5, 0.5, np.nan, 1.0),
            (0.5, 0.5, 1.0, np.nan),
            (np.inf, np.inf, np.inf, np.inf),
            (-np.inf, -np.inf, -np.inf, -np.inf),
            (0.5, 0.5, np.inf, 1.0),
        ],
        dtype=np.float32,
    )


@pytest.mark.parametrize("output", list(NEUTRAL))
@pytest.mark.parametrize("supersampling", [1, 2])
def test_pixels_that_no_map_can_hold(group: GroupRenderer, supersampling: int, output: str) -> None:
    warp_map = full_sphere_map(SIZE[0] * supersampling, SIZE[1] * supersampling)
    broken = foreign_pixels()
    # Whole pixels at the left, and the first of a pixel's four subpixels further to the right.
    warp_map[0 : 2 * supersampling, : len(broken) * supersampling] = np.repeat(broken, supersampling, axis=0)
    warp_map[10 * supersampling, 20 * supersampling : 36 * supersampling : supersampling] = broken
    sky = smooth_environment(64, 32)
    picture = group.render(SIZE, warp_map=warp_map, environment=sky, output=output)
    reference = reference_render.render(MapArrays.of(warp_map), sky, output_size=SIZE)
    expected = getattr(reference, output.lower())
    if expected.ndim == 2:
        picture = picture[..., 0]
    np.testing.assert_allclose(picture, expected, rtol=0.0, atol=2e-6)
    if output == "Image":
        np.testing.assert_array_equal(picture[:2, : len(broken)], np.full((2, len(broken), 4), MAGENTA))


def test_valid_extremes_are_not_magenta(group: GroupRenderer) -> None:
    warp_map = full_sphere_map(4, 2)
    warp_map[0, 0] = (np.float32(np.pi), np.float32(2.0 * np.pi), 1e-3, 1.0)
    warp_map[0, 1] = (0.0, 0.0, 1.0, 0.0)
    warp_map[0, 2] = (0.0, 0.0, 1e3, 1.0)
    picture = group.render((4, 2), warp_map=warp_map, values={"Environment": (0.0, 1.0, 0.0, 1.0)})
    assert np.all(picture[0, :3, 0] == 0.0)
    np.testing.assert_array_equal(picture[0, 1], (0.0, 0.0, 0.0, 1.0))
