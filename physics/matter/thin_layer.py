# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of a thin sheet of matter, from a map's passes, front to back.

Each pixel is shaded in full at 1, 2, 4, 8 or 16 places along the major axis of what it covers (Greene & Heckbert 1986,
"Creating raster Omnimax images from multiple perspective views using the elliptical weighted average filter"), and each
of these looks into rip maps that are averaged over the rest of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..disk_passes.disk_pass import DiskPass
from ..numerics.arrays import Image
from ..sampling.view import View
from .footprints import Footprints, Pixels, footprints
from .surface import Surface

BLOCK = 1 << 16
"""Pixels shaded at a time: their values stay in the cache."""

TEXELS_PER_TAP, MOST_TAPS = 3.0, 16

LEAST_TAPPED = 1e-2
"""Least 1 / r of a tap over that of its pixel."""


def slants(view: View, size: tuple[int, int], rows: slice = slice(None)) -> Image:
    """Return sqrt(q) / E_camera of the pixels of some rows, flat: times g / r the cosine of emission in the matter's
    frame, whose polar component of the light's momentum is sqrt(q) / r in the equatorial plane.
    """
    columns, height = size
    x, y = (np.arange(each, dtype=np.float64) + 0.5 for each in (columns, height))
    found = view.carter(x, y[rows, None])
    slant: Image = np.sqrt(np.maximum(found, 0.0)).astype(np.float32).ravel()
    return slant


def thin_layer(
    surface: Surface,
    passes: Sequence[DiskPass],
    view: View,
    time: float,
    delays: Sequence[Image] | None = None,
    filtered: bool = True,
) -> Image:
    """Return premultiplied light and what passes through, shape (height, width, 4).

    Parameters
    ----------
    surface : Surface
    passes : sequence of DiskPass
        Of one map, the first crossing first.
    view : View
        Of the map.
    time : float
        Units of M.
    delays : sequence of ndarray, shape (height, width), optional
        For each pass, how much earlier each place is seen than at `time`, units of M.
    filtered : bool
        False shades each pixel at one place without a filter: what a picture of many more pixels needs.
    """
    rows, columns = passes[0].radius.shape
    size = columns, rows
    layer = np.zeros((rows * columns, 4), dtype=np.float32)
    layer[:, 3] = 1.0
    slant = slants(view, size)
    for number, one in enumerate(passes):
        coverage = one.coverage.ravel()
        covered = np.flatnonzero(coverage > 0.0).astype(np.int32)
        if not len(covered):
            continue
        log_radius, log_g = np.zeros((2, rows * columns), dtype=np.float32)
        log_radius[covered], log_g[covered] = (np.log(each.ravel()[covered]) for each in (one.radius, one.g))
        planes = log_radius, one.phi.ravel(), log_g
        late = None if delays is None else delays[number].ravel()
        for start in range(0, len(covered), BLOCK):
            pixels = covered[start : start + BLOCK]
            here = planes[0].take(pixels), planes[1].take(pixels), planes[2].take(pixels), slant.take(pixels)
            delay = None if late is None else late.take(pixels)
            if filtered:
                covers = footprints(planes, coverage, pixels, size, _texels(surface), _whole(surface))
                light, alpha = _filtered(surface, here, covers, time, delay)
            else:
                none = np.zeros(len(pixels), dtype=np.float32)
                light, alpha = surface.shade(*here, time, delay, surface.levels(none, none))
                light *= alpha[:, None]
            share = coverage.take(pixels)
            behind = layer[pixels]
            through = behind[:, 3].copy()
            light *= (through * share)[:, None]
            behind += light
            behind[:, 3] = through * (np.float32(1.0) - alpha * share)
            layer[pixels] = behind
    return layer.reshape(rows, columns, 4)


def _texels(surface: Surface) -> tuple[float, float]:
    field = surface.fine.field
    return field.rows / field.span, field.columns / (2.0 * math.pi)


def _whole(surface: Surface) -> float:
    return float(surface.log_outer - surface.log_inner)


def _filtered(
    surface: Surface, here: tuple[Image, Image, Image, Image], covers: Footprints, time: float, delay: Image | None
) -> tuple[Image, Image]:
    """Return premultiplied light and opacity of pixels, the mean over the taps of each."""
    log_radius, phi, log_g, slant = here
    light = np.empty((len(phi), 4), dtype=np.float32)
    alpha = np.empty(len(phi), dtype=np.float32)
    doublings = np.log2(np.maximum(covers.length * np.float32(1.0 / TEXELS_PER_TAP), np.float32(1.0)))
    doublings = np.minimum(np.ceil(doublings), math.log2(MOST_TAPS)).astype(np.int32)
    whole, least = np.float32(_whole(surface)), np.float32(LEAST_TAPPED)
    for doubling in range(int(math.log2(MOST_TAPS)) + 1):
        some: Pixels = np.flatnonzero(doublings == doubling).astype(np.int32)
        if not len(some):
            continue
        taps = 1 << doubling
        step = [each.take(some) * np.float32(1.0 / taps) for each in (covers.log_radius, covers.phi, covers.log_g)]
        levels = surface.levels(
            np.minimum(np.hypot(covers.wide_log_radius.take(some), step[0]), whole),
            np.hypot(covers.wide_phi.take(some), step[1]),
        )
        place = [each.take(some) for each in (log_radius, phi, log_g)]
        late = None if delay is None else delay.take(some)
        total, opaque = np.zeros((len(some), 4), dtype=np.float32), np.zeros(len(some), dtype=np.float32)
        for tap in range(taps):
            off = np.float32(tap + 0.5 - 0.5 * taps)
            # 1 / r is nearly linear across a pixel.
            tapped = place[0] - np.log(np.maximum(np.float32(1.0) - off * step[0], least))
            np.clip(tapped, surface.log_inner, surface.log_outer, out=tapped)
            seen, hides = surface.shade(
                tapped, place[1] + off * step[1], place[2] + off * step[2], slant.take(some), time, late, levels
            )
            seen *= hides[:, None]
            total += seen
            opaque += hides
        light[some] = total * np.float32(1.0 / taps)
        alpha[some] = opaque * np.float32(1.0 / taps)
    return light, alpha
