# SPDX-License-Identifier: GPL-3.0-or-later
"""What the benchmarks share: one core, the scene of all performance claims, and ways to measure.

Import this before numpy: it keeps the threads of numpy's linear algebra to one.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[variable] = "1"

import math
import platform
import time
from collections.abc import Callable

import numpy as np
import OpenEXR

import physics

SPIN, RADIUS, FIELD_OF_VIEW = 0.999, 10.0, math.radians(60.0)


def shot(width: int, height: int, azimuth: float = 0.0, **changes: object) -> physics.WarpMapParameters:
    """Spin 0.999, r = 10, the circular orbit of Eq. 14, 60 degrees vertical field of view, looking at the hole."""
    position = (RADIUS * math.cos(azimuth), RADIUS * math.sin(azimuth), 0.0)
    settings = {
        "camera": physics.PerspectiveCamera.from_field_of_view(width, height, FIELD_OF_VIEW),
        "camera_position": position,
        "camera_to_hole": physics.looking_at_hole(position),
        "motion": "circular",
    }
    return physics.WarpMapParameters(spin=SPIN, **{**settings, **changes})


def best_time(work: Callable[[], object], repeats: int) -> float:
    """Shortest of several runs, seconds: the others were disturbed."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def sky_of_the_camera(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """theta_rd, phi_rd of every pixel of that shot, in the frame of Eq. 4: y along the orbit, z up, x outward."""
    y, x = np.mgrid[0:height, 0:width] + 0.5
    right, up, back = np.moveaxis(shot(width, height).camera.directions(x, y), -1, 0)
    return np.arccos(up), np.arctan2(right, back)


def unit_vectors(warp_map: physics.WarpMap) -> np.ndarray:
    """The directions of a map, shape (height, width, 3)."""
    theta, phi = warp_map.theta.astype(float), warp_map.phi.astype(float)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def describe_machine() -> str:
    """The machine and the versions that a number belongs to."""
    return (
        f"{os.cpu_count()} cores ({platform.machine()}), {platform.system()}, Python {platform.python_version()}, "
        f"numpy {np.__version__}, OpenEXR {getattr(OpenEXR, '__version__', 'unknown')}; one core used"
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
