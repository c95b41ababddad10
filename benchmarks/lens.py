# SPDX-License-Identifier: GPL-3.0-or-later
"""What the Cycles Lens costs: one scene with Blender's own camera, and with one that bends its rays.

Cycles uses all cores, and its camera is most of the work here: shining balls under a plain World, no bounces of light.
A process of its own keeps Blender's memory and threads away from the other measurements; it prints one line a camera:

    PYTHONPATH=. python benchmarks/lens.py REPEATS
"""

# isort: off
import measuring  # before numpy
# isort: on

import importlib.util
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from measuring import Row

SIZE, SAMPLES = (960, 540), 16
BALLS = 40
TIMEOUT = 3600.0  # seconds
MARK = "lens benchmark:"


def rows(repeats: int) -> Iterator[Row | str]:
    """Lines of the table; a sentence where there is no Blender with what the lens needs."""
    if importlib.util.find_spec("bpy") is None:
        yield "Cycles Lens: not measured, because this Python has no module bpy."
        return
    yield f"Cycles Lens, {SIZE[0]} x {SIZE[1]}, {SAMPLES} samples a pixel, all cores:"
    command = [sys.executable, str(Path(__file__)), str(repeats)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    lines = [line.removeprefix(MARK).split(";") for line in done.stdout.splitlines() if line.startswith(MARK)]
    for name, seconds, work, unit in lines:
        yield Row(f"    {name}", float(seconds), int(work), unit)
    if done.returncode != 0 or not lines:
        reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        yield f"    could not be measured: {reason}"


def main() -> None:
    """Measure, in a Blender of its own."""
    repeats = int(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        os.environ["BLENDER_USER_RESOURCES"] = folder  # read when bpy is first imported
        import bpy

        import blender_addon

        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        blender_addon.register()
        try:
            measure(bpy.context.scene, Path(folder), repeats)
        finally:
            blender_addon.unregister()


def measure(scene: object, folder: Path, repeats: int) -> None:
    """Print what a frame takes with each camera; the first render of each does not count."""
    import bpy

    build(scene, folder)
    pixels = SIZE[0] * SIZE[1]
    samples = pixels * SAMPLES
    say("plain camera", rendering(scene, repeats), samples, "samples/s")
    if bpy.ops.umbra.set_output(output="CYCLES_LENS") != {"FINISHED"}:
        sys.exit("the Cycles Lens could not be set up")
    add_hole(scene)
    scene.umbra.lens_rays = "EXIT_MAP"
    start = time.perf_counter()
    if bpy.ops.umbra.bake_frame() != {"FINISHED"}:
        sys.exit("the exit map could not be baked")
    say("baking the exit map", time.perf_counter() - start, pixels, "pixels/s")
    say("lens with its exit map, baked before", rendering(scene, repeats), samples, "samples/s")
    scene.umbra.lens_rays = "IN_SHADER"
    say("lens that traces each ray", rendering(scene, repeats), samples, "samples/s")


def say(name: str, seconds: float, work: int, unit: str) -> None:
    print(f"{MARK}{name};{seconds:.6f};{work};{unit}", flush=True)


def rendering(scene: object, repeats: int) -> float:
    import bpy

    def render() -> None:
        if bpy.ops.render.render() != {"FINISHED"}:
            sys.exit("a frame could not be rendered")

    render()
    return measuring.best_time(render, repeats)


def build(scene: object, folder: Path) -> None:
    """Balls behind a place where a hole may come, seen by a camera 30 units in front of it."""
    import bpy

    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.cycles.samples, scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = SAMPLES, False, False
    scene.cycles.max_bounces = 0
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.umbra.map_folder = f"{folder / 'maps'}{os.sep}"
    scene.world = bpy.data.worlds.new("World")
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -30.0, 0.0), (math.pi / 2.0, 0.0, 0.0)
    camera.data.angle = measuring.FIELD_OF_VIEW
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
    ball = bpy.context.object
    for number in range(BALLS):
        angle = number * math.pi * (3.0 - math.sqrt(5.0))  # evenly over a disk
        radius = 4.0 * math.sqrt(number + 0.5)
        each = ball if number == 0 else bpy.data.objects.new("Ball", ball.data)
        each.location = (radius * math.cos(angle), 25.0, radius * math.sin(angle))
        if number > 0:
            scene.collection.objects.link(each)


def add_hole(scene: object) -> None:
    import bpy

    hole = bpy.data.objects.new("Hole", None)
    scene.collection.objects.link(hole)
    hole.umbra.is_black_hole = True
    hole.umbra.spin, hole.umbra.mass_scale = measuring.SPIN, 1.0
    scene.umbra.active_hole = hole


if __name__ == "__main__":
    main()
