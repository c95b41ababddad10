# SPDX-License-Identifier: GPL-3.0-or-later
"""What is inside the node group "Umbra Black Hole": from a warp map to a picture, in float32.

The same picture as `physics.reference_render` in float64, term by term. Where the two are written
differently, float32 is the reason: an angle of 6 radians has steps of 5e-7, a texture coordinate near 1 has
steps of 6e-8, and an environment 8192 texels wide turns each such step into a thousandth of a texel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..core.physics_api import color, reference_render
from .builder import SETTINGS_ARE_SOCKETS, Socket, TreeBuilder, Value

_HALVINGS = 2
"""Two halvings and the last step by 2 reduce exactly up to 8:1: a map of 4x supersampling at half size."""

# An eighth of a turn in two parts. The first has so few digits that its multiples up to 512 are exact in
# float32, so that subtracting a multiple from an angle loses nothing; the second is what the first lacks.
_EIGHTH_TURN = math.pi / 4.0
_EIGHTH_TURN_COARSE = round(_EIGHTH_TURN * 2**14) / 2**14
_EIGHTH_TURN_FINE = _EIGHTH_TURN - _EIGHTH_TURN_COARSE


@dataclass(frozen=True)
class GroupInputs:
    """Output sockets of the Group Input node."""

    render: Socket
    environment: Socket
    warp_map: Socket
    rotation: Socket
    strength: Socket
    exposure: Socket
    redshift_color: Socket
    redshift_brightness: Socket
    temperature: Socket
    disk: Socket


@dataclass(frozen=True)
class GroupOutputs:
    """What goes into the Group Output node."""

    image: Socket
    sky: Socket
    shadow: Socket
    redshift: Socket


@dataclass(frozen=True)
class _MapChannels:
    """A warp map's channels, made harmless where they are invalid; `valid` is 1 or 0."""

    theta: Socket
    phi: Socket
    one_plus_z: Socket
    visibility: Socket
    valid: Socket


@dataclass(frozen=True)
class _Angle:
    """An angle as `eighths` (a whole number of eighths of a turn) plus `rest` (radians, within pi/8)."""

    eighths: Socket
    rest: Socket


def build(builder: TreeBuilder, inputs: GroupInputs) -> GroupOutputs:
    """Add all nodes between the group's inputs and its outputs.

    Parameters
    ----------
    builder : TreeBuilder
        Of an empty compositor tree with the Group Input node in it.
    inputs : GroupInputs
        That node's sockets.

    Returns
    -------
    GroupOutputs
        Sockets to link to the Group Output node. All four images have exactly the render's size.
    """
    with builder.frame("Warp map: is it one?"):
        channels = _read_map(builder, inputs.warp_map)
    with builder.frame("Direction in the environment"):
        u, v = _texture_coordinates(builder, channels, inputs.rotation)
    with builder.frame("Environment"):
        environment = sample_bilinearly(builder, inputs.environment, u, v)
    with builder.frame("Redshift"):
        gain = redshift_gain(
            builder, channels.one_plus_z, inputs.redshift_color, inputs.redshift_brightness, inputs.temperature
        )
    with builder.frame("Sky"):
        factor = builder.math("MULTIPLY", builder.math("POWER", 2.0, inputs.exposure), inputs.strength)
        factor = builder.math("MULTIPLY", factor, channels.visibility)
        sky = builder.vector_math("MULTIPLY", environment, gain)
        sky = builder.vector_scale(sky, factor)
        sky = builder.select_vector(channels.valid, reference_render.MAGENTA, sky, "Magenta if invalid")
        data = builder.combine(channels.visibility, channels.one_plus_z, channels.valid)
    with builder.frame("To the render's size"):
        sky, data = to_render_size(builder, sky, data)
    with builder.frame("Picture"):
        return _compose(builder, inputs, sky, data)


def _read_map(builder: TreeBuilder, warp_map: Value) -> _MapChannels:
    """Tell pixels that a valid map can hold from others, and replace the others by harmless values."""
    slack = reference_render.ANGLE_SLACK
    smallest = reference_render.SMALLEST_ONE_PLUS_Z
    largest = reference_render.LARGEST_ONE_PLUS_Z
    theta, phi, one_plus_z, visibility = builder.separate_color(warp_map)
    # Every comparison is false for NaN, so NaN makes a pixel invalid.
    conditions = (
        builder.math("COMPARE", theta, math.pi / 2.0, math.pi / 2.0 + slack, label="theta in 0..pi"),
        builder.math("COMPARE", phi, math.pi, math.pi + slack, label="phi in 0..2 pi"),
        builder.math("COMPARE", visibility, 0.5, 0.5 + slack, label="visibility in 0..1"),
        builder.math("GREATER_THAN", one_plus_z, smallest),
        builder.math("LESS_THAN", one_plus_z, largest),
    )
    valid = conditions[0]
    for condition in conditions[1:]:
        valid = builder.math("MULTIPLY", valid, condition)

    def clamped(value: Socket, low: float, high: float) -> Socket:
        # With the constant first, both operations return it when the other operand is NaN.
        return builder.math("MINIMUM", high, builder.math("MAXIMUM", low, value))

    return _MapChannels(
        theta=clamped(theta, -slack, math.pi + slack),
        phi=clamped(phi, -slack, 2.0 * math.pi + slack),
        one_plus_z=builder.select(valid, 1.0, clamped(one_plus_z, smallest, largest), "1 + z"),
        visibility=builder.select(valid, 1.0, clamped(visibility, 0.0, 1.0), "Visibility"),
        valid=valid,
    )


def _texture_coordinates(builder: TreeBuilder, channels: _MapChannels, rotation: Value) -> tuple[Socket, Socket]:
    """Texture coordinates of the rotated direction: u within -0.6..0.6 (it repeats), v in 0..1 from below.

    The rotation is R = Rz Ry Rx. Rz only adds to the longitude; Ry Rx needs the vector, whose float32
    components cost digits near the poles, so it is only used when the environment is tilted.
    """
    angle_x, angle_y, angle_z = builder.separate(rotation)
    tilt = builder.math("ADD", builder.math("ABSOLUTE", angle_x), builder.math("ABSOLUTE", angle_y))
    tilted = builder.math("GREATER_THAN", tilt, 0.0, label="Tilted?")

    sine = builder.math("SINE", channels.theta)
    direction = builder.combine(
        builder.math("MULTIPLY", sine, builder.math("COSINE", channels.phi)),
        builder.math("MULTIPLY", sine, builder.math("SINE", channels.phi)),
        builder.math("COSINE", channels.theta),
    )
    direction = builder.rotate_euler(direction, builder.combine(angle_x, angle_y, 0.0))
    x, y, z = builder.separate(direction)
    tilted_longitude = builder.math("ARCTAN2", y, x)
    squares = builder.math("MULTIPLY_ADD", x, x, builder.math("MULTIPLY", y, y))
    # By arc tangent, since the arc sine of z loses half of the digits at the poles.
    tilted_polar = builder.math("ARCTAN2", builder.math("SQRT", squares), z)

    longitude = _split_angle(builder, builder.select(tilted, channels.phi, tilted_longitude, "Longitude"))
    polar = _split_angle(builder, builder.select(tilted, channels.theta, tilted_polar, "Polar angle"))
    turn = _split_angle(builder, angle_z)

    # u = 1/2 - (longitude + turn) / (2 pi). The whole eighths are exact; they are brought into -4..4, so
    # that u is smallest and float32's steps are finest.
    eighths = builder.math("SUBTRACT", 4.0, builder.math("ADD", longitude.eighths, turn.eighths))
    turns = builder.math("ROUND", builder.math("DIVIDE", eighths, 8.0))
    eighths = builder.math("MULTIPLY_ADD", turns, -8.0, eighths)
    rest = builder.math("MULTIPLY", builder.math("ADD", longitude.rest, turn.rest), -0.5 / math.pi)
    u = builder.math("MULTIPLY_ADD", eighths, 0.125, rest, label="u")

    # v = 1 - polar / pi.
    eighths = builder.math("SUBTRACT", 4.0, polar.eighths)
    rest = builder.math("MULTIPLY", polar.rest, -1.0 / math.pi)
    v = builder.math("MULTIPLY_ADD", eighths, 0.25, rest, label="v")
    return u, v


def _split_angle(builder: TreeBuilder, angle: Value) -> _Angle:
    eighths = builder.math("ROUND", builder.math("MULTIPLY", angle, 1.0 / _EIGHTH_TURN))
    rest = builder.math("MULTIPLY_ADD", eighths, -_EIGHTH_TURN_COARSE, angle)
    rest = builder.math("MULTIPLY_ADD", eighths, -_EIGHTH_TURN_FINE, rest)
    return _Angle(eighths, rest)


def sample_bilinearly(builder: TreeBuilder, environment: Value, u: Value, v: Value) -> Socket:
    """Bilinear look-up that wraps round in u and extends the first and last row in v."""
    if SETTINGS_ARE_SOCKETS:
        return builder.map_uv(environment, builder.combine(u, v, 1.0), "Bilinear")

    # Blender 4.5 has no usable bilinear look-up (its anisotropic one draws a line at the seam): four exact
    # texels, mixed here.
    width, height = (builder.math("MAXIMUM", 1.0, size) for size in builder.image_size(environment))
    column = builder.math("MULTIPLY_ADD", u, width, -0.5)
    row = builder.math("MULTIPLY_ADD", v, height, -0.5)
    left, below = builder.math("FLOOR", column), builder.math("FLOOR", row)
    share_x, share_y = builder.math("SUBTRACT", column, left), builder.math("SUBTRACT", row, below)
    top_row = builder.math("SUBTRACT", height, 1.0)

    def column_coordinate(index: Socket) -> Socket:
        wrapped = builder.math("FLOORED_MODULO", index, width)
        return builder.math("DIVIDE", builder.math("ADD", wrapped, 0.5), width)

    def row_coordinate(index: Socket) -> Socket:
        clamped = builder.math("MINIMUM", top_row, builder.math("MAXIMUM", 0.0, index))
        return builder.math("DIVIDE", builder.math("ADD", clamped, 0.5), height)

    columns = column_coordinate(left), column_coordinate(builder.math("ADD", left, 1.0))
    rows = row_coordinate(below), row_coordinate(builder.math("ADD", below, 1.0))
    mixed = []
    for row_at in rows:
        texels = [
            builder.map_uv(environment, builder.combine(column_at, row_at, 1.0), "Nearest") for column_at in columns
        ]
        mixed.append(builder.select_vector(share_x, *texels))
    return builder.select_vector(share_y, *mixed)


def sample_with_alpha(builder: TreeBuilder, picture: Value, u: Value, v: Value) -> tuple[Socket, Socket]:
    """The same look-up of a picture's color as a vector, and of its alpha."""
    if SETTINGS_ARE_SOCKETS:
        rgba = sample_bilinearly(builder, picture, u, v)
        return rgba, builder.separate_color(rgba)[3]
    _, _, _, alpha = builder.separate_color(picture)
    alphas = sample_bilinearly(builder, builder.combine(alpha, alpha, alpha), u, v)
    return sample_bilinearly(builder, picture, u, v), builder.separate(alphas)[0]


def redshift_gain(
    builder: TreeBuilder, one_plus_z: Socket, amount: Value, brightness_amount: Value, temperature: Value
) -> Socket:
    """Vector of the gains of red, green and blue; see `physics.color` for the formula and where it is from.

    exp(4 (c - k) ln(1+z) + c (x - y + ln(1 - exp(-x)) - ln(1 - exp(-y)))), y = (1 + z) x: by logarithms, so
    that nothing overflows on the way.
    """
    excess = builder.math("SUBTRACT", amount, brightness_amount)
    power = builder.math("MULTIPLY", builder.math("MULTIPLY", 4.0, excess), _natural_log(builder, one_plus_z))
    temperature = builder.math("MAXIMUM", 1.0, temperature)
    gains = []
    for wavelength in color.CHANNEL_WAVELENGTHS:
        x = builder.math("DIVIDE", color.SECOND_RADIATION_CONSTANT / wavelength, temperature)
        y = builder.math("MULTIPLY", x, one_plus_z)
        ratio = builder.math("SUBTRACT", _log_of_planck_term(builder, x), _log_of_planck_term(builder, y))
        ratio = builder.math("ADD", builder.math("SUBTRACT", x, y), ratio)
        exponent = builder.math("MULTIPLY_ADD", amount, ratio, power)
        gains.append(builder.math("EXPONENT", exponent))
    return builder.combine(*gains, label="Gains")


def _natural_log(builder: TreeBuilder, value: Value) -> Socket:
    return builder.math("LOGARITHM", value, math.e)


def _log_of_planck_term(builder: TreeBuilder, value: Socket) -> Socket:
    """ln(1 - exp(-y)), with 1 - exp(-y) = tanh(y / 2) (1 + exp(-y)), which keeps its digits at small y."""
    decay = builder.math("EXPONENT", builder.math("MULTIPLY", value, -1.0))
    tangent = builder.math("TANH", builder.math("MULTIPLY", value, 0.5))
    return _natural_log(builder, builder.math("MULTIPLY", tangent, builder.math("ADD", 1.0, decay)))


def to_render_size(builder: TreeBuilder, *images: Socket) -> tuple[Socket, ...]:
    """Bring images of the map's size to the render's size; vectors, of which the last one is asked for the size.

    A map of 2, 4 or 8 times the render's size is box-filtered exactly, one halving after the other: four
    nearest pixels added up, because a bilinear sample between four pixels, which ought to be the same, is
    off by 1e-4 in large pictures. Any other size is stretched bilinearly, so that the frame is filled
    whatever the map.
    """
    area = builder.render_area("The render's pixels")
    area_width, area_height = builder.image_size(area)
    for _ in range(_HALVINGS):
        width, _height = builder.image_size(images[-1])
        halve = builder.math(
            "GREATER_THAN",
            builder.math("DIVIDE", width, area_width),
            reference_render.HALVE_ABOVE,
            label="Halve?",
        )
        factor = builder.math("MULTIPLY_ADD", halve, -0.5, 1.0)
        step = builder.math("MULTIPLY", halve, 0.5)
        back = builder.math("MULTIPLY", step, -1.0)
        # An image of zeros in the halved size: being the first operand it makes Blender sample the others
        # there. (Two scalings in a row without arithmetic in between would merge into one.)
        grid = builder.vector_scale(builder.scale_by(images[-1], factor), 0.0)
        images = tuple(
            _mean_of_four(
                builder,
                grid,
                [
                    builder.scale_by(builder.translate(image, x, y, "Nearest"), factor, "Nearest")
                    for x in (back, step)
                    for y in (back, step)
                ],
            )
            for image in images
        )

    width, height = builder.image_size(images[-1])
    double = builder.math(
        "MULTIPLY",
        builder.math("COMPARE", width, builder.math("MULTIPLY", 2.0, area_width), 0.1),
        builder.math("COMPARE", height, builder.math("MULTIPLY", 2.0, area_height), 0.1),
        label="Exactly twice?",
    )
    shifts = (_centring(builder, width, area_width), _centring(builder, height, area_height))
    coverage = None if SETTINGS_ARE_SOCKETS else _coverage(builder, images[-1], area, shifts)
    return tuple(_last_step(builder, image, area, double, shifts, coverage) for image in images)


def _coverage(builder: TreeBuilder, image: Socket, area: Socket, shifts: tuple[Socket, Socket]) -> Socket:
    """How much of each pixel the stretched image covers: Blender 4.5 mixes black into the outermost ones."""
    white = builder.vector_math("MULTIPLY_ADD", image, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    covered, _, _ = builder.separate(_stretch(builder, white, area, shifts))
    return covered


def _centring(builder: TreeBuilder, size: Socket, area_size: Socket) -> Socket:
    """Shift (in the render's pixels) that undoes Blender's rounding when an image is scaled from even to odd.

    Blender lays images center on center. If one has an odd and the other an even number of pixels, it
    shifts the scaled one by half a pixel of its own to make the grids coincide, which only images that are
    not scaled need. It does so when it interpolates bilinearly; nearest pixels stay where they belong.
    """
    parity = builder.math("FLOORED_MODULO", builder.math("ADD", size, area_size), 2.0)
    return builder.math("DIVIDE", builder.math("MULTIPLY", parity, builder.math("MULTIPLY", 0.5, area_size)), size)


def _stretch(builder: TreeBuilder, image: Socket, area: Socket, shifts: tuple[Socket, Socket]) -> Socket:
    scaled = builder.translate(builder.scale_to_render(image, "Bilinear"), *shifts, "Bilinear")
    return builder.vector_math("ADD", area, scaled)


def _last_step(
    builder: TreeBuilder,
    image: Socket,
    area: Socket,
    double: Socket,
    shifts: tuple[Socket, Socket],
    coverage: Socket | None,
) -> Socket:
    stretched = _stretch(builder, image, area, shifts)
    if coverage is not None:
        stretched = builder.vector_scale(stretched, builder.math("DIVIDE", 1.0, coverage))
    step = builder.math("MULTIPLY", double, 0.25)
    back = builder.math("MULTIPLY", step, -1.0)
    corners = [
        builder.translate(builder.scale_to_render(image, "Nearest"), x, y, "Nearest")
        for x in (back, step)
        for y in (back, step)
    ]
    return builder.select_vector(double, stretched, _mean_of_four(builder, area, corners))


def _mean_of_four(builder: TreeBuilder, grid: Socket, images: list[Socket]) -> Socket:
    """Mean of four images on the pixels of `grid`, an image of zeros."""
    total = grid
    for image in images:
        total = builder.vector_math("ADD", total, image)
    return builder.vector_scale(total, 0.25)


def _compose(builder: TreeBuilder, inputs: GroupInputs, sky: Socket, data: Socket) -> GroupOutputs:
    """Render over disk over sky, premultiplied. Alpha Over would drop light whose alpha is 0, such as flames."""
    visibility, one_plus_z, valid = builder.separate(data)
    _, _, _, covered = builder.separate_color(inputs.disk)
    sky = builder.vector_math("MULTIPLY_ADD", sky, builder.math("SUBTRACT", 1.0, covered), inputs.disk)
    _, _, _, alpha = builder.separate_color(inputs.render)
    image = builder.vector_math("MULTIPLY_ADD", sky, builder.math("SUBTRACT", 1.0, alpha), inputs.render)
    image = builder.select_vector(valid, reference_render.MAGENTA, image, "Magenta if invalid")
    return GroupOutputs(
        image=image,
        sky=sky,
        shadow=builder.math("SUBTRACT", 1.0, visibility, label="Shadow"),
        redshift=one_plus_z,
    )
