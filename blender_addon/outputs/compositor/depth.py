# SPDX-License-Identifier: GPL-3.0-or-later
"""Hide what is behind the hole and inside its shadow, by the depth pass of the render layer in front of the sky."""

import bpy

from ...nodes import black_hole_group
from ...scene import frame_setup
from ..shared.compositor_tree import Setup, find_setup, find_tree, render_layers
from ..shared.tree_editing import background_layer
from . import hole_depth

DEPTH, HIDE_BEHIND = black_hole_group.DEPTH.name, black_hole_group.HIDE_BEHIND.name
# On a view layer whose depth pass was switched on for the group.
PASS_ADDED = "umbra_depth_pass_added"


def refresh(scene: bpy.types.Scene) -> None:
    """Link the depth pass to the group and let it know the hole's depth, or undo both, as the setting says."""
    setup = find_setup(scene)
    if setup is None or setup.tree.library is not None or DEPTH not in setup.group.inputs:
        return
    hole = frame_setup.find_active_hole(scene)
    is_wanted = bool(scene.umbra.hide_behind) and hole is not None
    layer = layer_of(scene, setup) if is_wanted else None
    _link(scene, setup, layer)
    hole_depth.follow(scene, setup, hole if layer is not None else None)
    switch = setup.group.inputs[HIDE_BEHIND]
    value = 1.0 if scene.umbra.hide_behind else 0.0
    if not switch.is_linked and switch.default_value != value:
        switch.default_value = value


def remove(scene: bpy.types.Scene) -> None:
    """Take the depth pass away from the group; a pass that was switched on for it is off again."""
    setup = find_setup(scene)
    if setup is not None and DEPTH in setup.group.inputs:
        _link(scene, setup, None)
        hole_depth.follow(scene, setup, None)
    else:
        _give_passes_back(scene, None)


def layer_of(scene: bpy.types.Scene, setup: Setup) -> bpy.types.Node | None:
    """The Render Layers node whose picture goes into the group."""
    return background_layer(setup.group.inputs["Render"], render_layers(setup.tree, scene), set())


def is_in_use(scene: bpy.types.Scene) -> bool:
    """Whether what is behind the hole is hidden."""
    setup = find_setup(scene)
    socket = None if setup is None else setup.group.inputs.get(DEPTH)
    return bool(scene.umbra.hide_behind) and socket is not None and socket.is_linked


# --- the pass -------------------------------------------------------------------------------------


def _link(scene: bpy.types.Scene, setup: Setup, node: bpy.types.Node | None) -> None:
    """Link the depth of a render layer; a link from nodes of the artist's stays."""
    socket = setup.group.inputs[DEPTH]
    if any(link.from_node.type != "R_LAYERS" for link in socket.links):
        node = None
    if node is not None:
        view_layer = scene.view_layers.get(node.layer)
        if view_layer is not None and not view_layer.use_pass_z:
            view_layer.use_pass_z = True
            view_layer[PASS_ADDED] = True
    origin = None if node is None else node.outputs.get("Depth")
    for link in list(socket.links):
        if link.from_node.type == "R_LAYERS" and link.from_socket != origin:
            setup.tree.links.remove(link)
    if origin is not None and not socket.is_linked:
        setup.tree.links.new(origin, socket)
    _give_passes_back(scene, node)


def _give_passes_back(scene: bpy.types.Scene, used: bpy.types.Node | None) -> None:
    """Switch the passes off again that nobody uses now."""
    tree = find_tree(scene)
    layers = [] if tree is None else render_layers(tree, scene)
    for view_layer in scene.view_layers:
        if PASS_ADDED not in view_layer or (used is not None and used.layer == view_layer.name):
            continue
        sockets = [node.outputs.get("Depth") for node in layers if node.layer == view_layer.name]
        if not any(socket is not None and socket.is_linked for socket in sockets):
            view_layer.use_pass_z = False
        del view_layer[PASS_ADDED]
