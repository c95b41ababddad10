# SPDX-License-Identifier: GPL-3.0-or-later
"""Images that read maps: a file for each frame, or none at all until a valid map is there.

In the window's session a node may read a map in memory instead, a live one. The live image remembers the image that it
stands for, so that the node can be given back to its files at any time: after undo too, when every datablock is
another one, and in a file that Blender has saved by itself.
"""

import math
import tempfile
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ...bake.names import SEQUENCE_LENGTH
from ...core import color_spaces
from ...core.physics_api import physics

# A file that never exists: a frame without a valid map is magenta instead of showing some older map.
NO_MAP = "no_warp_map_0001.exr"

# Of a map that bends nothing: every pixel is valid and sees the same place of the sky.
_PLAIN_MAP, _PLAIN_LAYER = "umbra_plain_map", "umbra_plain_layer"
_PLAIN = (0.5 * math.pi, 1.0, 1.0, 1.0)  # theta, phi, 1 + z, visibility

# The custom property of a live image, and how its name begins.
STANDS_FOR = "umbra_stands_for"
LIVE_NAME = "Umbra Live"

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
    return image


def keep_as_data(image: bpy.types.Image, *, is_light: bool = False) -> None:
    """Let Blender read a map's numbers as they are, whatever its image was set to by hand; light as linear Rec.709."""
    if not (is_light and color_spaces.mark_as_linear_rec709(image)):
        color_spaces.mark_as_data(image)
    if image.alpha_mode != "CHANNEL_PACKED":  # alpha is data, not a mask of the other channels
        image.alpha_mode = "CHANNEL_PACKED"
    if image.use_half_precision:
        image.use_half_precision = False


def read_sequence(node: bpy.types.Node, name: str, path: str, *, is_light: bool = False) -> None:
    """Let an image node read one file for each frame, of numbers or of light."""
    give_back(node)
    if node.image is None or node.image.source != "SEQUENCE":
        node.image = map_image(name)
    for name, value in SEQUENCE_SETTINGS.items():
        if getattr(node, name) != value:
            setattr(node, name, value)
    keep_as_data(node.image, is_light=is_light)
    if node.image.filepath != path:
        node.image.filepath = path


def plain_map(frame: int) -> str:
    """Return the path of a map for a frame without a black hole.

    They lie in Blender's temporary folder, and are written when they are first needed.
    """
    folder = Path(bpy.app.tempdir or tempfile.gettempdir())
    path = folder / f"{_PLAIN_MAP}_{frame % SEQUENCE_LENGTH:04d}.exr"
    if not path.is_file():
        physics.write_exr(path, np.full((2, 2, 4), _PLAIN, np.float32))
    return str(path)


def plain_layer(frame: int) -> str:
    """Return the path of a layer of light for a frame without a black hole: there is none, and all passes."""
    path = Path(plain_map(frame)).with_name(f"{_PLAIN_LAYER}_{frame % SEQUENCE_LENGTH:04d}.exr")
    if not path.is_file():
        physics.write_exr(path, np.full((2, 2, 4), (0.0, 0.0, 0.0, 1.0), np.float32))
    return str(path)


# --- live images ----------------------------------------------------------------------------------


def pixels_of(*planes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return four planes, row 0 at the top, as an image's pixels, row 0 at the bottom."""
    return np.ascontiguousarray(np.stack(planes, axis=-1)[::-1], dtype=np.float32)


def is_live(node: bpy.types.Node) -> bool:
    """Return whether an image node reads a live image."""
    return node.image is not None and STANDS_FOR in node.image


def file_image(node: bpy.types.Node) -> bpy.types.Image | None:
    """Return the image of the files that a node reads, or would read without its live image."""
    image: bpy.types.Image | None = node.image
    return image if image is None else image.get(STANDS_FOR, image)


def show_live(node: bpy.types.Node, pixels: NDArray[np.float32]) -> None:
    """Let an image node, which reads files, read these pixels, shape (height, width, 4), row 0 at the bottom."""
    live = _live_of(node)
    if live is None or (is_live(node) and live.users > 1):  # a copy of the tree reads it too
        live = _make_live(file_image(node))
    height, width = pixels.shape[:2]
    if tuple(live.size) != (width, height):
        live.generated_width, live.generated_height = width, height
    live.pixels.foreach_set(pixels.ravel())
    live.update()
    live.update_tag()
    if node.image != live:
        node.image = live


def show_live_again(node: bpy.types.Node) -> None:
    """Let an image node read its live image once more, if there is one."""
    live = _live_of(node)
    if live is not None and node.image != live:
        node.image = live


def give_back(node: bpy.types.Node) -> None:
    """Let an image node read its files again; the live image stays, to be used once more."""
    if is_live(node):
        node.image = file_image(node)


def drop_live(node: bpy.types.Node) -> None:
    """Let an image node read its files again, and free its live image."""
    give_back(node)
    live = _live_of(node)
    if live is not None and live.users == 0:
        bpy.data.images.remove(live)


def _live_of(node: bpy.types.Node) -> bpy.types.Image | None:
    if is_live(node):
        return node.image
    found = (each for each in bpy.data.images if each.users == 0 and each.get(STANDS_FOR) == node.image)
    return None if node.image is None else next(found, None)


def _make_live(stands_for: bpy.types.Image | None) -> bpy.types.Image:
    image = bpy.data.images.new(LIVE_NAME, 1, 1, alpha=True, float_buffer=True, is_data=True)
    keep_as_data(image)
    image[STANDS_FOR] = stands_for
    return image
