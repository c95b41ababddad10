# SPDX-License-Identifier: GPL-3.0-or-later
"""Bringing images from a map's size to the render's, as nodes. Shared by the groups of the compositor."""

from __future__ import annotations

from itertools import product

from ..core.blender_version import COMPOSITOR_SETTINGS_ARE_SOCKETS
from ..core.physics_api import physics
from .arithmetic import multiply_add, where
from .builder import Float, TreeBuilder, Vector
from .image_nodes import image_size, render_area, scale_by, scale_to_render, separate_color, translate

_HALVINGS = 2
"""Two halvings and the last step by 2 reduce exactly up to 8:1: a map of 4x supersampling at half size."""


def to_render_size(builder: TreeBuilder, *images: Vector) -> tuple[Vector, ...]:
    """Bring images of the map's size to the render's size.

    A map of 2, 4 or 8 times the render's size is box-filtered exactly, one halving after the other: four
    nearest pixels added up, because a bilinear sample between four pixels, which ought to be the same, is
    off by 1e-4 in large pictures. Any other size is stretched bilinearly, so that the frame is always filled.

    Parameters
    ----------
    builder : TreeBuilder
        Of a compositor tree.
    *images : Vector
        Images of one size, that of the last one; their alpha is dropped.

    Returns
    -------
    tuple of Vector
        As many images of exactly the render's size.
    """
    area = render_area(builder)
    area_width, area_height = image_size(area)
    for _ in range(_HALVINGS):
        width, _height = image_size(images[-1])
        halve = (width / area_width).greater_than(physics.RESIZE_HALVE_ABOVE).labeled("Halve?")
        factor = multiply_add(halve, -0.5, 1.0)
        step = halve * 0.5
        shifts = tuple(product((-step, step), repeat=2))
        # An image of zeros in the halved size: being the first operand it makes Blender sample the others
        # there. (Two scalings in a row without arithmetic in between would merge into one.)
        grid = scale_by(images[-1], factor) * 0.0
        images = tuple(
            _mean_of_four(grid, [scale_by(translate(image, x, y, "Nearest"), factor) for x, y in shifts])
            for image in images
        )

    width, height = image_size(images[-1])
    double = width.near(2.0 * area_width, 0.1) * height.near(2.0 * area_height, 0.1)
    double.labeled("Exactly twice?")
    centering = _centering(width, area_width), _centering(height, area_height)
    coverage = None if COMPOSITOR_SETTINGS_ARE_SOCKETS else _coverage(images[-1], area, centering)
    return tuple(_last_step(image, area, double, centering, coverage) for image in images)


def stretched_to_render(builder: TreeBuilder, image: Vector, interpolation: str = "Nearest") -> tuple[Vector, Float]:
    """Return colors and alpha of an image stretched over the render's pixels; of as many pixels, as they are."""
    area, stretched = render_area(builder), scale_to_render(image, interpolation)
    _, _, _, alpha = separate_color(stretched)
    return area + stretched, area.separate()[0] + alpha


def _coverage(image: Vector, area: Vector, centering: tuple[Float, Float]) -> Float:
    """How much of each pixel the stretched image covers: Blender 4.5 mixes black into the outermost ones."""
    white = multiply_add(image, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    return _stretch(white, area, centering).separate()[0]


def _centering(size: Float, area_size: Float) -> Float:
    """Shift (in the render's pixels) that undoes Blender's rounding when an image is scaled from even to odd.

    Blender lays images center on center. If one has an odd and the other an even number of pixels, it
    shifts the scaled one by half a pixel of its own to make the grids coincide, which only images that are
    not scaled need. It does so when it interpolates bilinearly; nearest pixels stay where they belong.
    """
    parity = (size + area_size) % 2.0
    return parity * (0.5 * area_size) / size


def _stretch(image: Vector, area: Vector, centering: tuple[Float, Float]) -> Vector:
    return area + translate(scale_to_render(image, "Bilinear"), *centering, "Bilinear")


def _last_step(
    image: Vector, area: Vector, double: Float, centering: tuple[Float, Float], coverage: Float | None
) -> Vector:
    stretched = _stretch(image, area, centering)
    if coverage is not None:
        stretched = stretched * (1.0 / coverage)
    step = double * 0.25
    corners = [
        translate(scale_to_render(image, "Nearest"), x, y, "Nearest") for x, y in product((-step, step), repeat=2)
    ]
    return where(double, _mean_of_four(area, corners), stretched)


def _mean_of_four(grid: Vector, images: list[Vector]) -> Vector:
    """Mean of four images on the pixels of `grid`, an image of zeros."""
    return sum(images, start=grid) * 0.25
