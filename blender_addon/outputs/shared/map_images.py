# SPDX-License-Identifier: GPL-3.0-or-later
"""Images that read maps: a file for each frame, or none at all until a valid map is there."""

import bpy

from ...bake.names import SEQUENCE_LENGTH
from ...core import color_spaces

# A file that never exists: a frame without a valid map is magenta instead of showing some older map.
NO_MAP = "no_warp_map_0001.exr"

# Together these read file `frame % SEQUENCE_LENGTH` at every frame, before zero too; see bake/request.py.
SEQUENCE_SETTINGS = {
    "frame_duration": SEQUENCE_LENGTH,
    "frame_start": 0,
    "frame_offset": -1,
    "use_cyclic": True,
    "use_auto_refresh": True,
}


def map_image(name: str) -> bpy.types.Image:
    """An image datablock that reads maps, as yet none."""
    image = bpy.data.images.new(name, 1, 1, float_buffer=True)
    image.source = "SEQUENCE"
    image.filepath = NO_MAP
    keep_as_data(image)
    return image


def keep_as_data(image: bpy.types.Image) -> None:
    """Let Blender read a map's numbers as they are, whatever its image was set to by hand."""
    color_spaces.mark_as_data(image)
    if image.alpha_mode != "CHANNEL_PACKED":  # alpha is data, not a mask of the other channels
        image.alpha_mode = "CHANNEL_PACKED"
    if image.use_half_precision:
        image.use_half_precision = False


def read_sequence(node: bpy.types.Node, name: str, path: str) -> None:
    """Let an image node read one file for each frame."""
    if node.image is None or node.image.source != "SEQUENCE":
        node.image = map_image(name)
    for name, value in SEQUENCE_SETTINGS.items():
        if getattr(node, name) != value:
            setattr(node, name, value)
    keep_as_data(node.image)
    if node.image.filepath != path:
        node.image.filepath = path
