# SPDX-License-Identifier: GPL-3.0-or-later
"""Keep a .blend file and its maps together, when the file is saved, saved under another name, or opened under one.

Maps are named after file, scene and hole. A saved file refers to the maps by their names of that moment, and knows what
they begin with (`map_names`), so that they can be found when one of the three is called otherwise the next time.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

import bpy

from ..bake import reuse, star_sky
from ..bake.folder import being_saved_as, explain, folder
from ..bake.names import former_shot_name, name_pattern, shot_name
from ..core import messages
from ..core.physics_api import physics
from ..core.session import SESSION, Life, PerScene
from ..scene import frame_setup
from . import registry


@dataclass(frozen=True)
class _Saving:
    """What a scene was before the file that is being saved."""

    map_names: str
    old: tuple[tuple[Path, str], ...]
    """Folders and beginnings of names that nobody needs once the file is saved, unless it is a copy."""
    new: tuple[Path, str]


_saving: PerScene[_Saving | None] = SESSION.per_scene(lambda: None, Life.FILE)


def before(blend: Path) -> None:
    """Let all scenes refer to the maps as the file will find them that is about to be saved, and carry those there."""
    for scene in bpy.data.scenes:
        with being_saved_as(blend):
            _keep_stars(scene)
        output = registry.of(scene)
        if scene.library is not None or not output.is_set_up(scene):
            continue
        hole = frame_setup.find_active_hole(scene)
        if hole is not None:
            _carry_to(scene, hole.name, blend)
        with being_saved_as(blend):
            output.point_at_files(scene)


def _keep_stars(scene: bpy.types.Scene) -> None:
    """Have the built-in sky beside the scene's maps."""
    try:
        star_sky.provide(scene, may_write=True)
    except physics.BlackHoleError as error:
        messages.warn(error.for_user())


def _carry_to(scene: bpy.types.Scene, hole_name: str, blend: Path) -> None:
    here = folder(scene)
    now = here.path, shot_name(scene, hole_name)
    with being_saved_as(blend):
        new = folder(scene).path, shot_name(scene, hole_name)
    known = scene.umbra.map_names
    names = [now, *([(here.path, known)] if known else [])]
    try:
        for source in names:
            reuse.carry(*source, *new, copy=here.is_temporary)
    except OSError as error:
        messages.warn(explain(error, new[0]).for_user())
    unsaved = not bpy.data.filepath
    renamed = bool(known) and blend == Path(bpy.data.filepath)
    old = ([now] if unsaved else []) + ([names[-1]] if renamed else [])
    _saving.put(scene, _Saving(known, tuple(each for each in old if each != new), new))
    scene.umbra.map_names = new[1]


def after(blend: Path) -> None:
    """The file is saved: remove names that nobody needs any more; after a copy, be the open file again."""
    is_copy = blend != Path(bpy.data.filepath)
    kept = {each.new for _scene, each in _saving.items() if each is not None}
    for scene in bpy.data.scenes:
        _keep_stars(scene)
    for scene, saving in _saving.items():
        if saving is None:
            continue
        if is_copy:
            scene.umbra.map_names = saving.map_names
        else:
            for old in set(saving.old) - kept:
                _remove(*old, *saving.new)
        registry.of(scene).point_at_files(scene)
    _saving.clear()


def _remove(source: Path, old: str, target: Path, new: str) -> None:
    """Remove the old names of maps that have new ones."""
    pattern = name_pattern(old)
    try:
        for path in source.iterdir():
            if pattern.fullmatch(path.name) and (target / (new + path.name.removeprefix(old))).exists():
                path.unlink(missing_ok=True)
    except OSError:  # they stay
        return


def on_load(scene: bpy.types.Scene) -> None:
    """Carry the maps of a file that was opened to its names, where it was renamed or is of version 0.1.0."""
    with contextlib.suppress(physics.BlackHoleError):  # a render makes the sky, or says why not
        star_sky.provide(scene, may_write=False)
    hole = frame_setup.find_active_hole(scene)
    if hole is None or not registry.of(scene).is_set_up(scene):
        return
    where, name = folder(scene).path, shot_name(scene, hole.name)
    former = scene.umbra.map_names or former_shot_name(scene, hole.name)
    try:
        count = reuse.carry(where, former, where, name)
    except OSError:  # a bake says that the folder cannot be written to
        return
    if count:
        print(f'Umbra: {count} maps of scene "{scene.name}" have names of this file now', flush=True)
