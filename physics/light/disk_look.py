# SPDX-License-Identifier: GPL-3.0-or-later
"""The light and the opacity of each place of a disk, from the look that an artist has chosen (`disk_settings`).

The light of a face is that of a black body of temperature T(r), seen as one of temperature g T and g^4 times as bright
(Liouville, see `color`), or g^3 for a narrow band of frequencies. How much of either is applied goes from 0, the
artist's disk without motion, to 1, physics: temperature g^color T, brightness g^(exponent brightness).
"""

from __future__ import annotations

import functools

import numpy as np

from ..numerics.arrays import Array
from ..shot.disk import Disk
from . import black_body
from .color import redshift_gain
from .disk_flux import relative_flux
from .disk_settings import COLDEST, HOTTEST, DiskLook
from .disk_texture import PICTURE_CHANNELS, moving_texture

# Light that is redshifted further is not seen; alphas below this one have no color.
SMALLEST_G, SMALLEST_ALPHA = 1e-6, 1e-6

# How many colors are tabulated, evenly in the logarithm of the temperature.
COLORS = 512
_TABLE = np.linspace(np.log(COLDEST), np.log(HOTTEST), COLORS)


@functools.cache
def _colors() -> Array:
    """Colors at the table's temperatures; made when they are first asked for, not when the module is imported."""
    return black_body.color(np.exp(_TABLE))


def seen_color(temperature: Array) -> Array:
    """Return a black body's color, linear Rec. 709 of luminance 1, shape (..., 3), from a table."""
    place = np.log(np.clip(temperature, COLDEST, HOTTEST))
    colors = _colors()
    return np.stack([np.interp(place, _TABLE, colors[:, i]) for i in range(3)], axis=-1)


def emission(look: DiskLook, disk: Disk, spin: float, radius: Array, g: Array) -> Array:
    """Return the light of an opaque disk where it is densest, linear Rec. 709, shape (..., 3)."""
    inner, _ = disk.radii(spin)
    flux = relative_flux(look.profile, spin, radius, inner, look.exponent, disk.retrograde)
    # Matter that falls from the innermost stable orbit is dark by that flux; its color is then of no matter.
    temperature = look.temperature * np.maximum(flux, 1e-6) ** (0.25 * look.color_variation)
    color = seen_color(temperature * g**look.doppler_color)
    brightness = flux**look.falloff * g ** (look.beaming * look.doppler_brightness) * 2.0**look.exposure
    light: Array = color * brightness[..., None]
    return light


def tinted_light(look: DiskLook, disk: Disk, spin: float, radius: Array, g: Array, color: Array) -> Array:
    """Return the light of places that have colors of their own, shape (..., 3), where they are densest.

    Brightness is that of `emission`; the color is shifted as the sky's is (`color.redshift_gain`), as light of the
    look's temperature, whatever the radius.
    """
    inner, _ = disk.radii(spin)
    flux = relative_flux(look.profile, spin, radius, inner, look.exponent, disk.retrograde)
    brightness = flux**look.falloff * g ** (look.beaming * look.doppler_brightness) * 2.0**look.exposure
    light: Array = color * brightness[..., None]
    if look.doppler_color > 0.0:
        light = light * redshift_gain(1.0 / np.maximum(g, SMALLEST_G), look.doppler_color, 0.0, look.temperature)
    return light


def fade(look: DiskLook, disk: Disk, spin: float, radius: Array) -> Array:
    """Return the share of the disk that is left by its soft rims, 0 to 1."""
    inner, outer = disk.radii(spin)
    depth = np.log(np.clip(radius, inner, outer) / inner) / np.log(outer / inner)
    share: Array = _smooth(depth / max(look.inner_softness, 1e-3)) * _smooth(
        (1.0 - depth) / max(look.outer_softness, 1e-3)
    )
    return share


def density(look: DiskLook, disk: Disk, spin: float, radius: Array, noise: Array) -> Array:
    """Return how dense the disk is, 0 to 1, from streaks and clumps of shape (..., 2); faded out at its rims."""
    thin = (1.0 - look.streaks * (1.0 - noise[..., 0])) * (1.0 - look.clumps * (1.0 - noise[..., 1]))
    total: Array = fade(look, disk, spin, radius) * thin
    return total


def shade(
    look: DiskLook,
    disk: Disk,
    spin: float,
    place: tuple[Array, Array, Array, Array],
    texture: Array,
    time: float,
    period: float | None = None,
) -> tuple[Array, Array]:
    """Return the light, shape (..., 3), and the opacity, shape (...), of places on the disk.

    The light is not yet multiplied by the opacity, nor that by the coverage.

    Parameters
    ----------
    look, disk, spin
        What the disk is.
    place : tuple of ndarray, shape (...)
        Radius, phi, g and coverage as in `disk_pass.DiskPass`. A pixel that is partly covered holds a rim or, along a
        thin ring, all of the disk at once: the less is covered, the more it shows the mean of streaks and clumps.
    texture : ndarray, shape (rows, columns, 2 or 4)
        Streaks and clumps, see `disk_texture.disk_texture`; or a picture, linear Rec. 709 premultiplied by its alpha,
        whose colors are the disk's and whose alpha is its density.
    time : float
        Units of M.
    period : float, optional
        See `disk_texture.moving_texture`.
    """
    radius, phi, g, coverage = place
    inner, outer = disk.radii(spin)
    noise = moving_texture(texture, radius, phi, time, spin, inner, outer, disk.retrograde, period)
    if texture.shape[2] == PICTURE_CHANNELS:
        thick = noise[..., 3]
        color = noise[..., :3] / np.maximum(thick, SMALLEST_ALPHA)[..., None]
        light = tinted_light(look, disk, spin, radius, g, color)
        return light, look.opacity * np.clip(thick, 0.0, 1.0) * fade(look, disk, spin, radius)
    noise = 0.5 + coverage[..., None] * (noise - 0.5)
    thick = density(look, disk, spin, radius, noise)
    light = emission(look, disk, spin, radius, g) * (thick ** (look.gain - 1.0))[..., None]
    return light, look.opacity * np.minimum(thick * OPACITY_REACH, 1.0)


OPACITY_REACH = 1.6
"""Density at which the opacity is full is one over this: dense streaks hide what is behind them."""


def _smooth(x: Array) -> Array:
    """Return 0 below 0, 1 above 1, and a smooth step between them."""
    t = np.clip(x, 0.0, 1.0)
    step: Array = t * t * (3.0 - 2.0 * t)
    return step
