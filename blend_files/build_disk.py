# SPDX-License-Identifier: GPL-3.0-or-later
"""Build disk.blend: a black hole with an accretion disk under the real stars.

PYTHONPATH=. .venv-py311/bin/python blend_files/build_disk.py
"""

from __future__ import annotations

import math

import scene_tools as tools
from scene_tools import Vector, bpy
from skies import sky_rotation

FRAMES = 96
ORBIT = math.radians(42.0)  # of the camera about the hole, in all frames
SPIN = 0.6
DISTANCE_IN_M = 46.0
HEIGHT = math.radians(10.0)  # of the camera over the disk's plane
LENS = 38.0


def build() -> None:
    """Build and save the scene."""
    scene = tools.new_scene("Disk", FRAMES)
    tools.world_background(scene, (0.0, 0.0, 0.0), 0.0)
    hole = tools.black_hole((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), SPIN, 0.2, "FIDO")
    hole.umbra.disk.enabled = True

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
