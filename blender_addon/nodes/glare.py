# SPDX-License-Identifier: GPL-3.0-or-later
"""Glare as nodes: the formula of `physics.add_glare`, by Blender's Blur nodes.

Blender's own Glare node adds light, cuts off what is dim and counts in iterations. Blur conserves light (to 0.12 % of
the share that it spreads), is linear, and takes its size in pixels, by a socket in each version of Blender.
"""

from __future__ import annotations

from ..core.physics_api import physics
from .arithmetic import multiply_add
from .builder import Vector
from .image_nodes import blur, image_size

_SIZE = 3.0
"""Blender's size of a Gaussian blur over its standard deviation."""

_LARGEST = 1e9
"""Light beyond this is no number: one pixel of it would fill the picture."""


def add_glare(light: Vector, kind: int) -> Vector:
    """Spread a share of an image's light.

    Parameters
    ----------
    light : Vector
        An image of the render's size.
    kind : int
        One of `physics.GLARES`, but not 0.
    """
    spreads = physics.GLARES[kind]
    _width, height = image_size(light)
    # in this order the larger of 0 and NaN is 0; one pixel of NaN would become a whole picture of it
    light = Vector(light.builder, light.builder.vector_math("MAXIMUM", (0.0, 0.0, 0.0), light).outputs["Vector"])
    light = light.at_most((_LARGEST, _LARGEST, _LARGEST))
    result = light * (1.0 - sum(each.share for each in spreads))
    for each in spreads:
        spread = blur(light, height * (_SIZE * each.across), height * (_SIZE * each.down))
        result = multiply_add(spread, (each.share, each.share, each.share), result)
    return result.at_least((0.0, 0.0, 0.0)).labeled("Glare")  # the fast blur undershoots by 1e-3 of its peak
