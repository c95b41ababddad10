# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter of the sky gives and costs: errors and flicker beside the shadow, seconds and memory in Blender.

Each way of compositing is measured in a process of its own, which renders a frame of stars several times and prints
what the fastest took; the frame without a compositor, Blender's own work and the file, is taken off:

    PYTHONPATH=. python benchmarks/skies.py WIDTH HEIGHT SKY_ROWS FILTER SAMPLES REPEATS
"""

# isort: off
import measuring  # before numpy
# isort: on

import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import flicker
import numpy as np

import physics

SIZES = ((1920, 1080), (3840, 2160))
SKY_ROWS = (2048, 4096)
WAYS = (("OFF", 1), ("FAST", 1), ("BEST", 1), ("OFF", 2), ("OFF", 4))
MOST_PIXELS = 40_000_000  # of a map; above it 24 GB of memory do not suffice
TIMEOUT = 1800.0  # seconds
MARK = "sky benchmark:"


def lines(repeats: int) -> Iterator[str]:
    """Lines of the table."""
    yield "light beside the shadow, one frame and its change to the next, % of the mean light, by rings of 1 to 3,"
    yield "3 to 10 and 10 to 20 % of the shadow's radius; the truth has 16 x 16 rays per pixel:"
    skies = {"stars, 4096 x 2048": np.asarray(physics.star_sky(2048))}
    city = flicker.hdri()
    if city is not None:
        skies["HDRI, 1024 x 512"] = city
    ways = {"off": flicker.looks(0), "fast": flicker.looks(8), "best": flicker.looks(16)}
    ways |= {"2 x 2": flicker.rays(2), "4 x 4": flicker.rays(4), "truth": flicker.rays(16)}
    for name, sky in skies.items():
        yield f"    {name}"
        for way, rings in flicker.measure(ways, "truth", sky).items():
            error = ", ".join(f"{100 * ring.error:5.1f}" for ring in rings)
            change = ", ".join(f"{100 * ring.change:5.1f}" for ring in rings)
            yield f"        {way:8s} off by {error}   change {change}"
    if importlib.util.find_spec("bpy") is None:
        yield "compositing: not measured, because this Python has no module bpy."
        return
    yield "compositing a frame of stars in Blender, all cores: processor seconds, seconds, peak memory of the process"
    for width, height in SIZES:
        for rows in SKY_ROWS:
            for way, samples in WAYS:
                name = f"    {width} x {height}, sky {2 * rows} x {rows}, {way.lower()}, {samples} x {samples}"
                if width * height * samples**2 > MOST_PIXELS:
                    yield f"{name}: not measured, a map of {width * samples} x {height * samples} is too large"
                    continue
                yield f"{name}: {_measured(width, height, rows, way, samples, repeats)}"


def _measured(*arguments: object) -> str:
    command = [sys.executable, str(Path(__file__)), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    found = [line.removeprefix(MARK) for line in done.stdout.splitlines() if line.startswith(MARK)]
    if done.returncode == 0 and found:
        return found[0]
    return f"could not be measured: {(done.stderr.strip().splitlines() or ['no reason given'])[-1]}"


def main() -> None:
    """Measure one way, in a Blender of its own."""
    width, height, rows, way, samples, repeats = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        os.environ["BLENDER_USER_RESOURCES"] = folder  # read when bpy is first imported
        import bpy

        import blender_addon

        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        blender_addon.register()
        try:
            build(bpy.context.scene, Path(folder), (int(width), int(height)), int(rows))
            scene = bpy.context.scene
            scene.umbra.sky_filter, scene.umbra.supersampling = way, samples
            scene.render.use_compositing = False
            plain = fastest(int(repeats))
            scene.render.use_compositing = True
            work, seconds = (one - other for one, other in zip(fastest(int(repeats)), plain, strict=True))
            print(f"{MARK}{work:6.2f} s, {seconds:6.2f} s, {measuring.process_memory():6.0f} MB", flush=True)
        finally:
            blender_addon.unregister()


def build(scene: object, folder: Path, size: tuple[int, int], rows: int) -> None:
    """An empty scene with a camera 30 units in front of a hole, under stars."""
    import bpy

    sky = folder / "sky.exr"
    command = f"import physics; physics.write_exr({str(sky)!r}, physics.star_sky({rows}), {{}})"
    subprocess.run([sys.executable, "-c", command], check=True)  # whose memory is not this process's
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 1
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = size
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR", "32", "NONE"
    scene.render.filepath = str(folder / "picture.exr")
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -30.0, 5.0), (1.405, 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.umbra.map_folder = f"{folder / 'maps'}{os.sep}"
    scene.umbra.environment_image = bpy.data.images.load(str(sky))
    scene.umbra.environment_source = "IMAGE"
    if bpy.ops.umbra.add_black_hole() != {"FINISHED"}:
        sys.exit("the hole could not be added")


def fastest(repeats: int) -> tuple[float, float]:
    """Processor seconds and seconds of the fastest render; the first one does not count."""
    import bpy

    found = []
    for _ in range(repeats + 1):
        work, start = time.process_time(), time.perf_counter()
        if bpy.ops.render.render(write_still=True) != {"FINISHED"}:
            sys.exit("a frame could not be rendered")
        found.append((time.process_time() - work, time.perf_counter() - start))
    return min(found[1:])


if __name__ == "__main__":
    main()
