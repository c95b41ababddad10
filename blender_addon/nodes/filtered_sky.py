# SPDX-License-Identifier: GPL-3.0-or-later
"""Light of the sky averaged over the part of it that each pixel sees, as nodes.

Nodes for the formula of `physics.reference.filtered_sky`: looks along the major axis of a pixel's footprint, each at
the level of the sky whose texels are as wide as the footprint. All levels lie in one image, the atlas of
`physics.light.sky_levels`, whose layout follows from its height.
"""

from __future__ import annotations

import math

from ..core.blender_version import COMPOSITOR_SETTINGS_ARE_SOCKETS
from ..core.physics_api import physics
from .arithmetic import atan2, clamp, combine, floor, maximum, minimum, mix, multiply_add, sqrt, where
from .builder import Float, Operand, TreeBuilder, Vector
from .image_nodes import image_size, map_uv, separate_color
from .versioned_group import GROUP_NODE_TYPE, SocketSpec, Values, VersionedGroup

_MARGIN = float(physics.SKY_LEVEL_MARGIN)

# The count of levels is a whole number below a logarithm, which single precision may put just below that.
_ROUNDING = 1e-3


def filtered(
    plain: Vector, atlas: Vector, footprint: Vector, direction: Vector, rotation: Vector, looks: int
) -> Vector:
    """Light of the sky over each pixel's footprint; `plain` where a texel is wider than that, or without an atlas.

    Parameters
    ----------
    plain : Vector
        The sky itself, at the direction.
    atlas : Vector
        Image with all levels of the sky.
    footprint : Vector
        Image of the map's size: major axis, and log2 of the minor axis as alpha.
    direction : Vector
        Unit vector of the map's frame.
    rotation : Vector
        Euler angles that turn the map's frame into the sky's.
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
    turn = plain.builder.rotation_rows(rotation)
    width, height = image_size(atlas)
    is_there = height.greater_than(8.0 * _MARGIN).labeled("Levels there?")
    rows = maximum((height - 4.0 * _MARGIN) * (2.0 / 3.0), float(physics.FEWEST_SKY_ROWS)).labeled("Rows of level 0")
    texel = math.pi / rows

    across = maximum(log_minor, _log2(maximum(length * (1.0 / looks), 1e-9)))
    coarsest = floor(_log2(rows * (1.0 / physics.FEWEST_SKY_ROWS)) + _ROUNDING)
    level = clamp(floor(across - _log2(texel)), 0.0, coarsest).labeled("Level")
    part = 0.5**level
    ratio = texel / (part * maximum(length, 1e-9))
    major = major * sqrt(maximum(0.0, 1.0 - ratio * ratio))
    width, height = maximum(width, 1.0), maximum(height, 1.0)
    place = _place_of_level(level, part, rows, width, height)

    light: Operand = (0.0, 0.0, 0.0)
    shared: dict[str, Operand] = {_ATLAS: atlas, _SIZE: combine(width, height, 0.0)}
    shared |= {_DIRECTION: combine(*direction.turned(turn)), _MAJOR: combine(*major.turned(turn))}
    shared |= dict(zip(_PLACE, place, strict=True))
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


def _place_of_level(level: Float, part: Float, rows: Float, width: Float, height: Float) -> tuple[Float, ...]:
    """Where a level lies in the atlas: what longitude and polar angle are multiplied by, and what is added to them."""
    columns = rows * 2.0
    above = minimum(level, 1.0)
    # Level l begins after the l - 1 levels beside it: columns (1 - 2^(1 - l)) and their margins.
    before = multiply_add(part, columns * -2.0, columns) + multiply_add(level, 2.0 * _MARGIN, -2.0 * _MARGIN)
    wide, high = part * (columns / width), part * (rows / height)
    left = multiply_add(above, before, _MARGIN) / width
    below = multiply_add(above, rows + 2.0 * _MARGIN, _MARGIN) / height
    return (
        wide * (-0.5 / math.pi),
        multiply_add(wide, 0.5, left),
        high * (-1.0 / math.pi),
        high + below,
    )


# --- one look, a group of its own: large trees take long to build ----------------------------------

_ATLAS, _SIZE, _DIRECTION, _MAJOR = "Atlas", "Size", "Direction", "Major Axis"
_SHARE, _LIGHT = "Share", "Light"
_PLACE = "Width", "Left", "Height", "Top"


def _vector(name: str, description: str) -> SocketSpec:
    return SocketSpec(name, "NodeSocketVector", description, default=(0.0, 0.0, 0.0))


def _build_look(builder: TreeBuilder, values: Values) -> Values:
    share = values[_SHARE]
    x, y, z = multiply_add(values[_MAJOR], combine(share, share, share), values[_DIRECTION]).separate()
    wide, left, high, top = (values[name] for name in _PLACE)
    u = multiply_add(atan2(y, x), wide, left)
    v = multiply_add(atan2(sqrt(multiply_add(x, x, y * y)), z), high, top)
    return {_LIGHT: values[_LIGHT] + _sample(values[_ATLAS], u, v, values[_SIZE])}


def _sample(atlas: Vector, u: Float, v: Float, size: Vector) -> Vector:
    """Bilinear look-up inside a level, whose margin makes wrapping needless."""
    if COMPOSITOR_SETTINGS_ARE_SOCKETS:
        return map_uv(atlas, combine(u, v, 1.0), "Bilinear")
    width, height, _ = size.separate()
    column, row = multiply_add(u, width, -0.5), multiply_add(v, height, -0.5)
    left, below = floor(column), floor(row)
    columns = [(left + offset) / width for offset in (0.5, 1.5)]
    rows = [(below + offset) / height for offset in (0.5, 1.5)]
    mixed = []
    for at_row in rows:
        texels = [map_uv(atlas, combine(at_column, at_row, 1.0), "Nearest") for at_column in columns]
        mixed.append(mix(column - left, *texels))
    return mix(row - below, *mixed)


LOOK = VersionedGroup(
    "Umbra Sky Look",
    1,
    "umbra_sky_look_version",
    (
        SocketSpec(_ATLAS, "NodeSocketColor", "All levels of the sky", default=(0.0, 0.0, 0.0, 0.0)),
        _vector(_SIZE, "Width and height of the atlas, pixels"),
        _vector(_DIRECTION, "Where the pixel looks"),
        _vector(_MAJOR, "Major axis of what it sees, without the width of a texel"),
        *(SocketSpec(name, "NodeSocketFloat", f"{name} of the level in the atlas", default=0.0) for name in _PLACE),
        SocketSpec(_SHARE, "NodeSocketFloat", "Where along the axis: -0.5 to 0.5", default=0.0),
        _vector(_LIGHT, "Light of the looks so far"),
    ),
    (SocketSpec(_LIGHT, "NodeSocketVector", "Light of the looks so far and this one", in_out="OUTPUT"),),
    _build_look,
)
"""The group of one look at the sky, which the filtering groups use inside."""
