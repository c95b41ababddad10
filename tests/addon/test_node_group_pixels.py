# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of the compositor's node group against numpy's float64 reference.

The tolerances and why:

COLORS (2e-6, of values up to 1): a dozen float32 operations, each rounding by 6e-8, and logarithms and exponentials
of the redshift.
GAINS (2e-4 of each pixel): the temperature comes from the color by a polynomial of alternating terms, which costs three
digits, and a strong shift multiplies what is left.
TEXELS (1e-4 of the brightest texel): a texture coordinate up to 1 is stored in steps of 6e-8, up to 0.5 in steps of
3e-8. With 2048 x 1024 texels of which neighbors differ by all they can, rounding by half a step in u and in v is worth
3e-5 each.
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from compositor_scene import (
    GroupRenderer,
    MapArrays,
    add_redshift_and_shadow,
    compositor_tree,
    empty_scene,
    full_sphere_map,
    image_node,
    noise_environment,
    render_pixels,
    smooth_environment,
    write_exr,
)

from physics.numerics import sphere
from physics.reference import reference_render

COLORS = 2e-6
GAINS = 2e-4
TEXELS = 1e-4
SIZE = (64, 36)
ROTATIONS = [
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 1.234),
    (0.0, 0.0, -9.0),
    (0.3, -0.7, 2.0),
    (math.pi / 2.0, 0.0, 0.0),
]


@pytest.fixture
def node_group(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("nodes.black_hole_group")


@pytest.fixture
def group(node_group: ModuleType, tmp_path: Path) -> GroupRenderer:
    return GroupRenderer(node_group, tmp_path)


def as_stored(rotation: tuple[float, ...]) -> list[float]:
    """The angles that a float32 socket holds."""
    return [float(np.float32(angle)) for angle in rotation]


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_smooth_sky_in_all_directions(group: GroupRenderer, rotation: tuple[float, ...]) -> None:
    warp_map, sky = full_sphere_map(*SIZE), smooth_environment(512, 256)
    picture = group.render(SIZE, warp_map=warp_map, environment=sky, values={"Environment Rotation": rotation})
    expected = reference_render.render(MapArrays.of(warp_map), sky, rotation=as_stored(rotation)).image
    np.testing.assert_allclose(picture, expected, rtol=0.0, atol=COLORS)


@pytest.mark.parametrize("rotation", ROTATIONS)
@pytest.mark.parametrize("brightest", [1.0, 500.0])
def test_noise_in_all_directions(group: GroupRenderer, rotation: tuple[float, ...], brightest: float) -> None:
    warp_map, sky = full_sphere_map(*SIZE), noise_environment(2048, 1024, brightest)
    picture = group.render(SIZE, warp_map=warp_map, environment=sky, values={"Environment Rotation": rotation})
    angles = as_stored(rotation)
    expected = reference_render.render(MapArrays.of(warp_map), sky, rotation=angles).image
    error = np.abs(picture - expected).max(axis=-1) / brightest
    if rotation[0] or rotation[1]:
        # A tilted direction is a float32 vector, accurate to 1e-7 rad; close to the environment's pole its longitude
        # is not, and the pole's row of noise differs with the longitude.
        directions = sphere.unit_vectors(warp_map[..., 0], warp_map[..., 1])
        x, y, _ = np.moveaxis(directions @ sphere.euler_rotation(angles).T, -1, 0)
        error = error * np.hypot(x, y)
    assert error.max() <= TEXELS


def test_environment_of_odd_size(group: GroupRenderer) -> None:
    warp_map, sky = full_sphere_map(*SIZE), noise_environment(65, 33)
    picture = group.render(SIZE, warp_map=warp_map, environment=sky)
    expected = reference_render.render(MapArrays.of(warp_map), sky).image
    np.testing.assert_allclose(picture, expected, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("brightness", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("color", [0.0, 0.5, 1.0])
def test_redshift_and_brightness(group: GroupRenderer, color: float, brightness: float) -> None:
    warp_map, sky = add_redshift_and_shadow(full_sphere_map(*SIZE)), smooth_environment(512, 256)
    picture = group.render(
        SIZE,
        warp_map=warp_map,
        environment=sky,
        values={
            "Redshift Color": color,
            "Redshift Brightness": brightness,
            "Sky Temperature": 4321.0,
            "Exposure": 1.5,
            "Environment Strength": 2.5,
        },
    )
    expected = reference_render.render(
        MapArrays.of(warp_map),
        sky,
        color_amount=color,
        brightness_amount=brightness,
        temperature=4321.0,
        exposure=1.5,
        strength=2.5,
    ).image
    np.testing.assert_allclose(picture, expected, rtol=GAINS, atol=COLORS)


@pytest.mark.parametrize("shift", [1e-4, 0.01, 100.0, 1e5])
def test_extreme_redshift_stays_finite(group: GroupRenderer, shift: float) -> None:
    warp_map = full_sphere_map(8, 4)
    warp_map[..., 2] = shift
    flat = np.ones((2, 4, 4), dtype=np.float32)
    picture = group.render((8, 4), warp_map=warp_map, environment=flat, values={"Redshift Color": 0.25})
    expected = reference_render.render(MapArrays.of(warp_map), flat, color_amount=0.25).image
    # The exponent of the gain reaches 50 and is rounded by 6e-8 of that.
    np.testing.assert_allclose(picture, expected, rtol=GAINS, atol=1e-30)


@pytest.mark.parametrize("output", ["Image", "Sky", "Shadow", "Redshift"])
@pytest.mark.parametrize("size", [(64, 36), (65, 37), (67, 36)])
@pytest.mark.parametrize("supersampling", [1, 2, 4])
def test_supersampled_map_is_box_filtered(
    group: GroupRenderer, supersampling: int, size: tuple[int, int], output: str
) -> None:
    # Odd sizes matter: Blender shifts images by half a pixel when it scales from even to odd sizes.
    width, height = size
    warp_map = add_redshift_and_shadow(full_sphere_map(width * supersampling, height * supersampling))
    sky = smooth_environment(512, 256)
    foreground = np.random.default_rng(3).random((height, width, 4)).astype(np.float32)
    picture = group.render(size, warp_map=warp_map, environment=sky, foreground=foreground, output=output)
    reference = reference_render.render(MapArrays.of(warp_map), sky, foreground=foreground)
    expected = getattr(reference, output.lower())
    if expected.ndim == 2:
        picture = picture[..., 0]
    # A hundred pixels of a bright blueshifted sky may enter one mean: the tolerance is relative to it.
    np.testing.assert_allclose(picture, expected, rtol=GAINS, atol=COLORS)


@pytest.mark.parametrize("supersampling", [1, 2, 4])
@pytest.mark.parametrize("size", [(64, 36), (70, 38), (66, 34)])
def test_map_of_full_size_at_fifty_percent(group: GroupRenderer, size: tuple[int, int], supersampling: int) -> None:
    width, height = size
    warp_map = add_redshift_and_shadow(full_sphere_map(width * supersampling, height * supersampling))
    sky = smooth_environment(512, 256)
    picture = group.render(size, warp_map=warp_map, environment=sky, percentage=50)
    expected = reference_render.render(MapArrays.of(warp_map), sky, output_size=(width // 2, height // 2)).image
    np.testing.assert_allclose(picture, expected, rtol=GAINS, atol=COLORS)


@pytest.mark.parametrize(("size", "percentage"), [((65, 37), 50), ((64, 36), 75), ((32, 18), 200), ((31, 17), 150)])
def test_map_of_another_size_fills_the_frame(group: GroupRenderer, size: tuple[int, int], percentage: int) -> None:
    warp_map, sky = full_sphere_map(*size), smooth_environment(512, 256)
    warp_map[0], warp_map[-1] = warp_map[1], warp_map[-2]
    picture = group.render(size, warp_map=warp_map, environment=sky, percentage=percentage)
    output_size = (size[0] * percentage // 100, size[1] * percentage // 100)
    expected = reference_render.render(MapArrays.of(warp_map), sky, output_size=output_size).image
    assert picture.shape == expected.shape
    # Blender interpolates at positions rounded to about 1e-5 of a pixel.
    np.testing.assert_allclose(picture, expected, rtol=0.0, atol=2e-5)


def test_light_without_alpha_and_opaque_pixels(group: GroupRenderer) -> None:
    warp_map, sky = full_sphere_map(*SIZE), smooth_environment(512, 256)
    foreground = np.zeros((SIZE[1], SIZE[0], 4), dtype=np.float32)
    foreground[10:20, 10:20] = (2.0, 1.0, 0.5, 0.0)  # a flame: light, but nothing behind it is covered
    foreground[20:30, 10:20] = (0.2, 0.3, 0.4, 1.0)
    foreground[10:30, 20:24] = (0.1, 0.15, 0.2, 0.5)  # half covered, premultiplied
    picture = group.render(SIZE, warp_map=warp_map, environment=sky, foreground=foreground)
    expected = reference_render.render(MapArrays.of(warp_map), sky, foreground=foreground).image
    np.testing.assert_allclose(picture, expected, rtol=0.0, atol=COLORS)
    np.testing.assert_array_equal(picture[20:30, 10:20], foreground[20:30, 10:20])


def test_rendered_object_with_soft_edge_on_transparent_film(node_group: ModuleType, tmp_path: Path) -> None:
    scene = empty_scene(*SIZE)
    scene.cycles.samples = 8
    material = bpy.data.materials.new("Glow")
    if bpy.app.version < (5, 0):
        material.use_nodes = True  # always so from 5.0 on, where setting it is deprecated
    material.node_tree.nodes.clear()
    emission = material.node_tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (0.9, 0.5, 0.1, 1.0)
    surface = material.node_tree.nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(emission.outputs[0], surface.inputs["Surface"])
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(0.2, 0.1, -3.0))
    bpy.context.object.data.materials.append(material)

    tree, target = compositor_tree(scene)
    layer = tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(layer.outputs["Image"], target)
    foreground = render_pixels(scene, tmp_path / "foreground.exr")
    alpha = foreground[..., 3]
    assert ((alpha > 0.1) & (alpha < 0.9)).sum() > 20, "the object's edge must be soft"
    assert (alpha == 0.0).any(), "the film must be transparent"

    warp_map, sky = full_sphere_map(*SIZE), smooth_environment(512, 256)
    node = node_group.add_group_node(tree)
    for name, pixels in (("Warp Map", warp_map), ("Environment", sky)):
        source = image_node(tree, write_exr(tmp_path / f"{name}.exr", pixels))
        tree.links.new(source.outputs["Image"], node.inputs[name])
    tree.links.new(layer.outputs["Image"], node.inputs["Render"])
    tree.links.new(node.outputs["Image"], target)
    picture = render_pixels(scene, tmp_path / "picture.exr")
    expected = reference_render.render(MapArrays.of(warp_map), sky, foreground=foreground).image
    np.testing.assert_allclose(picture, expected, rtol=0.0, atol=COLORS)
