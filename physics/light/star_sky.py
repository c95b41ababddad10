# SPDX-License-Identifier: GPL-3.0-or-later
"""A panorama of the real night sky: every star to magnitude 8, and the Milky Way.

Stars are drawn as small Gaussian spots on the sphere, not on the panorama, so they are round in every
direction, at the celestial poles too, and each spot's light adds up to what its magnitude says exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array
from ..numerics.errors import BlackHoleError
from . import black_body
from .milky_way import diffuse_light
from .star_color import temperature_from_color_index

CATALOG = Path(__file__).parent / "data" / "stars_xhip.npz"
FAINTEST = 8.0
"""The magnitude that the catalog reaches."""

ZERO_MAGNITUDE = 1.2e-4
"""Light of a star of magnitude 0 in the picture, in radiance times steradian.

Chosen for an exposure of 0: at the default size, magnitude 0 peaks at about 22 (white under any view
transform), magnitude 6, the limit of the naked eye, at 0.09, a faint but visible dot.
"""

_REACH = 4.0  # of a spot, in standard deviations: beyond, less than 0.04 % of its light is left
_SMALLEST_HEIGHT = 16
_ROWS_AT_ONCE = 64


@dataclass(frozen=True)
class Stars:
    """A catalog of stars; arrays of shape (n,)."""

    right_ascension: Array  # radians, J2000
    declination: Array  # radians, J2000
    magnitude: Array  # V
    color_index: Array  # B-V, NaN where unknown

    @property
    def flux(self) -> Array:
        """Flux of each star in units of a star of magnitude 0 (Pogson's law)."""
        result: Array = 10.0 ** (-0.4 * self.magnitude)
        return result


def load_stars(magnitude_limit: float = FAINTEST) -> Stars:
    """The real stars down to a visual magnitude, brightest first.

    Parameters
    ----------
    magnitude_limit : float
        The faintest visual magnitude wanted; the catalog ends at 8.0.

    Returns
    -------
    Stars
        From XHIP (Anderson & Francis 2012, Astronomy Letters 38, 331); see data/README.md.

    Raises
    ------
    BlackHoleError
        If the limit is not a number.
    """
    if math.isnan(magnitude_limit):
        raise BlackHoleError("The magnitude limit is not a number; give one between -1 and 8.", code="settings.range")
    with np.load(CATALOG) as file:
        columns = {name: file[name].astype(np.float64) for name in ("ra_deg", "dec_deg", "v_mag", "b_v")}
    bright = columns["v_mag"] <= magnitude_limit
    return Stars(
        right_ascension=np.radians(columns["ra_deg"][bright]),
        declination=np.radians(columns["dec_deg"][bright]),
        magnitude=columns["v_mag"][bright],
        color_index=columns["b_v"][bright],
    )


def texel_directions(rows: NDArray[np.intp], height: int) -> Array:
    """Unit vectors of the centers of a panorama's texels.

    Parameters
    ----------
    rows : ndarray of int, shape (n,)
        Rows, 0 at the top.
    height : int
        Height of the panorama in texels; its width is twice that.

    Returns
    -------
    ndarray, shape (n, 2 * height, 3)
        Directions with u = 0.5 - atan2(y, x) / (2 pi) and v = 0.5 + asin(z) / pi, Blender's convention.
    """
    latitude = math.pi * (0.5 - (rows + 0.5) / height)
    longitude = 2.0 * math.pi * (0.5 - (np.arange(2 * height) + 0.5) / (2 * height))
    cosine = np.cos(latitude)[:, np.newaxis]
    return np.stack(
        [
            cosine * np.cos(longitude),
            cosine * np.sin(longitude),
            np.broadcast_to(np.sin(latitude)[:, np.newaxis], (len(rows), 2 * height)),
        ],
        axis=-1,
    )


def row_solid_angles(height: int) -> Array:
    """Solid angle (sr) of a texel of each row of a panorama twice as wide as high, shape (height,)."""
    edges = np.cos(np.linspace(0.0, math.pi, height + 1))
    solid_angles: Array = (edges[:-1] - edges[1:]) * math.pi / height
    return solid_angles


def draw_stars(stars: Stars, height: int, star_width: float = 0.6) -> Array:
    """Draw each star as a Gaussian spot on the sphere, its light conserved.

    Parameters
    ----------
    stars : Stars
        What to draw.
    height : int
        Height of the panorama in texels; its width is twice that.
    star_width : float
        Standard deviation of a spot in heights of a texel, > 0.

    Returns
    -------
    ndarray, shape (height, 2 * height, 3)
        Linear Rec. 709 radiance in units of `ZERO_MAGNITUDE`: the luminance times the texels' solid angles
        adds up to the stars' fluxes.
    """
    width = 2 * height
    texel = math.pi / height
    sigma = star_width * texel
    solid_angles = row_solid_angles(height)
    colors = black_body.color(temperature_from_color_index(stars.color_index)) * stars.flux[:, np.newaxis]
    # Continuous position in the panorama, texel centers at i + 0.5.
    row = (0.5 - stars.declination / math.pi) * height
    column = (0.5 - stars.right_ascension / (2.0 * math.pi)) * width
    row_reach = math.ceil(_REACH * star_width) + 1
    rows = np.floor(row).astype(np.intp)[:, np.newaxis] + np.arange(-row_reach, row_reach + 1)
    reaches = _column_reaches(stars.declination, _REACH * sigma, width)

    picture = np.zeros((height * width, 3))
    for reach in np.unique(reaches):
        everything = bool(2 * reach + 1 >= width)
        offsets = np.arange(width) if everything else np.arange(-reach, reach + 1)
        # A spot close to a pole covers whole rows; blocks bound the memory that this takes.
        members = np.flatnonzero(reaches == reach)
        block = max(1, 2_000_000 // (len(offsets) * rows.shape[1]))
        for start in range(0, len(members), block):
            chosen = members[start : start + block]
            r = rows[chosen][:, :, np.newaxis]
            inside = (r >= 0) & (r < height)
            r = np.clip(r, 0, height - 1)
            c = (np.floor(column[chosen]).astype(np.intp)[:, np.newaxis, np.newaxis] + offsets) % width
            latitude = math.pi * (0.5 - (r + 0.5) / height)
            declination = stars.declination[chosen][:, np.newaxis, np.newaxis]
            turn = 2.0 * math.pi * (c + 0.5 - column[chosen][:, np.newaxis, np.newaxis]) / width
            # The squared chord between star and texel, without cancellation, right at the poles as well.
            chord2 = 4.0 * (
                np.sin(0.5 * (latitude - declination)) ** 2
                + np.cos(latitude) * np.cos(declination) * np.sin(0.5 * turn) ** 2
            )
            weight = np.where(inside, np.exp(-0.5 * chord2 / sigma**2), 0.0)
            light = np.sum(weight * solid_angles[r], axis=(1, 2), keepdims=True)
            weight /= light
            texels = (r * width + c).ravel()
            for channel in range(3):
                values = weight * colors[chosen, channel][:, np.newaxis, np.newaxis]
                # Not `picture[texels] += ...`: one texel may belong to several stars.
                np.add.at(picture[:, channel], texels, values.ravel())
    return picture.reshape(height, width, 3)


def _column_reaches(declination: Array, reach: float, width: int) -> NDArray[np.intp]:
    """How many columns a spot of this angular reach spans to each side: a power of two or half the width."""
    furthest = np.abs(declination) + reach
    with np.errstate(divide="ignore"):
        # sin(half the turn) <= sin(half the reach) / cos(latitude), at the latitude closest to the pole
        sine = math.sin(0.5 * reach) / np.cos(np.minimum(furthest, 0.5 * math.pi))
    away_from_pole = (furthest < 0.5 * math.pi) & (sine < 1.0)
    turn = np.where(away_from_pole, 2.0 * np.arcsin(np.minimum(sine, 1.0)), math.pi)
    columns = np.ceil(turn / (2.0 * math.pi) * width) + 1.0
    result: NDArray[np.intp] = np.minimum(2.0 ** np.ceil(np.log2(columns)), width // 2).astype(np.intp)
    return result


def star_sky(
    height: int = 2048,
    *,
    magnitude_limit: float = FAINTEST,
    galactic_glow: bool = True,
    star_width: float = 0.6,
) -> NDArray[np.float32]:
    """An equirectangular panorama of the real stars and the Milky Way.

    Parameters
    ----------
    height : int
        Height in texels, at least 16; the width is twice that.
    magnitude_limit : float
        The faintest visual magnitude drawn as a star of its own; the catalog ends at 8.0.
    galactic_glow : bool
        Whether to add the Milky Way, the light of the stars that the catalog does not have; see `milky_way`.
    star_width : float
        Standard deviation of a star's spot in heights of a texel, between 0.3 and 20.

    Returns
    -------
    ndarray of float32, shape (height, 2 * height, 3)
        Linear Rec. 709 radiance; row 0 is the top, declination +90 degrees. A direction (x, y, z), with x
        towards right ascension 0, y towards 6 h and z north, is found at u = 0.5 - atan2(y, x) / (2 pi) from
        the left and v = 0.5 + asin(z) / pi from the bottom, Blender's convention. A star of magnitude 0
        carries `ZERO_MAGNITUDE`.

    Raises
    ------
    BlackHoleError
        If the height or the width of the stars is out of range.
    """
    _check_height(height)
    if not 0.3 <= star_width <= 20.0:
        raise BlackHoleError(
            f"A star width of {star_width} texels is not drawable; give one from 0.3 to 20.", code="settings.range"
        )
    stars = load_stars(magnitude_limit)
    picture = draw_stars(stars, height, star_width)
    result: NDArray[np.float32] = (ZERO_MAGNITUDE * picture).astype(np.float32)
    if galactic_glow:
        result += milky_way_sky(height)
    return result


def milky_way_sky(height: int = 1280) -> NDArray[np.float32]:
    """A panorama of the Milky Way alone, the sky behind stars that are drawn as points.

    Parameters
    ----------
    height : int
        Height in texels, at least 16; the width is twice that.

    Returns
    -------
    ndarray of float32, shape (height, 2 * height, 3)
        What `star_sky` adds to the stars.

    Raises
    ------
    BlackHoleError
        If the height is out of range.
    """
    _check_height(height)
    picture = np.empty((height, 2 * height, 3), np.float32)
    for start in range(0, height, _ROWS_AT_ONCE):
        rows = np.arange(start, min(start + _ROWS_AT_ONCE, height))
        picture[rows] = ZERO_MAGNITUDE * diffuse_light(texel_directions(rows, height))
    return picture


def _check_height(height: int) -> None:
    if height < _SMALLEST_HEIGHT:
        raise BlackHoleError(
            f"A sky {height} texels high is too small; give at least {_SMALLEST_HEIGHT}.", code="settings.range"
        )
