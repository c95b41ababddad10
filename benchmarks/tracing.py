# SPDX-License-Identifier: GPL-3.0-or-later
"""How many rays a second each method traces, and how exactly; threads; and another analytic tracer beside it."""

# isort: off
import measuring  # before numpy
# isort: on

import contextlib
import importlib
import io
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from measuring import Row

import physics
from physics import METHODS

SIZE = (1920, 1080)
# The slow methods are measured on every fourth or sixteenth row of the picture.
THINNING = {"cash-karp": 4, "cash-karp-printed": 16}
# Rows that the errors are measured on.
EXACT_ROWS = slice(None, None, 32)

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)

KGEO_RAYS = 20_000


def rows(repeats: int, kgeo: Path | None) -> Iterator[Row | str]:
    copied, multiplied = measuring.memory_speed()
    yield f"numpy itself, in the cache: copy {copied:.1f}, multiply {multiplied:.1f} (1e9 float64/s)"
    theta_rd, phi_rd = measuring.sky_of_the_camera(*SIZE)
    exact = trace(theta_rd[EXACT_ROWS], phi_rd[EXACT_ROWS], "cash-karp", 1e-12)
    for name, method in METHODS.items():
        thin = slice(None, None, THINNING.get(name, 1))
        part = theta_rd[thin], phi_rd[thin]
        seconds = measuring.best_time(lambda part=part, name=name: trace(*part, name), repeats)
        result = trace(*part, name)
        typical, largest = errors(trace(theta_rd[EXACT_ROWS], phi_rd[EXACT_ROWS], name), exact)
        sky = result.counts["sky"]
        peak = measuring.peak_memory(lambda part=part, name=name: trace(*part, name))
        label = f"{method.label} ({name}), {physics.DEFAULT_TOLERANCE:g}"
        yield Row(label, seconds, sky, "sky rays/s", peak, sky, typical, largest)
        unresolved = result.counts["unresolved"]
        if unresolved:
            yield f"    {unresolved} of these rays stayed unresolved"
    yield threads(theta_rd, phi_rd, repeats)
    yield from kgeo_rows(kgeo, repeats)


def trace(theta_rd: np.ndarray, phi_rd: np.ndarray, method: str, tolerance: float = 1e-6) -> physics.TraceResult:
    observer = physics.Observer.circular_orbit(measuring.SPIN, measuring.RADIUS)
    return physics.trace_rays(measuring.SPIN, observer, theta_rd, phi_rd, method=method, tolerance=tolerance)


def errors(result: physics.TraceResult, exact: physics.TraceResult) -> tuple[float, float]:
    """Error of direction that 99.9 % of the rays keep to, and the largest, radians."""
    both = np.isfinite(result.theta) & np.isfinite(exact.theta)
    one, other = (measuring.unit_vectors(each.theta[both], each.phi[both]) for each in (result, exact))
    distance = np.linalg.norm(one - other, axis=-1)
    return float(np.quantile(distance, 0.999)), float(distance.max())


def threads(theta_rd: np.ndarray, phi_rd: np.ndarray, repeats: int) -> str:
    """What a second thread brings: numpy lets others work while it does, but Python between its calls does not."""
    halves = [(theta_rd[start::2], phi_rd[start::2]) for start in (0, 1)]
    alone = measuring.best_time(lambda: [trace(*half, "gauss-legendre") for half in halves], repeats)
    with ThreadPoolExecutor(2) as pool:
        together = measuring.best_time(
            lambda: list(pool.map(lambda half: trace(*half, "gauss-legendre"), halves)), repeats
        )
    return f"tracing in two threads takes {together / alone:.2f} times as long as in one ({os.cpu_count()} cores)"


def kgeo_rows(path: Path | None, repeats: int) -> Iterator[Row | str]:
    """kgeo's analytic tracer (Chael; after Gralla & Lupsasca 2020), for a far camera: it has no other."""
    if path is None or not (path / "kgeo" / "kerr_raytracing_ana.py").is_file():
        yield "kgeo: skipped; give the folder of a copy of it (github: achael/kgeo) by --kgeo to see it here"
        return
    vars(np).update(infty=np.inf, NaN=np.nan)  # their names before numpy 2, which kgeo uses
    sys.path.insert(0, str(path))
    try:
        module = importlib.import_module("kgeo.kerr_raytracing_ana")
    except ImportError as error:
        yield f"kgeo: skipped; it cannot be imported here ({error})"
        return
    random = np.random.default_rng(1)
    radius, angle = random.uniform(8.0, 30.0, KGEO_RAYS), random.uniform(0.0, 2.0 * np.pi, KGEO_RAYS)
    image = [radius * np.cos(angle), radius * np.sin(angle)]

    def work() -> object:
        with contextlib.redirect_stdout(io.StringIO()):
            return module.raytrace_ana(
                a=measuring.SPIN, observer_coords=[0, 1e5, 1.4, 0], image_coords=image, ngeo=2, plotdata=False
            )

    seconds = measuring.best_time(work, repeats)
    yield Row("kgeo, analytic, from afar", seconds, KGEO_RAYS, "sky rays/s", measuring.peak_memory(work), KGEO_RAYS)


def error_against_tolerance() -> dict[str, list[tuple[float, float, float]]]:
    """For each method (tolerance, median error, error that 99.9 % keep to), radians."""
    theta_rd, phi_rd = (each[::32] for each in measuring.sky_of_the_camera(960, 540))
    exact = trace(theta_rd, phi_rd, "gauss-legendre", 1e-13), trace(theta_rd, phi_rd, "cash-karp", 1e-13)
    curves: dict[str, list[tuple[float, float, float]]] = {}
    for name, method in METHODS.items():
        curves[method.label] = []
        for tolerance in TOLERANCES:
            result = trace(theta_rd, phi_rd, name, tolerance)
            # Each is compared with the other kind.
            reference = exact[0] if name != "gauss-legendre" else exact[1]
            both = np.isfinite(result.theta) & np.isfinite(reference.theta)
            if not both.any():
                continue  # all given up
            one, other = (measuring.unit_vectors(each.theta[both], each.phi[both]) for each in (result, reference))
            distance = np.linalg.norm(one - other, axis=-1)
            curves[method.label].append((tolerance, float(np.median(distance)), float(np.quantile(distance, 0.999))))
    return curves
