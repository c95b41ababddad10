# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist decides about a disk, and the light and opacity that follow at each place of it.

The light of a face is that of a black body of temperature T(r), seen as one of temperature g T and g^4 times as bright
(Liouville, see `color`), or g^3 for a narrow band of frequencies. How much of either is applied goes from 0, the
artist's disk without motion, to 1, physics: temperature g^color T, brightness g^(exponent brightness).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from ..numerics.arrays import Array
from ..numerics.checks import finite
from ..numerics.errors import BlackHoleError
from ..shot.disk import Disk
from .color import redshift_gain
from .disk_flux import relative_flux
from .disk_texture import PICTURE_CHANNELS, moving_texture
from .star_color import black_body_color

BOLOMETRIC, MONOCHROMATIC = 4, 3

# Light that is redshifted further is not seen; alphas below this one have no color.
SMALLEST_G, SMALLEST_ALPHA = 1e-6, 1e-6

# What settings may be; amounts and shares are from 0 to 1.
RANGES = {
    **dict.fromkeys(("doppler_color", "doppler_brightness", "color_variation", "falloff"), (0.0, 1.0)),
    **dict.fromkeys(("opacity", "streaks", "clumps", "inner_softness", "outer_softness"), (0.0, 1.0)),
    "exponent": (0.0, 20.0),
    "exposure": (-32.0, 32.0),
    "gain": (1.0, 8.0),
}

# Temperatures between which colors are tabulated, kelvin, evenly in their logarithm.
COLDEST, HOTTEST, COLORS = 500.0, 60_000.0, 512
_TABLE = np.linspace(np.log(COLDEST), np.log(HOTTEST), COLORS)
_COLORS = black_body_color(np.exp(_TABLE))


@dataclass(frozen=True)
class DiskLook:
    """How a disk looks; amounts are from 0 (artistic) to 1 (physical) unless said otherwise."""

    profile: str = "novikov_thorne"
    """One of `disk_flux.PROFILES`."""
    exponent: float = 3.0
    """Of the power law."""
    temperature: float = 6500.0
    """Where the disk is brightest, kelvin."""
    doppler_color: float = 1.0
    """How much g changes the temperature that is seen."""
    doppler_brightness: float = 1.0
    """How much g changes the brightness."""
    beaming: int = BOLOMETRIC
    """The power of g in the brightness: 4, or 3 for a narrow band."""
    color_variation: float = 1.0
    """How far the temperature follows the profile, T ~ F^(1/4): at 0 the disk has one temperature."""
    falloff: float = 1.0
    """How far the brightness follows the profile: at 0 it is the same at all radii."""
    exposure: float = 0.0
    """Stops by which the disk is brightened."""
    opacity: float = 0.9
    """Of the densest parts, 0 to 1."""
    streaks: float = 0.7
    """How much the streaks thin the disk out, 0 to 1."""
    clumps: float = 0.4
    """How much the clumps do."""
    inner_softness: float = 0.1
    """Share of the disk, in ln(r), over which it fades in at the inner rim."""
    outer_softness: float = 0.4
    """The same at the outer rim."""
    gain: float = 1.5
    """Power of the density in the brightness: above 1 dense streaks stand out."""

    def validate(self) -> None:
        """Raise BlackHoleError, with a sentence for the user, for a look that cannot be."""
        for field in dataclasses.fields(self):
            if field.name != "profile":
                finite(getattr(self, field.name), f"the disk's {field.name.replace('_', ' ')}")
        relative_flux(self.profile, 0.0, 10.0, 6.0)
        if self.beaming not in (BOLOMETRIC, MONOCHROMATIC):
            raise BlackHoleError(
                f"The power of g in the brightness is {self.beaming}; choose 4 or 3.", code="disk.setting"
            )
        if not COLDEST <= self.temperature <= HOTTEST:
            raise BlackHoleError(
                f"The disk's temperature is {self.temperature:g} K; give it a value between {COLDEST:g} and "
                f"{HOTTEST:g} K.",
                code="disk.setting",
            )
        for field in dataclasses.fields(self):
            low, high = RANGES.get(field.name, (-math.inf, math.inf))
            value = getattr(self, field.name)
            if field.name in RANGES and not low <= value <= high:
                raise BlackHoleError(
                    f"The disk's {field.name.replace('_', ' ')} is {value:g}; give it a value from {low:g} to "
                    f"{high:g}.",
                    code="disk.setting",
                )


PRESETS: dict[str, DiskLook] = {
    "gargantua": DiskLook(
        profile="power_law",
        exponent=1.5,
        temperature=4300.0,
        doppler_color=0.0,
        doppler_brightness=0.0,
        color_variation=0.5,
        opacity=0.95,
        streaks=0.85,
        clumps=0.3,
        inner_softness=0.05,
        outer_softness=0.5,
        gain=1.7,
        exposure=2.4,
    ),
    "physical": DiskLook(exposure=2.0),
    "blue hot": DiskLook(
        temperature=18_000.0,
        doppler_color=0.7,
        doppler_brightness=0.5,
        streaks=0.8,
        clumps=0.5,
        exposure=1.8,
    ),
    "ember": DiskLook(
        profile="power_law",
        exponent=2.4,
        temperature=2400.0,
        doppler_color=0.3,
        doppler_brightness=0.4,
        streaks=0.9,
        clumps=0.8,
        opacity=0.85,
        gain=2.2,
        exposure=3.0,
    ),
}
"""Looks by name."""


def seen_color(temperature: Array) -> Array:
    """Return a black body's color, linear Rec. 709 of luminance 1, shape (..., 3), from a table."""
    place = np.log(np.clip(temperature, COLDEST, HOTTEST))
    return np.stack([np.interp(place, _TABLE, _COLORS[:, i]) for i in range(3)], axis=-1)


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
