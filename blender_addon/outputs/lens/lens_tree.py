# SPDX-License-Identifier: GPL-3.0-or-later
"""The compositor of a scene with the Cycles Lens: made where the disk or the foreground needs one, and given back."""

import bpy

from ..shared import disk_sync, tree_editing
from ..shared.compositor_tree import ROLE, find_node, find_tree, has_scene_tree

# On the scene: what was there before.
BEFORE = "umbra_lens_tree_before"

FOREGROUND_LAYER, FOREGROUND_OVER = "foreground_layer", "foreground_over"
_OURS = (disk_sync.DISK, disk_sync.LAYER, FOREGROUND_LAYER, FOREGROUND_OVER)

_SETTINGS = {
    "use_compositing": True,
    "compositor_precision": "FULL",  # half floats lose the dim light of a disk
}


def claim(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """The scene's compositor tree, switched on; what changes is remembered, and is not changed a second time.

    Raises
    ------
    SceneError
        It belongs to another file or scene.
    """
    tree = find_tree(scene)
    if tree is not None:
        tree_editing.check_shared(scene, tree)
    if BEFORE in scene and tree is not None:
        return tree
    settings = dict(_SETTINGS)
    if bpy.app.background and hasattr(scene.render, "compositor_device"):
        settings["compositor_device"] = "CPU"  # without a display there is usually no OpenGL
    before: dict[str, object] = {name: getattr(scene.render, name) for name in settings}
    used = not has_scene_tree() or scene.use_nodes
    scene[BEFORE] = {**before, "tree_is_new": tree is None, "use_nodes": used}
    if tree is None:
        tree = tree_editing.make_tree(scene)
    elif not used:
        scene.use_nodes = True
    for name, value in settings.items():
        setattr(scene.render, name, value)
    return tree


def release(scene: bpy.types.Scene) -> None:
    """Give the tree back when neither the disk nor the foreground is in it any more."""
    tree = find_tree(scene)
    if BEFORE not in scene or (tree is not None and any(find_node(tree, role) is not None for role in _OURS)):
        return
    before = scene[BEFORE].to_dict()
    if tree is not None and before["tree_is_new"]:
        if all(node.get(ROLE) for node in tree.nodes):
            tree_editing.remove_tree(scene, tree)
        else:
            for node in tree.nodes:  # what remains is the artist's own from now on
                if ROLE in node:
                    del node[ROLE]
    if has_scene_tree():
        scene.use_nodes = bool(before["use_nodes"])
    for name in (*_SETTINGS, "compositor_device"):
        if name in before:
            value = before[name]
            setattr(scene.render, name, value if isinstance(value, str) else bool(value))
    del scene[BEFORE]
