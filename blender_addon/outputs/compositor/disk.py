# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk in the compositor's set-up: its node, behind the scene and in front of the bent sky."""

import bpy

from ...nodes import disk_group
from ..shared import disk_sync
from ..shared.compositor_tree import Setup, find_node, find_setup
from ..shared.map_images import file_image

SOCKET = "Disk"  # of the group "Umbra Black Hole"


def refresh(scene: bpy.types.Scene) -> None:
    """Put the disk's nodes into the set-up, bring them up to date, or take them out."""
    setup = find_setup(scene)
    if setup is None or setup.tree.library is not None:
        return
    hole = disk_sync.wanted_hole(scene)
    if hole is None:
        disk_sync.remove(setup.tree)
        return
    disk_sync.update(scene, hole, _put_in(scene, setup))
    image = None if setup.map is None else file_image(setup.map)
    if image is not None:
        disk_sync.point_passes(setup.tree, image.filepath)


def _put_in(scene: bpy.types.Scene, setup: Setup) -> bpy.types.Node:
    """The disk's node behind the scene of a set-up with a bent sky."""
    is_new = find_node(setup.tree, disk_sync.DISK) is None
    node = disk_sync.ensure_node(scene, setup.tree)
    if is_new:
        x, y = setup.group.location
        node.location = (x - 300, y - 1100)
        disk_sync.arrange(setup.tree, node)
    if not setup.group.inputs[SOCKET].is_linked:
        setup.tree.links.new(node.outputs[disk_group.OUTPUT], setup.group.inputs[SOCKET])
    return node
