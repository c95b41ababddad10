# SPDX-License-Identifier: GPL-3.0-or-later
"""What is inside the node groups "Umbra Disk": from a map's disk passes to a premultiplied picture, in float32.

The same picture as `physics.reference.disk_render` in float64, term by term, with a table of the colors of black
bodies over the temperature (see `disk_images`).
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

from ..core.physics_api import physics
from .arithmetic import acos, clamp, combine, cos, fraction, log, maximum, minimum, multiply_add, sin, sqrt, where
from .builder import Float, TreeBuilder, Vector
from .image_lookup import sample_bilinearly, sample_with_alpha
from .image_nodes import combine_color, image_size, separate_color
from .redshift import redshift_gain
from .render_size import to_render_size

_SMALLEST_FLUX = 1e-6
_SMALLEST_SOFTNESS = 1e-3

_LOWEST, _HIGHEST = math.log(physics.COLDEST_DISK), math.log(physics.HOTTEST_DISK)


@dataclass(frozen=True)
class DiskInputs:
    """Values of the Group Input node; `disk_group` describes them."""

    disk_pass: Vector
    colors: Vector
    texture: Vector
    phase: Float
    first_turn: Float
    second_turn: Float
    period: Float
    spin: Float
    direction: Float
    inner: Float
    outer: Float
    innermost: Float
    flux_factor: Float
    profile: Float
    exponent: Float
    temperature: Float
    doppler_color: Float
    doppler_brightness: Float
    beaming: Float
    color_variation: Float
    falloff: Float
    exposure: Float
    opacity: Float
    streaks: Float
    clumps: Float
    inner_softness: Float
    outer_softness: Float
    gain: Float


@dataclass(frozen=True)
class _FluxTerms:
    """The constants of Page & Thorne's flux (1974, Eq. 15n), which do not depend on the radius."""

    start: Float
    """x_0, the root of the innermost stable orbit's radius."""
    log_factor: Float
    """3 a / 2, a < 0 for a disk that turns against the hole."""
    roots: tuple[Float, ...]
    weights: tuple[Float, ...]


@dataclass(frozen=True)
class _Pattern:
    """One of the two patterns of the texture, of which one fades in while the other fades out."""

    age: Float
    share: Float
    contrast: Float
    """Share of the contrast."""
    turn: Float


@dataclass(frozen=True)
class _Shared:
    """What is the same for all pixels."""

    log_inner: Float
    log_width: Float
    """ln(outer / inner)."""
    flux: _FluxTerms
    patterns: tuple[_Pattern, ...]
    brightness_power: Float
    temperature_power: Float
    brightness: Float
    color_rows: Float


@dataclass(frozen=True)
class _Place:
    """Where on the disk a pixel looks."""

    radius: Float
    phi: Float
    depth: Float
    """ln(r / inner) / ln(outer / inner), from 0 at the inner rim to 1 at the outer one."""


def build_image(
    builder: TreeBuilder, inputs: DiskInputs, light: Vector, through: Float, *, picture: bool
) -> tuple[Vector, Float]:
    """Add all nodes that draw one image of the disk behind those in front of it.

    Parameters
    ----------
    builder : TreeBuilder
        Of a compositor tree in which there is only the Group Input node.
    inputs : DiskInputs
        That node's values.
    light : Vector
        Light of the images in front.
    through : Float
        Share of what is behind that they leave, 0 to 1.
    picture : bool
        Whether the texture's colors are the disk's and its alpha is the density. Otherwise its red channel holds
        streaks and its green one clumps.

    Returns
    -------
    light : Vector
        Light of this image and those in front.
    through : Float
        Share of what is behind that is left.
    """
    with builder.frame("Once for all pixels"):
        shared = _share(inputs)
    with builder.frame("Place"):
        radius, phi, g, coverage = separate_color(inputs.disk_pass)
        place = _Place(radius, phi, _depth(inputs, shared, radius))
    with builder.frame("Streaks and clumps"):
        if picture:
            tint, full = _moving_picture(inputs, shared, place)
            full = full * _fade(inputs, place.depth)
        else:
            streaks, clumps = _moving_texture(inputs, shared, place, coverage)
            density = _density(inputs, place.depth, streaks, clumps)
            full = minimum(1.0, density * physics.DISK_OPACITY_REACH)
    with builder.frame("Light"):
        if picture:
            color = _tinted_light(inputs, shared, radius, g, tint)
        else:
            color = _emission(inputs, shared, radius, g) * density ** (inputs.gain - 1.0)
    with builder.frame("In front of what is behind"):
        alpha = full * inputs.opacity * coverage
        light = color * (alpha * through) + light
        return light, (1.0 - alpha) * through


def build_whole(
    builder: TreeBuilder, passes: Sequence[Vector], behind: Vector, light: Vector, through: Float
) -> tuple[Vector, Vector]:
    """Add the nodes that bring the light of all images to the render's size and lay it over what is behind.

    Parameters
    ----------
    builder : TreeBuilder
        Of a compositor tree.
    passes : sequence of Vector
        The baked passes. If one is missing, the picture is magenta.
    behind : Vector
        What is behind the disk, premultiplied, of the render's size.
    light : Vector
        Light of all images, of the passes' size.
    through : Float
        Share of what is behind that they leave, of the passes' size.

    Returns
    -------
    disk : Vector
        The disk alone, premultiplied, with its coverage as alpha.
    image : Vector
        The disk in front of what is behind.
    """
    with builder.frame("Are all passes there?"):
        complete = _all_there(passes)
    with builder.frame("To the render's size"):
        covered = 1.0 - through
        light, alphas = to_render_size(builder, light, combine(covered, covered, covered))
    with builder.frame("Picture"):
        light = where(complete, light, physics.INVALID_MAP_COLOR).labeled("Magenta if a pass is missing")
        red, green, blue = light.separate()
        alpha = where(complete, alphas.separate()[0], 1.0)
        disk = combine_color(red, green, blue, alpha)
    with builder.frame("Over what is behind"):
        left = 1.0 - alpha
        channels = (
            multiply_add(back, left, front)
            for back, front in zip(separate_color(behind), (red, green, blue, alpha), strict=True)
        )
        return disk, combine_color(*channels)


def _share(inputs: DiskInputs) -> _Shared:
    log_inner = log(inputs.inner)
    log_width = log(inputs.outer) - log_inner
    phases = inputs.phase, fraction(inputs.phase + 0.5)
    shares = [sin(phase * math.pi) ** 2.0 for phase in phases]
    contrast = sqrt(multiply_add(shares[0], shares[0], shares[1] * shares[1]))
    return _Shared(
        log_inner=log_inner,
        log_width=log_width,
        flux=_flux_terms(inputs),
        patterns=tuple(
            _Pattern(age=phase * inputs.period, share=share, contrast=share / contrast, turn=turn)
            for phase, share, turn in zip(phases, shares, (inputs.first_turn, inputs.second_turn), strict=True)
        ),
        brightness_power=inputs.beaming * inputs.doppler_brightness,
        temperature_power=inputs.color_variation * 0.25,
        brightness=2.0**inputs.exposure,
        color_rows=maximum(2.0, image_size(inputs.colors)[1]),
    )


def _flux_terms(inputs: DiskInputs) -> _FluxTerms:
    """See `physics.light.disk_flux.page_thorne_flux`."""
    a = inputs.direction * inputs.spin
    third = acos(a) / 3.0
    roots = tuple(
        cos(third + shift) * factor for shift, factor in ((-math.pi / 3.0, 2.0), (math.pi / 3.0, 2.0), (0.0, -2.0))
    )
    weights = []
    for i, root in enumerate(roots):
        over = root - a
        under = root * (root - roots[i - 1]) * (root - roots[i - 2])
        weights.append(over * over * 3.0 / under)
    return _FluxTerms(start=sqrt(inputs.innermost), log_factor=a * 1.5, roots=roots, weights=tuple(weights))


def _flux(inputs: DiskInputs, terms: _FluxTerms, radius: Float) -> Float:
    """The flux of the chosen profile, relative to its largest; see `physics.light.disk_flux.relative_flux`."""
    # Where there is no disk, passes hold 0.
    outside = maximum(radius, inputs.innermost)
    x = sqrt(outside)
    growth = log(x / terms.start)
    total = x - terms.start - terms.log_factor * growth
    under = outside * outside
    for root, weight in zip(terms.roots, terms.weights, strict=True):
        way = x - root
        total = total - weight * log(way / (terms.start - root))
        under = under * way
    steady = total * 1.5 * inputs.flux_factor / under * radius.greater_than(inputs.innermost)
    power = (inputs.inner / maximum(radius, inputs.inner)) ** inputs.exponent
    return maximum(0.0, where(inputs.profile, steady, power))


def _look_up(table: Vector, rows: Float, place: Float) -> Vector:
    """A table's value between its first row, at place 0, which is at the top, and its last, at place 1."""
    steps = rows - 1.0
    return sample_bilinearly(table, 0.5, multiply_add(1.0 - place, steps, 0.5) / rows)


def _depth(inputs: DiskInputs, shared: _Shared, radius: Float) -> Float:
    inside = clamp(radius, inputs.inner, inputs.outer)
    return clamp((log(inside) - shared.log_inner) / shared.log_width, 0.0, 1.0)


def _texture_places(inputs: DiskInputs, shared: _Shared, place: _Place) -> list[tuple[Float, Float]]:
    """Texture coordinates of the two patterns, which turn with the matter; see `physics.light.disk_texture`."""
    # Omega = +-1 / (r^(3/2) +- a), BPT Eq. 2.16
    outside = maximum(place.radius, inputs.inner)
    omega = inputs.direction / multiply_add(outside, sqrt(outside), inputs.direction * inputs.spin)
    v = 1.0 - place.depth
    found = []
    for pattern in shared.patterns:
        azimuth = place.phi + pattern.turn - omega * pattern.age
        found.append((fraction(azimuth * (0.5 / math.pi)), v))
    return found


def _moving_picture(inputs: DiskInputs, shared: _Shared, place: _Place) -> tuple[Vector, Float]:
    """Color (not premultiplied) and alpha of a picture whose two patterns are mixed as they are."""
    samples = []
    for (u, v), pattern in zip(_texture_places(inputs, shared, place), shared.patterns, strict=True):
        color, alpha = sample_with_alpha(inputs.texture, u, v)
        samples.append((color * pattern.share, alpha * pattern.share))
    color, alpha = (one + other for one, other in zip(*samples, strict=True))
    inverse = 1.0 / maximum(physics.SMALLEST_ALPHA, alpha)
    return color * inverse, clamp(alpha, 0.0, 1.0)


def _moving_texture(inputs: DiskInputs, shared: _Shared, place: _Place, coverage: Float) -> tuple[Float, Float]:
    """Streaks and clumps, 0 to 1; see `physics.light.disk_texture`."""
    samples = [
        (sample_bilinearly(inputs.texture, u, v) - (0.5, 0.5, 0.5)) * pattern.contrast
        for (u, v), pattern in zip(_texture_places(inputs, shared, place), shared.patterns, strict=True)
    ]
    streaks, clumps, _ = (samples[0] + samples[1]).separate()
    # A rim, or all of the disk at once in a thin ring, shows the mean.
    streaks = multiply_add(clamp(streaks, -0.5, 0.5), coverage, 0.5)
    clumps = multiply_add(clamp(clumps, -0.5, 0.5), coverage, 0.5)
    return streaks, clumps


def _fade(inputs: DiskInputs, depth: Float) -> Float:
    """The share of the disk that is left by its soft rims."""
    inner = _smooth_step(depth, inputs.inner_softness)
    return inner * _smooth_step(1.0 - depth, inputs.outer_softness)


def _smooth_step(way: Float, softness: Float) -> Float:
    t = clamp(way / maximum(_SMALLEST_SOFTNESS, softness), 0.0, 1.0)
    return t * t * multiply_add(t, -2.0, 3.0)


def _density(inputs: DiskInputs, depth: Float, streaks: Float, clumps: Float) -> Float:
    density = _fade(inputs, depth)
    for value, amount in ((streaks, inputs.streaks), (clumps, inputs.clumps)):
        density = density * (1.0 - (1.0 - value) * amount)
    return density


def _emission(inputs: DiskInputs, shared: _Shared, radius: Float, g: Float) -> Vector:
    """Light of an opaque disk where it is densest; see `physics.light.disk_look.emission`."""
    flux = _flux(inputs, shared.flux, radius)
    shift = maximum(physics.SMALLEST_G, g)
    cooling = maximum(_SMALLEST_FLUX, flux) ** shared.temperature_power
    seen = shift**inputs.doppler_color
    temperature = inputs.temperature * cooling * seen
    temperature = clamp(temperature, physics.COLDEST_DISK, physics.HOTTEST_DISK)
    place = (log(temperature) - _LOWEST) * (1.0 / (_HIGHEST - _LOWEST))
    color = _look_up(inputs.colors, shared.color_rows, place)
    return color * _brightness(inputs, shared, flux, shift)


def _tinted_light(inputs: DiskInputs, shared: _Shared, radius: Float, g: Float, color: Vector) -> Vector:
    """Light of a place that has a color of its own; see `physics.light.disk_look.tinted_light`."""
    flux = _flux(inputs, shared.flux, radius)
    shift = maximum(physics.SMALLEST_G, g)
    gain = redshift_gain(1.0 / shift, inputs.doppler_color, 0.0, inputs.temperature)
    return color * _brightness(inputs, shared, flux, shift) * gain


def _brightness(inputs: DiskInputs, shared: _Shared, flux: Float, shift: Float) -> Float:
    return flux**inputs.falloff * shift**shared.brightness_power * shared.brightness


def _all_there(passes: Sequence[Vector]) -> Float:
    """1 if each pass is a picture, else 0; a file that is missing has no size."""
    return reduce(operator.mul, (image_size(one)[0].greater_than(0.5) for one in passes))
