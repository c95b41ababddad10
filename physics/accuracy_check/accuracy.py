# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact a baked map is: sampled pixels are traced again by the reference method at a tight tolerance.

What is judged is the file, pixels that were interpolated included. Definitions are in `docs/accuracy.md`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..disk_passes.disk_pass import DiskPass
from ..files.disk_pass_file import read_disk_pass
from ..files.exit_map_file import FORMAT as EXIT_FORMAT
from ..files.exit_map_file import read_exit_map
from ..files.map_file import ATTRIBUTE_FORMAT
from ..files.warp_map_file import read_warp_map
from ..geodesics.exit_lines import exit_lines
from ..geodesics.radial_path import winding
from ..geodesics.tracer import Fate, trace_block
from ..images.exr import PathLike, read_exr_header
from ..maps.painting import UNRESOLVED_ONE_PLUS_Z
from ..numerics.arrays import Array
from ..numerics.blocks import BLOCK_SIZE
from ..numerics.checks import shown
from ..numerics.errors import BlackHoleError, WarpMapError
from ..numerics.sphere import unit_vectors
from ..numerics.work import Cancel, Progress, drain, share_of
from ..sampling.view import View
from ..sampling.visibility import cells_for_shadow, center_block, refine
from ..shot.map_parameters import WarpMapParameters
from .accuracy_report import AccuracyReport, DiskAccuracy
from .accuracy_samples import Samples, choose

REFERENCE_METHOD = "cash-karp"
REFERENCE_TOLERANCE = 1e-11
# Crossings of the disk are found with steps a thousand times more exact than this; less is lost in rounding.
DISK_TOLERANCE = 1e-8
# A ray next to the critical curve needs more steps than one for a picture may take.
REFERENCE_STEPS = 20_000

DEFAULT_SAMPLES = 6000
FEWEST_SAMPLES, MOST_SAMPLES = 10, 1_000_000
DEFAULT_ENVIRONMENT_WIDTH, WIDEST_ENVIRONMENT = 8192, 1_000_000_000
LARGEST_SEED = 2**63 - 1

# Cells along each side of a pixel when the visible share is worked out again: a map has a quarter of them.
CELLS = 16
# Visible shares that differ by more are another picture: one level of 8 bits.
VISIBILITY_TOLERANCE = 1.0 / 255.0
# Pixels whose edges are looked at together: each takes (CELLS + 1)^2 places.
EDGE_BLOCK = BLOCK_SIZE // (CELLS + 1) ** 2
# Rays traced between two steps of the work: small, so that a window stays alive.
RAY_BLOCK = 1000

SHADOW, EDGE, SKY, LOST = range(4)


@dataclass(frozen=True)
class _Pixels:
    """A map of either kind, as far as it is judged."""

    parameters: WarpMapParameters
    hash: str
    direction: NDArray[np.float32]
    """Unit vectors of the sky in the map's own axes, (height, width, 3)."""
    one_plus_z: NDArray[np.float32]
    visibility: NDArray[np.float32]
    kind: NDArray[np.uint8]
    impact: NDArray[np.float32] | None
    """Of an exit map, units of M, (height, width, 3)."""
    unresolved: int


def check_accuracy(
    path: PathLike,
    *,
    passes: Sequence[PathLike] = (),
    samples: int = DEFAULT_SAMPLES,
    environment_width: int = DEFAULT_ENVIRONMENT_WIDTH,
    seed: int = 0,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> AccuracyReport:
    """Trace sampled pixels of a baked map again and say how far the map is from them.

    Parameters
    ----------
    path : path
        A warp map or an exit map; what it was made from is in its header.
    passes : sequence of path
        The passes of its disk, to be judged as well.
    samples : int
        How many pixels are traced again, about; all of a map that has no more.
    environment_width : int
        Width in pixels of the equirectangular picture in units of whose pixels errors are told as well.
    seed : int
        The same seed chooses the same pixels.
    progress, cancel : callable, optional
        As for `trace_rays`.

    Raises
    ------
    WarpMapError
        When the map or a pass is missing, damaged, or does not belong to the map.
    BlackHoleError
        For a number of samples or a width out of range.
    Cancelled
        When `cancel` returned true.
    """
    steps = accuracy_steps(path, passes=passes, samples=samples, environment_width=environment_width, seed=seed)
    return drain(steps, progress, cancel)


def accuracy_steps(
    path: PathLike,
    *,
    passes: Sequence[PathLike] = (),
    samples: int = DEFAULT_SAMPLES,
    environment_width: int = DEFAULT_ENVIRONMENT_WIDTH,
    seed: int = 0,
) -> Generator[float, None, AccuracyReport]:
    """Trace sampled pixels of a baked map again, step by step.

    Parameters
    ----------
    path, passes, samples, environment_width, seed
        See `check_accuracy`.

    Yields
    ------
    float
        The fraction done, 0 to 1, after each block of rays.

    Returns
    -------
    AccuracyReport

    Raises
    ------
    WarpMapError
        If the map or a pass is missing, damaged, or does not belong to the map.
    BlackHoleError
        If a number of samples or a width is out of range.
    """
    if not FEWEST_SAMPLES <= samples <= MOST_SAMPLES:
        raise BlackHoleError(
            f"The number of samples is {shown(samples)}; give it a value between {FEWEST_SAMPLES} and {MOST_SAMPLES}.",
            code="settings.range",
        )
    if not 1 <= environment_width <= WIDEST_ENVIRONMENT:
        raise BlackHoleError(
            f"The environment's width is {shown(environment_width)}; it must be 1 to {WIDEST_ENVIRONMENT} pixels.",
            code="settings.range",
        )
    if not 0 <= seed <= LARGEST_SEED:
        raise BlackHoleError(f"The seed is {shown(seed)}; give 0 to {LARGEST_SEED}.", code="settings.range")
    pixels = _read(path)
    pixels.parameters.validate()
    disk = [_read_pass(each, path, pixels.hash) for each in passes]
    share = 0.25 if disk else 1.0 / 3.0
    chosen = yield from share_of(choose(pixels.kind, pixels.kind == SKY, pixels.direction, samples, seed), 0.0, share)
    visibility = yield from share_of(_visibility(pixels.parameters, chosen), share, 2.0 * share)
    rays = yield from share_of(_trace(pixels, chosen), 2.0 * share, 3.0 * share)
    judged = yield from share_of(_judge_passes(disk, pixels.parameters, chosen), 3.0 * share, 4.0 * share)
    return _report(path, pixels, chosen, visibility, rays, environment_width, judged)


# --- reading ----------------------------------------------------------------------------------------


def _read(path: PathLike) -> _Pixels:
    stamp = read_exr_header(path).get(ATTRIBUTE_FORMAT) if os.path.isfile(path) else None
    if isinstance(stamp, str) and stamp.startswith(EXIT_FORMAT.name):
        exit_map = read_exit_map(path)
        seen = (exit_map.direction != 0.0).any(axis=-1)
        kind = np.where(seen, np.uint8(SKY), np.uint8(SHADOW))
        parameters = WarpMapParameters.from_metadata(exit_map.metadata["parameters"])
        lost = exit_map.counts["unresolved"]
        shares, identity = seen.astype(np.float32), exit_map.metadata["hash"]
        return _Pixels(
            parameters, identity, exit_map.direction, exit_map.one_plus_z, shares, kind, exit_map.impact, lost
        )
    warp_map = read_warp_map(path)
    kind = np.full(warp_map.visibility.shape, EDGE, np.uint8)
    kind[warp_map.visibility == 0.0] = SHADOW
    kind[warp_map.visibility == 1.0] = SKY
    kind[warp_map.one_plus_z == UNRESOLVED_ONE_PLUS_Z] = LOST
    direction = np.empty((*kind.shape, 3), np.float32)
    for row, (theta, phi) in enumerate(zip(warp_map.theta, warp_map.phi, strict=True)):
        direction[row] = unit_vectors(theta, phi)
    parameters = WarpMapParameters.from_metadata(warp_map.metadata["parameters"])
    lost = int(np.count_nonzero(kind == LOST))
    identity = warp_map.metadata["hash"]
    return _Pixels(parameters, identity, direction, warp_map.one_plus_z, warp_map.visibility, kind, None, lost)


def _read_pass(path: PathLike, map_path: PathLike, identity: str) -> DiskPass:
    one = read_disk_pass(path)
    if one.metadata["hash"] != identity:
        raise WarpMapError(f"{path} does not belong to {map_path}; bake it again.", code="map.passes-mixed")
    return one


# --- tracing again ----------------------------------------------------------------------------------


def _visibility(parameters: WarpMapParameters, samples: Samples) -> Generator[float, None, Array]:
    """Return the visible share of sampled pixels, shape (n,), from smaller cells than a map's."""
    view = View(parameters)
    shares = np.empty(len(samples))
    for start in range(0, len(samples), EDGE_BLOCK):
        block = slice(start, start + EDGE_BLOCK)
        shares[block], _, _ = refine(samples.column[block], samples.row[block], view.edge, CELLS)
        yield min(start + EDGE_BLOCK, len(samples)) / len(samples)
    center = view.center()
    if center is not None:  # a distant hole is smaller than those cells
        column, row = center_block(center, *parameters.map_size)
        width = parameters.map_size[0]
        small = np.flatnonzero(np.isin(samples.row * width + samples.column, row * width + column))
        if len(small):
            cells = max(CELLS, cells_for_shadow(center, view.edge))
            shares[small], _, _ = refine(samples.column[small], samples.row[small], view.edge, cells)
    return shares


@dataclass(frozen=True)
class _Rays:
    """What the reference finds at the centers of sampled pixels."""

    fate: NDArray[np.uint8]
    direction: Array
    impact: Array | None
    one_plus_z: Array


def _trace(pixels: _Pixels, samples: Samples) -> Generator[float, None, _Rays]:
    """Trace the centers of sampled pixels by the reference method."""
    view = View(pixels.parameters)
    count = len(samples)
    fate = np.empty(count, np.uint8)
    direction, impact = np.empty((2, count, 3))
    one_plus_z = np.empty(count)
    for start in range(0, count, RAY_BLOCK):
        block = slice(start, start + RAY_BLOCK)
        rays = view.rays(*samples.centers(block))
        one_plus_z[block] = rays.one_plus_z
        if pixels.impact is not None:
            fate[block], direction[block], impact[block] = exit_lines(rays, REFERENCE_TOLERANCE, REFERENCE_METHOD)
        else:
            fate[block], hole = trace_block(rays, REFERENCE_TOLERANCE, REFERENCE_METHOD, REFERENCE_STEPS)
            direction[block] = hole @ view.hole_to_world.T
        yield min(start + RAY_BLOCK, count) / count
    return _Rays(fate, direction, None if pixels.impact is None else impact, one_plus_z)


def _judge_passes(
    disk: Sequence[DiskPass], parameters: WarpMapParameters, samples: Samples
) -> Generator[float, None, tuple[DiskAccuracy, ...]]:
    """Compare passes with crossings found by the reference method."""
    if parameters.disk is None or not disk:
        return ()
    view, last = View(parameters), max(one.metadata["crossing"] for one in disk)
    radius, phi, g = np.empty((3, last, len(samples)))
    lost = np.empty(len(samples), dtype=bool)
    for start in range(0, len(samples), RAY_BLOCK):
        block = slice(start, start + RAY_BLOCK)
        found, light = view.crossings(*samples.centers(block), last, DISK_TOLERANCE, REFERENCE_METHOD)
        with np.errstate(all="ignore"):  # beyond a ray's end, where a pass holds nothing
            radius[:, block] = np.where(found.u > 0.0, 1.0 / found.u, np.inf)
            g[:, block] = light.g(parameters.spin, found.u, found.u_slope, parameters.disk.retrograde)
            phi[:, block] = found.unwound + winding(parameters.spin, found.u)
        lost[block] = found.fate == Fate.UNRESOLVED
        yield min(start + RAY_BLOCK, len(samples)) / len(samples)
    inner, outer = parameters.disk.radii(parameters.spin)
    judged = []
    for one in disk:
        order, place = one.metadata["crossing"] - 1, (samples.row, samples.column)
        on_disk = (radius[order] >= inner) & (radius[order] <= outer) & ~lost
        share = one.coverage[place]
        whole = (share == 1.0) & on_disk
        pixel = (samples.row[whole], samples.column[whole])
        turned = (one.phi[pixel] - phi[order, whole] + math.pi) % (2.0 * math.pi) - math.pi
        judged.append(
            DiskAccuracy(
                crossing=order + 1,
                compared=int(whole.sum()),
                radius=_worst(np.abs(one.radius[pixel] / radius[order, whole] - 1.0)),
                azimuth=_worst(np.abs(turned)),
                g=_worst(np.abs(one.g[pixel] / g[order, whole] - 1.0)),
                differing=int(np.count_nonzero(((share == 1.0) & ~on_disk & ~lost) | ((share == 0.0) & on_disk))),
                reference_unresolved=int(lost.sum()),
            )
        )
    return tuple(judged)


# --- comparing --------------------------------------------------------------------------------------


def _report(
    path: PathLike,
    pixels: _Pixels,
    samples: Samples,
    visibility: Array,
    rays: _Rays,
    environment_width: int,
    disk: tuple[DiskAccuracy, ...],
) -> AccuracyReport:
    place = (samples.row, samples.column)
    kind = pixels.kind[place]
    if pixels.impact is not None:  # an exit map knows centers alone
        visibility = np.where(rays.fate == Fate.SHADOW, 0.0, 1.0)
    apart = np.abs(pixels.visibility[place] - visibility)
    # A ray that the reference gave up tells nothing; its pixel's visible share does.
    differs = (apart > VISIBILITY_TOLERANCE) & (kind != LOST)
    compared = (kind == SKY) & (rays.fate == Fate.SKY) & ~differs
    found = pixels.direction[place][compared].astype(np.float64)
    found /= np.linalg.norm(found, axis=-1, keepdims=True)
    error = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(found - rays.direction[compared], axis=-1), 1.0))
    shift = np.abs(pixels.one_plus_z[place][compared] / rays.one_plus_z[compared] - 1.0)
    impact = None
    if pixels.impact is not None and rays.impact is not None:
        impact = _worst(np.linalg.norm(pixels.impact[place][compared] - rays.impact[compared], axis=-1))
    worst = int(np.flatnonzero(compared)[error.argmax()]) if len(error) else None
    even = samples.even[compared]
    return AccuracyReport(
        map=Path(path).name,
        hash=pixels.hash,
        size=(pixels.kind.shape[1], pixels.kind.shape[0]),
        samples=len(samples),
        compared=int(compared.sum()),
        environment_width=environment_width,
        worst=_worst(error),
        worst_pixel=None if worst is None else (int(samples.column[worst]), int(samples.row[worst])),
        percentile_999=float(np.quantile(error[even], 0.999)) if even.any() else 0.0,
        median=float(np.median(error[even])) if even.any() else 0.0,
        redshift=_worst(shift),
        visibility=_worst(np.where(kind == LOST, 0.0, apart)),
        differing=int(differs.sum()),
        differing_pixel=_first(samples, np.where(differs, apart, 0.0)),
        unresolved=pixels.unresolved,
        reference_unresolved=int(np.count_nonzero(rays.fate == Fate.UNRESOLVED)),
        impact=impact,
        disk=disk,
    )


def _worst(errors: NDArray[Any]) -> float:
    return float(errors.max()) if len(errors) else 0.0


def _first(samples: Samples, values: Array) -> tuple[int, int] | None:
    """Return the column and row of the sample of the largest value, None where no value is above 0."""
    best = int(values.argmax()) if len(values) else 0
    return (int(samples.column[best]), int(samples.row[best])) if len(values) and values[best] > 0.0 else None
