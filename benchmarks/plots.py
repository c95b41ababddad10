# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark's pictures."""

from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt

mpl.use("Agg")

SIZE = (8.0, 5.0)


def plot_times(curves: dict[str, list[tuple[int, float]]], machine: str, path: Path) -> None:
    figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
    for label, points in curves.items():
        axes.loglog(*zip(*points, strict=True), marker="o", label=label)
    axes.set(xlabel="pixels of the map", ylabel="seconds, one core", title="Time of a warp map against its pixels")
    _finish(figure, axes, machine, path)


def plot_errors(curves: dict[str, list[tuple[float, float, float]]], machine: str, path: Path) -> None:
    figure, axes = plt.subplots(figsize=SIZE, layout="constrained")
    for label, points in curves.items():
        if not points:
            continue
        tolerance, median, most = zip(*points, strict=True)
        (line,) = axes.loglog(tolerance, most, marker="o", label=f"{label}, 99.9 %")
        axes.loglog(tolerance, median, marker=".", linestyle="--", color=line.get_color(), label=f"{label}, median")
    every = [point[0] for points in curves.values() for point in points]
    ends = [min(every), max(every)]
    axes.loglog(ends, ends, color="gray", linewidth=0.8, label="error = tolerance")
    axes.set(xlabel="tolerance (radians)", ylabel="error of direction (radians)", title="Error against tolerance")
    _finish(figure, axes, machine, path)


def _finish(figure: plt.Figure, axes: plt.Axes, machine: str, path: Path) -> None:
    axes.grid(which="both", alpha=0.25)
    axes.legend()
    figure.text(0.995, 0.005, machine, ha="right", va="bottom", fontsize=6, color="gray")
    figure.savefig(path, dpi=120)
    plt.close(figure)
