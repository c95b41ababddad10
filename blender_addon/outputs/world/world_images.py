# SPDX-License-Identifier: GPL-3.0-or-later
"""The images that a lensed World reads: a file for each frame, or one in memory while the preview is on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..shared.map_images import SEQUENCE_SETTINGS, keep_as_data, map_image


@dataclass(frozen=True)
class WorldImages:
    """The images of one kind of map, which a World remembers by custom properties."""

    file_key: str
    live_keys: tuple[str, str]
    file_name: str
    live_name: str
    is_light: bool = False
    """Whether the files hold light, in linear Rec.709; otherwise numbers."""

    @property
    def keys(self) -> tuple[str, ...]:
        """The custom properties."""
        return (self.file_key, *self.live_keys)

    def file_image(self, world: bpy.types.World) -> bpy.types.Image:
        """Return the image that reads the files: the World's own, or another."""
        image = _own(world, self.file_key)
        if image is None:
            image = map_image(self.file_name)
            world[self.file_key] = image
        return image

    def at_path(self, world: bpy.types.World, path: str) -> bpy.types.Image:
        """Return the image that reads the files, made to read those of a path."""
        image = self.file_image(world)
        keep_as_data(image, is_light=self.is_light)
        if image.source != "SEQUENCE":
            image.source = "SEQUENCE"
        if image.filepath != path:
            image.filepath = path
        return image

    def shown_live(self, world: bpy.types.World, nodes: Iterable[bpy.types.Node]) -> bpy.types.Image | None:
        """Return the image in memory that all nodes read now, if they do."""
        read = {each.image for each in nodes}
        image = read.pop() if len(read) == 1 else None
        return image if image is not None and image in self._live(world) else None

    def write_live(
        self, world: bpy.types.World, shown: bpy.types.Image | None, pixels: NDArray[np.float32], *, in_turns: bool
    ) -> bpy.types.Image:
        """Return the image in memory with these pixels, shape (rows, columns, 4), row 0 at the bottom.

        In turns it is another one than the one that is shown: Cycles keeps the pixels of an image for as long as a
        shader reads it.
        """
        first, second = self.live_keys
        key = second if in_turns and shown is not None and shown == world.get(first) else first
        image = _own(world, key)
        rows, columns = pixels.shape[:2]
        if image is None or tuple(image.size) != (columns, rows):
            image = bpy.data.images.new(self.live_name, columns, rows, alpha=True, float_buffer=True, is_data=True)
            image.alpha_mode = "CHANNEL_PACKED"
            image.use_half_precision = False
            world[key] = image
        image.pixels.foreach_set(np.ravel(pixels))
        image.update()
        return image

    def drop_live(self, world: bpy.types.World) -> None:
        """Forget the images in memory, and free them."""
        _forget(world, self.live_keys)

    def drop(self, world: bpy.types.World) -> None:
        """Forget all images, and remove those that nothing else uses."""
        _forget(world, self.keys)

    def _live(self, world: bpy.types.World) -> list[bpy.types.Image]:
        return [world[key] for key in self.live_keys if world.get(key) is not None]


MAPS = WorldImages("umbra_world_map", ("umbra_live_map_1", "umbra_live_map_2"), "Umbra World Map", "Umbra Live Map")
DISKS = WorldImages(
    "umbra_world_disk", ("umbra_live_disk_1", "umbra_live_disk_2"), "Umbra World Disk", "Umbra Live Disk", is_light=True
)


def read(nodes: Iterable[bpy.types.Node], image: bpy.types.Image) -> None:
    """Let nodes read an image, frame by frame if it is of files."""
    for node in nodes:
        if node.image != image:
            node.image = image
        if image.source == "SEQUENCE":
            for name, value in SEQUENCE_SETTINGS.items():
                if getattr(node.image_user, name) != value:
                    setattr(node.image_user, name, value)


def _own(world: bpy.types.World, key: str) -> bpy.types.Image | None:
    """Return an image that a World remembers; not one that it shares with the World it is a copy of."""
    image = world.get(key)
    shared = any(each != world and each.get(key) == image for each in bpy.data.worlds)
    return None if shared else image


def _forget(world: bpy.types.World, keys: Iterable[str]) -> None:
    images = {world[key] for key in keys if world.get(key) is not None}
    for key in keys:
        if key in world:
            del world[key]
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)
