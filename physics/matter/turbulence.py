# SPDX-License-Identifier: GPL-3.0-or-later
"""Turbulence of the disk: strands of hot gas and clouds of dense gas, as Gaussian random fields that repeat.

A field's spectrum is isotropic in a frame that is turned by the pitch and stretched along it,
(1 + (along / m_0)^2 + (across / (m_0 stretch))^2)^(-slope / 2). Ridges are sums of octaves of 1 - |n| (Musgrave 1998,
in Texturing and Modeling, ch. 16). The fields are warped by another one, and mapped by rank to a normal distribution,
so that how much light they give is known in closed form (`surface`).
"""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist

import numpy as np

from ..light.matter_settings import MatterLook
from ..numerics.arrays import Array
from .rip_map import RipMap

COLUMNS, ROWS = 2048, 512
# Large clouds have no fine detail.
COARSE_SHARE = 4
SPAN = 1.0
"""Logarithm of the radius after which a field repeats, finely; coarsely, three times that."""
COARSE_SPAN = 3.0
COARSE_WAVES, COARSE_STRETCH = 0.5, 0.35

SLOPE, SMOOTH_SLOPE, RIDGE_SLOPE = 2.1, 3.5, 4.0
RIDGE_OCTAVES, RIDGE_GAIN, RIDGE_WAVES, RIDGE_STRETCH = 4, 0.55, 1.6, 0.25
DENSE_WAVES, DENSE_SLOPE, DENSE_RIDGES = 0.8, 0.2, 0.35
WARP_STRETCH, WARP_WAVES = 3.0, 0.8

_QUANTILES = np.array([NormalDist().inv_cdf((k + 0.5) / 4096) for k in range(4096)])


def fields(look: MatterLook, trailing: float) -> tuple[RipMap, RipMap]:
    """Return the fine and the coarse field of a look.

    Parameters
    ----------
    look : MatterLook
    trailing : float
        1 if the matter orbits toward +phi, else -1: strands trail.
    """
    shape = look.waves, look.stretch, trailing * look.pitch, look.ridges, look.warp
    return _fine(*shape, look.seed), _coarse(*shape, look.seed)


@lru_cache(maxsize=4)
def _fine(waves: float, stretch: float, pitch: float, ridges: float, warp: float, seed: int) -> RipMap:
    return _make(waves, stretch, pitch, ridges, warp, 2 * seed, COLUMNS, ROWS, SPAN)


@lru_cache(maxsize=4)
def _coarse(waves: float, stretch: float, pitch: float, ridges: float, warp: float, seed: int) -> RipMap:
    size = COLUMNS // COARSE_SHARE, ROWS // COARSE_SHARE
    waves, stretch = max(waves * COARSE_WAVES, 1.0), max(stretch * COARSE_STRETCH, 1.0)
    return _make(waves, stretch, pitch, 0.5 * ridges, warp, 2 * seed + 1, *size, COARSE_SPAN)


def _make(
    waves: float,
    stretch: float,
    pitch: float,
    ridges: float,
    warp: float,
    seed: int,
    columns: int,
    rows: int,
    span: float,
) -> RipMap:
    random = np.random.default_rng(seed)
    m = np.fft.rfftfreq(columns, 1.0 / columns)
    k = np.fft.fftfreq(rows, 1.0 / rows)[:, None] * (2.0 * math.pi / span)
    cos, sin = math.cos(math.radians(pitch)), math.sin(math.radians(pitch))
    along, across = m * cos - k * sin, m * sin + k * cos

    def field(waves: float, stretch: float, slope: float) -> Array:
        amplitude = (1.0 + (along / waves) ** 2 + (across / (waves * stretch)) ** 2) ** (-0.5 * slope)
        amplitude[0, 0] = 0.0
        phases = random.normal(size=amplitude.shape) + 1j * random.normal(size=amplitude.shape)
        values = np.fft.irfft2(amplitude * phases, s=(rows, columns))
        scaled: Array = values / values.std()
        return scaled

    right = field(waves * WARP_WAVES, WARP_STRETCH, SMOOTH_SLOPE) * (warp * columns / (2.0 * math.pi * waves))
    down = field(waves * WARP_WAVES, WARP_STRETCH, SMOOTH_SLOPE) * (warp * rows / (span * waves * stretch))

    def threads() -> Array:
        total, gain = np.zeros((rows, columns)), 1.0
        for octave in range(RIDGE_OCTAVES):
            noise = field(waves * RIDGE_WAVES * 2**octave, stretch * (1.0 + RIDGE_STRETCH * octave), RIDGE_SLOPE)
            total += gain * (1.0 - np.minimum(np.abs(noise), 2.0))
            gain *= RIDGE_GAIN
        return normal(total)

    heat = (1.0 - ridges) * field(waves, stretch, SLOPE) + ridges * threads()
    dense = field(waves * DENSE_WAVES, stretch, SLOPE + DENSE_SLOPE) * DENSE_WAVES + DENSE_RIDGES * threads()
    return RipMap(normal(_moved(heat, right, down)), normal(_moved(dense, right, down)), span)


def normal(field: Array) -> Array:
    """Return a field mapped by rank to a normal distribution of mean 0 and variance 1."""
    ranks = np.empty(field.size)
    places = (np.arange(len(_QUANTILES)) + 0.5) / len(_QUANTILES)
    ranks[np.argsort(field, axis=None)] = np.interp((np.arange(field.size) + 0.5) / field.size, places, _QUANTILES)
    mapped: Array = (ranks / ranks.std()).reshape(field.shape)
    return mapped


def _moved(field: Array, right: Array, down: Array) -> Array:
    """Return a field looked up so many texels away, bilinear; it repeats."""
    rows, columns = field.shape
    y, x = np.mgrid[:rows, :columns] + np.stack([down, right])
    top, left = np.floor(y).astype(np.intp), np.floor(x).astype(np.intp)
    y, x = y - top, x - left

    def at(below: int, beside: int) -> Array:
        values: Array = field[(top + below) % rows, (left + beside) % columns]
        return values

    upper, lower = at(0, 0) * (1.0 - x) + at(0, 1) * x, at(1, 0) * (1.0 - x) + at(1, 1) * x
    moved: Array = upper * (1.0 - y) + lower * y
    return moved
