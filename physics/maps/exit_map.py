# SPDX-License-Identifier: GPL-3.0-or-later
"""Exit maps: for each pixel the line in space along which its light comes in, for cameras that bend their rays."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geodesics.exit_lines import check_exit_method, exit_lines
from ..geodesics.tracer import Fate
from ..numerics.arrays import Array, Image
from ..numerics.blocks import BLOCK_SIZE
from ..numerics.work import Cancel, Progress, drain
from ..sampling.tiles import Tiles, interpolate
from ..shot.map_parameters import WarpMapParameters
from .lens import DEFAULT_SPHERE_RADIUS
from .painting import GROUP_PIXELS, Painting

# Impact vectors are compared with directions after division by this, units of M: their error moves what lies beyond a
# sphere of this radius by the same angle, or by less.
IMPACT_SCALE = DEFAULT_SPHERE_RADIUS

# Error of direction allowed to bilinear interpolation between pixel centers, radians: a tenth of a pixel of common
# pictures. Where it would be more, a pixel is marked as not usable, and the camera follows the ray itself.
BILINEAR_TOLERANCE = 5e-5


@dataclass(frozen=True)
class ExitMap:
    """An exit map in memory; images of shape (height, width) or (height, width, 3), row 0 at the top."""

    direction: Image
    """N: unit vectors towards the origin of the light, in the hole's frame; 0 where there is none."""
    impact: Image
    """D: the point of the ray's asymptote nearest to the hole, in the hole's frame, units of M; 0 where none."""
    one_plus_z: Image
    """f_source / f_camera for a source at rest at infinity; 1 where there is none."""
    usable: Image
    """1 where N and D may be interpolated between this pixel's center and those around it, else 0."""
    metadata: dict[str, Any]
    """What the file's header says: ``format``, ``hash``, ``counts`` and ``parameters``."""

    @property
    def counts(self) -> dict[str, int]:
        """Pixels by what their centers see: ``sky``, ``shadow``, ``unresolved``; ``usable`` ones; ``rays`` traced."""
        counts: dict[str, int] = self.metadata["counts"]
        return counts


def bake_exit_map(
    parameters: WarpMapParameters, *, progress: Progress | None = None, cancel: Cancel | None = None
) -> ExitMap:
    """Trace an exit map.

    Parameters
    ----------
    parameters : WarpMapParameters
        The camera's size is the map's, before supersampling.
    progress : callable, optional
        Called with the fraction done, 0 to 1, after each block of rays.
    cancel : callable, optional
        Called before each block; if it returns true, the work ends.

    Returns
    -------
    ExitMap

    Raises
    ------
    BlackHoleError
        If no map can be made from these parameters, or the method has no exit lines.
    Cancelled
        If `cancel` returned true.
    """
    return drain(bake_exit_map_steps(parameters), progress, cancel)


def bake_exit_map_steps(parameters: WarpMapParameters) -> Generator[float, None, ExitMap]:
    """Trace an exit map step by step.

    Parameters
    ----------
    parameters : WarpMapParameters
        See `bake_exit_map`.

    Yields
    ------
    float
        The fraction done, 0 to 1, after each block of rays.

    Returns
    -------
    ExitMap

    Raises
    ------
    BlackHoleError
        Before the first step, if no map can be made from these parameters, or the method has no exit lines.
    """
    parameters.validate()
    parameters.check_size(pictures=2)
    check_exit_method(parameters.method)
    painting = ExitPainting(parameters)
    yield from painting.steps()
    return painting.result()


class ExitPainting(Painting):
    """An exit map in the making: the tiles of a warp map's, with lines in place of angles."""

    def __init__(self, parameters: WarpMapParameters) -> None:
        super().__init__(parameters)
        shape = (self._height, self._width, 6)
        # N and D / IMPACT_SCALE; NaN where there is no sky
        self._lines = np.full(shape, np.nan, np.float32)

    def result(self) -> ExitMap:
        """Return the finished map."""
        seen = np.isfinite(self._lines).all(axis=-1)
        usable = interpolable(self._lines, BILINEAR_TOLERANCE)
        lines = np.where(seen[..., None], self._lines, np.float32(0.0))
        counts = {
            "sky": int(seen.sum()),
            "shadow": int((~seen).sum()) - self._unresolved,
            "unresolved": self._unresolved,
            "usable": int(usable.sum()),
            "rays": self._rays,
        }
        parameters = self._parameters
        metadata = {"hash": parameters.hash, "counts": counts, "parameters": parameters.to_metadata()}
        return ExitMap(
            np.ascontiguousarray(lines[..., :3]),
            lines[..., 3:] * np.float32(IMPACT_SCALE),
            self._one_plus_z,
            usable.astype(np.float32),
            metadata,
        )

    def _directions(self, x: Array, y: Array) -> Array:
        """Return N and D / IMPACT_SCALE, hole's frame, at map pixel coordinates; NaN in the shadow; shape (n, 6)."""
        lines = np.empty((len(x), 6))
        for start in range(0, len(x), BLOCK_SIZE):
            block = slice(start, start + BLOCK_SIZE)
            _, lines[block] = self._exits(x[block], y[block])
        self._rays += len(x)
        return lines

    def _exits(self, x: Array, y: Array) -> tuple[NDArray[np.uint8], Array]:
        rays = self._view.rays(x, y)
        fate, direction, impact = exit_lines(rays, self._parameters.tolerance, self._parameters.method)
        return fate, np.concatenate([direction, impact / IMPACT_SCALE], axis=1)

    def _interpolate_group(self, tiles: Tiles, coefficients: Array) -> None:
        lines = np.moveaxis(interpolate(coefficients, tiles.side, np.eye(6)), 0, -1)
        columns, rows = tiles.pixels()
        one_plus_z = self._view.one_plus_z(columns.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5)
        tiles.put(self._lines, lines)
        tiles.put(self._one_plus_z, one_plus_z)

    def _trace(self, tiles: Tiles, done: float, end: float) -> Generator[float, None, None]:
        """Fill tiles by a ray for each pixel's center, yielding fractions from `done` to `end`."""
        group = max(1, GROUP_PIXELS // (tiles.side * tiles.side))
        for start in range(0, len(tiles), group):
            part = tiles.select(np.arange(start, min(start + group, len(tiles))))
            shape = (len(part), tiles.side, tiles.side)
            columns, rows = (np.broadcast_to(each, shape) for each in part.pixels())
            inside = (columns < self._width) & (rows < self._height)
            self._trace_pixels(columns[inside], rows[inside])
            yield done + (end - done) * min(start + group, len(tiles)) / len(tiles)

    def _trace_pixels(self, columns: NDArray[np.intp], rows: NDArray[np.intp]) -> None:
        for start in range(0, len(columns), BLOCK_SIZE):
            place = (rows[start : start + BLOCK_SIZE], columns[start : start + BLOCK_SIZE])
            x, y = (each.astype(np.float64) + 0.5 for each in (place[1], place[0]))
            fate, self._lines[place] = self._exits(x, y)
            self._unresolved += int(np.count_nonzero(fate == Fate.UNRESOLVED))
            self._one_plus_z[place] = np.where(fate == Fate.SKY, self._view.one_plus_z(x, y), 1.0)
        self._rays += len(columns)


def interpolable(lines: NDArray[np.floating[Any]], tolerance: float) -> NDArray[np.bool_]:
    """Return where values may be interpolated bilinearly to within `tolerance`, shape (height, width).

    Between the four centers of a cell the error is up to (|f_xx| + |f_yy|) / 8 in units of pixels; second differences
    stand for the derivatives, those of the neighbors at the picture's sides. False where they are not finite.
    """
    height, width = lines.shape[:2]
    bend, lines = np.zeros((height, width)), lines.astype(np.float64)
    with np.errstate(invalid="ignore"):
        for axis, count in ((0, height), (1, width)):
            if count < 3:
                return np.zeros((height, width), dtype=bool)
            along = np.linalg.norm(np.diff(lines, n=2, axis=axis), axis=-1)
            bend += np.pad(along, [(1, 1) if each == axis else (0, 0) for each in (0, 1)], mode="edge")
        good: NDArray[np.bool_] = bend / 8.0 <= tolerance
    return good
