# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the picture of the Cycles Lens in docs: balls behind a hole, before a World of squares.

PYTHONPATH=. python blend_files/render_lens_picture.py docs/images/cycles_lens.jpg
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
from pathlib import Path

import scene_tools as tools
from scene_tools import bpy

SIZE, SAMPLES = (960, 540), 32
BALLS = 16


def squares(world: bpy.types.World) -> None:
    """A World of squares in two shades, so that its bending is seen everywhere."""
    tree = world.node_tree
    checker = tree.nodes.new("ShaderNodeTexChecker")
    checker.inputs["Scale"].default_value = 14.0
    checker.inputs["Color1"].default_value = (0.02, 0.05, 0.12, 1.0)
    checker.inputs["Color2"].default_value = (0.12, 0.16, 0.25, 1.0)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def render(path: Path, maps: str) -> None:
    """Build the scene and render it."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    scene = bpy.context.scene
    for thing in ("Cube", "Light"):
        bpy.data.objects.remove(bpy.data.objects[thing])
    squares(scene.world)
    draw = random.Random(2)
    for number in range(BALLS):
        radius = draw.uniform(0.3, 1.2)
        place = (draw.uniform(-6.0, 6.0), draw.uniform(4.0, 14.0), draw.uniform(-3.5, 3.5))
        shade = tools.material(f"Shade {number}", (draw.random(), draw.random(), draw.random()))
        tools.ball(f"Ball {number}", radius, place, shade)
    tools.sun("Sun", (0.3, -0.8, 0.6), 3.0, (1.0, 0.95, 0.9))
    scene.camera.location, scene.camera.rotation_euler = (0.0, -7.0, 0.6), (math.radians(85.0), 0.0, 0.0)
    scene.camera.data.lens = 32.0
    scene.render.engine, scene.cycles.samples = "CYCLES", SAMPLES
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.image_settings.file_format, scene.render.image_settings.quality = "JPEG", 90
    scene.render.filepath = str(path)
    scene.umbra.map_folder = maps
    bpy.ops.umbra.add_black_hole(spin=0.9, mass_scale=0.22)
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    scene.umbra.redshift_color = scene.umbra.redshift_brightness = 0.0
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    with tools.addon(), tempfile.TemporaryDirectory() as folder:
        render(Path(sys.argv[1]).resolve(), folder)
