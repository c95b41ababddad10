# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene whose compositor consists of the node group and its three pictures, rendered to float pixels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy
import numpy as np
import OpenEXR
from numpy.typing import NDArray

FloatArray = NDArray[np.floating[Any]]

# Just inside 2 pi in float32.
LARGEST_AZIMUTH = float(np.nextafter(np.float32(2.0 * math.pi), np.float32(0.0)))


@dataclass(frozen=True)
class MapArrays:
    """A warp map as bare arrays, for the reference rendering."""

    theta: FloatArray
    phi: FloatArray
    one_plus_z: FloatArray
    visibility: FloatArray

    @classmethod
    def of(cls, channels: FloatArray) -> MapArrays:
        return cls(*(channels[..., index] for index in range(4)))


def write_exr(path: Path, pixels: FloatArray) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {"RGBA": np.ascontiguousarray(pixels, dtype=np.float32)}
    OpenEXR.File(header, channels).write(str(path))
    return path


def read_exr(path: Path) -> FloatArray:
    with OpenEXR.File(str(path)) as file:
        return np.array(file.channels()["RGBA"].pixels)


def smooth_environment(width: int, height: int) -> FloatArray:
    """A sky without structure as small as a texel, different in every direction and in every channel."""
    longitude, polar = np.meshgrid(
        (0.5 - (np.arange(width) + 0.5) / width) * 2.0 * np.pi, (np.arange(height) + 0.5) / height * np.pi
    )
    x, y, z = np.sin(polar) * np.cos(longitude), np.sin(polar) * np.sin(longitude), np.cos(polar)
    colors = [0.5 + 0.4 * x, 0.5 + 0.3 * y * z, 0.6 + 0.3 * z * x, np.ones_like(x)]
    return np.stack(colors, axis=-1).astype(np.float32)


def noise_environment(width: int, height: int, brightest: float = 1.0) -> FloatArray:
    """A sky with the largest possible difference between neighboring texels."""
    return (np.random.default_rng(7).random((height, width, 4)) * brightest).astype(np.float32)


def full_sphere_map(width: int, height: int) -> FloatArray:
    """A map that looks in every direction: seam in the outermost columns, poles in the outermost rows.

    The angles are scattered inside each pixel. Values across the seam and at the poles are as close to 0, 2 pi and
    pi as float32 can write.
    """
    rng = np.random.default_rng(11)
    longitude, polar = np.meshgrid(
        (rng.random(width) + np.arange(width)) / width * 2.0 * np.pi,
        (rng.random(height) + np.arange(height)) / height * np.pi,
    )
    polar[0] = np.geomspace(1e-6, 0.02, width)
    polar[-1] = np.pi - np.geomspace(1e-6, 0.02, width)
    # Light from -x, the seam: longitudes closely above and below pi. From +x: closely above 0 and below 2 pi.
    middle = width // 2
    steps = np.geomspace(1e-7, 0.02, height)
    longitude[:, middle], longitude[:, middle + 1] = np.pi - steps, np.pi + steps
    longitude[:, 0], longitude[:, -1] = steps, 2.0 * np.pi - steps
    channels = np.ones((height, width, 4), dtype=np.float32)
    channels[..., 0] = polar
    channels[..., 1] = np.clip(longitude, 0.0, LARGEST_AZIMUTH)
    return channels


def add_redshift_and_shadow(channels: FloatArray) -> FloatArray:
    """The same directions with a strong spread of 1 + z and with hard and soft visibilities, as in a map."""
    rng = np.random.default_rng(13)
    changed = channels.copy()
    shape = changed.shape[:2]
    changed[..., 2] = np.exp(rng.normal(scale=0.5, size=shape))
    changed[..., 3] = np.clip(rng.normal(loc=0.5, size=shape), 0.0, 1.0)
    hidden = changed[..., 3] == 0.0
    changed[hidden] = (0.0, 0.0, 1.0, 0.0)
    return changed


def empty_scene(width: int, height: int, percentage: int = 100) -> bpy.types.Scene:
    """The current scene without objects but a camera at the origin; float output, one sample."""
    scene = bpy.context.scene
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, percentage
    render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    render.compositor_device = "CPU"
    render.compositor_precision = "FULL"
    render.film_transparent = True
    settings = render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    return scene


def compositor_tree(scene: bpy.types.Scene) -> tuple[bpy.types.NodeTree, bpy.types.NodeSocket]:
    """An empty compositor tree of the scene, and the socket to link its picture to."""
    if bpy.app.version >= (5, 0, 0):
        tree = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
        scene.compositing_node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        return tree, tree.nodes.new("NodeGroupOutput").inputs[0]
    scene.use_nodes = True
    scene.node_tree.nodes.clear()
    return scene.node_tree, scene.node_tree.nodes.new("CompositorNodeComposite").inputs[0]


def image_node(tree: bpy.types.NodeTree, path: Path) -> bpy.types.Node:
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(str(path))
    node.image.colorspace_settings.name = "Non-Color"
    node.image.alpha_mode = "CHANNEL_PACKED"
    return node


def render_pixels(scene: bpy.types.Scene, path: Path) -> FloatArray:
    """Render the current frame and read the written EXR, shape (height, width, 4), row 0 at the top."""
    path.unlink(missing_ok=True)
    scene.render.filepath = str(path)
    scene.render.use_file_extension = False
    bpy.ops.render.render(write_still=True)
    return read_exr(path)


class GroupRenderer:
    """Renders one output of the node group for given inputs, each in a scene of its own making."""

    def __init__(self, node_group: ModuleType, folder: Path) -> None:
        self.node_group = node_group
        self.folder = folder

    def render(
        self,
        size: tuple[int, int],
        *,
        warp_map: FloatArray | None = None,
        environment: FloatArray | None = None,
        foreground: FloatArray | None = None,
        disk: FloatArray | None = None,
        output: str = "Image",
        percentage: int = 100,
        values: Mapping[str, object] | None = None,
        looks: int = 0,
        levels: FloatArray | None = None,
        footprint: FloatArray | None = None,
        stars: FloatArray | None = None,
    ) -> FloatArray:
        scene = empty_scene(*size, percentage)
        tree, target = compositor_tree(scene)
        node = self.node_group.add_group_node(tree, looks)
        pictures = {
            "Warp Map": warp_map,
            "Environment": environment,
            "Render": foreground,
            "Sky Levels": levels,
            "Footprint": footprint,
            "Stars": stars,
            "Disk": disk,
        }
        for name, pixels in pictures.items():
            if pixels is not None:
                source = image_node(tree, write_exr(self.folder / f"{name}.exr", pixels))
                tree.links.new(source.outputs["Image"], node.inputs[name])
        for name, value in (values or {}).items():
            node.inputs[name].default_value = value
        tree.links.new(node.outputs[output], target)
        picture = render_pixels(scene, self.folder / "picture.exr")
        for image in list(bpy.data.images):
            bpy.data.images.remove(image)
        return picture
