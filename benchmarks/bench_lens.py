# SPDX-License-Identifier: GPL-3.0-or-later
"""What the Cycles Lens costs: one scene rendered with the plain camera, with exit maps, and with rays traced in OSL."""

# isort: off
import measuring  # before numpy
# isort: on

import argparse
import math
import sys
import tempfile
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "blend_files"))
from scene_tools import addon

SIZE, SAMPLES = (960, 540), 4


def scene_with_planets(folder: str) -> bpy.types.Scene:
    """A scene of 24 balls behind a hole."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    scene = bpy.context.scene
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    for number in range(24):
        angle = number * 2.4
        place = (0.5 * number * math.cos(angle), 8.0 + number, 0.5 * number * math.sin(angle))
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.8, location=place)
    scene.camera.location, scene.camera.rotation_euler = (0.0, -6.0, 0.0), (math.pi / 2, 0.0, 0.0)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = SAMPLES, False, False
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.umbra.map_folder = folder
    hole = bpy.data.objects.new("Hole", None)
    scene.collection.objects.link(hole)
    hole.umbra.is_black_hole, hole.umbra.mass_scale = True, 0.2
    scene.umbra.active_hole = hole
    return scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    print(measuring.describe_machine())
    with addon(), tempfile.TemporaryDirectory() as folder:
        scene = scene_with_planets(folder)
        times = {"plain camera": measuring.best_time(bpy.ops.render.render, options.repeats)}
        bpy.ops.umbra.set_output(output="CYCLES_LENS")
        bpy.ops.umbra.bake_frame()
        times["lens, exit map"] = measuring.best_time(bpy.ops.render.render, options.repeats)
        scene.umbra.lens_rays = "IN_SHADER"
        times["lens, no bake"] = measuring.best_time(bpy.ops.render.render, options.repeats)
    rays = SIZE[0] * SIZE[1] * SAMPLES
    about = f"Blender {bpy.app.version_string}, {SIZE[0]} x {SIZE[1]}, {SAMPLES} samples"
    print(f"\n{about}: seconds, camera rays a second")
    for name, seconds in times.items():
        print(f"{name:16} {seconds:6.2f} {rays / seconds:12,.0f}")


if __name__ == "__main__":
    main()
