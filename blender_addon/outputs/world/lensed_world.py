# SPDX-License-Identifier: GPL-3.0-or-later
"""Put a lensed copy of a scene's World in its place, and the World itself back.

The artist's World is never touched, so that what comes back is exactly what was there. The copy keeps all of its
nodes: the group's Vector takes the place of Generated coordinates, and each Background's color passes by the group's
Tint and Fault.
"""

import bpy

from ...core.blender_version import NODES_ARE_OPTIONAL
from ...core.errors import SceneError
from ...nodes import world_group, world_nodes
from ...scene import environment, image_world

# On the scene: the World to put back; and that there is one to put back, which may have been none.
BEFORE, IS_BENT = environment.WORLD_BEFORE, "umbra_world_bent"
# On the lensed World: what it was made of, the image that reads its maps, and those that the preview's map is kept in.
LENSED, FILE_IMAGE = "umbra_lensed", "umbra_world_map"
LIVE_IMAGES = ("umbra_live_map_1", "umbra_live_map_2")
OF_IMAGE, OF_WORLD = "image", "world"

# Resolution of the map by which Cycles samples the World's light. Its own choice here is one that takes 12 seconds a
# frame to fill.
IMPORTANCE_RESOLUTION = 512

_NO_BACKGROUND = (
    'World "{}" has no Background node that could be bent: connect one to its output, or choose Sky: Image in the '
    "Umbra panel."
)

# Kinds of nodes that look in the ray's direction when their input Vector is not linked.
_LOOK_BY_THEMSELVES = ("TEX_ENVIRONMENT", "TEX_SKY")


def lensed_world(scene: bpy.types.Scene) -> bpy.types.World | None:
    """The scene's World if it is one of ours."""
    world = scene.world
    return world if world is not None and LENSED in world and group_node(world) is not None else None


def group_node(world: bpy.types.World | None) -> bpy.types.Node | None:
    """The node of the group in a World."""
    if world is None or world.node_tree is None:
        return None
    nodes = world.node_tree.nodes
    return next((node for node in nodes if node.type == "GROUP" and world_group.is_group(node.node_tree)), None)


def group_of(world: bpy.types.World | None) -> bpy.types.NodeTree | None:
    """The group in a World."""
    node = group_node(world)
    return None if node is None else node.node_tree


def check(scene: bpy.types.Scene) -> None:
    """Refuse a scene that has no sky that could be lensed.

    Raises
    ------
    SceneError
        If `install` would fail.
    """
    if lensed_world(scene) is not None:
        return
    if scene.umbra.environment_source == "IMAGE":
        environment.chosen_image(scene)
        return
    world = scene.world
    if world is None:
        raise SceneError(
            f'Scene "{scene.name}" has no World: add one, or choose Sky: Image in the Umbra panel.', code="sky.no-world"
        )
    uses_nodes = not NODES_ARE_OPTIONAL or world.use_nodes
    if uses_nodes and not any(node.type == "BACKGROUND" for node in world.node_tree.nodes):
        raise SceneError(_NO_BACKGROUND.format(world.name), code="sky.no-background")


def install(scene: bpy.types.Scene) -> bpy.types.Node:
    """Give the scene a lensed World, unless it has one; return the group's node.

    Raises
    ------
    SceneError
        The scene has no sky that could be lensed.
    """
    present = group_node(lensed_world(scene))
    if present is not None:
        return present
    forget(scene)
    of_image = scene.umbra.environment_source == "IMAGE"
    made = _world_of_image(scene) if of_image else _copy_of_world(scene)
    made[LENSED] = OF_IMAGE if of_image else OF_WORLD
    sampling = getattr(made, "cycles", None)  # none where the add-on Cycles is switched off
    if sampling is not None and sampling.sampling_method == "AUTOMATIC":
        sampling.sampling_method = "MANUAL"
        sampling.sample_map_resolution = IMPORTANCE_RESOLUTION
    try:
        node = _insert(made)
    except SceneError:
        _delete(made)
        raise
    if scene.world is not None:
        scene[BEFORE] = scene.world
    scene[IS_BENT] = True
    scene.world = made
    return node


def place(scene: bpy.types.Scene, rotation: tuple[float, ...], strength: float) -> None:
    """Turn and brighten the image that a lensed World shows, if it was made of one."""
    world = lensed_world(scene)
    if world is not None and world[LENSED] == OF_IMAGE:
        sockets = image_world.placement(world)
        sockets["Rotation"].default_value = rotation
        sockets["Strength"].default_value = strength


def placement(scene: bpy.types.Scene) -> dict[str, object]:
    """Rotation and strength of the image that a lensed World shows, none if it was not made of one."""
    world = lensed_world(scene)
    if world is None or world[LENSED] != OF_IMAGE:
        return {}
    values = {name: socket.default_value for name, socket in image_world.placement(world).items()}
    return {name: value if isinstance(value, float) else tuple(value) for name, value in values.items()}


def remove(scene: bpy.types.Scene) -> None:
    """Put back the World that was there; one that was chosen by hand since then stays."""
    ours = lensed_world(scene)
    if ours is not None:
        scene.world = scene.get(BEFORE)
        if ours.users == 0:
            _delete(ours)
    forget(scene)


def forget(scene: bpy.types.Scene) -> None:
    """Drop what is remembered."""
    for key in (BEFORE, IS_BENT):
        if key in scene:
            del scene[key]


def _delete(world: bpy.types.World) -> None:
    node = group_node(world)
    group = None if node is None else node.node_tree
    images = {image for image in map(world.get, (FILE_IMAGE, *LIVE_IMAGES)) if image is not None}
    bpy.data.worlds.remove(world)
    if group is None or group.users > 0:
        return
    images.update(each.image for each in world_nodes.map_nodes(group) if each.image is not None)
    bpy.data.node_groups.remove(group)
    for image in images:
        if image.users == 0:
            bpy.data.images.remove(image)


def _copy_of_world(scene: bpy.types.Scene) -> bpy.types.World:
    world = scene.world
    if world is None:
        raise SceneError(
            f'Scene "{scene.name}" has no World: add one, or choose Sky: Image in the Umbra panel.', code="sky.no-world"
        )
    made = world.copy()
    made.name = f"{world.name} (lensed)"
    if NODES_ARE_OPTIONAL and not made.use_nodes:
        made.use_nodes = True
        made.node_tree.nodes.clear()
        background = made.node_tree.nodes.new("ShaderNodeBackground")
        background.inputs["Color"].default_value = (*world.color, 1.0)
        output = made.node_tree.nodes.new("ShaderNodeOutputWorld")
        made.node_tree.links.new(background.outputs[0], output.inputs["Surface"])
    return made


def _world_of_image(scene: bpy.types.Scene) -> bpy.types.World:
    """A World that shows the image chosen as the sky."""
    image = environment.chosen_image(scene)
    return image_world.make(f"{image.name} (lensed)", image)


def _insert(world: bpy.types.World) -> bpy.types.Node:
    """Put the group into a World's nodes."""
    tree = world.node_tree
    backgrounds = [node for node in tree.nodes if node.type == "BACKGROUND"]
    if not backgrounds:
        raise SceneError(_NO_BACKGROUND.format(world.name.removesuffix(" (lensed)")), code="sky.no-background")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = world_group.new_group()
    node.name = node.label = world_group.GROUP_NAME
    node.width = 220.0
    node.location = (min(each.location.x for each in tree.nodes) - 320.0, 0.0)
    vector = node.outputs[world_group.VECTOR.name]
    for link in [each for each in tree.links if each.from_node.type == "TEX_COORD"]:
        if link.from_socket.name == "Generated":
            tree.links.new(vector, link.to_socket)
    for each in tree.nodes:
        if each.type in _LOOK_BY_THEMSELVES and "Vector" in each.inputs and not each.inputs["Vector"].is_linked:
            tree.links.new(vector, each.inputs["Vector"])
    for background in backgrounds:
        _tint(tree, background, node)
    return node


def _tint(tree: bpy.types.NodeTree, background: bpy.types.Node, group: bpy.types.Node) -> None:
    """Let a Background's color pass by the group's Tint and Fault."""
    color = background.inputs["Color"]
    tint = tree.nodes.new("ShaderNodeVectorMath")
    tint.operation = "MULTIPLY_ADD"
    tint.name = tint.label = "Umbra Tint"
    tint.location = (background.location.x - 60.0, background.location.y - 180.0)
    if color.is_linked:
        tree.links.new(color.links[0].from_socket, tint.inputs[0])
    else:
        tint.inputs[0].default_value = tuple(color.default_value)[:3]
    tree.links.new(group.outputs[world_group.TINT.name], tint.inputs[1])
    tree.links.new(group.outputs[world_group.FAULT.name], tint.inputs[2])
    tree.links.new(tint.outputs["Vector"], color)
