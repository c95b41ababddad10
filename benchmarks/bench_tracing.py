# SPDX-License-Identifier: GPL-3.0-or-later
"""How many rays a second each method traces, and how exactly."""

# isort: off
import measuring  # before numpy
# isort: on

import argparse

import numpy as np

import physics
from physics.tracer import METHODS

# The slow methods are measured on every fourth or sixteenth row of the picture.
THINNING = {"cash-karp": 4, "cash-karp-printed": 16}
TOLERANCES = (physics.DEFAULT_TOLERANCE, 1e-9)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--size", type=int, nargs=2, default=(960, 540), metavar=("WIDTH", "HEIGHT"))
    options = parser.parse_args()

    print(measuring.describe_machine())
    copied, multiplied = measuring.memory_speed()
    print(f"numpy in the cache: copy {copied:.1f}, multiply {multiplied:.1f} (1e9 float64/s)\n")
    print("method              tolerance   sky rays/s   unresolved   median error   99.9 % (radians)")
    observer = physics.Observer.circular_orbit(measuring.SPIN, measuring.RADIUS)
    theta_rd, phi_rd = measuring.sky_of_the_camera(*options.size)
    exact = trace(observer, theta_rd[::16], phi_rd[::16], "cash-karp", 1e-12)
    for method in METHODS:
        for tolerance in TOLERANCES:
            thin = slice(None, None, THINNING.get(method, 1))
            results = []

            def work(
                method: str = method, tolerance: float = tolerance, thin: slice = thin, results: list = results
            ) -> None:
                results.append(trace(observer, theta_rd[thin], phi_rd[thin], method, tolerance))

            seconds = measuring.best_time(work, options.repeats)
            result = results[-1]
            median, most = errors(result, exact, 16 // THINNING.get(method, 1))
            print(
                f"{method:18s} {tolerance:10.0e}   {result.counts['sky'] / seconds:10,.0f}   "
                f"{result.counts['unresolved']:10d}   {median:12.1e}   {most:6.1e}"
            )


def trace(
    observer: physics.Observer, theta_rd: np.ndarray, phi_rd: np.ndarray, method: str, tolerance: float
) -> physics.TraceResult:
    return physics.trace_rays(measuring.SPIN, observer, theta_rd, phi_rd, method=method, tolerance=tolerance)


def errors(result: physics.TraceResult, exact: physics.TraceResult, step: int) -> tuple[float, float]:
    """Median and 99.9th percentile of the error of direction, radians, over the rows that both traced."""
    both = np.isfinite(result.theta[::step]) & np.isfinite(exact.theta)
    one, other = (
        np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
        for theta, phi in (
            (result.theta[::step][both], result.phi[::step][both]),
            (exact.theta[both], exact.phi[both]),
        )
    )
    distance = np.linalg.norm(one - other, axis=-1)
    return float(np.median(distance)), float(np.quantile(distance, 0.999))


if __name__ == "__main__":
    main()
