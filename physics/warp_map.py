# SPDX-License-Identifier: GPL-3.0-or-later
"""Warp maps: for each pixel, where in the sky its light comes from, how far it is shifted, and how much is seen."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .rays import Array, Rays, rays_from_triad
from .shot import WarpMapParameters, spherical_triad
from .tracer import BLOCK_SIZE, Cancel, Fate, Progress, celestial_coordinates, drain, trace_block
from .trapped import edge_function
from .visibility import cells_for_shadow, centre_block, near_edge, refine

# What pixels without any sky carry for 1 + z: no redshift. 0 is kept for "no valid map".
SHADOW_ONE_PLUS_Z = 1.0
# 1 + z of a pixel whose ray was given up, which no sky has: the compositor shows it as it shows a broken map.
UNRESOLVED_ONE_PLUS_Z = -1.0

# Rows are worked through in strips of about this many pixels, which bounds the memory.
STRIP_PIXELS = 8 * BLOCK_SIZE

Image = NDArray[np.float32]


@dataclass(frozen=True)
class WarpMap:
    """A warp map in memory; images of shape (height, width), row 0 at the top of the picture."""

    theta: Image
    """Angle from the world's z axis of the direction the light comes from, radians, [0, pi]."""
    phi: Image
    """Azimuth of that direction about the world's z axis, from x, radians, [0, 2 pi)."""
    one_plus_z: Image
    """f_source / f_camera for a source at rest at infinity; > 1 is redshift; never 0."""
    visibility: Image
    """Share of the pixel that sees the sky, 0 to 1."""
    metadata: dict[str, Any]
    """What the file's header says: ``format``, ``hash``, ``counts`` and ``parameters``."""

    @property
    def counts(self) -> dict[str, int]:
        """Number of pixels by what they see: ``sky``, ``edge`` (partly), ``shadow``, ``unresolved``."""
        counts: dict[str, int] = self.metadata["counts"]
        return counts


def bake(
    parameters: WarpMapParameters, *, progress: Progress | None = None, cancel: Cancel | None = None
) -> WarpMap:
    """Trace a warp map.

    Parameters
    ----------
    parameters : WarpMapParameters
    progress : callable, optional
        Called with the fraction done, 0 to 1, after each block of rays.
    cancel : callable, optional
        Asked before each block; true ends the work.

    Raises
    ------
    BlackHoleError
        When no map can be made from these parameters.
    Cancelled
        When `cancel` returned true.
    """
    return drain(bake_steps(parameters), progress, cancel)


def bake_steps(parameters: WarpMapParameters) -> Generator[float, None, WarpMap]:
    """Trace a warp map step by step: yields the fraction done after each block of rays, returns the map.

    The steps take some tens of milliseconds each, so that a window can be kept alive between them.

    Raises
    ------
    BlackHoleError
        Before the first step, when no map can be made from these parameters.
    """
    parameters.validate()
    view = _View(parameters)
    width, height = parameters.map_size
    planes = np.empty((4, height, width), dtype=np.float32)
    counts = dict.fromkeys(("sky", "edge", "shadow", "unresolved"), 0)
    strip = max(1, STRIP_PIXELS // width)
    for first in range(0, height, strip):
        last = min(first + strip, height)
        for fraction in _bake_strip(view, parameters, first, last, planes, counts):
            yield (first + fraction * (last - first)) / height
    metadata = {"hash": parameters.hash, "counts": counts, "parameters": parameters.to_metadata()}
    return WarpMap(planes[0], planes[1], planes[2], planes[3], metadata)


class _View:
    """The camera of one map as a function from map pixels to rays."""

    def __init__(self, parameters: WarpMapParameters) -> None:
        self._spin = parameters.spin
        self._camera = parameters.camera
        self._per_pixel = 1.0 / parameters.supersampling
        self._observer = parameters.observer()
        self._camera_to_triad = (
            spherical_triad(self._observer.theta, self._observer.phi) @ np.array(parameters.camera_to_hole)
        ).T
        self.hole_to_world = np.array(parameters.hole_to_world)

    def rays(self, x: Array, y: Array) -> Rays:
        """Return the rays seen at map pixel coordinates x, y, shape (n,)."""
        seen = self._camera.directions(x * self._per_pixel, y * self._per_pixel)
        return rays_from_triad(self._spin, self._observer, seen @ self._camera_to_triad)

    def edge(self, x: Array, y: Array) -> Array:
        """Return the edge function at map pixel coordinates x, y, shape (n,), block by block."""
        values = np.empty(x.shape)
        for start in range(0, len(x), BLOCK_SIZE):
            block = slice(start, start + BLOCK_SIZE)
            values[block] = edge_function(self.rays(x[block], y[block]))
        return values

    def centre(self) -> tuple[float, float] | None:
        """Return the map pixel coordinates where the camera sees light that comes from the hole's direction."""
        # Light from the hole's centre moves along r-hat of the FIDO; Eq. 5 reversed says where it is seen.
        beta = self._observer.beta
        motion = np.array(self._observer.direction)
        light = np.array([1.0, 0.0, 0.0])
        along = float(motion @ light)
        across = light - along * motion
        seen = -(math.sqrt(1.0 - beta * beta) * across + (along - beta) * motion) / (1.0 - beta * along)
        pixel = self._camera.pixel(self._camera_to_triad @ seen)
        return None if pixel is None else (pixel[0] / self._per_pixel, pixel[1] / self._per_pixel)


def _bake_strip(
    view: _View,
    parameters: WarpMapParameters,
    first: int,
    last: int,
    planes: NDArray[np.float32],
    counts: dict[str, int],
) -> Generator[float, None, None]:
    """Fill rows `first` to `last` of the map, yielding the share of the strip that is done."""
    width = planes.shape[2]
    columns, rows = np.meshgrid(np.arange(width + 1.0), np.arange(first, last + 1.0))
    corners = view.edge(columns.ravel(), rows.ravel()).reshape(columns.shape)
    marked = near_edge(corners)

    visibility = (corners[:-1, :-1] > 0.0).astype(np.float64)
    x = columns[:-1, :-1] + 0.5
    y = rows[:-1, :-1] + 0.5
    row, column = np.nonzero(marked)
    visibility[marked], x[marked], y[marked] = refine(column, row + first, view.edge)
    centre = view.centre()
    column, row = centre_block(centre, first, last, width)
    if centre is not None and len(column):
        cells = cells_for_shadow(centre, view.edge)
        block = (row - first, column)
        visibility[block], x[block], y[block] = refine(column, row, view.edge, cells)
    yield 0.1

    traced = np.flatnonzero(visibility.ravel() > 0.0)
    theta, phi, one_plus_z = (np.zeros(visibility.size) for _ in range(3))
    one_plus_z[:] = SHADOW_ONE_PLUS_Z
    unresolved = 0
    for start in range(0, len(traced), BLOCK_SIZE):
        pixel = traced[start : start + BLOCK_SIZE]
        rays = view.rays(x.ravel()[pixel], y.ravel()[pixel])
        fate, direction = trace_block(rays, parameters.tolerance, parameters.method)
        world = direction @ view.hole_to_world.T
        lost = fate != Fate.SKY
        found_theta, found_phi = celestial_coordinates(world)
        theta[pixel] = np.where(lost, 0.0, found_theta)
        phi[pixel] = np.where(lost, 0.0, found_phi)
        one_plus_z[pixel] = np.where(lost, UNRESOLVED_ONE_PLUS_Z, rays.one_plus_z)
        unresolved += int(lost.sum())
        yield 0.1 + 0.9 * (start + len(pixel)) / len(traced)

    shape = visibility.shape
    planes[0, first:last] = theta.reshape(shape)
    planes[1, first:last] = _below_two_pi(phi.astype(np.float32)).reshape(shape)
    planes[2, first:last] = one_plus_z.reshape(shape)
    planes[3, first:last] = visibility
    partial = (visibility > 0.0) & (visibility < 1.0)
    counts["edge"] += int(partial.sum())
    counts["shadow"] += int((visibility == 0.0).sum())
    counts["unresolved"] += unresolved
    counts["sky"] += int((visibility == 1.0).sum()) - unresolved


def _below_two_pi(phi: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return `phi` with values that single precision rounds up to 2 pi put at 0."""
    return np.where(phi >= np.float32(2.0 * math.pi), np.float32(0.0), phi)
