# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of the sky averaged over the part of it that each pixel sees, as nodes.

Nodes for the formula of `physics.reference.filtered_sky`: looks along the major axis of a pixel's footprint, each at
the level of the sky whose texels are as wide as the footprint. Level 0 is the sky's own image; the others
lie in one image, the atlas of `physics.light.sky_levels`, whose layout follows from its height.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..core.blender_version import COMPOSITOR_SETTINGS_ARE_SOCKETS
from ..core.physics_api import physics
from .arithmetic import atan2, clamp, combine, floor, fraction, maximum, minimum, mix, multiply_add, sqrt, where
from .builder import Float, Operand, TreeBuilder, Vector
from .image_nodes import image_size, map_uv, separate_color
from .versioned_group import GROUP_NODE_TYPE, SocketSpec, Values, VersionedGroup

_MARGIN = float(physics.SKY_LEVEL_MARGIN)

# The count of levels is a whole number below a logarithm, which single precision may put just below that.
_ROUNDING = 1e-3

# A row of texture coordinates that no picture has.
_OUTSIDE = -1.0

# Blender 4.5 has no bilinear look-up that is of use, see `image_lookup`.
_TEXELS_ARE_MIXED_HERE = not COMPOSITOR_SETTINGS_ARE_SOCKETS


@dataclass(frozen=True)
class Sky:
    """What is filtered.

    Attributes
    ----------
    picture : Vector
        Image of the sky: level 0.
    atlas : Vector
        Image with the further levels.
    rotation : Vector
        Euler angles that turn the map's frame into the sky's.
    """

    picture: Vector
    atlas: Vector
    rotation: Vector


def filtered(plain: Vector, sky: Sky, footprint: Vector, direction: Vector, looks: int) -> Vector:
    """Light of the sky over each pixel's footprint; `plain` where a texel is wider than that, or without an atlas.

    Parameters
    ----------
    plain : Vector
        The sky itself, at the direction.
    sky : Sky
        Its levels.
    footprint : Vector
        Image of the map's size: major axis, and log2 of the minor axis as alpha.
    direction : Vector
        Unit vector of the map's frame.
    looks : int
        Number of looks per pixel.

    Returns
    -------
    Vector
        Colors of the map's size.
    """
    x, y, z, log_minor = separate_color(footprint)
    major = combine(x, y, z)
    length = major.length().labeled("Major axis")
    turn = plain.builder.rotation_rows(sky.rotation)
    width, height = image_size(sky.atlas)
    is_there = height.greater_than(8.0 * _MARGIN).labeled("Levels there?")
    rows = maximum((height - 4.0 * _MARGIN) * (2.0 / 3.0), float(physics.FEWEST_SKY_ROWS)).labeled("Rows of level 1")
    texel = (0.5 * math.pi) / rows

    across = maximum(log_minor, _log2(maximum(length * (1.0 / looks), 1e-9)))
    coarsest = floor(_log2(rows * (2.0 / physics.FEWEST_SKY_ROWS)) + _ROUNDING)
    level = clamp(floor(across - _log2(texel)), 0.0, coarsest).labeled("Level")
    part = 0.5**level
    ratio = texel / (part * maximum(length, 1e-9))
    major = major * sqrt(maximum(0.0, 1.0 - ratio * ratio))
    finest = level.less_than(0.5).labeled("The sky itself?")
    size = maximum(width, 1.0), maximum(height, 1.0)
    place = _place_of_level(maximum(level - 1.0, 0.0), rows, *size)
    whole = (-0.5 / math.pi, 0.5, -1.0 / math.pi, 1.0)
    place = tuple(where(finest, one, other) for one, other in zip(whole, place, strict=True))

    light: Operand = (0.0, 0.0, 0.0)
    shared: dict[str, Operand] = {_SKY: sky.picture, _ATLAS: sky.atlas, _FINEST: finest}
    shared |= {_DIRECTION: combine(*direction.turned(turn)), _MAJOR: combine(*major.turned(turn))}
    shared |= dict(zip(_PLACE, place, strict=True))
    if _TEXELS_ARE_MIXED_HERE:
        whole_size = (maximum(each, 1.0) for each in image_size(sky.picture))
        shared |= {name: where(finest, one, other) for name, one, other in zip(_SIZE, whole_size, size, strict=True)}
    look_group = LOOK.ensure()
    for look in range(looks):
        node = plain.builder.node(GROUP_NODE_TYPE)
        node.node_tree = look_group
        for name, value in {**shared, _SHARE: (look + 0.5) / looks - 0.5, _LIGHT: light}.items():
            plain.builder.feed(node.inputs[name], value)
        light = Vector(plain.builder, node.outputs[_LIGHT])
    wide = (is_there * length.greater_than(texel)).labeled("Wider than a texel?")
    return where(wide, Vector(plain.builder, node.outputs[_LIGHT]) * (1.0 / looks), plain).labeled("Filtered sky")


def _log2(value: Float) -> Float:
    return value.builder.math("LOGARITHM", value, 2.0)


def _place_of_level(above: Float, rows: Float, width: Float, height: Float) -> tuple[Float, ...]:
    """Where a level lies in the atlas: what longitude and polar angle are multiplied by, and what is added to them.

    `above` counts the levels from the atlas's first one, whose rows these are.
    """
    columns = rows * 2.0
    part = 0.5**above
    is_above = minimum(above, 1.0)
    # All but the first lie side by side, l of them on columns (1 - 2^-l) and their margins.
    before = multiply_add(part, columns * -2.0, columns) + multiply_add(above, 2.0 * _MARGIN, -2.0 * _MARGIN)
    wide, high = part * (columns / width), part * (rows / height)
    left = multiply_add(is_above, before, _MARGIN) / width
    below = multiply_add(is_above, rows + 2.0 * _MARGIN, _MARGIN) / height
    return (
        wide * (-0.5 / math.pi),
        multiply_add(wide, 0.5, left),
        high * (-1.0 / math.pi),
        high + below,
    )


# --- one look, a group of its own: large trees take long to build ----------------------------------

_SKY, _ATLAS, _FINEST, _DIRECTION, _MAJOR = "Sky", "Atlas", "Finest", "Direction", "Major Axis"
_SHARE, _LIGHT = "Share", "Light"
_PLACE = "Width", "Left", "Height", "Top"
_SIZE = "Columns", "Rows"


def _vector(name: str, description: str) -> SocketSpec:
    return SocketSpec(name, "NodeSocketVector", description, default=(0.0, 0.0, 0.0))


def _build_look(builder: TreeBuilder, values: Values) -> Values:
    share = values[_SHARE]
    x, y, z = multiply_add(values[_MAJOR], combine(share, share, share), values[_DIRECTION]).separate()
    wide, left, high, top = (values[name] for name in _PLACE)
    u = multiply_add(atan2(y, x), wide, left)
    v = multiply_add(atan2(sqrt(multiply_add(x, x, y * y)), z), high, top)
    light: Vector = values[_LIGHT]
    if not _TEXELS_ARE_MIXED_HERE:
        half_row = 0.5 / maximum(1.0, image_size(values[_SKY])[1])
        return {_LIGHT: light + _either(values, u, (clamp(v, half_row, 1.0 - half_row), v), "Bilinear")}
    width, height = (values[name] for name in _SIZE)
    column, row = multiply_add(u, width, -0.5), multiply_add(v, height, -0.5)
    before, below = floor(column), floor(row)
    # A level of the atlas ends before its picture does, so this wraps the sky itself only.
    columns = [fraction((before + offset) / width) for offset in (0.5, 1.5)]
    rows = [clamp(below + offset, 0.5, height - 0.5) / height for offset in (0.5, 1.5)]
    mixed = []
    for at_row in rows:
        texels = [_either(values, at_column, (at_row, at_row), "Nearest") for at_column in columns]
        mixed.append(mix(column - before, *texels))
    return {_LIGHT: light + mix(row - below, *mixed)}


def _either(values: Values, u: Float, v: tuple[Float, Float], interpolation: str) -> Vector:
    """Color of the sky itself, or of the atlas, at its v: that of the other one lies below the picture, where all is 0.

    Multiplied by 0 instead, a texel that is no number would spread over the picture.
    """
    finest = values[_FINEST]
    places = (where(finest, v[0], _OUTSIDE), where(finest, _OUTSIDE, v[1]))
    itself, other = (
        map_uv(values[picture], combine(u, at, 1.0), interpolation, ends="Clip")
        for picture, at in zip((_SKY, _ATLAS), places, strict=True)
    )
    return itself + other


LOOK = VersionedGroup(
    "Umbra Sky Look",
    2,
    "umbra_sky_look_version",
    (
        SocketSpec(_SKY, "NodeSocketColor", "The sky itself, level 0", default=(0.0, 0.0, 0.0, 0.0)),
        SocketSpec(_ATLAS, "NodeSocketColor", "The further levels of the sky", default=(0.0, 0.0, 0.0, 0.0)),
        SocketSpec(_FINEST, "NodeSocketFloat", "1: look at the sky itself; 0: at the atlas", default=0.0),
        _vector(_DIRECTION, "Where the pixel looks"),
        _vector(_MAJOR, "Major axis of what it sees, without the width of a texel"),
        *(SocketSpec(name, "NodeSocketFloat", f"{name} of the level in its picture", default=0.0) for name in _PLACE),
        *(
            SocketSpec(name, "NodeSocketFloat", f"{name} of that picture", default=1.0)
            for name in (_SIZE if _TEXELS_ARE_MIXED_HERE else ())
        ),
        SocketSpec(_SHARE, "NodeSocketFloat", "Where along the axis: -0.5 to 0.5", default=0.0),
        _vector(_LIGHT, "Light of the looks so far"),
    ),
    (SocketSpec(_LIGHT, "NodeSocketVector", "Light of the looks so far and this one", in_out="OUTPUT"),),
    _build_look,
)
"""The group of one look at the sky, which the filtering groups use inside."""
