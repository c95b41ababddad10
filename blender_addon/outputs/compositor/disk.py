# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in the compositor's set-up: its layer of light, behind the scene and in front of the bent sky."""

import bpy

from ...bake.kinds import LIGHT_LAYER
from ...bake.names import sequence_path
from ...nodes import disk_layer
from ...scene import cameras
from ..shared import disk_sync
from ..shared.compositor_tree import find_setup


def refresh(scene: bpy.types.Scene) -> None:
    """Put the disk's node into the set-up, bring it up to date, or take it out."""
    setup = find_setup(scene)
    if setup is None or setup.tree.library is not None:
        return
    socket = setup.group.inputs[disk_layer.DISK.name]
    if socket.type == "RGBA" and not socket.is_linked:  # in old files it is 0, which would be a missing layer
        socket.default_value = disk_layer.NOTHING
    hole = disk_sync.wanted_hole(scene)
    if hole is None:
        disk_sync.remove(setup.tree)
        return
    if disk_sync.has_former(setup.tree):
        disk_sync.remove(setup.tree)
    disk_sync.ensure_layer(setup.tree, socket)
    disk_sync.follow(setup.group, hole)
    # A node that got its image only while Blender renders would show it a frame late.
    path = sequence_path(scene, hole.name, cameras.render_size(scene.render), LIGHT_LAYER)
    disk_sync.point_at(setup.tree, path)
