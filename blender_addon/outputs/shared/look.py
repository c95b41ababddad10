# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist has set of the sky, in a form that goes from one output to another.

A look is a dict from the names of the sockets of the group "Umbra Black Hole" to values.
"""

from typing import Any

import bpy

from ...core.physics_api import physics
from ...settings.scene_properties import SKY_PROPERTIES

# The scene's settings and the group's sockets that say the same.
SHARED = {name: physics.SKY_SETTINGS[name].socket for name in SKY_PROPERTIES}
EXPOSURE = physics.SKY_SETTINGS["exposure"].socket

# What the image of a lensed World is placed by, and the sockets of the compositor's group that say the same.
PLACEMENT = {"Rotation": "Environment Rotation", "Strength": "Environment Strength"}

# All that several outputs know.
CARRIED = (EXPOSURE, *PLACEMENT.values(), *SHARED.values())


def look_of_scene(scene: bpy.types.Scene) -> dict[str, Any]:
    """Return the part of the look that the scene's own settings hold."""
    return {socket: getattr(scene.umbra, name) for name, socket in SHARED.items()}


def write_to_scene(scene: bpy.types.Scene, look: dict[str, Any]) -> None:
    """Let the scene's own settings hold their part of a look."""
    for name, socket in SHARED.items():
        if socket in look and getattr(scene.umbra, name) != look[socket]:
            setattr(scene.umbra, name, look[socket])


def look_of_group(group: bpy.types.Node) -> dict[str, Any]:
    """Return the values that the artist has given a group's inputs."""
    look: dict[str, Any] = {}
    for socket in group.inputs:
        if not socket.is_linked and socket.type in {"VALUE", "VECTOR", "ROTATION"}:
            value = socket.default_value
            look[socket.name] = value if isinstance(value, float) else tuple(value)
    return look


def write_to_group(group: bpy.types.Node, look: dict[str, Any]) -> None:
    """Give a group's inputs the values of a look, where they are not linked."""
    for name, value in look.items():
        socket = group.inputs.get(name)
        if socket is not None and not socket.is_linked:
            socket.default_value = value
