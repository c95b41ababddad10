# SPDX-License-Identifier: GPL-3.0-or-later
"""A small picture of the hole as the camera sees it, made by numpy: for the panel, whatever the viewport shows."""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Any

import bpy
import bpy.utils.previews
import numpy as np
from numpy.typing import NDArray

from ..core import color_spaces
from ..core.physics_api import physics
from ..core.session import SESSION, Life, scene_of
from ..outputs import registry
from ..scene import frame_setup
from ..scene.sky import environment
from ..settings.scene_properties import SKY_PROPERTIES
from . import small_maps

# Pixels of the longer side.
SIDE = 192
# Rows of the sky that is looked up: a texel of it is a pixel of the thumbnail, about.
SKY_ROWS = 256

# Where the sky cannot be read, squares of 10 degrees in two grays stand for it.
SQUARES = 18
GRAYS = (0.02, 0.12)

Array = NDArray[np.floating[Any]]

# Arguments of `physics.render_reference`, and the groups' sockets that say the same.
_SOCKETS = {argument: physics.SKY_SETTINGS[name].socket for name, argument in physics.SKY_ARGUMENTS.items()}


@dataclass(frozen=True)
class _Sky:
    key: tuple[object, ...]
    pixels: Array


def _no_collection() -> bpy.utils.previews.ImagePreviewCollection | None:
    return None


_collection = SESSION.value(_no_collection, Life.REGISTRATION)
_skies = SESSION.per_scene(lambda: _Sky((), np.empty(0)), Life.FILE)


def _preview_of(scene: bpy.types.Scene) -> bpy.types.ImagePreview | None:
    found = _collection.now
    key = str(scene.session_uid)
    return found[key] if found is not None and key in found else None


def icon(scene: bpy.types.Scene) -> int:
    """Return the icon of a scene's thumbnail, 0 if there is none."""
    preview = _preview_of(scene)
    return 0 if preview is None else preview.icon_id


def pixels(scene: bpy.types.Scene) -> Array | None:
    """Return the thumbnail's pixels, shape (height, width, 4), row 0 at the bottom; None if there is none."""
    preview = _preview_of(scene)
    if preview is None:
        return None
    width, height = preview.image_size
    values = np.empty(width * height * 4, np.float32)
    preview.image_pixels_float.foreach_get(values)
    return values.reshape(height, width, 4)


def show(scene: bpy.types.Scene, picture: Array) -> None:
    """Keep a picture, shape (height, width, 4), row 0 at the bottom, as the scene's thumbnail."""
    if _collection.now is None:
        _collection.now = bpy.utils.previews.new()
    preview = _preview_of(scene) or _collection.now.new(str(scene.session_uid))
    height, width = picture.shape[:2]
    if tuple(preview.image_size) != (width, height):
        preview.image_size = (width, height)
    preview.image_pixels_float.foreach_set(np.ravel(picture).astype(np.float32))


def forget(scene: bpy.types.Scene) -> None:
    """Drop a scene's thumbnail."""
    _skies.drop(scene)
    if _collection.now is not None and _preview_of(scene) is not None:
        del _collection.now[str(scene.session_uid)]


def clear() -> None:
    """Drop all thumbnails."""
    _skies.clear()
    if _collection.now is not None:
        bpy.utils.previews.remove(_collection.now)
    _collection.clear()


def steps(
    uid: int, parameters: "physics.WarpMapParameters", light: "physics.LightParameters | None"
) -> Generator[float, None, Array | None]:
    """Make the thumbnail of a frame step by step; None if the scene is gone."""
    small = _small(parameters)
    warp_map = yield from physics.share_of(physics.bake_steps(small), 0.0, 0.5)
    layer = None
    if light is not None:
        shot = replace(small, disk=light.view.disk, interpolation=small_maps.DISK_INTERPOLATION)
        layer = yield from physics.share_of(physics.light_steps(replace(light, view=shot)), 0.5, 1.0)
    scene = scene_of(uid)
    if scene is None:
        return None
    picture: Array = physics.render_reference(warp_map, _sky_of(scene), **look(scene)).sky
    if layer is not None:
        picture = _laid_over(scene, layer, picture)
    picture[..., :3] = _encoded(picture[..., :3])
    return picture[::-1]


def _small(parameters: "physics.WarpMapParameters") -> "physics.WarpMapParameters":
    camera = parameters.camera
    longer = max(camera.width, camera.height)
    width, height = (max(round(each * SIDE / longer), 1) for each in (camera.width, camera.height))
    return replace(
        parameters,
        camera=camera.resized(width, height),
        supersampling=1,
        interpolation=2e-3,
    )


def _live(scene: bpy.types.Scene) -> tuple[float, ...]:
    """Return the live controls of the disk: exposure, opacity and tint."""
    hole = frame_setup.find_active_hole(scene)
    disk = None if hole is None else hole.umbra.disk
    return (0.0, 1.0, 1.0, 1.0, 1.0) if disk is None else (disk.exposure, disk.opacity, *disk.tint)


def _laid_over(scene: bpy.types.Scene, layer: "physics.LightLayer", picture: Array) -> Array:
    """Return a disk over a picture, as the compositor lays it."""
    exposure, opacity, *tint = _live(scene)
    light = layer.light * (np.array(tint) * (2.0**exposure * opacity))
    over: Array = physics.disk_over_sky(picture, light, 1.0 - (1.0 - layer.transmittance) * opacity)
    return over


def _encoded(values: Array) -> Array:
    """Linear light as a screen shows it (sRGB)."""
    held = np.clip(values, 0.0, 1.0)
    encoded: Array = np.where(held <= 0.0031308, 12.92 * held, 1.055 * held ** (1.0 / 2.4) - 0.055)
    return encoded


def look(scene: bpy.types.Scene) -> dict[str, Any]:
    """How the sky is placed and shifted, as `physics.render_reference` takes it; as it is where that cannot be read."""
    values: dict[str, Any] = {physics.SKY_ARGUMENTS[name]: getattr(scene.umbra, name) for name in SKY_PROPERTIES}
    placed = registry.of(scene).look(scene)
    values |= {name: placed[socket] for name, socket in _SOCKETS.items() if socket in placed}
    try:
        sky = environment.read(scene)
    except physics.BlackHoleError:
        return values
    return values | {
        "rotation": tuple(placed.get("Environment Rotation", sky.rotation)),
        "strength": placed.get("Environment Strength", sky.strength),
    }


def key(scene: bpy.types.Scene) -> tuple[object, ...]:
    """All that the thumbnail depends on besides the shot."""
    return (_image_key(_image_of(scene)), *look(scene).items(), *_live(scene))


def _sky_of(scene: bpy.types.Scene) -> Array:
    """The scene's sky, small, row 0 at the top; it is read once for each image."""
    image = _image_of(scene)
    known = _skies.find(scene)
    if known is None or known.key != _image_key(image):
        known = _Sky(_image_key(image), _squares() if image is None else _shrunk(image))
        _skies.put(scene, known)
    return known.pixels


def _image_of(scene: bpy.types.Scene) -> bpy.types.Image | None:
    try:
        return environment.read(scene).image
    except physics.BlackHoleError:
        return None


def _image_key(image: bpy.types.Image | None) -> tuple[object, ...]:
    return () if image is None else (image.name, image.filepath, tuple(image.size), image.is_dirty)


def _squares() -> Array:
    row, column = np.mgrid[0:SKY_ROWS, 0 : 2 * SKY_ROWS]
    size = SKY_ROWS / SQUARES
    odd = ((row // size + column // size) % 2).astype(int)
    return np.repeat(np.array(GRAYS)[odd][..., None], 3, axis=-1)


def _shrunk(image: bpy.types.Image) -> Array:
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
    if not image.is_float and color_spaces.is_srgb(image):
        small = physics.linear_from_srgb(small)
    shrunk: Array = small.astype(np.float64)
    return shrunk
