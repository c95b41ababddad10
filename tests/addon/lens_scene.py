# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of the Cycles Lens put into a scene."""

import math
from pathlib import Path

import bpy
from small_scene import shrink


def in_the_dark(maps: Path) -> bpy.types.Scene:
    """A small scene in the dark with a camera at (0, -6, 0) that looks along y, and maps of its own."""
    scene = bpy.context.scene
    shrink(scene, (160, 90))
    scene.umbra.map_folder = str(maps)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene.world = None
    scene.camera.location, scene.camera.rotation_euler = (0.0, -6.0, 0.0), (math.pi / 2, 0.0, 0.0)
    scene.camera.data.clip_end = 1e5
    return scene


def add_lens(scene: bpy.types.Scene, mass_scale: float = 0.2, **settings: object) -> bpy.types.Object:
    hole = bpy.data.objects.new("Hole", None)
    scene.collection.objects.link(hole)
    hole.umbra.is_black_hole = True
    hole.umbra.mass_scale = mass_scale
    for name, value in settings.items():
        setattr(hole.umbra, name, value)
    scene.umbra.active_hole = hole
    scene.umbra.redshift_color = scene.umbra.redshift_brightness = 0.0
    assert bpy.ops.umbra.set_output(output="CYCLES_LENS") == {"FINISHED"}
    return hole


def add_ball(
    place: tuple[float, ...],
    radius: float,
    color: tuple[float, float, float] = (1.0, 1.0, 1.0),
    socket: str = "Surface",
) -> bpy.types.Object:
    """A ball that shines, at its surface or throughout its volume."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=place, segments=48, ring_count=24)
    ball = bpy.context.object
    made = bpy.data.materials.new("Light")
    made.use_nodes = True
    made.node_tree.nodes.clear()
    light = made.node_tree.nodes.new("ShaderNodeEmission")
    output = made.node_tree.nodes.new("ShaderNodeOutputMaterial")
    light.inputs["Color"].default_value = (*color, 1.0)
    made.node_tree.links.new(light.outputs[0], output.inputs[socket])
    ball.data.materials.append(made)
    return ball
