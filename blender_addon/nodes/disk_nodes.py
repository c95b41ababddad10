# SPDX-License-Identifier: GPL-3.0-or-later
"""What is inside the node groups "Umbra Disk": from a map's disk passes to a premultiplied picture, in float32.

The same picture as `physics.disk_render` in float64, term by term, with a table of the colors of black bodies over the
temperature (see `disk_images`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..core.physics_api import disk_look, reference_render
from .black_hole_nodes import redshift_gain, sample_bilinearly, sample_with_alpha, to_render_size
from .builder import Socket, TreeBuilder, Value

_SMALLEST_FLUX = 1e-6
_SMALLEST_SOFTNESS = 1e-3

_LOWEST, _HIGHEST = math.log(disk_look.COLDEST), math.log(disk_look.HOTTEST)


@dataclass(frozen=True)
class DiskInputs:
    """Output sockets of the Group Input node; what they mean is said where they are declared, in `disk_group`."""

    disk_pass: Socket
    colors: Socket
    texture: Socket
    phase: Socket
    first_turn: Socket
    second_turn: Socket
    period: Socket
    spin: Socket
    direction: Socket
    inner: Socket
    outer: Socket
    innermost: Socket
    flux_factor: Socket
    page_thorne: Socket
    exponent: Socket
    temperature: Socket
    doppler_color: Socket
    doppler_brightness: Socket
    beaming: Socket
    color_variation: Socket
    falloff: Socket
    exposure: Socket
    opacity: Socket
    streaks: Socket
    clumps: Socket
    inner_softness: Socket
    outer_softness: Socket
    gain: Socket


@dataclass(frozen=True)
class _Shared:
    """What is the same for every pixel, worked out once."""

    log_inner: Socket
    log_width: Socket
    """ln(outer / inner)."""
    flux: _FluxTerms
    patterns: tuple[tuple[Socket, Socket, Socket, Socket], ...]
    """Age, share, share of the contrast, and turn of the two patterns of the texture."""
    brightness_power: Socket
    temperature_power: Socket
    brightness: Socket
    color_rows: Socket


@dataclass(frozen=True)
class _FluxTerms:
    """What Page & Thorne's flux (1974, Eq. 15n) is made of but for the radius."""

    start: Socket
    """x_0, the root of the innermost stable orbit's radius."""
    drag: Socket
    """3 a / 2, a < 0 for a disk that turns against the hole."""
    roots: tuple[Socket, Socket, Socket]
    weights: tuple[Socket, Socket, Socket]


def build_image(
    builder: TreeBuilder, inputs: DiskInputs, light: Socket, through: Socket, *, picture: bool
) -> tuple[Socket, Socket]:
    """Add all nodes that draw one image of the disk behind those in front of it.

    Taken and returned are the light of the disk so far and the share of what is behind that is left. With `picture`,
    the texture's colors are the disk's, and its alpha is the density.
    """
    with builder.frame("Once for all pixels"):
        shared = _share(builder, inputs)
    with builder.frame("Place"):
        radius, phi, g, coverage = builder.separate_color(inputs.disk_pass)
        depth = _depth(builder, inputs, shared, radius)
    with builder.frame("Streaks and clumps"):
        place = radius, phi, depth
        if picture:
            tint, full = _moving_picture(builder, inputs, shared, place)
            full = builder.math("MULTIPLY", full, _fade(builder, inputs, depth))
        else:
            streaks, clumps = _moving_texture(builder, inputs, shared, place, coverage)
            thick = _density(builder, inputs, depth, streaks, clumps)
            full = builder.math("MINIMUM", 1.0, builder.math("MULTIPLY", thick, disk_look.OPACITY_REACH))
    with builder.frame("Light"):
        if picture:
            color = _tinted_light(builder, inputs, shared, radius, g, tint)
        else:
            color = _emission(builder, inputs, shared, radius, g)
            dense = builder.math("POWER", thick, builder.math("SUBTRACT", inputs.gain, 1.0))
            color = builder.vector_scale(color, dense)
    with builder.frame("In front of what is behind"):
        alpha = builder.math("MULTIPLY", builder.math("MULTIPLY", full, inputs.opacity), coverage)
        share = builder.math("MULTIPLY", alpha, through)
        light = builder.vector_math("ADD", builder.vector_scale(color, share), light)
        return light, builder.math("MULTIPLY", builder.math("SUBTRACT", 1.0, alpha), through)


def build_whole(
    builder: TreeBuilder, passes: Sequence[Socket], behind: Socket, light: Socket, through: Socket
) -> tuple[Socket, Socket]:
    """Add the nodes that make pictures of the render's size from the light of all images and what they leave.

    Returned are the disk alone and in front of what is behind, premultiplied. A pass that is missing makes all of the
    picture magenta.
    """
    with builder.frame("Are all passes there?"):
        whole = _all_there(builder, passes)
    with builder.frame("To the render's size"):
        covered = builder.math("SUBTRACT", 1.0, through)
        light, alphas = to_render_size(builder, light, builder.combine(covered, covered, covered))
    with builder.frame("Picture"):
        red, green, blue = builder.separate(
            builder.select_vector(whole, reference_render.MAGENTA, light, "Magenta if a pass is missing")
        )
        alpha, _, _ = builder.separate(alphas)
        alpha = builder.select(whole, 1.0, alpha)
        disk = builder.combine_color(red, green, blue, alpha)
    with builder.frame("Over what is behind"):
        left = builder.math("SUBTRACT", 1.0, alpha)
        channels = (
            builder.math("MULTIPLY_ADD", back, left, front)
            for back, front in zip(builder.separate_color(behind), (red, green, blue, alpha), strict=True)
        )
        return disk, builder.combine_color(*channels)


def _share(builder: TreeBuilder, inputs: DiskInputs) -> _Shared:
    log_inner = builder.math("LOGARITHM", inputs.inner, math.e)
    log_width = builder.math("SUBTRACT", builder.math("LOGARITHM", inputs.outer, math.e), log_inner)
    phases = inputs.phase, builder.math("FRACT", builder.math("ADD", inputs.phase, 0.5))
    shares = [
        builder.math("POWER", builder.math("SINE", builder.math("MULTIPLY", phase, math.pi)), 2.0) for phase in phases
    ]
    squares = builder.math("MULTIPLY_ADD", shares[0], shares[0], builder.math("MULTIPLY", shares[1], shares[1]))
    contrast = builder.math("SQRT", squares)
    return _Shared(
        log_inner=log_inner,
        log_width=log_width,
        flux=_flux_terms(builder, inputs),
        patterns=tuple(
            (builder.math("MULTIPLY", phase, inputs.period), share, builder.math("DIVIDE", share, contrast), turn)
            for phase, share, turn in zip(phases, shares, (inputs.first_turn, inputs.second_turn), strict=True)
        ),
        brightness_power=builder.math("MULTIPLY", inputs.beaming, inputs.doppler_brightness),
        temperature_power=builder.math("MULTIPLY", inputs.color_variation, 0.25),
        brightness=builder.math("POWER", 2.0, inputs.exposure),
        color_rows=_rows(builder, inputs.colors),
    )


def _flux_terms(builder: TreeBuilder, inputs: DiskInputs) -> _FluxTerms:
    """See `physics.disk_flux.page_thorne_flux`."""
    a = builder.math("MULTIPLY", inputs.direction, inputs.spin)
    third = builder.math("DIVIDE", builder.math("ARCCOSINE", a), 3.0)
    roots = [
        builder.math("MULTIPLY", builder.math("COSINE", builder.math("ADD", third, shift)), factor)
        for shift, factor in ((-math.pi / 3.0, 2.0), (math.pi / 3.0, 2.0), (0.0, -2.0))
    ]
    weights = []
    for i, root in enumerate(roots):
        over = builder.math("SUBTRACT", root, a)
        under = builder.math("MULTIPLY", root, builder.math("SUBTRACT", root, roots[i - 1]))
        under = builder.math("MULTIPLY", under, builder.math("SUBTRACT", root, roots[i - 2]))
        over = builder.math("MULTIPLY", builder.math("MULTIPLY", over, over), 3.0)
        weights.append(builder.math("DIVIDE", over, under))
    return _FluxTerms(
        start=builder.math("SQRT", inputs.innermost),
        drag=builder.math("MULTIPLY", a, 1.5),
        roots=tuple(roots),
        weights=tuple(weights),
    )


def _flux(builder: TreeBuilder, inputs: DiskInputs, terms: _FluxTerms, radius: Socket) -> Socket:
    """The flux of the chosen profile, relative to its largest; see `physics.disk_flux.relative_flux`."""
    # Where there is no disk, passes hold 0.
    outside = builder.math("MAXIMUM", radius, inputs.innermost)
    x = builder.math("SQRT", outside)
    log = builder.math("LOGARITHM", builder.math("DIVIDE", x, terms.start), math.e)
    total = builder.math("SUBTRACT", x, terms.start)
    total = builder.math("SUBTRACT", total, builder.math("MULTIPLY", terms.drag, log))
    under = builder.math("MULTIPLY", outside, outside)
    for root, weight in zip(terms.roots, terms.weights, strict=True):
        way = builder.math("SUBTRACT", x, root)
        log = builder.math("DIVIDE", way, builder.math("SUBTRACT", terms.start, root))
        log = builder.math("LOGARITHM", log, math.e)
        total = builder.math("SUBTRACT", total, builder.math("MULTIPLY", weight, log))
        under = builder.math("MULTIPLY", under, way)
    total = builder.math("MULTIPLY", builder.math("MULTIPLY", total, 1.5), inputs.flux_factor)
    steady = builder.math("DIVIDE", total, under)
    steady = builder.math("MULTIPLY", steady, builder.math("GREATER_THAN", radius, inputs.innermost))
    ratio = builder.math("DIVIDE", inputs.inner, builder.math("MAXIMUM", radius, inputs.inner))
    power = builder.math("POWER", ratio, inputs.exponent)
    return builder.math("MAXIMUM", 0.0, builder.select(inputs.page_thorne, power, steady))


def _rows(builder: TreeBuilder, table: Socket) -> Socket:
    _, height = builder.image_size(table)
    return builder.math("MAXIMUM", 2.0, height)


def _look_up(builder: TreeBuilder, table: Socket, rows: Socket, place: Socket) -> Socket:
    """A table's value between its first row, at place 0, which is at the top, and its last, at place 1."""
    steps = builder.math("SUBTRACT", rows, 1.0)
    below = builder.math("MULTIPLY_ADD", builder.math("SUBTRACT", 1.0, place), steps, 0.5)
    return sample_bilinearly(builder, table, 0.5, builder.math("DIVIDE", below, rows))


def _clamped(builder: TreeBuilder, value: Socket, low: Value, high: Value) -> Socket:
    return builder.math("MINIMUM", high, builder.math("MAXIMUM", low, value))


def _depth(builder: TreeBuilder, inputs: DiskInputs, shared: _Shared, radius: Socket) -> Socket:
    """ln(r / inner) / ln(outer / inner), from 0 at the inner rim to 1 at the outer one."""
    inside = _clamped(builder, radius, inputs.inner, inputs.outer)
    log = builder.math("SUBTRACT", builder.math("LOGARITHM", inside, math.e), shared.log_inner)
    return _clamped(builder, builder.math("DIVIDE", log, shared.log_width), 0.0, 1.0)


def _places(
    builder: TreeBuilder, inputs: DiskInputs, shared: _Shared, place: tuple[Socket, Socket, Socket]
) -> list[tuple[Socket, Socket]]:
    """Where the two patterns of the texture are looked up, which turn with the matter; see `physics.disk_texture`."""
    radius, phi, depth = place
    # Omega = +-1 / (r^(3/2) +- a), BPT Eq. 2.16
    outside = builder.math("MAXIMUM", radius, inputs.inner)
    period = builder.math(
        "MULTIPLY_ADD",
        outside,
        builder.math("SQRT", outside),
        builder.math("MULTIPLY", inputs.direction, inputs.spin),
    )
    omega = builder.math("DIVIDE", inputs.direction, period)
    v = builder.math("SUBTRACT", 1.0, depth)
    found = []
    for age, _share, _contrast, turn in shared.patterns:
        azimuth = builder.math("SUBTRACT", builder.math("ADD", phi, turn), builder.math("MULTIPLY", omega, age))
        found.append((builder.math("FRACT", builder.math("MULTIPLY", azimuth, 0.5 / math.pi)), v))
    return found


def _moving_picture(
    builder: TreeBuilder, inputs: DiskInputs, shared: _Shared, place: tuple[Socket, Socket, Socket]
) -> tuple[Socket, Socket]:
    """Color (not premultiplied) and alpha of a picture whose two patterns are mixed as they are."""
    color: Socket | None = None
    alpha: Socket | None = None
    for (u, v), (_, share, _, _) in zip(_places(builder, inputs, shared, place), shared.patterns, strict=True):
        one, covered = sample_with_alpha(builder, inputs.texture, u, v)
        one, covered = builder.vector_scale(one, share), builder.math("MULTIPLY", covered, share)
        color = one if color is None else builder.vector_math("ADD", color, one)
        alpha = covered if alpha is None else builder.math("ADD", alpha, covered)
    inverse = builder.math("DIVIDE", 1.0, builder.math("MAXIMUM", disk_look.SMALLEST_ALPHA, alpha))
    return builder.vector_scale(color, inverse), _clamped(builder, alpha, 0.0, 1.0)


def _moving_texture(
    builder: TreeBuilder,
    inputs: DiskInputs,
    shared: _Shared,
    place: tuple[Socket, Socket, Socket],
    coverage: Socket,
) -> tuple[Socket, Socket]:
    """Streaks and clumps, 0 to 1; see `physics.disk_texture`."""
    total: Socket | None = None
    for (u, v), (_, _, share, _) in zip(_places(builder, inputs, shared, place), shared.patterns, strict=True):
        pattern = sample_bilinearly(builder, inputs.texture, u, v)
        pattern = builder.vector_scale(builder.vector_math("SUBTRACT", pattern, (0.5, 0.5, 0.5)), share)
        total = pattern if total is None else builder.vector_math("ADD", total, pattern)
    # A rim, or all of the disk at once in a thin ring, shows the mean.
    found = []
    for value in builder.separate(total)[:2]:
        whole = _clamped(builder, value, -0.5, 0.5)
        found.append(builder.math("MULTIPLY_ADD", whole, coverage, 0.5))
    return found[0], found[1]


def _fade(builder: TreeBuilder, inputs: DiskInputs, depth: Socket) -> Socket:
    """The share of the disk that is left by its soft rims."""
    thick: Socket | None = None
    for way, softness in ((depth, inputs.inner_softness), (None, inputs.outer_softness)):
        way = builder.math("SUBTRACT", 1.0, depth) if way is None else way
        t = builder.math("DIVIDE", way, builder.math("MAXIMUM", _SMALLEST_SOFTNESS, softness))
        t = _clamped(builder, t, 0.0, 1.0)
        step = builder.math("MULTIPLY", builder.math("MULTIPLY", t, t), builder.math("MULTIPLY_ADD", t, -2.0, 3.0))
        thick = step if thick is None else builder.math("MULTIPLY", thick, step)
    return thick


def _density(builder: TreeBuilder, inputs: DiskInputs, depth: Socket, streaks: Socket, clumps: Socket) -> Socket:
    thick = _fade(builder, inputs, depth)
    for value, amount in ((streaks, inputs.streaks), (clumps, inputs.clumps)):
        missing = builder.math("MULTIPLY", builder.math("SUBTRACT", 1.0, value), amount)
        thick = builder.math("MULTIPLY", thick, builder.math("SUBTRACT", 1.0, missing))
    return thick


def _emission(builder: TreeBuilder, inputs: DiskInputs, shared: _Shared, radius: Socket, g: Socket) -> Socket:
    """Light of an opaque disk where it is densest; see `physics.disk_look.emission`."""
    flux = _flux(builder, inputs, shared.flux, radius)
    shift = builder.math("MAXIMUM", disk_look.SMALLEST_G, g)
    cooling = builder.math("POWER", builder.math("MAXIMUM", _SMALLEST_FLUX, flux), shared.temperature_power)
    seen = builder.math("POWER", shift, inputs.doppler_color)
    temperature = builder.math("MULTIPLY", builder.math("MULTIPLY", inputs.temperature, cooling), seen)
    temperature = _clamped(builder, temperature, disk_look.COLDEST, disk_look.HOTTEST)
    log = builder.math("SUBTRACT", builder.math("LOGARITHM", temperature, math.e), _LOWEST)
    place = builder.math("MULTIPLY", log, 1.0 / (_HIGHEST - _LOWEST))
    color = _look_up(builder, inputs.colors, shared.color_rows, place)
    return builder.vector_scale(color, _brightness(builder, inputs, shared, flux, shift))


def _tinted_light(
    builder: TreeBuilder, inputs: DiskInputs, shared: _Shared, radius: Socket, g: Socket, color: Socket
) -> Socket:
    """Light of a place that has a color of its own; see `physics.disk_look.tinted_light`."""
    flux = _flux(builder, inputs, shared.flux, radius)
    shift = builder.math("MAXIMUM", disk_look.SMALLEST_G, g)
    gain = redshift_gain(builder, builder.math("DIVIDE", 1.0, shift), inputs.doppler_color, 0.0, inputs.temperature)
    light = builder.vector_scale(color, _brightness(builder, inputs, shared, flux, shift))
    return builder.vector_math("MULTIPLY", light, gain)


def _brightness(builder: TreeBuilder, inputs: DiskInputs, shared: _Shared, flux: Socket, shift: Socket) -> Socket:
    brightness = builder.math("POWER", flux, inputs.falloff)
    beamed = builder.math("POWER", shift, shared.brightness_power)
    return builder.math("MULTIPLY", builder.math("MULTIPLY", brightness, beamed), shared.brightness)


def _all_there(builder: TreeBuilder, passes: Sequence[Socket]) -> Socket:
    """1 if each pass is a picture, else 0; a file that is missing has no size."""
    there: Socket | None = None
    for one in passes:
        width, _ = builder.image_size(one)
        one_there = builder.math("GREATER_THAN", width, 0.5)
        there = one_there if there is None else builder.math("MULTIPLY", there, one_there)
    return there
