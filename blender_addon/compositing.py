# SPDX-License-Identifier: GPL-3.0-or-later
"""Put the node group into a scene's compositor, keep it up to date, and take it out again.

The artist's own nodes stay as they are: whatever the render layer's picture fed before is fed by the group, and
what must be known to undo that lies in custom properties, so that it is saved with the file.
"""

from dataclasses import dataclass

import bpy

from . import environment, maps, node_group, shot
from .errors import SceneError

ROLE = "umbra_role"
BEFORE = "umbra_before"
OUTPUT_LINK = "umbra_output_link"  # on the group's node: the compositor's output was not connected before
GROUP, MAP, SKY, RENDER_LAYER, OUTPUT = "group", "map", "sky", "render_layer", "output"

MAP_IMAGE_NAME = "Umbra Warp Map"
# A file that never exists: a frame without a valid map is magenta instead of showing some older map.
NO_MAP = "no_warp_map_0001.exr"

ROTATION_SOCKET, STRENGTH_SOCKET = "Environment Rotation", "Environment Strength"

# Settings that the set-up changes, and their new values.
_RENDER_SETTINGS = {
    "film_transparent": True,  # the sky is put behind the render by the group
    "use_compositing": True,
    "compositor_precision": "FULL",  # half floats would move the sky by texels
    # maps are baked by handlers while rendering; the viewport must not read the scene meanwhile
    "use_lock_interface": True,
}


@dataclass(frozen=True)
class Setup:
    """The nodes of a scene's set-up."""

    tree: bpy.types.NodeTree
    group: bpy.types.Node
    map: bpy.types.Node | None
    sky: bpy.types.Node | None


# --- finding --------------------------------------------------------------------------------------


def _has_scene_tree() -> bool:
    """Whether this Blender keeps the compositor's tree inside the scene (before 5.0)."""
    return bpy.app.version < (5, 0)


def find_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """The scene's compositor tree, if it has one."""
    return scene.node_tree if _has_scene_tree() else scene.compositing_node_group


def _find(tree: bpy.types.NodeTree, role: str) -> bpy.types.Node | None:
    return next((node for node in tree.nodes if node.get(ROLE) == role), None)


def find_setup(scene: bpy.types.Scene) -> Setup | None:
    """The nodes of the set-up; None where the group is not in the scene's compositor."""
    tree = find_tree(scene)
    if tree is None:
        return None
    group = _find(tree, GROUP)
    if group is None:
        return None
    return Setup(tree, group, _find(tree, MAP), _find(tree, SKY))


def is_in_use(scene: bpy.types.Scene) -> bool:
    """Whether rendering the scene runs the group."""
    if not scene.render.use_compositing or (_has_scene_tree() and not scene.use_nodes):
        return False
    setup = find_setup(scene)
    return setup is not None and not setup.group.mute and any(each.is_linked for each in setup.group.outputs)


def _render_layers(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> list[bpy.types.Node]:
    return [node for node in tree.nodes if node.type == "R_LAYERS" and node.scene in (None, scene)]


def _output_node(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    kind = "COMPOSITE" if _has_scene_tree() else "GROUP_OUTPUT"
    outputs = [node for node in tree.nodes if node.type == kind]
    if not _has_scene_tree():
        outputs.sort(key=lambda node: not node.is_active_output)
    return outputs[0] if outputs else None


def _background_layer(
    socket: bpy.types.NodeSocket, layers: list[bpy.types.Node], seen: set[str]
) -> bpy.types.Node | None:
    """The render layer that lies farthest back in what feeds a socket: the one the sky belongs behind."""
    for link in socket.links:
        node = link.from_node
        if node in layers:
            return node
        if node.name in seen:
            continue
        seen.add(node.name)
        inputs = [each for each in node.inputs if each.is_linked]
        if node.type == "ALPHAOVER":
            # its first picture is the one behind, called Background in newer versions
            pictures = [each for each in node.inputs if each.type == "RGBA"]
            behind = node.inputs.get("Background") or pictures[0]
            inputs.sort(key=lambda each: each != behind)
        else:
            inputs.sort(key=lambda each: each.type != "RGBA")
        for each in inputs:
            found = _background_layer(each, layers, seen)
            if found is not None:
                return found
    return None


# --- setting up -----------------------------------------------------------------------------------


def _remember(scene: bpy.types.Scene, *, tree_is_new: bool) -> None:
    """Keep what the set-up is about to change; a second run must not take its own changes for the artist's."""
    if BEFORE in scene:
        return
    render = scene.render
    before: dict[str, object] = {name: getattr(render, name) for name in _RENDER_SETTINGS}
    before["tree_is_new"] = tree_is_new
    if _has_scene_tree():
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


def _make_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """A compositor tree that passes the render on, for a scene that has none."""
    if _has_scene_tree():
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    else:
        tree = bpy.data.node_groups.new("Compositor Nodes", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        output = tree.nodes.new("NodeGroupOutput")
    output[ROLE] = OUTPUT
    output.location = (500, 0)
    _add_render_layer(tree, scene)
    return tree


def _add_render_layer(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> bpy.types.Node:
    layer = tree.nodes.new("CompositorNodeRLayers")
    layer.scene = scene
    layer[ROLE] = RENDER_LAYER
    layer.location = (-400, 0)
    return layer


def _check_shared(scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> None:
    if _has_scene_tree():
        return
    if tree.library is not None:
        raise SceneError(
            f'The compositor tree "{tree.name}" is linked from another file: make it local first.'
        )
    others = [each.name for each in bpy.data.scenes if each != scene and each.compositing_node_group == tree]
    if others:
        raise SceneError(
            f'The compositor tree "{tree.name}" also belongs to scene "{others[0]}", which has no part in this black '
            "hole: make it single-user in the Compositor first."
        )


def _map_image() -> bpy.types.Image:
    image = bpy.data.images.new(MAP_IMAGE_NAME, 1, 1, float_buffer=True)
    image.source = "SEQUENCE"
    image.filepath = NO_MAP
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "CHANNEL_PACKED"  # alpha is the visibility, not a mask of the other channels
    return image


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
        _check_shared(scene, tree)
    if _has_scene_tree() and tree is not None and not scene.use_nodes and BEFORE not in scene:
        notes.append("Use Nodes was off: it has been switched on, with the nodes that were there.")
    _remember(scene, tree_is_new=tree is None)
    if tree is None:
        tree = _make_tree(scene)
    elif _has_scene_tree():
        scene.use_nodes = True
    _apply_settings(scene)

    group = _find(tree, GROUP)
    if group is None:
        group = tree.nodes.new("CompositorNodeGroup")
        group[ROLE] = GROUP
        group.width = 220
    if group.node_tree is None or group.node_tree != node_group.ensure_group():
        group.node_tree = node_group.ensure_group()
    group.name = group.label = node_group.GROUP_NAME
    _insert(scene, tree, group, notes)
    refresh(scene, notes)
    return notes


def _insert(
    scene: bpy.types.Scene, tree: bpy.types.NodeTree, group: bpy.types.Node, notes: list[str]
) -> None:
    """Link the group in behind the render, unless it is."""
    map_node = _find(tree, MAP)
    if map_node is None:
        map_node = _add_image_node(tree, MAP, "Warp Map", group)
    sky_node = _find(tree, SKY)
    if sky_node is None:
        sky_node = _add_image_node(tree, SKY, "Sky", group)
    _link(tree, map_node.outputs["Image"], group.inputs["Warp Map"])
    _link(tree, sky_node.outputs["Image"], group.inputs["Environment"])

    if not group.inputs["Render"].is_linked:
        output = _output_node(tree)
        layers = _render_layers(tree, scene)
        layer = _background_layer(output.inputs[0], layers, set()) if output is not None else None
        if layer is None:
            layer = layers[0] if layers else _add_render_layer(tree, scene)
        if len(layers) > 1:
            notes.append(f'The sky was put behind render layer "{layer.layer}", the one farthest back.')
        picture = layer.outputs["Image"]
        fed = [link.to_socket for link in picture.links]
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
            "The compositor's output does not use the render: connect the Image output of the Umbra Black Hole node "
            "where the picture belongs."
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


# --- keeping up to date ---------------------------------------------------------------------------


def refresh(scene: bpy.types.Scene, notes: list[str] | None = None) -> None:
    """Carry the scene's settings into an existing set-up: which maps, which sky. Failures become notes."""
    setup = find_setup(scene)
    if setup is None:
        return
    try:
        point_at_maps(scene)
    except SceneError as error:
        if notes is not None:
            notes.append(str(error))
    try:
        sync_sky(scene)
    except SceneError as error:
        if notes is not None:
            notes.append(str(error))


def point_at_maps(scene: bpy.types.Scene) -> None:
    """Let the map node read the scene's maps of the current resolution.

    Raises
    ------
    SceneError
        There is no hole.
    """
    hole = shot.active_hole(scene)
    samples = int(scene.umbra.supersampling)
    width, height = shot.render_size(scene.render)
    size = (width * samples, height * samples)
    _set_map_path(scene, maps.blender_map_path(scene, hole.name, size, 1))


def point_at_nothing(scene: bpy.types.Scene) -> None:
    """Let the map node read no map at all: the picture is magenta until a valid map is in place."""
    _set_map_path(scene, maps.folder(scene).blender_path + NO_MAP)


def _set_map_path(scene: bpy.types.Scene, path: str) -> None:
    setup = find_setup(scene)
    if setup is None or setup.map is None:
        return
    node = setup.map
    if node.image is None or node.image.source != "SEQUENCE":
        node.image = _map_image()
    wanted = {
        # together these read file `frame % SEQUENCE_LENGTH` at every frame, before zero too; see maps.py
        "frame_duration": maps.SEQUENCE_LENGTH,
        "frame_start": 0,
        "frame_offset": -1,
        "use_cyclic": True,
        "use_auto_refresh": True,
    }
    for name, value in wanted.items():
        if getattr(node, name) != value:
            setattr(node, name, value)
    if node.image.filepath != path:
        node.image.filepath = path


def forget_loaded_map(scene: bpy.types.Scene) -> None:
    """Let Blender read the maps anew from their files."""
    setup = find_setup(scene)
    if setup is not None and setup.map is not None and setup.map.image is not None:
        setup.map.image.reload()


def sync_sky(scene: bpy.types.Scene) -> None:
    """Bring image, rotation and strength of the sky into the set-up.

    A World's rotation and strength are followed by drivers, so that they stay in step when they are animated, and
    in a Blender that lacks this add-on.

    Raises
    ------
    SceneError
        There is no sky, or it cannot be read.
    """
    setup = find_setup(scene)
    if setup is None or setup.sky is None:
        return
    sky = environment.read(scene)
    if setup.sky.image != sky.image:
        setup.sky.image = sky.image
    if sky.texture is not None and sky.image.source in {"SEQUENCE", "MOVIE"}:
        user = sky.texture.image_user
        for name in ("frame_duration", "frame_start", "frame_offset", "use_cyclic", "use_auto_refresh"):
            setattr(setup.sky, name, getattr(user, name))
    environment.check_image(sky.image)
    from_world = scene.umbra.environment_source == "WORLD"
    _follow(scene, setup, ROTATION_SOCKET, sky.rotation_path, sky.rotation, fixed=from_world)
    _follow(scene, setup, STRENGTH_SOCKET, sky.strength_path, sky.strength, fixed=from_world)


def _follow(
    scene: bpy.types.Scene,
    setup: Setup,
    socket_name: str,
    path: str | None,
    value: "float | tuple[float, float, float]",
    *,
    fixed: bool,
) -> None:
    """Drive a socket of the group by a World's value; without a path, write the value once if it is `fixed`."""
    socket = setup.group.inputs[socket_name]
    is_vector = not isinstance(value, float)
    socket_path = socket.path_from_id("default_value")
    animation = setup.tree.animation_data
    present = [each for each in animation.drivers if each.data_path == socket_path] if animation else []
    if path is None:
        for each in present:
            animation.drivers.remove(each)
        if fixed:
            socket.default_value = value
        elif present:  # the World's values are not those of a picture chosen by hand
            socket.default_value = (0.0, 0.0, 0.0) if is_vector else 1.0
        return
    wanted = [f"{path}[{index}]" for index in range(3)] if is_vector else [path]
    if [
        _driven_by(each, scene.world) for each in sorted(present, key=lambda each: each.array_index)
    ] == wanted:
        return
    for each in present:
        animation.drivers.remove(each)
    for index, data_path in enumerate(wanted):
        driver = socket.driver_add("default_value", *([index] if is_vector else [])).driver
        driver.type = "SUM"
        variable = driver.variables.new()
        target = variable.targets[0]
        target.id_type = "WORLD"
        target.id = scene.world
        target.data_path = data_path
    socket.default_value = value


def _driven_by(curve: bpy.types.FCurve, world: bpy.types.World) -> str | None:
    variables = curve.driver.variables
    if len(variables) != 1 or variables[0].targets[0].id != world or not curve.driver.is_valid:
        return None
    return variables[0].targets[0].data_path


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
            f'The compositor of scene "{scene.name}" contains no black hole: there is nothing to remove.'
        )
    before = dict(scene[BEFORE]) if BEFORE in scene else {}
    if tree is not None:
        tree_is_new = bool(before.get("tree_is_new"))
        _unlink(tree, tree_is_new=tree_is_new)
        if tree_is_new and all(node.get(ROLE) for node in tree.nodes):
            _remove_tree(scene, tree)
        else:
            for node in tree.nodes:  # what remains is the artist's own from now on
                if ROLE in node:
                    del node[ROLE]
    if _has_scene_tree() and "use_nodes" in before:
        scene.use_nodes = bool(before["use_nodes"])
    for name in (*_RENDER_SETTINGS, "compositor_device"):
        if name in before:
            value = before[name]
            setattr(scene.render, name, value if isinstance(value, str) else bool(value))
    if BEFORE in scene:
        del scene[BEFORE]


def _unlink(tree: bpy.types.NodeTree, *, tree_is_new: bool) -> None:
    """Give the render's picture back to whatever the group's feeds, and remove our nodes."""
    group = _find(tree, GROUP)
    if group is not None:
        _give_back(tree, group)
        prefix = group.path_from_id() + "."
        if tree.animation_data is not None:
            for curve in [each for each in tree.animation_data.drivers if each.data_path.startswith(prefix)]:
                tree.animation_data.drivers.remove(curve)
        inner = group.node_tree
        tree.nodes.remove(group)
        if inner is not None and inner.users == 0:
            bpy.data.node_groups.remove(inner)
    for role in (MAP, SKY):
        node = _find(tree, role)
        if node is None:
            continue
        image = node.image
        tree.nodes.remove(node)
        if role == MAP and image is not None and image.users == 0:
            bpy.data.images.remove(image)
    layer = _find(tree, RENDER_LAYER)
    if layer is not None and not tree_is_new and not any(each.is_linked for each in layer.outputs):
        tree.nodes.remove(layer)


def _give_back(tree: bpy.types.NodeTree, group: bpy.types.Node) -> None:
    """Link what the group feeds to the render layer, except what was not linked at all before."""
    if not group.inputs["Render"].is_linked:
        return
    picture = group.inputs["Render"].links[0].from_socket
    output = _output_node(tree)
    for link in list(group.outputs["Image"].links):
        if group.get(OUTPUT_LINK) and output is not None and link.to_socket == output.inputs[0]:
            continue
        tree.links.new(picture, link.to_socket)


def _remove_tree(scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> None:
    """Remove a tree that the set-up made and nobody added to."""
    if _has_scene_tree():
        for node in tree.nodes:  # the tree itself is part of the scene and cannot go
            del node[ROLE]
    else:
        scene.compositing_node_group = None
        bpy.data.node_groups.remove(tree)
