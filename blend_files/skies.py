# SPDX-License-Identifier: GPL-3.0-or-later
"""The sky of real stars for the demo scenes: a packed panorama, turned, and a World that shows it."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np
import scene_tools as tools
from scene_tools import Euler, Matrix, Vector, bpy


def star_panorama(height: int, star_width: float, quality: int) -> bpy.types.Image:
    """The sky of real stars, half floats, packed. DWAA keeps it at a third of what a lossless file takes.

    Parameters
    ----------
    height : int
        Texels; the width is twice that.
    star_width : float
        Size of a star's spot in texels, see `physics.star_sky`.
    quality : int
        Of the compression, 0 to 100.
    """
    from physics import star_sky

    pixels = np.ones((height, 2 * height, 4), np.float32)
    pixels[..., :3] = star_sky(height, star_width=star_width)
    buffer = bpy.data.images.new("Pixels", 2 * height, height, float_buffer=True)
    buffer.colorspace_settings.name = "Linear Rec.709"
    buffer.pixels.foreach_set(pixels[::-1].ravel())
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "16"
    settings.exr_codec, settings.quality = "DWAA", quality
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "star_sky.exr")
        buffer.save_render(str(path))
        print(f"star sky: {path.stat().st_size / 1e6:.1f} MB")
        image = tools.pack_image(path, "Star Sky")
    bpy.data.images.remove(buffer)
    settings.exr_codec, settings.quality = "ZIP", 90
    settings.file_format, settings.color_depth = "PNG", "8"
    return image


def sky_rotation(longitude: float, latitude: float, roll: float) -> Euler:
    """The environment rotation that puts a galactic direction behind the hole (world +y).

    Parameters
    ----------
    longitude, latitude, roll : float
        Galactic coordinates, and the angle by which the Milky Way's band is turned in the picture; degrees.
    """
    from physics import galactic_axes

    lon, lat = math.radians(longitude), math.radians(latitude)
    forward = Vector((math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)))
    right = forward.cross(Vector((0.0, 0.0, 1.0))).normalized()
    basis = Matrix((right, forward, right.cross(forward))).transposed()  # world axes to galactic ones
    to_equatorial = Matrix(galactic_axes().tolist()).transposed()
    return (to_equatorial @ basis @ Matrix.Rotation(math.radians(roll), 3, "Y")).to_euler("XYZ")


def star_world(
    scene: bpy.types.Scene, image: bpy.types.Image, rotation: Euler, strength: float, fill: tools.Color
) -> None:
    """A World that shows the camera the stars, and lights the objects with one dim color, which makes no noise."""
    background = tools.world_background(scene, fill, 1.0)
    tree = scene.world.node_tree
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = rotation
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    stars = tree.nodes.new("ShaderNodeBackground")
    stars.inputs["Strength"].default_value = strength
    path = tree.nodes.new("ShaderNodeLightPath")
    mix = tree.nodes.new("ShaderNodeMixShader")
    output = tree.nodes["World Output"]
    for source, target in (
        (coordinates.outputs["Generated"], mapping.inputs["Vector"]),
        (mapping.outputs["Vector"], texture.inputs["Vector"]),
        (texture.outputs["Color"], stars.inputs["Color"]),
        (path.outputs["Is Camera Ray"], mix.inputs["Fac"]),
        (background.outputs["Background"], mix.inputs[1]),
        (stars.outputs["Background"], mix.inputs[2]),
        (mix.outputs["Shader"], output.inputs["Surface"]),
    ):
        tree.links.new(source, target)
    scene.world.cycles.sampling_method = "NONE"
