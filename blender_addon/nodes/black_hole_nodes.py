# SPDX-License-Identifier: GPL-3.0-or-later
"""What is inside the node group "Umbra Black Hole": from a warp map to a picture, in float32.

The same picture as `physics.reference.reference_render` in float64, term by term. Where the two are written
differently, float32 is the reason: an angle of 6 radians has steps of 5e-7, a texture coordinate near 1 has
steps of 6e-8, and an environment 8192 texels wide turns each such step into a thousandth of a texel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..core.physics_api import physics
from .arithmetic import atan2, clamp, combine, cos, multiply_add, nearest_integer, sin, sqrt, where
from .builder import Float, TreeBuilder, Vector
from .disk_layer import DiskLight
from .filtered_sky import Sky, filtered
from .glare import add_glare
from .image_lookup import sample_bilinearly
from .image_nodes import erode, separate_color
from .redshift import redshift_gain
from .render_size import stretched_to_render, to_render_size

# An eighth of a turn in two parts. The first has so few digits that its multiples up to 512 are exact in
# float32, so that subtracting a multiple from an angle loses nothing; the second is what the first lacks.
_EIGHTH_TURN = math.pi / 4.0
_EIGHTH_TURN_COARSE = round(_EIGHTH_TURN * 2**14) / 2**14
_EIGHTH_TURN_FINE = _EIGHTH_TURN - _EIGHTH_TURN_COARSE

EDGE = 2
"""How many pixels beyond its own an object can shine, by the pixel filter and at its corners."""

NO_DEPTH = 1e9
"""Blender's depth pass is 1e10 where there is no object."""


@dataclass(frozen=True)
class GroupInputs:
    """Values of the Group Input node, which `black_hole_group` describes; of the disk, what its inputs give."""

    render: Vector
    environment: Vector
    warp_map: Vector
    rotation: Vector
    strength: Float
    exposure: Float
    redshift_color: Float
    redshift_brightness: Float
    temperature: Float
    disk: DiskLight
    depth: Float
    hole_depth: Float
    hide_behind: Float
    levels: Vector
    footprint: Vector
    stars: Vector
    star_brightness: Float


@dataclass(frozen=True)
class GroupOutputs:
    """Values for the Group Output node, all of the render's size."""

    image: Vector
    sky: Vector
    shadow: Float
    redshift: Float


@dataclass(frozen=True)
class _MapChannels:
    """A warp map's channels, made harmless where they are invalid; `valid` is 1 or 0."""

    theta: Float
    phi: Float
    one_plus_z: Float
    visibility: Float
    valid: Float


@dataclass(frozen=True)
class _Angle:
    """An angle as `eighths` (a whole number of eighths of a turn) plus `rest` (radians, within pi/8)."""

    eighths: Float
    rest: Float


def build(builder: TreeBuilder, inputs: GroupInputs, looks: int, glare: int = 0) -> GroupOutputs:
    """Add all nodes between the group's inputs and its outputs.

    Parameters
    ----------
    builder : TreeBuilder
        Of a compositor tree in which there is only the Group Input node.
    inputs : GroupInputs
        That node's values.
    looks : int
        Looks at the sky per pixel, along its footprint; 0: one, unfiltered.
    glare : int
        How the light of sky and disk is spread, one of `physics.GLARES`; 0: not at all.

    Returns
    -------
    GroupOutputs
        Values to link to the Group Output node.
    """
    with builder.frame("Warp map: is it one?"):
        channels = _read_map(inputs.warp_map)
    with builder.frame("Direction in the environment"):
        direction = _direction(channels)
        u, v = _texture_coordinates(channels, direction, inputs.rotation)
    with builder.frame("Environment"):
        environment = sample_bilinearly(inputs.environment, u, v)
    if looks:
        with builder.frame("Filtered sky"):
            levels = Sky(inputs.environment, inputs.levels, inputs.rotation)
            environment = filtered(environment, levels, inputs.footprint, direction, looks)
    with builder.frame("Redshift"):
        gain = redshift_gain(
            channels.one_plus_z, inputs.redshift_color, inputs.redshift_brightness, inputs.temperature, environment
        )
    with builder.frame("Sky"):
        factor = 2.0**inputs.exposure * inputs.strength * channels.visibility
        sky = environment * gain * factor
        sky = where(channels.valid, sky, physics.INVALID_MAP_COLOR).labeled("Magenta if invalid")
        data = combine(channels.visibility, channels.one_plus_z, channels.valid)
    with builder.frame("To the render's size"):
        sky, data = to_render_size(builder, sky, data)
    with builder.frame("Stars"):
        sky, has_stars = _add_stars(builder, sky, inputs)
    with builder.frame("Behind the hole"):
        behind = _behind(inputs)
    with builder.frame("Picture"):
        return _compose(inputs, sky, data, has_stars, behind, glare)


def _read_map(warp_map: Vector) -> _MapChannels:
    """Tell pixels that a valid map can hold from others, and replace the others by harmless values."""
    slack = physics.ANGLE_SLACK
    smallest = physics.SMALLEST_ONE_PLUS_Z
    largest = physics.LARGEST_ONE_PLUS_Z
    theta, phi, one_plus_z, visibility = separate_color(warp_map)
    # Every comparison is false for NaN, so NaN makes a pixel invalid.
    conditions = (
        theta.near(math.pi / 2.0, math.pi / 2.0 + slack).labeled("theta in 0..pi"),
        phi.near(math.pi, math.pi + slack).labeled("phi in 0..2 pi"),
        visibility.near(0.5, 0.5 + slack).labeled("visibility in 0..1"),
        one_plus_z.greater_than(smallest),
        one_plus_z.less_than(largest),
    )
    valid = conditions[0]
    for condition in conditions[1:]:
        valid = valid * condition
    return _MapChannels(
        theta=clamp(theta, -slack, math.pi + slack),
        phi=clamp(phi, -slack, 2.0 * math.pi + slack),
        one_plus_z=where(valid, clamp(one_plus_z, smallest, largest), 1.0).labeled("1 + z"),
        visibility=where(valid, clamp(visibility, 0.0, 1.0), 1.0).labeled("Visibility"),
        valid=valid,
    )


def _direction(channels: _MapChannels) -> Vector:
    sine = sin(channels.theta)
    return combine(sine * cos(channels.phi), sine * sin(channels.phi), cos(channels.theta))


def _texture_coordinates(channels: _MapChannels, direction: Vector, rotation: Vector) -> tuple[Float, Float]:
    """Texture coordinates of the rotated direction: u within -0.6..0.6 (it repeats), v in 0..1 from below.

    The rotation is R = Rz Ry Rx. Rz only adds to the longitude; Ry Rx needs the vector, whose float32
    components cost digits near the poles, so it is only used when the environment is tilted.
    """
    angle_x, angle_y, angle_z = rotation.separate()
    tilted = (abs(angle_x) + abs(angle_y)).greater_than(0.0).labeled("Tilted?")

    x, y, z = direction.turned(rotation.builder.rotation_rows(combine(angle_x, angle_y, 0.0)))
    tilted_longitude = atan2(y, x)
    # By arc tangent, since the arc sine of z loses half of the digits at the poles.
    tilted_polar = atan2(sqrt(multiply_add(x, x, y * y)), z)

    longitude = _split_angle(where(tilted, tilted_longitude, channels.phi).labeled("Longitude"))
    polar = _split_angle(where(tilted, tilted_polar, channels.theta).labeled("Polar angle"))
    turn = _split_angle(angle_z)

    # u = 1/2 - (longitude + turn) / (2 pi). The whole eighths are exact; they are brought into -4..4, so
    # that u is smallest and float32's steps are finest.
    eighths = 4.0 - (longitude.eighths + turn.eighths)
    eighths = multiply_add(nearest_integer(eighths / 8.0), -8.0, eighths)
    rest = (longitude.rest + turn.rest) * (-0.5 / math.pi)
    u = multiply_add(eighths, 0.125, rest).labeled("u")

    # v = 1 - polar / pi.
    eighths = 4.0 - polar.eighths
    v = multiply_add(eighths, 0.25, polar.rest * (-1.0 / math.pi)).labeled("v")
    return u, v


def _split_angle(angle: Float) -> _Angle:
    eighths = nearest_integer(angle * (1.0 / _EIGHTH_TURN))
    rest = multiply_add(eighths, -_EIGHTH_TURN_COARSE, angle)
    return _Angle(eighths, multiply_add(eighths, -_EIGHTH_TURN_FINE, rest))


def _add_stars(builder: TreeBuilder, sky: Vector, inputs: GroupInputs) -> tuple[Vector, Float]:
    """The sky with the layer of stars, and 1 where there is one or none is wanted, else 0.

    A missing file has alpha 0. Points keep their light only where pixels are not averaged: no box filter.
    """
    light, alpha = stretched_to_render(builder, inputs.stars)
    factor = 2.0 ** (inputs.exposure + inputs.star_brightness) * inputs.strength
    is_there = alpha.greater_than(0.5).labeled("Layer there?")
    sky = multiply_add(light, combine(factor, factor, factor), sky)
    return where(is_there, sky, physics.INVALID_MAP_COLOR).labeled("Sky with stars"), is_there


def _behind(inputs: GroupInputs) -> Float:
    """1 where the render is deeper than the hole and that counts, else 0.

    The depth pass has one depth per pixel, that of its center, while the edges of objects cover pixels in part. A pixel
    whose center sees no object takes the depth of the nearest object beside it: that is what covers its edge. Without
    one it shows what has no depth, such as a volume, which stays.
    """
    is_empty = inputs.depth.greater_than(NO_DEPTH).labeled("No object?")
    depth = where(is_empty, erode(inputs.depth, EDGE), inputs.depth).labeled("Depth")
    deeper = depth.greater_than(inputs.hole_depth) * depth.less_than(NO_DEPTH)
    return deeper * clamp(inputs.hide_behind, 0.0, 1.0)


def _compose(
    inputs: GroupInputs, sky: Vector, data: Vector, has_stars: Float, behind: Float, glare: int
) -> GroupOutputs:
    """Render over disk over sky, premultiplied. Alpha Over would drop light whose alpha is 0, such as flames.

    Of what is behind the hole only the share of a pixel is seen that is not shadow. The rest shows the disk; there is
    no sky in it to be covered.

    A glare spreads what is seen of sky and disk, over the render too, as a lens does. It leaves the render's own light,
    which the artist's glare behind this group may spread.
    """
    visibility, one_plus_z, valid = data.separate()
    valid = valid * inputs.disk.there * has_stars
    sky = multiply_add(sky, 1.0 - inputs.disk.covers, inputs.disk.light)
    _, _, _, alpha = separate_color(inputs.render)
    hidden = ((1.0 - visibility) * behind).labeled("Hidden")
    if glare:
        seen = multiply_add(inputs.disk.light, alpha * hidden, sky * (1.0 - alpha)).labeled("Sky and disk")
        image = multiply_add(inputs.render, 1.0 - hidden, add_glare(seen, glare))
    else:
        image = multiply_add(sky, 1.0 - alpha, inputs.render * (1.0 - hidden))
        image = multiply_add(inputs.disk.light, alpha * hidden, image)
    return GroupOutputs(
        image=where(valid, image, physics.INVALID_MAP_COLOR).labeled("Magenta if invalid"),
        sky=sky,
        shadow=(1.0 - visibility).labeled("Shadow"),
        redshift=one_plus_z,
    )
