# SPDX-License-Identifier: GPL-3.0-or-later
"""Streaks and clumps on the disk that turn with it, for a shot of any length.

The pattern is a picture with azimuth across, where it repeats, and the logarithm of the radius down. Matter at radius
r turns with Omega(r), so after a time t the pattern at (r, phi) is the picture at phi - Omega(r) t: seamless, but
sheared without bound. So no pattern lives for ever. Two are shown at a time, each for a period P from its beginning:
it is sheared for that long and no longer, by (Omega(inner) - Omega(outer)) P = 2 pi `SHEAR_TURNS` at the most; its
share swells from 0 to 1 and back as sin^2(pi t / P), while that of the other, half a period later, is the rest. A
pattern begins and ends unseen, each one turned by another angle, and everything in it moves with exactly Omega(r) at
all times. (Flow maps in games are reset in this way: A. Vlachos 2010, "Water Flow in Portal 2", SIGGRAPH courses.)

All that a frame needs is a picture looked up twice at shifted azimuths and a mix, which compositor and shader nodes can
do, and it depends on the frame's time alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..kerr.orbiting_matter import orbital_frequency
from ..numerics.arrays import Array

TEXTURE_WIDTH, TEXTURE_HEIGHT = 2048, 512

# A texture has two channels, streaks and clumps; a picture's are red, green, blue and alpha.
PICTURE_CHANNELS = 4

# How many turns the inner rim gets ahead of the outer one before a pattern has ended.
SHEAR_TURNS = 1.5

# Each pattern is turned against the one before by this share of a turn: the golden section, which comes near to a
# repetition as late as any number does.
TURN_BETWEEN = 0.5 * (math.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class Pattern:
    """The spectrum of a random picture: amplitude (1 + (m / m_0)^2 + (k / k_0)^2)^(-slope / 2)."""

    across: float
    """m_0, waves around the disk up to which all are alike."""
    down: float
    """k_0, waves from rim to rim up to which all are alike."""
    slope: float


STREAKS = Pattern(across=2.0, down=26.0, slope=2.2)
CLUMPS = Pattern(across=7.0, down=5.0, slope=2.6)


def random_picture(pattern: Pattern, seed: int, width: int = TEXTURE_WIDTH, height: int = TEXTURE_HEIGHT) -> Array:
    """Return a random picture of values spread evenly over 0 to 1 that repeats in both directions.

    A Gaussian random field of the given spectrum, by Fourier transformation, mapped to an even distribution.

    Parameters
    ----------
    pattern : Pattern
        The spectrum.
    seed : int
    width, height : int
        Texels.

    Returns
    -------
    ndarray, shape (height, width)
    """
    random = np.random.default_rng(seed)
    m = np.fft.rfftfreq(width, 1.0 / width)
    k = np.fft.fftfreq(height, 1.0 / height)[:, None]
    amplitude = (1.0 + (m / pattern.across) ** 2 + (k / pattern.down) ** 2) ** (-0.5 * pattern.slope)
    amplitude[0, 0] = 0.0
    spectrum = amplitude * (random.normal(size=amplitude.shape) + 1j * random.normal(size=amplitude.shape))
    field = np.fft.irfft2(spectrum, s=(height, width))
    ranks = np.empty(field.size)
    ranks[np.argsort(field, axis=None)] = (np.arange(field.size) + 0.5) / field.size
    return ranks.reshape(field.shape)


def disk_texture(seed: int = 1, width: int = TEXTURE_WIDTH, height: int = TEXTURE_HEIGHT) -> Array:
    """Return a texture of streaks and clumps.

    Parameters
    ----------
    seed : int
        Another seed makes another texture.
    width, height : int
        Texels around the disk and across it.

    Returns
    -------
    ndarray, shape (height, width, 2)
        Streaks and clumps, 0 to 1; row 0 at the inner rim, column 0 at azimuth 0.
    """
    return np.stack(
        [
            random_picture(STREAKS, 2 * seed, width, height),
            random_picture(CLUMPS, 2 * seed + 1, width, height),
        ],
        axis=-1,
    )


def look_up(texture: Array, radius: Array, phi: Array, inner: float, outer: float) -> Array:
    """Return the texture at places on the disk, interpolated bilinearly.

    Azimuth 0 to 2 pi runs across and wraps around; ln(r / inner) / ln(outer / inner) runs down and ends at the rims.

    Parameters
    ----------
    texture : ndarray, shape (rows, columns, channels)
    radius, phi : ndarray, shape (...)
        Units of M, and radians.
    inner, outer : float
        The disk's radii, units of M.

    Returns
    -------
    ndarray, shape (..., channels)
    """
    height, width = texture.shape[:2]
    column = phi * (width / (2.0 * math.pi)) - 0.5
    row = np.log(np.clip(radius, inner, outer) / inner) * (height / math.log(outer / inner)) - 0.5
    row = np.clip(row, 0.0, height - 1.0)
    left, top = np.floor(column), np.floor(row)
    share_x, share_y = (column - left)[..., None], (row - top)[..., None]
    left_index = left.astype(np.int64) % width
    right_index = (left_index + 1) % width
    top_index = top.astype(np.int64)
    bottom_index = np.minimum(top_index + 1, height - 1)
    upper = texture[top_index, left_index] * (1.0 - share_x) + texture[top_index, right_index] * share_x
    lower = texture[bottom_index, left_index] * (1.0 - share_x) + texture[bottom_index, right_index] * share_x
    values: Array = upper * (1.0 - share_y) + lower * share_y
    return values


def pattern_period(spin: float, inner: float, outer: float, retrograde: bool = False) -> float:
    """Return how long a pattern is shown: until its inner rim is `SHEAR_TURNS` ahead of its outer one.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    inner, outer : float
        The disk's radii, units of M.
    retrograde : bool
        Whether the disk orbits against the hole's rotation.

    Returns
    -------
    float
        P, units of M.
    """
    fast, slow = np.abs(orbital_frequency(spin, np.array([inner, outer]), retrograde))
    return float(2.0 * math.pi * SHEAR_TURNS / (fast - slow))


def pattern_shares(time: float, period: float) -> list[tuple[float, float, float]]:
    """Return the two patterns that are shown at a time.

    Parameters
    ----------
    time : float
        Units of M.
    period : float
        From `pattern_period`, units of M.

    Returns
    -------
    list of (float, float, float)
        Age (units of M), share and turn (radians) of each pattern; the shares sum to 1.
    """
    patterns = []
    for delay in (0.0, 0.5):
        cycles = time / period + delay
        number = math.floor(cycles)
        phase = cycles - number
        turn = 2.0 * math.pi * ((TURN_BETWEEN * (2 * number + 2.0 * delay)) % 1.0)
        patterns.append((phase * period, math.sin(math.pi * phase) ** 2, turn))
    return patterns


def moving_texture(
    texture: Array,
    radius: Array,
    phi: Array,
    time: float,
    spin: float,
    inner: float,
    outer: float,
    retrograde: bool = False,
    period: float | None = None,
) -> Array:
    """Return the texture at places on the disk at a time, shape (..., channels), 0 to 1.

    Parameters
    ----------
    texture : ndarray, shape (rows, columns, 2 or 4)
        See `disk_texture`; any picture that repeats across will do.
    radius, phi : ndarray, shape (...)
        Units of M, and radians.
    time : float
        Coordinate time, units of M.
    spin, inner, outer, retrograde
        The disk.
    period : float, optional
        How long a pattern is shown, units of M; `pattern_period` of this disk by default. A shot whose spin or edges
        change needs one for all of its frames.

    Notes
    -----
    A picture of four channels is one of colors, premultiplied: its two patterns are mixed as they are.
    """
    omega = orbital_frequency(spin, radius, retrograde)
    if period is None:
        period = pattern_period(spin, inner, outer, retrograde)
    middle = 0.0 if texture.shape[2] == PICTURE_CHANNELS else 0.5
    total = np.zeros((*np.shape(radius), texture.shape[2]))
    squares = 0.0
    for age, share, turn in pattern_shares(time, period):
        total += share * (look_up(texture, radius, phi - omega * age + turn, inner, outer) - middle)
        squares += share * share
    if texture.shape[2] == PICTURE_CHANNELS:
        return total
    # Two patterns that know nothing of each other would average out to less contrast than one has.
    return np.clip(0.5 + total / math.sqrt(squares), 0.0, 1.0)
