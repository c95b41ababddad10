# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of a sky averaged over each pixel's footprint, as plainly as possible: the node group is judged against it.

Looks at K places along the footprint's major axis, each on the level of the sky whose texels are as wide as the
footprint across, or as the distance between two looks if that is wider (Heckbert 1989, "Fundamentals of Texture Mapping
and Image Warping"; McCormack et al. 1999, "Feline: fast elliptical lines for anisotropic texture mapping").
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..light.environment_lookup import sample_environment
from ..light.sky_levels import SkyLevels

FloatArray = NDArray[np.float64]


def sample_filtered(
    environment: ArrayLike, levels: SkyLevels, directions: FloatArray, footprints: FloatArray, looks: int
) -> FloatArray:
    """Mean light of a sky over footprints.

    Parameters
    ----------
    environment : array_like, shape (rows, columns, channels)
        The sky, row 0 at the top.
    levels : SkyLevels
        Its levels.
    directions : ndarray, shape (..., 3)
        Unit vectors.
    footprints : ndarray, shape (..., 4)
        Major axis and log2 of the minor axis of each, as of `footprint`, in the frame of the directions.
    looks : int
        K, at least 1.

    Returns
    -------
    ndarray, shape (..., channels)

    Notes
    -----
    With a the length of the major axis m, b the minor one and s = pi / rows the width of a texel of level 0:

        level = floor(log2(max(b, a / K) / s)), from 0 to the coarsest,
        light = mean of level(D + m sqrt(1 - (2^level s / a)^2) ((k + 1/2) / K - 1/2)) over k = 0 ... K - 1,

    each a bilinear look-up, on level 0 in the sky's own picture. The root takes off the width that the level's own
    texels add. Where a <= s nothing is averaged: the sky itself is looked up.
    """
    picture: FloatArray = np.asarray(environment, dtype=np.float64)
    directions = np.asarray(directions, dtype=np.float64)
    major, minor = footprints[..., :3], footprints[..., 3]
    length = np.sqrt((major * major).sum(axis=-1))
    texel = math.pi / levels.layout.rows
    result = sample_environment(picture, directions)
    wide = length > texel
    if not wide.any():
        return result
    directions, major, minor, length = directions[wide], major[wide], minor[wide], length[wide]
    finest = np.floor(np.maximum(minor, np.log2(length / looks)) - math.log2(texel))
    level = np.clip(finest, 0, levels.layout.count - 1).astype(np.int64)
    spread = np.sqrt(np.maximum(0.0, 1.0 - (texel * 2.0**level / length) ** 2))
    major = major * spread[:, np.newaxis]
    light = np.zeros((len(length), picture.shape[2]))
    for number, coarser in enumerate(levels.levels):
        texels = coarser if number else picture
        chosen = level == number
        for look in range(looks):
            place = directions[chosen] + major[chosen] * ((look + 0.5) / looks - 0.5)
            light[chosen] += sample_environment(texels, place)
    result[wide] = light / looks
    return result
