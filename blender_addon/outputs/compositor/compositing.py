# SPDX-License-Identifier: GPL-3.0-or-later
"""Put the node group into a scene's compositor, and take it out again.

The artist's own nodes stay as they are: whatever the render layer's picture fed before is fed by the group.
What must be known to undo that lies in custom properties, so that it is saved with the file.
"""

import contextlib

import bpy

from ...core.errors import SceneError
from ...nodes import black_hole_group
from ...settings.scene_properties import glare_of, looks_of
from ..shared import disk_sync
from ..shared.compositor_tree import (
    GROUP,
    MAP,
    RENDER_LAYER,
    ROLE,
    SKY,
    find_node,
    find_nodes,
    find_setup,
    find_tree,
    has_scene_tree,
    render_layers,
)
from ..shared.map_images import drop_live
from ..shared.tree_editing import (
    OUTPUT_LINK,
    add_render_layer,
    background_layer,
    check_shared,
    give_back,
    leads_to_picture,
    make_tree,
    output_node,
    remove_tree,
)
from . import depth, sky_filter, stars
from .compositor_sync import refresh

BEFORE = "umbra_before"

# Settings that the set-up changes, and their new values.
_RENDER_SETTINGS = {
    "film_transparent": True,  # the sky is put behind the render by the group
    "use_compositing": True,
    "compositor_precision": "FULL",  # half floats would move the sky by texels
    # maps are baked by handlers while rendering; the viewport must not read the scene meanwhile
    "use_lock_interface": True,
}


def _remember(scene: bpy.types.Scene, *, tree_is_new: bool) -> None:
    """Keep what is about to change; a second run must not take its own changes for the artist's."""
    if BEFORE in scene:
        return
    render = scene.render
    before: dict[str, object] = {name: getattr(render, name) for name in _RENDER_SETTINGS}
    before["tree_is_new"] = tree_is_new
    if has_scene_tree():
        before["use_nodes"] = scene.use_nodes
    if bpy.app.background and hasattr(render, "compositor_device"):
        before["compositor_device"] = render.compositor_device
    scene[BEFORE] = before


def _apply_settings(scene: bpy.types.Scene) -> None:
    for name, value in _RENDER_SETTINGS.items():
        setattr(scene.render, name, value)
    # Without a display there is usually no OpenGL either, and then Blender's GPU compositor ends the process.
    if bpy.app.background and hasattr(scene.render, "compositor_device"):
        scene.render.compositor_device = "CPU"


def set_up(scene: bpy.types.Scene) -> list[str]:
    """Put the group behind the scene's render, or bring an existing set-up up to date.

    Returns
    -------
    list of str
        What the artist should know: sentences, none if all is plain.

    Raises
    ------
    SceneError
        The scene's compositor tree cannot be changed.
    """
    notes: list[str] = []
    tree = find_tree(scene)
    if tree is not None:
        check_shared(scene, tree)
    if has_scene_tree() and tree is not None and not scene.use_nodes and BEFORE not in scene:
        notes.append("Use Nodes was off: it has been switched on, with the nodes that were there.")
    _remember(scene, tree_is_new=tree is None)
    if tree is None:
        tree = make_tree(scene)
    elif has_scene_tree():
        scene.use_nodes = True
    _apply_settings(scene)

    group = find_node(tree, GROUP)
    if group is None:
        group = tree.nodes.new("CompositorNodeGroup")
        group[ROLE] = GROUP
        group.width = 220
    black_hole_group.use(group, looks_of(scene.umbra), glare_of(scene.umbra))
    group.name = group.label = black_hole_group.GROUP_NAME
    _insert(scene, tree, group, notes)
    refresh(scene, notes)
    return notes


def _insert(scene: bpy.types.Scene, tree: bpy.types.NodeTree, group: bpy.types.Node, notes: list[str]) -> None:
    """Link the group in behind the render, unless it is."""
    map_node = find_node(tree, MAP)
    if map_node is None:
        map_node = _add_image_node(tree, MAP, "Warp Map", group)
    sky_node = find_node(tree, SKY)
    if sky_node is None:
        sky_node = _add_image_node(tree, SKY, "Sky", group)
    _link(tree, map_node.outputs["Image"], group.inputs["Warp Map"])
    if not group.inputs["Environment"].is_linked:  # the artist may have a sky of other nodes there
        _link(tree, sky_node.outputs["Image"], group.inputs["Environment"])

    if not group.inputs["Render"].is_linked:
        output = output_node(tree)
        layers = render_layers(tree, scene)
        layer = background_layer(output.inputs[0], layers, set()) if output is not None else None
        if layer is None:
            layer = layers[0] if layers else add_render_layer(tree, scene)
        if len(layers) > 1:
            notes.append(f'The sky was put behind render layer "{layer.layer}", the one farthest back.')
        picture = layer.outputs["Image"]
        fed = [link.to_socket for link in picture.links if leads_to_picture(link.to_node)]
        group.location = (layer.location.x + 300, layer.location.y)
        _link(tree, picture, group.inputs["Render"])
        for socket in fed:
            _link(tree, group.outputs["Image"], socket)
        map_node.location = (group.location.x - 300, group.location.y - 420)
        sky_node.location = (group.location.x - 300, group.location.y - 760)
        if output is not None and not output.inputs[0].is_linked:
            _link(tree, group.outputs["Image"], output.inputs[0])
            group[OUTPUT_LINK] = True
    if not any(each.is_linked for each in group.outputs):
        notes.append(
            "The compositor's output does not use the render: connect the Image output of the Umbra Black "
            "Hole node where the picture belongs."
        )


def _add_image_node(tree: bpy.types.NodeTree, role: str, label: str, group: bpy.types.Node) -> bpy.types.Node:
    node = tree.nodes.new("CompositorNodeImage")
    node[ROLE] = role
    node.name = f"Umbra {label}"
    node.label = label
    node.location = (group.location.x - 300, group.location.y - (420 if role == MAP else 760))
    return node


def _link(tree: bpy.types.NodeTree, origin: bpy.types.NodeSocket, target: bpy.types.NodeSocket) -> None:
    if not any(link.from_socket == origin for link in target.links):
        tree.links.new(origin, target)


# --- removing -------------------------------------------------------------------------------------


def remove(scene: bpy.types.Scene) -> None:
    """Take the set-up out of the compositor: links and settings are as they were before it.

    Raises
    ------
    SceneError
        There is none.
    """
    tree = find_tree(scene)
    ours = [node for node in tree.nodes if node.get(ROLE)] if tree is not None else []
    if not ours and BEFORE not in scene:
        raise SceneError(
            f'The compositor of scene "{scene.name}" contains no black hole: there is nothing to remove.',
            code="compositor.no-hole",
        )
    kept = scene.get(BEFORE)
    before = kept.to_dict() if hasattr(kept, "to_dict") else {}
    if tree is not None:
        tree_is_new = bool(before.get("tree_is_new"))
        _unlink(scene, tree, tree_is_new=tree_is_new)
        if tree_is_new and all(node.get(ROLE) for node in tree.nodes):
            remove_tree(scene, tree)
        else:
            for node in tree.nodes:  # what remains is the artist's own from now on
                if ROLE in node:
                    del node[ROLE]
    if has_scene_tree() and "use_nodes" in before:
        scene.use_nodes = bool(before["use_nodes"])
    for name in (*_RENDER_SETTINGS, "compositor_device"):
        if name in before:
            _restore(scene.render, name, before[name])
    if BEFORE in scene:
        del scene[BEFORE]


def film_before(scene: bpy.types.Scene) -> bool:
    """Whether the film was transparent before the set-up."""
    kept = scene.get(BEFORE)
    before = kept.to_dict() if hasattr(kept, "to_dict") else {}
    return bool(before.get("film_transparent", False))


def _restore(render: bpy.types.RenderSettings, name: str, value: object) -> None:
    """Set a setting back, unless what was kept of it has been overwritten with something else since."""
    is_text = isinstance(getattr(render, name), str)
    with contextlib.suppress(TypeError):  # text that is none of the setting's choices
        if isinstance(value, str) == is_text:
            setattr(render, name, value if is_text else bool(value))


def _unlink(scene: bpy.types.Scene, tree: bpy.types.NodeTree, *, tree_is_new: bool) -> None:
    """Give the render's picture back to whatever the group's feeds, and remove our nodes."""
    setup = find_setup(scene)
    if setup is not None:
        disk_sync.remove(tree)
        sky_filter.remove(tree)
        stars.remove(tree)
    depth.remove(scene)
    for group in find_nodes(tree, GROUP):
        give_back(tree, group, "Render")
        prefix = group.path_from_id() + "."
        if tree.animation_data is not None:
            for curve in [each for each in tree.animation_data.drivers if each.data_path.startswith(prefix)]:
                tree.animation_data.drivers.remove(curve)
        tree.nodes.remove(group)
    black_hole_group.remove_unused()
    maps, skies = find_nodes(tree, MAP), find_nodes(tree, SKY)
    for node in maps:
        drop_live(node)
    images = {node.image for node in maps if node.image is not None}
    for node in maps + skies:
        tree.nodes.remove(node)
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)
    layer = find_node(tree, RENDER_LAYER)
    if layer is not None and not tree_is_new and not any(each.is_linked for each in layer.outputs):
        tree.nodes.remove(layer)
