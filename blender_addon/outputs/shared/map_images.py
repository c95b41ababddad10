# SPDX-License-Identifier: GPL-3.0-or-later
"""Images that read maps: a file for each frame, or none at all until a valid map is there."""

import math
import tempfile
from pathlib import Path

import bpy
import numpy as np

from ...bake.names import SEQUENCE_LENGTH
from ...core import color_spaces
from ...core.physics_api import physics

# A file that never exists: a frame without a valid map is magenta instead of showing some older map.
NO_MAP = "no_warp_map_0001.exr"

# Of a map that bends nothing: every pixel is valid and sees the same place of the sky.
_PLAIN_MAP = "umbra_plain_map"
_PLAIN = (0.5 * math.pi, 1.0, 1.0, 1.0)  # theta, phi, 1 + z, visibility

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


def plain_map(frame: int) -> str:
    """Return the path of a map for a frame without a black hole, with passes of a disk that is nowhere.

    They lie in Blender's temporary folder, and are written when they are first needed.
    """
    folder = Path(bpy.app.tempdir or tempfile.gettempdir())
    path = folder / f"{_PLAIN_MAP}_{frame % SEQUENCE_LENGTH:04d}.exr"
    if not path.is_file():
        for number in range(1, physics.MOST_CROSSINGS + 1):
            physics.write_exr(physics.pass_path(path, number), np.zeros((2, 2, 4), np.float32))
        physics.write_exr(path, np.full((2, 2, 4), _PLAIN, np.float32))
    return str(path)
