# SPDX-License-Identifier: GPL-3.0-or-later
"""A smooth Milky Way from published numbers alone, by which the brightness of the picture is checked.

Starlight is emitted by a double-exponential disc, dimmed by a double-exponential disc of dust, and summed
along each line of sight; the Sun is in the plane. The numbers follow these works, rounded; none is adjusted to the
picture:

* disc of stars: scale height 300 pc, scale length 2600 pc (Juric et al. 2008, ApJ 673, 864); luminosity of
  the column through the disc at the Sun 24.4 solar luminosities per square parsec in V, color from its
  mass-to-light ratios 1.4 in B and 1.5 in V (Flynn et al. 2006, MNRAS 372, 1149);
* dust: extinction 0.7 mag/kpc in V at the Sun, scale height 140 pc, scale length 4500 pc (the diffuse
  extinction of the Besancon model, Robin et al. 2003, A&A 409, 523);
* distance of the galactic center 8 kpc (Reid 1993, ARA&A 31, 345); the Sun's absolute magnitude 4.81 in V
  (Willmer 2018, ApJS 236, 47).

The stars of the catalog are drawn one by one, so their light must not be counted twice. They are, roughly,
the nearest ones; so the glow starts at the distance within which the model emits just as much light, averaged
over the sky, as the drawn stars have together.

Limits: a smooth disc. Bulge, spiral arms, single dust clouds and all nebulae are missing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from physics.light.milky_way import galactic_axes
from physics.numerics.arrays import Array

STAR_HEIGHT = 300.0  # pc
STAR_LENGTH = 2600.0  # pc
STAR_COLUMN = 24.4  # solar luminosities / pc^2, V
DUST_HEIGHT = 140.0  # pc
DUST_LENGTH = 4500.0  # pc
DUST_EXTINCTION = 0.7e-3  # mag / pc, V
CENTER_DISTANCE = 8000.0  # pc
SUN_ABSOLUTE_MAGNITUDE = 4.81  # V
SUN_COLOR_INDEX = 0.65  # B-V
COLOR_INDEX = SUN_COLOR_INDEX - 2.5 * math.log10(1.5 / 1.4)
"""B-V of the disc's light: the luminosities in B and V go as the inverse of the mass-to-light ratios."""

# The grid of the table. The model is symmetric in latitude and in longitude, and steepest close to the plane.
_LATITUDES = np.radians(90.0 * np.linspace(0.0, 1.0, 121) ** 2)
_LONGITUDES = np.radians(np.linspace(0.0, 180.0, 61))
_DISTANCES = np.concatenate([[0.0], np.geomspace(10.0, 25000.0, 240)])  # pc


@dataclass(frozen=True)
class Glow:
    """Brightness of the sky by galactic latitude and longitude, in magnitude 0 stars per steradian."""

    table: Array  # shape (latitudes, longitudes)

    def __call__(self, directions: ArrayLike) -> Array:
        """Brightness seen in these directions.

        Parameters
        ----------
        directions : array_like, shape (..., 3)
            Unit vectors, equatorial J2000 (x towards RA 0, z north).

        Returns
        -------
        ndarray, shape (...)
            Fluxes of a magnitude 0 star per steradian.
        """
        galactic = np.asarray(directions, dtype=np.float64) @ galactic_axes().T
        latitude = np.arcsin(np.minimum(np.abs(galactic[..., 2]), 1.0))
        longitude = np.abs(np.arctan2(galactic[..., 1], galactic[..., 0]))
        # Bilinear in the table; the latitudes are squares of evenly spaced numbers.
        row = np.sqrt(latitude / _LATITUDES[-1]) * (len(_LATITUDES) - 1)
        column = longitude / _LONGITUDES[-1] * (len(_LONGITUDES) - 1)
        i = np.minimum(row.astype(np.intp), len(_LATITUDES) - 2)
        j = np.minimum(column.astype(np.intp), len(_LONGITUDES) - 2)
        up, across = row - i, column - j
        near: Array = (1.0 - across) * self.table[i, j] + across * self.table[i, j + 1]
        far: Array = (1.0 - across) * self.table[i + 1, j] + across * self.table[i + 1, j + 1]
        brightness: Array = (1.0 - up) * near + up * far
        return brightness


def _accumulated_light() -> Array:
    """Solar luminosities / pc^2 from within each distance, shape (latitudes, longitudes, distances)."""
    latitude = _LATITUDES[:, np.newaxis, np.newaxis]
    longitude = _LONGITUDES[np.newaxis, :, np.newaxis]
    in_plane = _DISTANCES * np.cos(latitude)
    height = _DISTANCES * np.sin(latitude)
    radius = np.sqrt(CENTER_DISTANCE**2 + in_plane**2 - 2.0 * CENTER_DISTANCE * in_plane * np.cos(longitude))
    outward = radius - CENTER_DISTANCE
    emission = STAR_COLUMN / (2.0 * STAR_HEIGHT) * np.exp(-height / STAR_HEIGHT - outward / STAR_LENGTH)
    extinction = DUST_EXTINCTION * np.exp(-height / DUST_HEIGHT - outward / DUST_LENGTH)
    magnitudes = _accumulate(extinction)
    return _accumulate(emission * 10.0 ** (-0.4 * magnitudes))


def _accumulate(values: Array) -> Array:
    """Integral over the distance from 0 to each of `_DISTANCES`, by trapezoids, same shape as `values`."""
    steps = 0.5 * (values[..., 1:] + values[..., :-1]) * np.diff(_DISTANCES)
    return np.concatenate([np.zeros_like(values[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)


def unresolved_glow(drawn_flux: float) -> Glow:
    """The glow that is left when stars of a given total flux are drawn one by one.

    Parameters
    ----------
    drawn_flux : float
        Sum over the drawn stars of the whole sky of 10^(-0.4 V), >= 0.

    Returns
    -------
    Glow
        The brightness as a function of direction; dark when the drawn stars already outshine the model.
    """
    light = _accumulated_light()
    # 10^(-0.4 M) is the flux of one solar luminosity at 10 pc; j ds d^2 of them at distance d give 100 j ds.
    flux = 100.0 * 10.0 ** (-0.4 * SUN_ABSOLUTE_MAGNITUDE) * light
    by_latitude = 0.5 * np.mean(flux[:, 1:] + flux[:, :-1], axis=1)
    bands = np.diff(np.sin(_LATITUDES))[:, np.newaxis]  # their shares of the hemisphere
    mean = np.sum(0.5 * (by_latitude[1:] + by_latitude[:-1]) * bands, axis=0)
    drawn_to = float(np.interp(drawn_flux / (4.0 * math.pi), mean, _DISTANCES))
    last = min(int(np.searchsorted(_DISTANCES, drawn_to)), len(_DISTANCES) - 1)
    before = max(last - 1, 0)
    share = (drawn_to - _DISTANCES[before]) / max(_DISTANCES[last] - _DISTANCES[before], 1.0)
    nearer = (1.0 - share) * flux[..., before] + share * flux[..., last]
    return Glow(flux[..., -1] - nearer)
