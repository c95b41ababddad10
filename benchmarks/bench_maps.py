# SPDX-License-Identifier: GPL-3.0-or-later
"""How long warp maps take: by size, with and without interpolation, in an animation, and on the disk."""

# isort: off
import measuring  # before numpy
# isort: on

import argparse
import dataclasses
import math
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import OpenEXR

import physics

SIZES = ((480, 270), (1920, 1080), (3840, 2160))

# Lossless, and read by every Blender that is supported. ZIP is what maps are written with.
COMPRESSIONS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--frames", type=int, default=50, help="of the orbit")
    options = parser.parse_args()
    print(measuring.describe_machine())

    print("\nsize          interpolated: seconds    rays   every pixel: seconds   99.9 % (radians)   largest")
    for width, height in SIZES:
        report_size(width, height, options.repeats)
    print(f"peak memory of this process so far: {peak_memory():.0f} MB")
    report_files()
    report_orbit(options.frames)
    report_panorama()


def report_size(width: int, height: int, repeats: int) -> None:
    parameters = measuring.shot(width, height)
    seconds = measuring.best_time(lambda: physics.bake(parameters), repeats)
    adaptive = physics.bake(parameters)
    start = time.perf_counter()
    every = physics.bake(dataclasses.replace(parameters, interpolation=0.0))
    slow = time.perf_counter() - start
    if not np.array_equal(adaptive.visibility, every.visibility):
        sys.exit("The visibilities of the two maps differ.")
    whole = every.visibility == 1.0
    error = np.linalg.norm(measuring.unit_vectors(adaptive)[whole] - measuring.unit_vectors(every)[whole], axis=-1)
    print(
        f"{width:4d} x {height:4d}   {seconds:20.3f} {adaptive.counts['rays']:9,d}   {slow:20.2f}   "
        f"{np.quantile(error, 0.999):16.1e}   {error.max():7.1e}"
    )


def report_files() -> None:
    """Time and size of one full-HD map on the disk, and what OpenEXR's other lossless compressions would make of it."""
    warp_map = physics.bake(measuring.shot(1920, 1080))
    planes = (warp_map.theta, warp_map.phi, warp_map.one_plus_z, warp_map.visibility)
    channels = dict(zip("RGBA", planes, strict=True))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.exr"
        written = measuring.best_time(lambda: physics.write_warp_map(path, warp_map), 3)
        read = measuring.best_time(lambda: physics.read_warp_map(path), 3)
        print(f"\n1920 x 1080 file: {path.stat().st_size / 1e6:.1f} MB, {written:.2f} s to write, {read:.2f} s to read")
        print("compression   write (s)   read (s)      MB")
        for name in COMPRESSIONS:
            header = {"compression": getattr(OpenEXR, f"{name}_COMPRESSION"), "type": OpenEXR.scanlineimage}

            def write(header: dict = header) -> None:
                with OpenEXR.File(header, channels) as file:
                    file.write(str(path))

            def read_back() -> None:
                with OpenEXR.File(str(path), separate_channels=True) as file:
                    file.channels()

            written, read = measuring.best_time(write, 3), measuring.best_time(read_back, 3)
            print(f"{name:11s}   {written:9.3f}   {read:8.3f}   {path.stat().st_size / 1e6:5.1f}")


def report_orbit(frames: int) -> None:
    """A circular orbit whose camera tracks the hole: each frame's sky is the first one's, turned."""
    first = physics.bake(measuring.shot(1920, 1080))
    shared = traced = 0.0
    for frame in range(1, frames + 1):
        parameters = measuring.shot(1920, 1080, azimuth=2.0 * math.pi * frame / frames)
        start = time.perf_counter()
        if physics.turned_map(first, parameters) is None:
            sys.exit("A frame of the orbit does not share the first one's rays.")
        shared += time.perf_counter() - start
    for frame in range(3):
        parameters = measuring.shot(1920, 1080, azimuth=0.1 * frame)
        start = time.perf_counter()
        physics.bake(parameters)
        traced += (time.perf_counter() - start) / 3
    print(
        f"\norbit of {frames} frames, 1920 x 1080: {shared / frames:.3f} s a frame from shared rays, "
        f"{traced:.3f} s where each is traced"
    )


def report_panorama() -> None:
    """The largest map: the whole sky."""
    parameters = measuring.shot(1, 1, camera=physics.PanoramaCamera(8192, 4096))
    start = time.perf_counter()
    warp_map = physics.bake(parameters)
    seconds = time.perf_counter() - start
    print(
        f"\n8192 x 4096 panorama: {seconds:.1f} s, {warp_map.counts['rays']:,} rays, "
        f"peak memory of this process {peak_memory():.0f} MB"
    )


def peak_memory() -> float:
    """Largest resident memory so far, MB."""
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return kilobytes / (1e6 if sys.platform == "darwin" else 1e3)


if __name__ == "__main__":
    main()
