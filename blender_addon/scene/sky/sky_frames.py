# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies that move: which file of an image sequence a frame shows, and whether it is there.

Image nodes of the compositor and the image users of shader nodes have the same settings under the same names.
"""

import re
from pathlib import Path
from typing import Any

import bpy

from ...core.errors import SceneError

BUILT_IN = "umbra_built_in_sky"
"""Custom property of an image that this add-on makes: the name of its file."""

SETTINGS = ("frame_duration", "frame_start", "frame_offset", "use_cyclic")

# The last run of digits before a file's extension.
_NUMBERED = re.compile(r"(.*?)(\d+)(\D*)", re.DOTALL)


def moves(image: bpy.types.Image) -> bool:
    """Return whether an image is another one at each frame."""
    return image.source in {"SEQUENCE", "MOVIE"}


def moves_at(node: bpy.types.Node) -> bool:
    """Return whether an image node shows another image at each frame."""
    return node.image is not None and moves(node.image)


def path_of(image: bpy.types.Image) -> Path:
    """Return the file that an image names."""
    return Path(bpy.path.abspath(image.filepath, library=image.library))


def is_packed(image: bpy.types.Image) -> bool:
    """Return whether an image needs no file."""
    return image.source == "GENERATED" or image.packed_file is not None or len(image.packed_files) > 0


def is_built_in(image: bpy.types.Image) -> bool:
    """Return whether an image is a file that this add-on makes."""
    return BUILT_IN in image and not is_packed(image)


def tiled(image: bpy.types.Image) -> SceneError:
    """Return the refusal of an image of UDIM tiles."""
    return SceneError(
        f'The sky image "{image.name}" has UDIM tiles, and a sky is one picture: choose an equirectangular image of '
        "one file.",
        code="sky.tiled",
    )


def image_missing(image: bpy.types.Image) -> SceneError:
    """Return the refusal of an image without its file."""
    if is_built_in(image):
        return SceneError(
            f"The built-in sky is missing ({path_of(image)}): press Sky of Real Stars or Update Compositor in the "
            "Umbra panel, or render with Bake When Rendering, which make it.",
            code="sky.stars-missing",
        )
    return SceneError(
        f'The sky image "{image.name}" cannot be loaded from {path_of(image)}: choose a file that exists.',
        code="sky.image-missing",
    )


def default_settings(image: bpy.types.Image) -> dict[str, int | bool]:
    """Return the settings that show all of a sequence or movie, from frame 1 on, as Blender does when it opens one."""
    if image.source == "MOVIE":
        return {"frame_duration": max(image.frame_duration, 1), "frame_start": 1, "frame_offset": 0}
    numbers = _numbers(path_of(image))
    first, last = min(numbers), max(numbers)
    return {"frame_duration": last - first + 1, "frame_start": 1, "frame_offset": first - 1}


def copy_settings(source: Any, target: Any) -> None:
    """Let an image node, or an image user, show the frames that another one shows."""
    _set(target, {name: getattr(source, name) for name in SETTINGS})


def set_defaults(image: bpy.types.Image, target: Any) -> None:
    """Let an image node, or an image user, show all of a sequence or movie."""
    _set(target, default_settings(image) | {"use_cyclic": False})


def _set(target: Any, values: dict[str, Any]) -> None:
    # Cycles moves without Auto Refresh as well, the compositor does not
    for name, value in (values | {"use_auto_refresh": True}).items():
        if getattr(target, name) != value:
            setattr(target, name, value)


def _numbers(path: Path) -> list[int]:
    """Return the numbers of the files of a sequence; that of the path itself if there are none, or 1."""
    match = _NUMBERED.fullmatch(path.stem)
    if match is None:
        return [1]
    head, digits, tail = match.groups()
    pattern = re.compile(re.escape(head) + r"(\d+)" + re.escape(tail + path.suffix))
    try:
        found = [pattern.fullmatch(each.name) for each in path.parent.iterdir()]
    except OSError:
        found = []
    return [int(each.group(1)) for each in found if each is not None] or [int(digits)]


def number_at(frame: int, settings: Any) -> int:
    """Return the number of the file that is shown at a frame of the scene."""
    length = max(settings.frame_duration, 1)
    number = frame - settings.frame_start + 1
    if settings.use_cyclic:
        number = (number - 1) % length + 1
    return int(min(max(number, 0), length) + settings.frame_offset)


def file_at(image: bpy.types.Image, frame: int, settings: Any) -> Path:
    """Return the file that an image shows at a frame of the scene."""
    path = path_of(image)
    match = _NUMBERED.fullmatch(path.stem)
    if image.source != "SEQUENCE" or match is None:
        return path
    head, digits, tail = match.groups()
    return path.with_name(f"{head}{number_at(frame, settings):0{len(digits)}d}{tail}{path.suffix}")


def check_frame(image: bpy.types.Image, frame: int, settings: Any) -> None:
    """Refuse a frame whose sky has no file.

    Parameters
    ----------
    image : Image
        The sky.
    frame : int
        A frame of the scene.
    settings : image user or image node
        Which frames of a sequence are shown.

    Raises
    ------
    SceneError
        The file is missing.
    """
    if is_packed(image) or image.source == "TILED":
        return
    path = file_at(image, frame, settings)
    if path.is_file():
        return
    if image.source == "FILE":
        if min(image.size) > 0:  # it is still in memory, and is rendered from there
            return
        raise image_missing(image)
    raise SceneError(
        f'The sky image "{image.name}" has no file for frame {frame}: {path} is missing.', code="sky.frame-missing"
    )
