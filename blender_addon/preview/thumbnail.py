# SPDX-License-Identifier: GPL-3.0-or-later
"""A small picture of the hole as the camera sees it, made by numpy: for the panel, whatever the viewport shows."""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace

import bpy
import bpy.utils.previews
import numpy as np

from ..core.physics_api import physics, reference_render
from ..outputs.shared.compositor_tree import find_setup
from ..outputs.world import lensed_world
from ..scene import environment

# Pixels of the longer side.
SIDE = 192
# Rows of the sky that is looked up: a texel of it is a pixel of the thumbnail, about.
SKY_ROWS = 256

# Where the sky cannot be read, squares of 10 degrees in two grays stand for it.
SQUARES = 18
GRAYS = (0.02, 0.12)

# Arguments of `reference_render.render`, and the groups' sockets that say the same.
_SOCKETS = {
    "exposure": "Exposure",
    "color_amount": "Redshift Color",
    "brightness_amount": "Redshift Brightness",
    "temperature": "Sky Temperature",
}


@dataclass(frozen=True)
class _Sky:
    key: tuple
    pixels: np.ndarray


_collection: bpy.utils.previews.ImagePreviewCollection | None = None
_skies: dict[str, _Sky] = {}


def icon(scene: bpy.types.Scene) -> int:
    """The icon of a scene's thumbnail, 0 if there is none."""
    if _collection is None or scene.name not in _collection:
        return 0
    return _collection[scene.name].icon_id


def pixels(scene_name: str) -> np.ndarray | None:
    """The thumbnail's pixels, shape (height, width, 4), row 0 at the bottom; None if there is none."""
    if _collection is None or scene_name not in _collection:
        return None
    preview = _collection[scene_name]
    width, height = preview.image_size
    values = np.empty(width * height * 4, np.float32)
    preview.image_pixels_float.foreach_get(values)
    return values.reshape(height, width, 4)


def show(scene_name: str, picture: np.ndarray) -> None:
    """Keep a picture, shape (height, width, 4), row 0 at the bottom, as the scene's thumbnail."""
    global _collection
    if _collection is None:
        _collection = bpy.utils.previews.new()
    preview = _collection[scene_name] if scene_name in _collection else _collection.new(scene_name)
    height, width = picture.shape[:2]
    if tuple(preview.image_size) != (width, height):
        preview.image_size = (width, height)
    preview.image_pixels_float.foreach_set(np.ravel(picture).astype(np.float32))


def forget(scene_name: str) -> None:
    """Drop a scene's thumbnail."""
    _skies.pop(scene_name, None)
    if _collection is not None and scene_name in _collection:
        del _collection[scene_name]


def clear() -> None:
    """Drop all thumbnails."""
    global _collection
    _skies.clear()
    if _collection is not None:
        bpy.utils.previews.remove(_collection)
        _collection = None


def steps(scene_name: str, parameters: "physics.WarpMapParameters") -> Generator[float, None, np.ndarray | None]:
    """Make the thumbnail of a shot step by step; None if the scene is gone."""
    camera = parameters.camera
    longer = max(camera.width, camera.height)
    small = replace(
        parameters,
        camera=replace(
            camera,
            width=max(round(camera.width * SIDE / longer), 1),
            height=max(round(camera.height * SIDE / longer), 1),
        ),
        supersampling=1,
        interpolation=2e-3,
    )
    warp_map = yield from physics.bake_steps(small)
    scene = bpy.data.scenes.get(scene_name)
    if scene is None:
        return None
    picture = reference_render.render(warp_map, _sky_of(scene), **look(scene)).sky
    picture[..., :3] = _encoded(picture[..., :3])
    return picture[::-1]


def _encoded(values: np.ndarray) -> np.ndarray:
    """Linear light as a screen shows it (sRGB)."""
    held = np.clip(values, 0.0, 1.0)
    return np.where(held <= 0.0031308, 12.92 * held, 1.055 * held ** (1.0 / 2.4) - 0.055)


def look(scene: bpy.types.Scene) -> dict[str, object]:
    """How the sky is placed and shifted, as `reference_render.render` takes it; as it is where that cannot be read."""
    settings = scene.umbra
    values: dict[str, object] = {
        "color_amount": settings.redshift_color,
        "brightness_amount": settings.redshift_brightness,
        "temperature": settings.sky_temperature,
    }
    setup = find_setup(scene)
    node = lensed_world.group_node(lensed_world.lensed_world(scene)) if setup is None else setup.group
    if node is not None:
        values |= {
            name: node.inputs[socket].default_value for name, socket in _SOCKETS.items() if socket in node.inputs
        }
    try:
        sky = environment.read(scene)
    except physics.BlackHoleError:
        return values
    if setup is not None:
        rotation = node.inputs["Environment Rotation"].default_value
        return values | {"rotation": tuple(rotation), "strength": node.inputs["Environment Strength"].default_value}
    placed = lensed_world.placement(scene)
    return values | {
        "rotation": tuple(placed.get("Rotation", sky.rotation)),
        "strength": placed.get("Strength", sky.strength),
    }


def key(scene: bpy.types.Scene) -> tuple:
    """All that the thumbnail depends on besides the shot."""
    return (_image_key(_image_of(scene)), *look(scene).items())


def _sky_of(scene: bpy.types.Scene) -> np.ndarray:
    """The scene's sky, small, row 0 at the top; it is read once for each image."""
    image = _image_of(scene)
    known = _skies.get(scene.name)
    if known is None or known.key != _image_key(image):
        known = _Sky(_image_key(image), _squares() if image is None else _shrunk(image))
        _skies[scene.name] = known
    return known.pixels


def _image_of(scene: bpy.types.Scene) -> bpy.types.Image | None:
    try:
        return environment.read(scene).image
    except physics.BlackHoleError:
        return None


def _image_key(image: bpy.types.Image | None) -> tuple:
    return () if image is None else (image.name, image.filepath, tuple(image.size), image.is_dirty)


def _squares() -> np.ndarray:
    row, column = np.mgrid[0:SKY_ROWS, 0 : 2 * SKY_ROWS]
    size = SKY_ROWS / SQUARES
    odd = ((row // size + column // size) % 2).astype(int)
    return np.repeat(np.array(GRAYS)[odd][..., None], 3, axis=-1)


def _shrunk(image: bpy.types.Image) -> np.ndarray:
    """An image's colors at the thumbnail's resolution, scene-linear."""
    width, height = image.size
    if width * height == 0:
        return _squares()
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, image.channels)[::-1]
    step = max(math.ceil(height / SKY_ROWS), 1)
    rows, columns = height // step, width // step
    small = values[: rows * step, : columns * step].reshape(rows, step, columns, step, -1).mean(axis=(1, 3))
    small = small[..., :3] if image.channels >= 3 else np.repeat(small[..., :1], 3, axis=-1)
    if not image.is_float and image.colorspace_settings.name == "sRGB":
        small = np.where(small <= 0.04045, small / 12.92, ((small + 0.055) / 1.055) ** 2.4)
    return small.astype(np.float64)
