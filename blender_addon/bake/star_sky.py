# SPDX-License-Identifier: GPL-3.0-or-later
"""The built-in sky of real stars: a file in the folder of a scene's maps, made when it is needed.

What renders the maps has that folder: a farm, a moved project, another file that the scene is appended to. So the
.blend file only names it. Files of before, which have the sky packed into them, stay as they are.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

import bpy
import numpy as np

from ..core import color_spaces
from ..core.physics_api import PACKAGE, physics
from ..scene.sky import sky_frames
from ..scene.sky.environment import STAR_SKY_NAME
from .folder import MapFolder, check_path, explain, folder, link

HEIGHT = 2048
FILE = f"umbra_stars_{HEIGHT}_2.exr"
"""Name of the file. Its last number is raised whenever the picture changes."""


def load(scene: bpy.types.Scene) -> bpy.types.Image:
    """Return the built-in sky, with its file beside the maps of a scene.

    Parameters
    ----------
    scene : Scene
        The scene that is to show it.

    Raises
    ------
    physics.BlackHoleError
        Its file is not there and cannot be written.
    """
    image = bpy.data.images.get(STAR_SKY_NAME)
    if image is None:
        home = folder(scene)
        _write(home.path / FILE)
        image = bpy.data.images.load(str(home.path / FILE))
        image.name = STAR_SKY_NAME
        image.filepath_raw = home.blender_path + FILE
        image[sky_frames.BUILT_IN] = FILE
        if not color_spaces.mark_as_linear_rec709(image):
            print("Umbra: the color configuration has no linear Rec.709, in which the stars are given", flush=True)
    elif sky_frames.is_built_in(image):
        _move(scene, image, may_write=True)
    return image


def provide(scene: bpy.types.Scene, *, may_write: bool) -> None:
    """Have the built-in sky lie beside the maps of the scene that shows it, if one does; make it where it is missing.

    Parameters
    ----------
    scene : Scene
        The scene. A sky that lies beside the maps of another scene that shows it stays there.
    may_write : bool
        Whether a file may be made. Otherwise one that is there already is found.

    Raises
    ------
    physics.BlackHoleError
        Its file is not there and cannot, or may not, be written.
    """
    image = _shown(scene)
    if image is not None:
        _move(scene, image, may_write=may_write)


def _shown(scene: bpy.types.Scene) -> bpy.types.Image | None:
    """The built-in sky where a scene of this file shows it from a file."""
    image = scene.umbra.environment_image
    if image is None or scene.library is not None or image.library is not None or not sky_frames.is_built_in(image):
        return None
    return image


def _move(scene: bpy.types.Scene, image: bpy.types.Image, *, may_write: bool) -> None:
    present = sky_frames.path_of(image)
    is_there = present.is_file()
    homes = [folder(each).blender_path for each in bpy.data.scenes if _shown(each) == image]
    if is_there and image.filepath in [home + FILE for home in homes]:
        return
    home = folder(scene)
    if not (home.path / FILE).is_file():
        if not may_write and not is_there:
            raise sky_frames.image_missing(image)
        if not may_write:
            return
        try:
            _write(home.path / FILE, present)
        except physics.BlackHoleError:
            if is_there:  # as good as before
                return
            raise
    _point(image, home, is_new=not is_there)


def _point(image: bpy.types.Image, home: MapFolder, *, is_new: bool) -> None:
    image.filepath_raw = home.blender_path + FILE
    image[sky_frames.BUILT_IN] = FILE
    if is_new:
        image.reload()
        image.update_tag()


def _write(path: Path, present: Path | None = None) -> None:
    """Put the file at a path, from one that is there or from what sessions before this one have made."""
    check_path(path)
    if path.is_file():
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        source = present if present is not None and present.name == FILE and present.is_file() else _kept()
        if source is None:
            _make(path)
        else:
            link(source, path, copy=True)
    except OSError as error:
        raise explain(error, path.parent) from error


def _kept() -> Path | None:
    """The file in the extension's own folder, made if it is not there; None where that cannot be written to."""
    try:
        path = Path(bpy.utils.extension_path_user(PACKAGE, create=True)) / FILE
    except (ValueError, OSError):  # not installed as an extension
        return None
    if not path.is_file():
        with contextlib.suppress(physics.BlackHoleError, OSError):
            _make(path)
    return path if path.is_file() else None


def _make(path: Path) -> None:
    pixels = physics.star_sky(HEIGHT)
    physics.write_exr(path, np.minimum(pixels, physics.LARGEST_HALF).astype(np.float16))
