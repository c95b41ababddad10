# SPDX-License-Identifier: GPL-3.0-or-later
"""The levels of a scene's sky, by which the compositor filters it: a file beside the maps, made once for an image."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import color_spaces
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..scene.sky import sky_frames
from .folder import folder

# Raised whenever the levels of an image, or their file, change.
VERSION = 2

_DIGITS = 16

# Of a movie, by whose beginning and end it is known.
_END = 2**20

# Images as they were -> the digest of their content.
_digests = SESSION.value(dict[tuple[object, ...], str], Life.FILE)


def problem(image: bpy.types.Image) -> str | None:
    """Return why an image has no levels, as a sentence, if so."""
    reason = None
    if image.type == "MULTILAYER":
        reason = "it has layers: save it as an image of one layer"
    elif not image.is_float and not (_is_plain(image) or color_spaces.is_srgb(image)):
        reason = f"its 8-bit colors are in {image.colorspace_settings.name}: convert it to a linear OpenEXR file"
    return None if reason is None else f'The sky image "{image.name}" is not filtered, because {reason}.'


def path_of(scene: bpy.types.Scene, image: bpy.types.Image, number: str = "0001") -> str:
    """Return where the levels of an image lie, as Blender keeps a path.

    Parameters
    ----------
    scene : Scene
        Whose maps lie there.
    image : Image
        Without a `problem`.
    number : str
        Of an image that moves: which of its frames, in at least as many digits as the levels of all of them have.
    """
    name = f"umbra_sky_{_digest(image)}"
    if sky_frames.moves(image):
        name += f"_{number}"
    return folder(scene).blender_path + name + ".exr"


def ensure(scene: bpy.types.Scene, image: bpy.types.Image, *, may_bake: bool, settings: object = None) -> None:
    """Make the levels of an image, or of what it shows at the scene's frame, unless they are there.

    Parameters
    ----------
    scene : Scene
        Whose maps lie there.
    image : Image
        Without a `problem`.
    may_bake : bool
        Whether they may be made.
    settings : image node, optional
        Which frames of a sequence or movie are shown.

    Raises
    ------
    SceneError
        They are not there and may not be made.
    physics.BlackHoleError
        They cannot be written.
    """
    number = sky_frames.number_at(scene.frame_current, settings) if sky_frames.moves(image) else 0
    source = sky_frames.file_at(image, scene.frame_current, settings) if image.source == "SEQUENCE" else None
    path = Path(bpy.path.abspath(path_of(scene, image, f"{number:04d}")))
    if _is_up_to_date(path, source):
        return
    if not may_bake:
        raise SceneError(
            f'The levels of the sky image "{image.name}" are missing ({path}), by which it is filtered: bake, or '
            "choose Filter: Off in the Umbra panel.",
            code="sky.levels-missing",
        )
    if source is not None:
        pixels = _pixels_of_file(source, image)
    elif image.source == "MOVIE":
        pixels = _pixels_of_movie(image, number)
    else:
        pixels = _pixels(image)
    atlas = physics.sky_levels(pixels).atlas()
    is_half = float(np.abs(atlas).max()) <= physics.LARGEST_HALF
    attributes = {"umbraSky": _stamp(source)}
    physics.write_exr(path, atlas.astype(np.float16) if is_half else atlas, attributes)


def mark(levels: bpy.types.Image, sky: bpy.types.Image) -> None:
    """Have the numbers of a levels' image read in the color space that they are in."""
    if sky.is_float or sky.colorspace_settings.is_data or not color_spaces.mark_as_linear_rec709(levels):
        color_spaces.mark_as_data(levels)
    if levels.alpha_mode != "CHANNEL_PACKED":
        levels.alpha_mode = "CHANNEL_PACKED"


def _is_plain(image: bpy.types.Image) -> bool:
    """Whether 8-bit values are proportional to light, in the color space that levels of 8-bit images are in."""
    return image.colorspace_settings.is_data or color_spaces.is_linear_rec709(image)


def _stamp(source: Path | None) -> str:
    """What tells that a file of a sequence was written again; other images have their content in the file's name."""
    if source is None:
        return f"{VERSION}"
    return f"{VERSION} {hashlib.sha256(source.read_bytes()).hexdigest()[:_DIGITS]}"


def _is_up_to_date(path: Path, source: Path | None) -> bool:
    if not path.is_file():
        return False
    try:
        return bool(physics.read_exr_header(path).get("umbraSky") == _stamp(source))
    except physics.BlackHoleError:
        return False


def _digest(image: bpy.types.Image) -> str:
    """Digest of all that the levels of an image depend on."""
    path = sky_frames.path_of(image)
    stat = path.stat() if image.source == "FILE" and path.is_file() else None
    key = (
        image.session_uid,
        image.is_dirty,
        image.packed_file is None,
        image.colorspace_settings.name,
        image.alpha_mode,
        str(path),
        stat and (stat.st_size, stat.st_mtime_ns),
    )
    known = _digests.now.get(key)
    if known is None or image.is_dirty or image.source == "GENERATED":
        content = hashlib.sha256(f"{VERSION} {image.colorspace_settings.name} {image.alpha_mode}".encode())
        content.update(_content(image, path))
        known = _digests.now[key] = content.hexdigest()[:_DIGITS]
    return known


def _content(image: bpy.types.Image, path: Path) -> bytes:
    if image.source == "SEQUENCE":
        return path.name.encode()
    if image.source == "MOVIE":
        return _ends_of(path)
    if image.packed_file is not None and not image.is_dirty:
        return bytes(image.packed_file.data)
    if image.source == "FILE" and path.is_file() and not image.is_dirty:
        return path.read_bytes()
    return _values(image).tobytes()


def _ends_of(path: Path) -> bytes:
    """Length, beginning and end of a file that may be very large."""
    try:
        with path.open("rb") as file:
            length = file.seek(0, os.SEEK_END)
            file.seek(max(length - _END, 0))
            end = file.read()
            file.seek(0)
            return f"{length} ".encode() + file.read(_END) + end
    except OSError:
        return str(path).encode()


def _values(image: bpy.types.Image) -> NDArray[np.float32]:
    """An image's numbers, row 0 at the top."""
    width, height = image.size
    values = np.empty((height, width, image.channels), np.float32)
    image.pixels.foreach_get(values.ravel())
    return values[::-1]


def _pixels(image: bpy.types.Image) -> NDArray[np.float32]:
    """An image's colors as the compositor has them; scene-linear, or linear Rec.709 if it has 8 bits."""
    if 0 in image.size:
        raise sky_frames.image_missing(image)
    values = _values(image)
    colors = values[..., :3] if values.shape[2] >= 3 else np.repeat(values[..., :1], 3, axis=2)
    if not image.is_float and not _is_plain(image):
        colors = physics.linear_from_srgb(colors).astype(np.float32)
    if values.shape[2] == 4 and image.alpha_mode == "STRAIGHT" and not image.is_float:
        colors = colors * values[..., 3:]
    return colors


def _pixels_of_file(path: Path, image: bpy.types.Image) -> NDArray[np.float32]:
    """The colors of one file of a sequence."""
    single = bpy.data.images.load(str(path))
    try:
        single.colorspace_settings.name = image.colorspace_settings.name
        single.alpha_mode = image.alpha_mode
        return _pixels(single)
    finally:
        bpy.data.images.remove(single)


def _pixels_of_movie(image: bpy.types.Image, number: int) -> NDArray[np.float32]:
    """The colors of one frame of a movie, by its number from 1 on.

    An image's pixels are those of the frame that was asked for last. A texture can ask for one, during a render too.
    """
    texture = bpy.data.textures.new(image.name, "IMAGE")
    assert isinstance(texture, bpy.types.ImageTexture)
    user = texture.image_user
    assert user is not None
    try:
        texture.image = image
        user.frame_duration = max(image.frame_duration, 1)
        user.frame_current = max(number, 1)
        texture.evaluate((0.0, 0.0, 0.0))
        return _pixels(image)
    finally:
        bpy.data.textures.remove(texture)
