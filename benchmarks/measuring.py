# SPDX-License-Identifier: GPL-3.0-or-later
"""What the benchmarks share: one core, the scene of all performance claims, ways to measure, the table's rows.

Import this before numpy: it keeps the threads of numpy's linear algebra to one.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ[variable] = "1"

import math
import platform
import resource
import sys
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import OpenEXR

import physics

SPIN, RADIUS, FIELD_OF_VIEW = 0.999, 10.0, math.radians(60.0)


@dataclass(frozen=True)
class Row:
    """A line of the table; what does not apply is None."""

    name: str
    seconds: float
    work: int
    """Sky rays that were traced, or pixels that were filled."""
    unit: str
    peak: float | None = None
    """Largest memory that numpy held for the work, MB."""
    rays: int | None = None
    """Rays that were traced for the work."""
    typical: float | None = None
    """Error of direction that 99.9 % of the answers keep to, radians."""
    largest: float | None = None

    HEADINGS = (
        f"{'':44s} {'seconds':>9s} {'a second':>13s} {'':11s} {'rays':>11s} {'peak MB':>8s} {'99.9 % err':>11s} "
        f"{'largest':>8s}"
    )

    def __str__(self) -> str:
        return (
            f"{self.name:44s} {self.seconds:9.4f} {self.work / self.seconds:13,.0f} {self.unit:11s} "
            f"{_cell(self.rays, '11,d')} {_cell(self.peak, '8.0f')} {_cell(self.typical, '11.1e')} "
            f"{_cell(self.largest, '8.1e')}"
        ).rstrip()


def _cell(value: float | None, form: str) -> str:
    return f"{value:{form}}" if value is not None else " " * int("".join(c for c in form.split(".")[0] if c.isdigit()))


def shot(
    width: int, height: int, azimuth: float = 0.0, radius: float = RADIUS, **changes: object
) -> physics.WarpMapParameters:
    """Spin 0.999, r = 10, the circular orbit of Eq. 14, 60 degrees vertical field of view, looking at the hole."""
    position = (radius * math.cos(azimuth), radius * math.sin(azimuth), 0.0)
    settings = {
        "camera": physics.PerspectiveCamera.from_field_of_view(width, height, FIELD_OF_VIEW),
        "camera_position": position,
        "camera_to_hole": physics.looking_at_hole(position),
        "motion": "circular",
        "spin": SPIN,
    }
    return physics.WarpMapParameters(**{**settings, **changes})


def best_time(work: Callable[[], object], repeats: int) -> float:
    """Shortest of several runs, seconds: the others were disturbed."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def peak_memory(work: Callable[[], object]) -> float:
    """Largest memory that numpy and Python held during a run of its own, MB: keeping count of it takes time."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def process_memory() -> float:
    """Largest resident memory of this process so far, MB."""
    kilobytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return kilobytes / (1e6 if sys.platform == "darwin" else 1e3)


def sky_of_the_camera(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """theta_rd, phi_rd of every pixel of that shot, in the frame of Eq. 4: y along the orbit, z up, x outward."""
    y, x = np.mgrid[0:height, 0:width] + 0.5
    right, up, back = np.moveaxis(shot(width, height).camera.directions(x, y), -1, 0)
    return np.arccos(up), np.arctan2(right, back)


def unit_vectors(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    theta, phi = theta.astype(float), phi.astype(float)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def map_errors(warp_map: physics.WarpMap, exact: physics.WarpMap) -> tuple[float, float]:
    """Error of direction that 99.9 % of the wholly visible pixels keep to, and the largest, radians."""
    if not np.array_equal(warp_map.visibility, exact.visibility):
        sys.exit("The visibilities of two maps that should agree differ.")
    whole = exact.visibility == 1.0
    one, other = (unit_vectors(each.theta[whole], each.phi[whole]) for each in (warp_map, exact))
    error = np.linalg.norm(one - other, axis=-1)
    return float(np.quantile(error, 0.999)), float(error.max())


def describe_machine() -> str:
    """The machine and the versions that a number belongs to."""
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
