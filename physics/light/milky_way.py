# SPDX-License-Identifier: GPL-3.0-or-later
"""The Milky Way: the light of all stars that are too faint to be drawn one by one, with its dust, and its neighbors.

A picture of the whole sky in the colors of Gaia, without its single stars (data/README.md says how it was made), gives
the shape: bulge, dust lanes, clouds, the Magellanic Clouds. How bright it is, and of which color on the whole, follows
from published numbers.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..images.exr import read_exr
from ..numerics.arrays import Array
from .environment_lookup import sample_environment

PICTURE = Path(__file__).parent / "data" / "milky_way.exr"

BRIGHTNESS = 61.4
"""Mean luminance within `BAND` of the galactic plane, in magnitude 0 stars per steradian: 187 stars of magnitude 10 per
square degree.

It is that of a double-exponential disc of stars behind a double-exponential disc of dust, less the stars to magnitude
8. Scale height 300 pc and length 2600 pc (Juric et al. 2008, ApJ 673, 864); 24.4 solar luminosities per square
parsec in V at the Sun, and B-V 0.73 (Flynn et al. 2006, MNRAS 372, 1149); extinction 0.7 mag/kpc, height 140 pc, length
4500 pc (Robin et al. 2003, A&A 409, 523); 8 kpc to the center (Reid 1993, ARA&A 31, 345).
"""

BAND = math.radians(15.0)

# From equatorial to galactic coordinates, J2000: the galactic pole, and the longitude of the celestial pole.
_POLE_RA, _POLE_DEC, _CELESTIAL_POLE_LONGITUDE = np.radians([192.85948, 27.12825, 122.93192])


def galactic_axes() -> Array:
    """The axes of galactic coordinates in equatorial ones: rows towards the center, l = 90 degrees, the pole.

    Source: the IAU's definition of 1958, transferred to J2000 (Hipparcos catalog, volume 1, section 1.5.3).
    """
    sin_dec, cos_dec = math.sin(_POLE_DEC), math.cos(_POLE_DEC)
    sin_ra, cos_ra = math.sin(_POLE_RA), math.cos(_POLE_RA)
    pole = np.array([cos_dec * cos_ra, cos_dec * sin_ra, sin_dec])
    # In the galactic plane: towards the celestial pole, and a quarter turn of longitude further.
    northward = np.array([-sin_dec * cos_ra, -sin_dec * sin_ra, cos_dec])
    onward = np.cross(pole, northward)
    sin_l, cos_l = math.sin(_CELESTIAL_POLE_LONGITUDE), math.cos(_CELESTIAL_POLE_LONGITUDE)
    return np.array([cos_l * northward - sin_l * onward, sin_l * northward + cos_l * onward, pole])


@functools.cache
def _picture() -> Array:
    """Mean luminance 1 within `BAND`; galactic coordinates, the center in the middle, longitude growing to the left."""
    pixels, _attributes = read_exr(PICTURE)
    picture: Array = np.asarray(pixels[..., :3], dtype=np.float64)
    return picture


def diffuse_light(directions: ArrayLike) -> Array:
    """Light of the Milky Way seen in these directions.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Unit vectors, equatorial J2000 (x towards RA 0, z north).

    Returns
    -------
    ndarray, shape (..., 3)
        Linear Rec. 709, in fluxes of a magnitude 0 star per steradian.
    """
    galactic = np.asarray(directions, dtype=np.float64) @ galactic_axes().T
    return BRIGHTNESS * sample_environment(_picture(), galactic)
