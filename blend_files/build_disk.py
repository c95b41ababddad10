# SPDX-License-Identifier: GPL-3.0-or-later
"""Build disk.blend: a black hole with an accretion disk under the real stars, and rocks that the disk lights.

PYTHONPATH=. .venv-py311/bin/python blend_files/build_disk.py
"""

from __future__ import annotations

import math
import random

import numpy as np
import scene_tools as tools
from build_station import sky_rotation, star_panorama
from scene_tools import Vector, bpy

FRAMES = 96
ORBIT = math.radians(70.0)  # of the camera about the hole, in all frames
SPIN = 0.6
DISTANCE_IN_M = 46.0
HEIGHT = math.radians(10.0)  # of the camera over the disk's plane
LENS = 38.0


def rock(name: str, size: float, seed: int, shade: bpy.types.Material) -> bpy.types.Object:
    """A lump: a sphere with random dents of three sizes."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, radius=size)
    made = bpy.context.object
    made.name = name
    draw = np.random.default_rng(seed)
    mesh = made.data
    places = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", places)
    places = places.reshape(-1, 3)
    unit = places / np.linalg.norm(places, axis=1, keepdims=True)
    height = np.ones(len(unit))
    for count, width, depth in ((7, 0.8, 0.22), (28, 0.35, 0.07), (110, 0.14, 0.025)):
        centres = draw.normal(size=(count, 3))
        centres /= np.linalg.norm(centres, axis=1, keepdims=True)
        apart = 2.0 - 2.0 * unit @ centres.T
        height -= depth * np.exp(-apart / width**2).sum(axis=1)
    places *= height[:, None] * draw.uniform(0.7, 1.2, size=3)
    mesh.vertices.foreach_set("co", places.ravel())
    mesh.update()
    for face in mesh.polygons:
        face.use_smooth = True
    mesh.materials.append(shade)
    return made


def stone() -> bpy.types.Material:
    """Dark basalt with fine grain."""
    made = tools.material("Basalt", (0.16, 0.145, 0.13), roughness=0.75)
    coordinates = tools.add_node(made, "ShaderNodeTexCoord", {})
    grain = tools.add_node(
        made, "ShaderNodeTexNoise", {"Vector": coordinates.outputs["Object"], "Scale": 14.0, "Detail": 8.0}
    )
    bump = tools.add_node(made, "ShaderNodeBump", {"Height": grain.outputs["Fac"], "Strength": 0.5, "Distance": 0.02})
    tools.feed(made, "Normal", bump.outputs["Normal"])
    return made


def build() -> None:
    """Build and save the scene."""
    scene = tools.new_scene("Disk", FRAMES)
    tools.world_background(scene, (0.0, 0.0, 0.0), 0.0)
    scene.umbra.environment_image = star_panorama()
    scene.umbra.environment_source = "IMAGE"
    hole = tools.black_hole((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), SPIN, 0.2, "FIDO")
    hole.umbra.disk.enabled = True
    hole.umbra.disk.light = True
    hole.umbra.disk.light_strength = 3.0

    # The camera hangs on an Empty that turns: all frames share the rays of one map.
    pivot = tools.add_object("Orbit", None)
    pivot.empty_display_size = 0.5
    camera = tools.add_object("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens = LENS
    camera.data.clip_end = 1000.0
    camera.parent = pivot
    distance = DISTANCE_IN_M * hole.umbra.mass_scale
    camera.location = (0.0, -distance * math.cos(HEIGHT), distance * math.sin(HEIGHT))
    toward = -Vector(camera.location)
    camera.rotation_euler = toward.to_track_quat("-Z", "Y").to_euler()
    scene.camera = camera
    tools.spin_steadily(pivot, 2, ORBIT, FRAMES)

    # Rocks that drift through the foreground, each at a place of its own beside the camera's path.
    shade, draw = stone(), random.Random(4)
    for index, (turn, share, side, size) in enumerate(
        ((0.10, 0.72, -0.045, 0.17), (0.38, 0.64, 0.05, 0.09), (0.60, 0.70, -0.04, 0.15), (0.88, 0.68, -0.05, 0.12))
    ):
        angle = turn * ORBIT - math.pi / 2.0
        reach = share * distance
        made = rock(f"Rock {index + 1}", size, index, shade)
        height = reach * math.sin(HEIGHT) + side * distance
        made.location = (reach * math.cos(angle), reach * math.sin(angle), height)
        made.rotation_euler = [draw.uniform(0.0, 6.28) for _ in range(3)]
        tools.spin_steadily(made, 2, draw.uniform(0.5, 1.5), FRAMES)

    group = tools.group_node(scene)
    group.inputs["Environment Rotation"].default_value = sky_rotation(8.0, -24.0, 20.0)
    group.inputs["Exposure"].default_value = 1.0
    scene.view_settings.look = "AgX - High Contrast"
    add_glow(scene, group)
    tools.save(scene, "disk")


def add_glow(scene: bpy.types.Scene, group: bpy.types.Node) -> None:
    """Let what is bright glow, as in a lens."""
    tree = scene.node_tree
    glow = tree.nodes.new("CompositorNodeGlare")
    glow.glare_type = "BLOOM"
    for name, value in (("Threshold", 1.2), ("Strength", 0.2), ("Size", 0.55)):
        glow.inputs[name].default_value = value
    targets = [link.to_socket for link in group.outputs["Image"].links]
    tree.links.new(group.outputs["Image"], glow.inputs["Image"])
    for target in targets:
        tree.links.new(glow.outputs["Image"], target)
    glow.location = (group.location.x + 280.0, group.location.y)


if __name__ == "__main__":
    with tools.addon():
        build()
