# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects nearer than the hole, in front of the lensed picture: a second scene with the unbent camera, put over it.

A custom camera bends the rays of every view layer of its scene, so the plain camera needs a scene of its own. Objects
are shared: those of the collection "Umbra Foreground" are seen by the plain camera alone (to the lens they are
"indirect only": they still cast shadows and reflections), all others are indirect only there.
"""

import bpy

from ...core.errors import SceneError
from ...scene import cameras, frame_setup
from ...scene.camera_type import original_type
from .. import registry
from ..shared import tree_editing
from ..shared.compositor_tree import ROLE, find_node, find_tree, has_scene_tree
from . import lens_camera, lens_objects, lens_sync, lens_tree

COLLECTION_NAME, BACKGROUND_NAME = "Umbra Foreground", "Umbra Background"
LAYER, OVER = lens_tree.FOREGROUND_LAYER, lens_tree.FOREGROUND_OVER
# What an artist animates about a camera.
CAMERA_SETTINGS = (
    *("lens", "sensor_width", "sensor_height", "sensor_fit", "shift_x", "shift_y", "clip_start", "clip_end"),
)
DEPTH_OF_FIELD = (
    *("use_dof", "focus_object", "focus_subtarget", "focus_distance"),
    *("aperture_fstop", "aperture_blades", "aperture_rotation", "aperture_ratio"),
)


def can_set_up(scene: bpy.types.Scene) -> bool:
    """Return whether the scene's cameras bend their rays."""
    return registry.of(scene).identifier == "CYCLES_LENS"


def set_up(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[str]:
    """Put what is nearer than the hole in front, unlensed, or bring that up to date; return the names of new objects.

    Raises
    ------
    SceneError
        There is nothing nearer than the hole, or no camera.
    """
    nearer = lens_objects.place(
        scene, depsgraph, frame_setup.read(scene, depsgraph, False, lens_sync.LIVE_TRAITS)
    ).nearer
    settings = scene.umbra
    if settings.foreground is None and not nearer:
        raise SceneError(
            "No object reaches nearer to the camera than the hole, outside of the lens sphere: nothing to put in "
            "front.",
            code="lens.no-foreground",
        )
    if settings.foreground is None:
        settings.foreground = bpy.data.collections.new(COLLECTION_NAME)
    collection = settings.foreground
    if collection.name not in scene.collection.children:
        scene.collection.children.link(collection)
    added = [name for name in nearer if name not in collection.all_objects]
    for name in added:
        collection.objects.link(scene.objects[name])
    for layer in scene.view_layers:
        layer.layer_collection.children[collection.name].indirect_only = True
    second = refresh(scene)
    if second is not None:
        _compose(scene, second)
    return added


def refresh(scene: bpy.types.Scene) -> bpy.types.Scene | None:
    """Bring the foreground's scene, if there is to be one, up to date with the lens's: objects, camera, settings."""
    settings = scene.umbra
    if settings.foreground is None:
        return None
    second = settings.foreground_scene
    if second is None:
        second = scene.copy()
        second.name = f"{scene.name} Foreground"
        settings.foreground_scene = second
        _make_plain(second)
    _follow_camera(scene, second)
    _share_objects(scene, second, settings.foreground)
    for name in ("frame_start", "frame_end", "frame_step"):
        setattr(second, name, getattr(scene, name))
    second.cycles.samples = scene.cycles.samples
    second.cycles.device = scene.cycles.device
    return second


def remove(scene: bpy.types.Scene) -> None:
    """Take the foreground out again; the objects stay where they were besides."""
    settings = scene.umbra
    tree = find_tree(scene)
    if tree is not None:
        _take_out(scene, tree)
    second, collection = settings.foreground_scene, settings.foreground
    if second is not None:
        for child in list(second.collection.children):
            second.collection.children.unlink(child)
            if child != collection and child.users == 0:
                bpy.data.collections.remove(child)
        _remove_camera(second)
        bpy.data.scenes.remove(second)
    if collection is not None:
        bpy.data.collections.remove(collection)


def _make_plain(second: bpy.types.Scene) -> None:
    """Take out of a copied scene everything but its render settings."""
    root = second.collection
    for child in list(root.children):
        root.children.unlink(child)
    for each in list(root.objects):
        root.objects.unlink(each)
    second.timeline_markers.clear()
    for key in [key for key in second.keys() if key.startswith("umbra_")]:  # noqa: SIM118  it has no iterator
        del second[key]
    second.umbra.foreground = None
    second.umbra.foreground_scene = None
    second.umbra.active_hole = None
    second.render.film_transparent = True
    second.camera = None
    if has_scene_tree():
        second.use_nodes = False
    else:
        second.compositing_node_group = None
    second.umbra.output = registry.default().identifier  # it has no camera to restore, and no group


def _follow_camera(scene: bpy.types.Scene, second: bpy.types.Scene) -> None:
    """Give the second scene a camera that goes where the first one goes and sees what that saw before the lens."""
    camera = cameras.active_camera(scene)
    if second.camera is None:
        data = camera.data.copy()
        lens_camera.restore(data)
        data.animation_data_clear()
        data.name = f"{camera.data.name} Foreground"
        second.camera = bpy.data.objects.new(data.name, data)
        second.collection.objects.link(second.camera)
    if second.camera.parent != camera:
        second.camera.parent = camera
    copy_lens(second, camera.data)


def copy_lens(second: bpy.types.Scene, camera: bpy.types.Camera) -> None:
    """Carry what the (evaluated) camera of the lens says about its picture over to the plain one."""
    if second.camera is None:
        return
    plain = second.camera.data
    for owner, source, names in ((plain, camera, CAMERA_SETTINGS), (plain.dof, camera.dof, DEPTH_OF_FIELD)):
        for name in names:
            value = getattr(source, name)
            if getattr(owner, name) != value:
                setattr(owner, name, value)
    original = original_type(camera)
    if plain.type != original:
        plain.type = original


def _remove_camera(second: bpy.types.Scene) -> None:
    camera = second.camera
    if camera is not None:
        data = camera.data
        bpy.data.objects.remove(camera)
        if data.users == 0:
            bpy.data.cameras.remove(data)


def _share_objects(scene: bpy.types.Scene, second: bpy.types.Scene, front: bpy.types.Collection) -> None:
    root = second.collection
    if front.name not in root.children:
        root.children.link(front)
    back = next((child for child in root.children if child != front), None)
    if back is None:
        back = bpy.data.collections.new(BACKGROUND_NAME)
        root.children.link(back)
    wanted = {each.name for layer in scene.view_layers for each in layer.objects}
    wanted -= {each.name for each in front.all_objects} | {cameras.active_camera(scene).name}
    for each in [each for each in back.objects if each.name not in wanted]:
        back.objects.unlink(each)
    for name in sorted(wanted - {each.name for each in back.objects}):
        back.objects.link(scene.objects[name])
    for layer in second.view_layers:
        layer.layer_collection.children[back.name].indirect_only = True


# --- compositor -----------------------------------------------------------------------------------


def _compose(scene: bpy.types.Scene, second: bpy.types.Scene) -> None:
    """Put the second scene's picture over what the compositor gives out."""
    tree = lens_tree.claim(scene)
    output = tree_editing.output_node(tree)
    if output is None:
        raise SceneError(
            f'The compositor of scene "{scene.name}" has no output node: add one.', code="compositor.no-output"
        )
    layer, over = find_node(tree, LAYER), find_node(tree, OVER)
    if layer is None:
        layer = tree.nodes.new("CompositorNodeRLayers")
        layer[ROLE] = LAYER
        layer.label = "Unlensed Foreground"
        layer.location = (output.location.x - 500, output.location.y - 350)
    layer.scene = second
    if over is None:
        over = tree.nodes.new("CompositorNodeAlphaOver")
        over[ROLE] = OVER
        over.location = (output.location.x - 200, output.location.y)
    pictures = [each for each in over.inputs if each.type == "RGBA"]
    behind = over.inputs.get("Background") or pictures[0]
    front = next(each for each in pictures if each != behind)
    if not behind.is_linked:
        if output.inputs[0].is_linked:
            tree.links.new(output.inputs[0].links[0].from_socket, behind)
        else:
            layers = [node for node in tree.nodes if node.type == "R_LAYERS" and node != layer]
            picture = layers[0] if layers else tree.nodes.new("CompositorNodeRLayers")
            picture.scene = scene
            tree.links.new(picture.outputs["Image"], behind)
    tree.links.new(layer.outputs["Image"], front)
    tree.links.new(over.outputs[0], output.inputs[0])


def _take_out(scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> None:
    layer, over = find_node(tree, LAYER), find_node(tree, OVER)
    if over is not None:
        pictures = [each for each in over.inputs if each.type == "RGBA"]
        behind = over.inputs.get("Background") or pictures[0]
        for link in list(over.outputs[0].links):
            if behind.is_linked:
                tree.links.new(behind.links[0].from_socket, link.to_socket)
        tree.nodes.remove(over)
    if layer is not None:
        tree.nodes.remove(layer)
    lens_tree.release(scene)
