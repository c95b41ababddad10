# SPDX-License-Identifier: GPL-3.0-or-later
"""Light and optical depth of places in the disk, from the look that an artist has chosen.

Temperature. ln T = ln T_0 + 1/4 ln F(r) + h, with F the flux relative to its largest (`disk_flux`) and h the heat of
the turbulence. Matter looks as a body of temperature g T does (Liouville): visible light is RGB(g T) / Y(T_0) by the
sky's own law (`black_body`), with no further power of g; the light of all wavelengths is (g T / T_0)^4, that of a
narrow band g^3 (T / T_0)^4, both with the color of g T.

Density. ln tau is Gaussian as well.

What a filter averages away. A field that has lost the variance v by filtering stands for a spread of places. With
tau lognormal of relative variance v, taken as a gamma distribution of the same mean and variance, the mean of
1 - exp(-tau / mu) is 1 - (1 + v x)^(-1/v), x the mean of tau / mu: the Laplace transform of a gamma distribution. Light
goes nearly like T^p with p = d ln Y / d ln T = 25900 K / T (Wien's law at 555 nm), so its mean is exp(p^2 v / 2) times
that at the mean of ln T.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..kerr.metric import isco_radius
from ..kerr.orbiting_matter import matter_direction, orbital_frequency
from ..light import black_body
from ..light.disk_flux import relative_flux
from ..light.matter_settings import COLDEST, HOTTEST, MONOCHROMATIC, VISIBLE, MatterLook
from ..numerics.arrays import Array, Image
from ..shot.disk import Disk
from .picture import Picture
from .rings import COARSE_WIDTH, FINE_WIDTH, TurningRings
from .rip_map import Levels, Whole
from .turbulence import fields

TEMPERATURES, RADII = 4096, 4096
_LOGS = np.linspace(math.log(COLDEST), math.log(HOTTEST), TEMPERATURES)

WIEN = 25_900.0
"""h c / (k lambda) at 555 nm, kelvin."""
MOST_LOST_GAIN = 40.0
BOLOMETRIC_POWER = 4.0

DIMMEST = 1e-4
"""Flux below this share of the largest counts as this, so that temperatures exist."""

LIMB = 2.06
"""Chandrasekhar 1960, Radiative Transfer, 25: the light of a scattering atmosphere goes like 1 + 2.06 mu, nearly."""

LEAST_COSINE = 1e-4
LEAST_VARIANCE = 1e-4

COARSE_HEAT, COARSE_SMOKE = 0.07 / 0.12 / 0.6, 0.8 / 0.6
"""Contrast of large clouds over that of strands and smoke, at `large_scale` 1."""

SPOT_SPREAD, SPOT_TURN = 1.2, 0.5 * (math.sqrt(5.0) - 1.0)
"""From spot to spot: the ratio of orbits' radii, and the share of a turn."""


class FieldLevels(NamedTuple):
    """What footprints say about each texture; see `Surface.levels`."""

    fine: Levels
    coarse: Levels
    radial: Image
    """Sides of the footprints, in ln r and radians."""
    azimuthal: Image


class Surface:
    """A disk's matter, ready to be shaded."""

    def __init__(self, look: MatterLook, disk: Disk, spin: float, picture: Picture | None = None) -> None:
        """`picture`: in place of the turbulence."""
        look.validate()
        self.look, self.picture = look, picture
        inner, outer = disk.radii(spin)
        self.log_inner, self.log_outer = np.float32(math.log(inner)), np.float32(math.log(outer))
        self._per_log = np.float32((RADII - 1) / math.log(outer / inner))
        radius = np.geomspace(inner, outer, RADII)
        flux = np.log(np.maximum(_flux(look, disk, spin, radius, inner), DIMMEST))
        share = np.linspace(0.0, 1.0, RADII)
        fade = smooth_step(share / max(look.inner_softness, 1e-3)) * smooth_step(
            (1.0 - share) / max(look.outer_softness, 1e-3)
        )
        gap = np.log(radius / max(look.gap_radius, 1e-6)) / look.gap_width
        fade *= 1.0 - look.gap_depth * np.exp(-(gap**4))
        self.depth = (look.depth * (radius / inner) ** look.depth_power * fade).astype(np.float32)
        """Vertical optical depth by radius."""
        zero = math.log(look.temperature)
        self._bright = (zero + 0.25 * look.falloff * flux).astype(np.float32)
        self._tint = (zero + 0.25 * look.color_variation * flux).astype(np.float32)
        by_band = 0.75 if look.band == MONOCHROMATIC else 1.0
        self._bright_power = np.float32(look.doppler_brightness * by_band)
        self._tint_power = np.float32(look.doppler_color)
        self._is_one = look.falloff == look.color_variation and self._bright_power == self._tint_power
        self._luminance, self._colors = _tables(look)
        self.trailing = matter_direction(spin, disk.retrograde)
        self.contrast = np.array(
            [
                [look.strands, look.smoke],
                [look.strands * look.large_scale * COARSE_HEAT, look.smoke * look.large_scale * COARSE_SMOKE],
            ],
            dtype=np.float32,
        )
        fine, coarse = fields(look, self.trailing)
        where = spin, (inner, outer)
        self.fine = TurningRings(fine, FINE_WIDTH, *where, look.seed, disk.retrograde)
        self.coarse = TurningRings(coarse, COARSE_WIDTH, *where, look.seed + 1, disk.retrograde)
        # A picture turns as a whole, as matter in its middle does.
        self._omega = float(orbital_frequency(spin, np.array([math.sqrt(inner * outer)]), disk.retrograde)[0])
        self._spots = _spots(look, spin, disk.retrograde)

    def levels(self, radial: Image, azimuthal: Image) -> FieldLevels:
        """Return the levels of both fields for footprints of these sides, in ln r and radians."""
        fine, coarse = (each.field.levels(radial, azimuthal) for each in (self.fine, self.coarse))
        return FieldLevels(fine, coarse, radial, azimuthal)

    def radial(self, table: Image, log_radius: Image) -> Image:
        """Return a table by radius at places."""
        place = ((log_radius - self.log_inner) * self._per_log + np.float32(0.5)).astype(np.int32)
        np.clip(place, 0, RADII - 1, out=place)
        found: Image = table.take(place)
        return found

    def emission(
        self, log_radius: Image, phi: Image, log_g: Image, time: float, delay: Image | None, levels: FieldLevels
    ) -> tuple[Image, Image, Image]:
        """Return the light of opaque matter, shape (n, 4) with 0 last; mean optical depth; and its relative variance.

        Parameters
        ----------
        log_radius, phi, log_g : ndarray of float32, shape (n,)
            ln r, azimuth (radians) and ln g.
        time : float
            Units of M.
        delay : ndarray of float32, shape (n,), or None
            How much earlier each place is seen, units of M.
        levels : tuple
            From `levels`.
        """
        if self.picture is not None and not self.picture.is_ramp:
            return self._pictured(self.picture, log_radius, phi, log_g, time, delay, levels)
        fine, coarse = levels.fine, levels.coarse
        strands = self.fine.at(log_radius, phi, time, delay, fine)
        clouds = self.coarse.at(log_radius, phi, time, delay, coarse)
        heat = strands.real * self.contrast[0, 0] + clouds.real * self.contrast[1, 0]
        dense = strands.imag * self.contrast[0, 1] + clouds.imag * self.contrast[1, 1]
        squares = self.contrast * self.contrast
        lost_heat = fine.lost_heat * squares[0, 0] + coarse.lost_heat * squares[1, 0]
        lost_dense = fine.lost_density * squares[0, 1] + coarse.lost_density * squares[1, 1]
        dense -= np.float32(0.5) * squares[:, 1].sum()
        dense += np.float32(0.5) * lost_dense
        for spot in self._spots:
            heat += spot.at(log_radius, phi, time, delay) * np.float32(self.look.spot_heat)
        depth = self.radial(self.depth, log_radius) * np.exp(dense)
        own = None
        if self.picture is not None:
            span = np.float32(self.log_outer - self.log_inner)
            place, none = (log_radius - self.log_inner) / span, np.zeros(len(phi), dtype=np.float32)
            own = self.picture.colors(self.picture.at(place, none, levels.radial / span, none))
        return self._light(log_radius, log_g, heat, lost_heat, own), depth, np.expm1(lost_dense)

    def _pictured(
        self,
        picture: Picture,
        log_radius: Image,
        phi: Image,
        log_g: Image,
        time: float,
        delay: Image | None,
        levels: FieldLevels,
    ) -> tuple[Image, Image, Image]:
        """Return what `emission` does for a disk that shows a picture, which turns as matter in its middle does."""
        azimuth = phi - np.float32((self._omega * time) % (2.0 * math.pi))
        if delay is not None:
            azimuth += np.float32(self._omega) * delay
        span = np.float32(self.log_outer - self.log_inner)
        place = (log_radius - self.log_inner) / span
        seen = picture.at(place, azimuth, levels.radial / span, levels.azimuthal)
        none = np.zeros(len(phi), dtype=np.float32)
        own = picture.colors(seen) if picture.is_color else None
        light = self._light(log_radius, log_g, none, none, own)
        return light, self.radial(self.depth, log_radius) * picture.density(seen), none

    def _light(
        self, log_radius: Image, log_g: Image, heat: Image, lost: Image, own_color: Image | None = None
    ) -> Image:
        """Return light, shape (n, 4), with 0 last, of the color of its temperature, or of a color of its own, which the
        shift changes as it changes that of the hottest matter."""
        bright = self.radial(self._bright, log_radius) + heat
        bright += log_g * self._bright_power
        if self._is_one:
            tint = bright
        else:
            tint = self.radial(self._tint, log_radius) + heat
            tint += log_g * self._tint_power
        light: Image = self._colors.take(_place(tint), axis=0)
        if own_color is not None:
            hottest = np.full(1, math.log(self.look.temperature), dtype=np.float32)
            light = self._colors.take(_place(hottest + log_g * self._tint_power), axis=0)
            light[:, :3] *= own_color / self._colors.take(_place(hottest), axis=0)[:, :3]
        power = np.float32(WIEN) * np.exp(-bright) if self.look.band == VISIBLE else np.float32(BOLOMETRIC_POWER)
        gain = np.exp(np.minimum(np.float32(0.5) * power * power * lost, np.float32(MOST_LOST_GAIN)))
        gain *= self._luminance.take(_place(bright))
        light *= gain[:, None]
        return light

    def shade(
        self,
        log_radius: Image,
        phi: Image,
        log_g: Image,
        slant: Image,
        time: float,
        delay: Image | None,
        levels: FieldLevels,
    ) -> tuple[Image, Image]:
        """Return a thin sheet's light, shape (n, 4), not yet times its opacity, and its opacity, shape (n,).

        alpha = 1 - exp(-tau / mu), with mu = g slant / r the cosine of emission in the matter's frame (`slants`).
        """
        light, depth, spread = self.emission(log_radius, phi, log_g, time, delay, levels)
        cosine = slant * np.exp(log_g - log_radius)
        np.clip(cosine, np.float32(LEAST_COSINE), np.float32(1.0), out=cosine)
        depth /= cosine
        if self.look.limb_darkening > 0.0:
            light *= limb_darkening(cosine, self.look.limb_darkening)[:, None]
        return light, opacity(depth, spread)


class _Spot:
    """A hot spot on a circular orbit, seen as a Gaussian of ln r and azimuth."""

    def __init__(self, radius: float, size: float, start: float, omega: float) -> None:
        self._log, self._size, self._start, self._omega = math.log(radius), size, start, omega

    def at(self, log_radius: Image, phi: Image, time: float, delay: Image | None) -> Image:
        turned = phi - np.float32((self._start + self._omega * time) % (2.0 * math.pi))
        if delay is not None:
            turned += np.float32(self._omega) * delay
        turned -= np.float32(2.0 * math.pi) * np.rint(turned * np.float32(0.5 / math.pi))
        away = log_radius - np.float32(self._log)
        square = (turned * turned + away * away) * np.float32(0.5 / self._size**2)
        shape: Image = np.exp(-square)
        return shape


def _spots(look: MatterLook, spin: float, retrograde: bool) -> list[_Spot]:
    radii = look.spot_radius * SPOT_SPREAD ** np.arange(look.spots)
    omegas = orbital_frequency(spin, radii, retrograde)
    return [
        _Spot(radius, look.spot_size, 2.0 * math.pi * ((number * SPOT_TURN) % 1.0), omega)
        for number, (radius, omega) in enumerate(zip(radii, omegas, strict=True))
    ]


def _flux(look: MatterLook, disk: Disk, spin: float, radius: Array, inner: float) -> Array:
    """Return the flux relative to its largest, with that of infalling gas: an artist's, as physics leaves it open."""
    flux = relative_flux(look.profile, spin, radius, inner, look.exponent, disk.retrograde)
    if look.infall > 0.0:
        brightest = int(np.argmax(flux))
        within = radius / max(radius[brightest], isco_radius(spin, prograde=not disk.retrograde))
        flux = np.maximum(flux, look.infall * flux.max() * np.minimum(within, 1.0) ** 2 * (radius <= radius[brightest]))
    return flux


def _tables(look: MatterLook) -> tuple[Image, Image]:
    """Return brightness, exposure included, and colors of luminance 1, shape (n, 4), by ln T."""
    kelvin = np.exp(_LOGS)
    if look.band == VISIBLE:
        bright = black_body.luminance(kelvin) / black_body.luminance(look.temperature)
    else:
        bright = (kelvin / look.temperature) ** BOLOMETRIC_POWER
    colors = np.concatenate([black_body.color(kelvin), np.zeros((TEMPERATURES, 1))], axis=1)
    return (bright * 2.0**look.exposure).astype(np.float32), colors.astype(np.float32)


def _place(log_temperature: Image) -> Whole:
    place = (log_temperature - np.float32(_LOGS[0])) * np.float32(1.0 / (_LOGS[1] - _LOGS[0]))
    place += np.float32(0.5)
    whole: Whole = np.clip(place, 0, TEMPERATURES - 1).astype(np.int32)
    return whole


def opacity(depth: Image, spread: Image) -> Image:
    """Return the mean of 1 - exp(-depth) over a gamma distribution of this mean and relative variance."""
    spread = np.maximum(spread, np.float32(LEAST_VARIANCE))
    alpha: Image = -np.expm1(-np.log1p(spread * depth) / spread)
    return alpha


def limb_darkening(cosine: Image, amount: float) -> Image:
    """Return the factor on the light at a cosine of emission: of the same flux at all amounts."""
    full = (np.float32(1.0) + np.float32(LIMB) * cosine) / np.float32(1.0 + LIMB * 2.0 / 3.0)
    factor: Image = np.float32(1.0) + np.float32(amount) * (full - np.float32(1.0))
    return factor


def smooth_step(x: Array) -> Array:
    """Return 0 below 0, 1 above 1, and a smooth step between them."""
    t = np.clip(x, 0.0, 1.0)
    step: Array = t * t * (3.0 - 2.0 * t)
    return step
