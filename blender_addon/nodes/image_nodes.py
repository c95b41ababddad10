# SPDX-License-Identifier: GPL-3.0-or-later
"""Compositor nodes that work on images, with the differences between Blender 4.5 and 5.x hidden.

In 5.x most settings of compositor nodes became input sockets. Code that builds node groups reads the same for both.
Every value in a compositor tree is an image; here images are `Vector` values, whose alpha only these nodes keep.
"""

from __future__ import annotations

import bpy

from ..core.blender_version import COMPOSITOR_SETTINGS_ARE_SOCKETS
from .builder import Float, Number, TreeBuilder, Vector


def separate_color(color: Vector) -> tuple[Float, Float, Float, Float]:
    """Red, green, blue and alpha as they are stored: nothing is divided by alpha."""
    node = color.builder.node("CompositorNodeSeparateColor")
    node.mode = "RGB"
    color.builder.feed(node.inputs[0], color)
    red, green, blue, alpha = (Float(color.builder, socket) for socket in node.outputs)
    return red, green, blue, alpha


def combine_color(red: Float, green: Number, blue: Number, alpha: Number) -> Vector:
    """Color of four numbers."""
    node = red.builder.node("CompositorNodeCombineColor")
    node.mode = "RGB"
    for target, channel in zip(node.inputs, (red, green, blue, alpha), strict=True):
        red.builder.feed(target, channel)
    return Vector(red.builder, node.outputs[0])


def image_size(image: Vector) -> tuple[Float, Float]:
    """Width and height of an image in pixels; 0 and 0 for a plain color or a missing file."""
    node = image.builder.node("CompositorNodeImageInfo")
    image.builder.feed(node.inputs[0], image)
    width, height, _ = Vector(image.builder, node.outputs["Dimensions"]).separate()
    return width, height


def render_area(builder: TreeBuilder) -> Vector:
    """Image of zeros that has exactly the render's size, whatever is linked elsewhere.

    A Box Mask without an input is the one node of both versions that takes its size from the render alone. As the
    first operand it makes Blender bring the other operands to the render's pixels.
    """
    mask = Float(builder, builder.node("CompositorNodeBoxMask").outputs[0]).labeled("The render's pixels")
    return Vector(builder, (mask * 0.0).socket)


def map_uv(image: Vector, uv: Vector, interpolation: str, ends: str = "Extend") -> Vector:
    """Look an image up at texture coordinates.

    Parameters
    ----------
    image : Vector
        Any image.
    uv : Vector
        Texture coordinates 0 to 1, v from below; the third component must be 1.
    interpolation : {"Nearest", "Bilinear"}
        "Bilinear" exists in Blender 5.x only. u repeats there; in 4.5 all is 0 outside.
    ends : {"Extend", "Clip"}
        What lies below and above the picture in Blender 5.x: its first and last row, or 0.

    Raises
    ------
    ValueError
        If this version of Blender does not have the interpolation.
    """
    builder = image.builder
    node = builder.node("CompositorNodeMapUV")
    if COMPOSITOR_SETTINGS_ARE_SOCKETS:
        node.inputs["Interpolation"].default_value = interpolation
        node.inputs["Extension X"].default_value = "Repeat"
        node.inputs["Extension Y"].default_value = ends
    else:
        if interpolation != "Nearest":
            raise ValueError(f"Map UV has no {interpolation} interpolation in Blender 4.5.")
        node.filter_type = "NEAREST"
    builder.feed(node.inputs["Image"], image)
    builder.feed(node.inputs["UV"], uv)
    return Vector(builder, node.outputs[0])


def scale_by(image: Vector, factor: Float) -> Vector:
    """Scale an image about its center by one factor for both axes, taking nearest pixels."""
    node = _resampling_node(image, "CompositorNodeScale", "Nearest")
    if COMPOSITOR_SETTINGS_ARE_SOCKETS:
        node.inputs["Type"].default_value = "Relative"
    else:
        node.space = "RELATIVE"
    image.builder.feed(node.inputs["X"], factor)
    image.builder.feed(node.inputs["Y"], factor)
    return Vector(image.builder, node.outputs[0])


def scale_to_render(image: Vector, interpolation: str) -> Vector:
    """Stretch an image over the render's area."""
    node = _resampling_node(image, "CompositorNodeScale", interpolation)
    if COMPOSITOR_SETTINGS_ARE_SOCKETS:
        node.inputs["Type"].default_value = "Render Size"
        node.inputs["Frame Type"].default_value = "Stretch"
    else:
        node.space = "RENDER_SIZE"
        node.frame_method = "STRETCH"
    return Vector(image.builder, node.outputs[0])


def translate(image: Vector, x: Float, y: Float, interpolation: str) -> Vector:
    """Shift an image by pixels."""
    node = _resampling_node(image, "CompositorNodeTranslate", interpolation)
    image.builder.feed(node.inputs["X"], x)
    image.builder.feed(node.inputs["Y"], y)
    return Vector(image.builder, node.outputs[0])


def erode(image: Float, pixels: int) -> Float:
    """The smallest value within so many pixels to each side."""
    node = image.builder.node("CompositorNodeDilateErode")
    if COMPOSITOR_SETTINGS_ARE_SOCKETS:
        node.inputs["Type"].default_value = "Steps"
    else:
        node.mode = "STEP"
    node.inputs["Size"].default_value = -pixels
    image.builder.feed(node.inputs[0], image)
    return Float(image.builder, node.outputs[0])


def blur(image: Vector, across: Float, down: Float) -> Vector:
    """Blur an image by a Gaussian of a size in pixels, three times its standard deviation, along rows and columns.

    Beyond its edges the image goes on as it is there. Wide blurs take no longer than narrow ones, and undershoot.
    """
    size = image.builder.combine(across, down, 0.0)
    node = image.builder.node("CompositorNodeBlur")
    if COMPOSITOR_SETTINGS_ARE_SOCKETS:
        node.inputs["Type"].default_value = "Fast Gaussian"
    else:
        node.filter_type = "FAST_GAUSS"
    image.builder.feed(node.inputs["Image"], image)
    image.builder.feed(node.inputs["Size"], size)
    return Vector(image.builder, node.outputs[0])


def _resampling_node(image: Vector, kind: str, interpolation: str) -> bpy.types.Node:
    node = image.builder.node(kind)
    image.builder.feed(node.inputs["Image"], image)
    if COMPOSITOR_SETTINGS_ARE_SOCKETS:
        node.inputs["Interpolation"].default_value = interpolation
        node.inputs["Extension X"].default_value = "Extend"
        node.inputs["Extension Y"].default_value = "Extend"
    else:
        node.interpolation = interpolation.upper()
    return node
