# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference data, and geometry that the tests share."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physics import Observer

DATA = Path(__file__).parent.parent / "data"

PUBLISHED = json.loads((DATA / "published_values.json").read_text())


@dataclass(frozen=True)
class ReferenceCamera:
    name: str
    spin: float
    observer: Observer
    rows: dict[str, np.ndarray]


def reference_cameras(file: str = "reference_rays.npz") -> Iterator[ReferenceCamera]:
    with np.load(DATA / file) as archive:
        table = {key: archive[key] for key in archive.files}
    for name in dict.fromkeys(table["name"].tolist()):
        rows = {key: column[table["name"] == name] for key, column in table.items()}
        observer = Observer(
            *(float(rows[key][0]) for key in ("r", "theta", "phi", "beta")), direction=tuple(rows["B"][0].tolist())
        )
        yield ReferenceCamera(name, float(rows["a"][0]), observer, rows)


def unit_vectors(theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def angle_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Great-circle distance of unit vectors, accurate for small angles too."""
    return 2.0 * np.arcsin(np.clip(np.linalg.norm(one - other, axis=-1) / 2.0, 0.0, 1.0))


def random_sky(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Directions spread evenly over the camera's sky, as theta_rd, phi_rd."""
    random = np.random.default_rng(seed)
    return np.arccos(random.uniform(-1.0, 1.0, count)), random.uniform(0.0, 2.0 * math.pi, count)


def bisect(inside, low: float, high: float) -> float:
    """Where `inside` changes from its value at `low`, to float64's resolution."""
    start = inside(low)
    assert inside(high) != start
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if inside(middle) == start:
            low = middle
        else:
            high = middle


def about(axis: int, angle: float) -> np.ndarray:
    """Rotation about one coordinate axis."""
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[[i, i, j, j], [i, j, i, j]] = math.cos(angle), -math.sin(angle), math.sin(angle), math.cos(angle)
    return matrix
