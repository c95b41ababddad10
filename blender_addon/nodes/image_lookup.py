# SPDX-License-Identifier: GPL-3.0-or-later
"""Bilinear look-up of pictures at texture coordinates, as nodes. Shared by the groups of the compositor."""

from __future__ import annotations

from ..core.blender_version import COMPOSITOR_SETTINGS_ARE_SOCKETS
from .arithmetic import clamp, combine, floor, maximum, mix, multiply_add
from .builder import Float, Number, Vector
from .image_nodes import image_size, map_uv


def sample_bilinearly(picture: Vector, u: Number, v: Float) -> Vector:
    """Color of a picture at texture coordinates.

    Parameters
    ----------
    picture : Vector
        An image of any size, or a plain color.
    u : Float or float
        Across; repeats with period 1.
    v : Float
        0 to 1 from below; beyond the centers of the first and last row these continue.

    Returns
    -------
    Vector
        The color; Blender 5.x keeps the alpha as well.
    """
    if COMPOSITOR_SETTINGS_ARE_SOCKETS:
        return map_uv(picture, combine(u, v, 1.0), "Bilinear")

    # Blender 4.5 has no usable bilinear look-up (its anisotropic one draws a line at the seam): four exact
    # texels, mixed here.
    width, height = (maximum(1.0, size) for size in image_size(picture))
    column = multiply_add(u, width, -0.5)
    row = multiply_add(v, height, -0.5)
    left, below = floor(column), floor(row)
    share_x, share_y = column - left, row - below
    top_row = height - 1.0

    def column_coordinate(index: Float) -> Float:
        return (index % width + 0.5) / width

    def row_coordinate(index: Float) -> Float:
        return (clamp(index, 0.0, top_row) + 0.5) / height

    columns = column_coordinate(left), column_coordinate(left + 1.0)
    rows = row_coordinate(below), row_coordinate(below + 1.0)
    mixed = []
    for row_at in rows:
        texels = [map_uv(picture, combine(column_at, row_at, 1.0), "Nearest") for column_at in columns]
        mixed.append(mix(share_x, *texels))
    return mix(share_y, *mixed)
