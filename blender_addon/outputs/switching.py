# SPDX-License-Identifier: GPL-3.0-or-later
"""Switch a scene from one output to another: wholly, or not at all."""

import bpy

from ..core import changes, messages
from ..core.changes import Change
from ..core.errors import SceneError
from ..core.physics_api import physics
from . import registry, switched
from .protocol import Look, Output
from .refreshing import refresh_disk
from .shared import leaving
from .shared.look import look_of_scene, write_to_scene

# On the scene: the output that it is set up for, if that is not the default one. Files of 0.1.0 lack it.
INSTALLED = "umbra_output"


def installed(scene: bpy.types.Scene) -> Output:
    """Return the output that the scene is set up for, whatever the setting says."""
    identifier = scene.get(INSTALLED)
    known = [each for each in registry.every() if each.identifier == identifier]
    return known[0] if known else next((each for each in registry.every() if each.marks(scene)), registry.default())


def switch(scene: bpy.types.Scene, wanted: str) -> list[str]:
    """Choose the output of a scene and set it up; return what the artist should know.

    Raises
    ------
    SceneError
        If the scene cannot be rendered that way. It stays as it is.
    """
    if scene.library is not None:
        raise SceneError(f'Scene "{scene.name}" is linked from another file: open that one.', code="settings.linked")
    new, old = registry.get(wanted), installed(scene)
    new.check(scene)
    look = leaving.kept_look(scene) | look_of_scene(scene) | old.look(scene)
    with changes.muted(Change.SCENE, Change.OUTPUT):
        if new is not old:
            notes = _replace(scene, old, new, look)
        else:
            notes = new.install(scene, look)
        scene.umbra.output = wanted
        _remember(scene, new)
    new.refresh(scene)
    refresh_disk(scene)
    changes.notify(Change.SWITCHED, scene)
    return notes


def _remember(scene: bpy.types.Scene, output: Output) -> None:
    if output is not registry.default():
        scene[INSTALLED] = output.identifier
    elif INSTALLED in scene:
        del scene[INSTALLED]


def _replace(scene: bpy.types.Scene, old: Output, new: Output, look: Look) -> list[str]:
    """Take one output out and put another one in; if that fails, put the first one back."""
    old.remove(scene)
    write_to_scene(scene, look)
    try:
        return new.install(scene, look)
    except Exception:
        new.remove(scene)
        old.install(scene, look)
        old.refresh(scene)
        old.refresh_disk(scene)
        raise


def on_setting_changed(owner: bpy.types.ID) -> None:
    """Follow a change of the setting itself, by the artist or by a script, or set it back with a message."""
    if not isinstance(owner, bpy.types.Scene):
        return
    try:
        before = switched.state(owner)
        for note in switch(owner, owner.umbra.output):
            messages.warn(note)
        text = switched.sentence(before, switched.state(owner))
        if text:
            messages.tell(text)
    except physics.BlackHoleError as error:
        messages.warn(error.for_user())
        messages.popup(error.for_user())
        with changes.muted(Change.OUTPUT):
            owner.umbra.output = installed(owner).identifier
