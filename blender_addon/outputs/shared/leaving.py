# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene keeps while its output is not the compositor, so that coming back finds everything as it was."""

from typing import Any

import bpy

# On the scene: whether the compositor was set up, the look of its group, and the interface's lock.
KEPT = "umbra_lens_before"


def is_left(scene: bpy.types.Scene) -> bool:
    """Return whether the compositor was left for another output."""
    return KEPT in scene


def keep(scene: bpy.types.Scene, look: dict[str, Any], *, in_compositor: bool) -> None:
    """Keep what was there, and lock the interface while rendering: maps are baked by handlers."""
    scene[KEPT] = {
        "in_compositor": in_compositor,
        "look": look,
        "use_lock_interface": scene.render.use_lock_interface,
    }
    scene.render.use_lock_interface = True


def kept_look(scene: bpy.types.Scene) -> dict[str, Any]:
    """Return the look of the compositor's group when it was left."""
    if KEPT not in scene:
        return {}
    return dict(scene[KEPT].to_dict()["look"])


def give_back(scene: bpy.types.Scene) -> bool:
    """Unlock the interface if it was not locked, forget the rest, and return whether the compositor was set up."""
    if KEPT not in scene:
        return False
    before = scene[KEPT].to_dict()
    scene.render.use_lock_interface = bool(before["use_lock_interface"])
    del scene[KEPT]
    return bool(before["in_compositor"])
