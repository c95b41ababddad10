# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast rays are traced and a 1080p warp map is baked.

The scene is that of the performance claims everywhere in this project: spin 0.999, r = 10, the circular orbit of
Eq. 14, 60 degrees vertical field of view, looking at the hole. One core: the threads of numpy's linear algebra are
kept to one, as nothing else here uses more.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[variable] = "1"  # before numpy is imported

import argparse
import math
import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR

import physics
from physics.tracer import METHODS

SPIN, RADIUS, FIELD_OF_VIEW = 0.999, 10.0, math.radians(60.0)

# The slow methods are measured on every fourth or sixteenth row of the picture.
THINNING = {"cash-karp": 4, "cash-karp-printed": 16}


def best_time(work: Callable[[], object], repeats: int) -> float:
    """Shortest of several runs, seconds: the others were disturbed."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def shot(width: int, height: int) -> physics.WarpMapParameters:
    position = (RADIUS, 0.0, 0.0)
    return physics.WarpMapParameters(
        spin=SPIN,
        camera=physics.PerspectiveCamera.from_field_of_view(width, height, FIELD_OF_VIEW),
        camera_position=position,
        camera_to_hole=physics.looking_at_hole(position),
        motion="circular",
    )


def sky_of_the_camera(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """theta_rd, phi_rd of every pixel of that shot, in the frame of Eq. 4: y along the orbit, z up, x outward."""
    y, x = np.mgrid[0:height, 0:width] + 0.5
    right, up, back = np.moveaxis(shot(width, height).camera.directions(x, y), -1, 0)
    return np.arccos(up), np.arctan2(right, back)


def describe_machine() -> str:
    return (
        f"{os.cpu_count()} cores ({platform.machine()}), {platform.system()}, Python {platform.python_version()}, "
        f"numpy {np.__version__}, OpenEXR {getattr(OpenEXR, '__version__', 'unknown')}"
    )


def memory_speed() -> tuple[float, float]:
    """numpy's own copy and multiply, in 1e9 float64 a second: the machine's limit for this kind of program."""
    source, factor = np.random.default_rng(0).random((2, 16384))
    target = np.empty_like(source)
    rounds = range(2000)

    def copy() -> None:
        for _ in rounds:
            np.copyto(target, source)

    def multiply() -> None:
        for _ in rounds:
            np.multiply(source, factor, out=target)

    values = len(rounds) * source.size
    return values / best_time(copy, 3) / 1e9, values / best_time(multiply, 3) / 1e9


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--size", type=int, nargs=2, default=(1920, 1080), metavar=("WIDTH", "HEIGHT"))
    options = parser.parse_args()

    print(describe_machine())
    copied, multiplied = memory_speed()
    print(f"numpy in the cache: copy {copied:.1f}, multiply {multiplied:.1f} (1e9 float64/s)")

    theta_rd, phi_rd = sky_of_the_camera(960, 540)
    observer = physics.Observer.circular_orbit(SPIN, RADIUS)
    print("\nmethod               tolerance   sky rays/s   unresolved")
    for method in METHODS:
        for tolerance in (physics.DEFAULT_TOLERANCE, 1e-9):
            thin = slice(None, None, THINNING.get(method, 1))
            result = None

            def trace(method: str = method, tolerance: float = tolerance, thin: slice = thin) -> None:
                nonlocal result
                result = physics.trace_rays(
                    SPIN, observer, theta_rd[thin], phi_rd[thin], tolerance=tolerance, method=method
                )

            seconds = best_time(trace, options.repeats)
            rate = result.counts["sky"] / seconds
            print(f"{method:20s} {tolerance:9.0e}   {rate:10,.0f}   {result.counts['unresolved']:10d}")

    width, height = options.size
    parameters = shot(width, height)
    start = time.perf_counter()
    warp_map = physics.bake(parameters)
    baked = time.perf_counter() - start
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.exr"
        written = best_time(lambda: physics.write_warp_map(path, warp_map), options.repeats)
        read = best_time(lambda: physics.read_warp_map(path), options.repeats)
        size = path.stat().st_size / 1e6
    print(f"\n{width} x {height} map: {baked:.2f} s to trace ({warp_map.counts['sky']:,} sky, "
          f"{warp_map.counts['edge']:,} edge, {warp_map.counts['shadow']:,} shadow pixels), "
          f"{written:.2f} s to write ({size:.1f} MB), {read:.2f} s to read")  # fmt: skip


if __name__ == "__main__":
    main()
