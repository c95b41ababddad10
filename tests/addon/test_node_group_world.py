# SPDX-License-Identifier: GPL-3.0-or-later
"""Without a hole, the group's picture of a World is the picture that Cycles itself makes of that World.

The map is the identity here: each pixel's own direction, everything visible, no shift. This test shares no formula with
the reference rendering: what Cycles does is the truth.

Tolerance: Cycles samples each pixel somewhere within the filter's width, which is set to its least, a hundredth of
a pixel; the sky changes by about 0.01 from pixel to pixel, so by 5e-5 over half of that width. Cycles' own float32
direction adds 1e-6. Within half a texel of a pole the two differ by intent: Cycles repeats the picture
vertically and mixes in the opposite pole's row, the group extends the pole's own row.
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from compositor_scene import (
    LARGEST_AZIMUTH,
    FloatArray,
    GroupRenderer,
    empty_scene,
    render_pixels,
    smooth_environment,
    write_exr,
)
from mathutils import Euler, Matrix

from physics.numerics import sphere

SIZE = (64, 36)
STRENGTH = 1.7
FOCAL_LENGTH, SENSOR_WIDTH = 18.0, 36.0  # 90 degrees from left to right

# Camera rotations: looking at the environment's middle (+x), its seam (-x), the zenith, the nadir, and askew.
VIEWS = {
    "middle": (math.pi / 2.0, 0.0, -math.pi / 2.0),
    "seam": (math.pi / 2.0, 0.0, math.pi / 2.0),
    "zenith": (math.pi, 0.0, 0.4),
    "nadir": (0.0, 0.0, 0.4),
    "askew": (1.1, 0.3, 2.2),
}
ROTATIONS = [(0.0, 0.0, 0.0), (0.0, 0.0, 2.5), (0.4, -0.8, 1.2)]


def identity_map(camera_to_world: Matrix) -> FloatArray:
    width, height = SIZE
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    pixel = SENSOR_WIDTH / FOCAL_LENGTH / width
    rays = np.stack([(column - width / 2.0) * pixel, (height / 2.0 - row) * pixel, -np.ones_like(row)], axis=-1)
    x, y, z = np.moveaxis(rays @ np.array(camera_to_world.to_3x3()).T, -1, 0)
    channels = np.ones((height, width, 4))
    channels[..., 0] = np.arctan2(np.hypot(x, y), z)
    channels[..., 1] = np.clip(np.arctan2(y, x) % (2.0 * np.pi), 0.0, LARGEST_AZIMUTH)
    return channels


def world_with_environment(path: Path, rotation: tuple[float, ...]) -> bpy.types.World:
    world = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.vector_type = "POINT"
    mapping.inputs["Rotation"].default_value = rotation
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(path))
    texture.image.colorspace_settings.name = "Non-Color"
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Strength"].default_value = STRENGTH
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    return world


# Setting use_nodes is deprecated from 5.0 on, where it always is True, but needed in 4.5.
@pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")
@pytest.mark.parametrize("rotation", ROTATIONS)
@pytest.mark.parametrize("view", list(VIEWS))
def test_identity_map_shows_the_world_as_cycles_does(
    addon_module: Callable[[str], ModuleType], tmp_path: Path, view: str, rotation: tuple[float, ...]
) -> None:
    sky = smooth_environment(512, 256)
    scene = empty_scene(*SIZE)
    scene.render.film_transparent = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 0.01
    scene.camera.rotation_euler = VIEWS[view]
    scene.camera.data.lens, scene.camera.data.sensor_width = FOCAL_LENGTH, SENSOR_WIDTH
    scene.world = world_with_environment(write_exr(tmp_path / "world.exr", sky), rotation)
    by_cycles = render_pixels(scene, tmp_path / "cycles.exr")

    warp_map = identity_map(Euler(VIEWS[view]).to_matrix())
    by_group = GroupRenderer(addon_module("nodes.black_hole_group"), tmp_path).render(
        SIZE,
        warp_map=warp_map,
        environment=sky,
        values={"Environment Rotation": rotation, "Environment Strength": STRENGTH},
    )
    directions = sphere.unit_vectors(warp_map[..., 0], warp_map[..., 1])
    x, y, _ = np.moveaxis(directions @ sphere.euler_rotation(rotation).T, -1, 0)
    apart = np.hypot(x, y) > 0.5 * math.pi / sky.shape[0]
    assert apart.mean() > 0.99
    np.testing.assert_allclose(by_group[apart], by_cycles[apart], rtol=0.0, atol=5e-5)
