# SPDX-License-Identifier: GPL-3.0-or-later
"""The built-in sky: files in the folder of a scene's maps, made when they are needed.

One is of real stars and the Milky Way; the other is the Milky Way alone, for a compositor that draws stars as points.
What renders the maps has that folder: a farm, a moved project, another file that the scene is appended to. So the
.blend file only names it. Files of before, which have the sky packed into them, stay as they are.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

import bpy
import numpy as np

from ..core import color_spaces
from ..core.blender_version import SCENE_OWNS_COMPOSITOR
from ..core.physics_api import PACKAGE, physics
from ..scene.sky import sky_frames
from ..scene.sky.environment import STAR_SKY_NAME, is_named
from .folder import MapFolder, check_path, explain, folder, link

MILKY_WAY_NAME = "Umbra Milky Way"

HEIGHT, MILKY_WAY_HEIGHT = 2048, 1024
FILE, MILKY_WAY_FILE = f"umbra_stars_{HEIGHT}_2.exr", f"umbra_milky_way_{MILKY_WAY_HEIGHT}_1.exr"
"""Names of the files. Their last number is raised whenever the picture changes."""


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
    image = _find_or_make(scene, STAR_SKY_NAME)
    if sky_frames.is_built_in(image):
        _move(scene, image, may_write=True)
    return image


def load_milky_way(scene: bpy.types.Scene) -> bpy.types.Image:
    """Return the built-in sky without the stars that are drawn as points; as `load`, but it stays where it is."""
    return _find_or_make(scene, MILKY_WAY_NAME)


def _find_or_make(scene: bpy.types.Scene, name: str) -> bpy.types.Image:
    image = bpy.data.images.get(name)
    if image is None:
        home, file_name = folder(scene), _file_name(name)
        _write(home.path / file_name)
        image = bpy.data.images.load(str(home.path / file_name))
        image.name = name
        image.filepath_raw = home.blender_path + file_name
        image[sky_frames.BUILT_IN] = file_name
        if not color_spaces.mark_as_linear_rec709(image):
            print("Umbra: the color configuration has no linear Rec.709, in which the stars are given", flush=True)
    return image


def _file_name(name: str) -> str:
    return MILKY_WAY_FILE if name.startswith(MILKY_WAY_NAME) else FILE


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
    for image in _shown(scene):
        _move(scene, image, may_write=may_write)


def _shown(scene: bpy.types.Scene) -> list[bpy.types.Image]:
    """The built-in skies that a scene of this file shows from files."""
    if scene.library is not None:
        return []
    tree = scene.node_tree if SCENE_OWNS_COMPOSITOR else scene.compositing_node_group
    in_compositor = [node.image for node in ([] if tree is None else tree.nodes) if node.type == "IMAGE"]
    named = [each for each in in_compositor if each is not None and is_named(each, MILKY_WAY_NAME)]
    images = [each for each in (scene.umbra.environment_image, *named) if each is not None]
    return [each for each in images if each.library is None and sky_frames.is_built_in(each)]


def _move(scene: bpy.types.Scene, image: bpy.types.Image, *, may_write: bool) -> None:
    file_name = _file_name(image.name)
    present = sky_frames.path_of(image)
    is_there = present.is_file()
    homes = [folder(each).blender_path for each in bpy.data.scenes if image in _shown(each)]
    if is_there and image.filepath in [home + file_name for home in homes]:
        return
    home = folder(scene)
    if not (home.path / file_name).is_file():
        if not may_write and not is_there:
            raise sky_frames.image_missing(image)
        if not may_write:
            return
        try:
            _write(home.path / file_name, present)
        except physics.BlackHoleError:
            if is_there:  # as good as before
                return
            raise
    _point(image, home, is_new=not is_there)


def _point(image: bpy.types.Image, home: MapFolder, *, is_new: bool) -> None:
    file_name = _file_name(image.name)
    image.filepath_raw = home.blender_path + file_name
    image[sky_frames.BUILT_IN] = file_name
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
        has_it = present is not None and present.name == path.name and present.is_file()
        source = present if has_it else _kept(path.name)
        if source is None:
            _make(path)
        else:
            link(source, path, copy=True)
    except OSError as error:
        raise explain(error, path.parent) from error


def _kept(file_name: str) -> Path | None:
    """The file in the extension's own folder, made if it is not there; None where that cannot be written to."""
    try:
        path = Path(bpy.utils.extension_path_user(PACKAGE, create=True)) / file_name
    except (ValueError, OSError):  # not installed as an extension
        return None
    if not path.is_file():
        with contextlib.suppress(physics.BlackHoleError, OSError):
            _make(path)
    return path if path.is_file() else None


def _make(path: Path) -> None:
    is_plain = path.name == MILKY_WAY_FILE
    pixels = physics.milky_way_sky(MILKY_WAY_HEIGHT) if is_plain else physics.star_sky(HEIGHT)
    physics.write_exr(path, np.minimum(pixels, physics.LARGEST_HALF).astype(np.float16))
