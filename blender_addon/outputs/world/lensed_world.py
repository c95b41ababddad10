# SPDX-License-Identifier: GPL-3.0-or-later
"""Put a lensed copy of a scene's World in its place, and the World itself back.

The artist's World is never touched, so that what comes back is exactly what was there. The copy keeps all of its
nodes: the group's Vector takes the place of Generated coordinates, and the color of each Background or Emission passes
by the group "Umbra World Tint" (`tinting`).
"""

from dataclasses import dataclass
from typing import Any

import bpy

from ...core.blender_version import NODES_ARE_OPTIONAL
from ...core.errors import SceneError
from ...nodes import world_disk, world_group, world_nodes
from ...scene.sky import environment, image_world
from ...scene.sky.node_paths import SHINING
from . import tinting
from .world_images import DISKS, MAPS

# On the scene: the World to put back; and that there is one to put back, which may have been none.
BEFORE, IS_BENT = environment.WORLD_BEFORE, "umbra_world_bent"
# On the lensed World: what it was made of.
LENSED = "umbra_lensed"
OF_IMAGE, OF_WORLD = "image", "world"

# Resolution of the map by which Cycles samples the World's light. Its own choice here is one that takes 12 seconds a
# frame to fill.
IMPORTANCE_RESOLUTION = 512

_NO_BACKGROUND = (
    'World "{}" has no Background or Emission node that could be bent: connect one to its output, or choose Sky: Image '
    "in the Umbra panel."
)

# Kinds of nodes that look in the ray's direction when their input Vector is not linked.
_LOOK_BY_THEMSELVES = frozenset(
    (
        *("TEX_ENVIRONMENT", "TEX_SKY", "TEX_NOISE", "TEX_VORONOI", "TEX_GRADIENT", "TEX_MAGIC", "TEX_WAVE"),
        *("TEX_CHECKER", "TEX_BRICK", "TEX_GABOR"),
    )
)

# Outputs, by the node's kind, that give the ray's direction, and those that give the opposite one.
_ALONG = {"TEX_COORD": {"Generated", "Object"}, "NEW_GEOMETRY": {"Position"}}
_AGAINST = {"TEX_COORD": {"Normal", "Reflection"}, "NEW_GEOMETRY": {"Normal", "True Normal", "Incoming"}}

# On the copy of a group inside of the World: that it is one.
_COPY = "umbra_lensed_group"


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
    if uses_nodes and not any(node.type in SHINING for node in _all_nodes(world.node_tree)):
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
    images = {image for image in map(world.get, (*MAPS.keys, *DISKS.keys)) if image is not None}
    disks = [
        each.node_tree for each in world.node_tree.nodes if each.type == "GROUP" and world_disk.is_group(each.node_tree)
    ]
    copies = [each for each in _inner_trees(world.node_tree) if _COPY in each]
    bpy.data.worlds.remove(world)
    for each in copies:  # outer ones come first
        if each.users == 0:
            bpy.data.node_groups.remove(each)
    tinting.remove_unused()
    for disk in disks:
        if disk is not None and disk.users == 0:
            bpy.data.node_groups.remove(disk)
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


def _inner_trees(tree: bpy.types.NodeTree) -> list[bpy.types.NodeTree]:
    """The groups in a tree, those in groups after the ones that they are in."""
    found: list[bpy.types.NodeTree] = []
    waiting = [tree]
    while waiting:
        for node in waiting.pop(0).nodes:
            inner = node.node_tree if node.type == "GROUP" else None
            if (
                inner is not None
                and inner not in found
                and not (world_group.is_group(inner) or tinting.is_group(inner) or world_disk.is_group(inner))
            ):
                found.append(inner)
                waiting.append(inner)
    return found


def _all_nodes(tree: bpy.types.NodeTree) -> list[Any]:
    return [node for each in (tree, *_inner_trees(tree)) for node in each.nodes]


@dataclass(frozen=True)
class _Sources:
    """The group's results, as sockets in one tree."""

    vector: bpy.types.NodeSocket
    shift: bpy.types.NodeSocket
    light: bpy.types.NodeSocket


def _insert(world: bpy.types.World) -> bpy.types.Node:
    """Put the group into a World's nodes."""
    tree = world.node_tree
    if not any(node.type in SHINING for node in _all_nodes(tree)):
        raise SceneError(_NO_BACKGROUND.format(world.name.removesuffix(" (lensed)")), code="sky.no-background")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = world_group.new_group()
    node.name = node.label = world_group.GROUP_NAME
    node.width = 220.0
    node.location = (min(each.location.x for each in tree.nodes) - 320.0, 0.0)
    outputs = [node.outputs[each.name] for each in (world_group.VECTOR, world_group.SHIFT, world_group.LIGHT)]
    _bend(tree, _Sources(*outputs), {node.name})
    return node


def _bend(tree: bpy.types.NodeTree, sources: _Sources, ours: set[str]) -> None:
    """Let the nodes of a tree look along bent rays, and those of the groups in it."""
    nodes = [node for node in tree.nodes if node.name not in ours]
    _bend_coordinates(tree, nodes, sources.vector)
    for node in nodes:
        if node.type in _LOOK_BY_THEMSELVES and "Vector" in node.inputs and not node.inputs["Vector"].is_linked:
            tree.links.new(sources.vector, node.inputs["Vector"])
        elif node.type in SHINING:
            tinting.add(tree, node, sources.shift, sources.light)
        elif node.type == "GROUP" and node.node_tree is not None:
            _bend_group(tree, node, node.node_tree.copy(), sources)


def _bend_coordinates(tree: bpy.types.NodeTree, nodes: list[Any], vector: bpy.types.NodeSocket) -> None:
    """Let what takes the ray's direction, or its opposite, take the bent one."""
    against = None
    for node in nodes:
        along_names, against_names = _ALONG.get(node.type, set()), _AGAINST.get(node.type, set())
        for socket in node.outputs:
            targets = [link.to_socket for link in socket.links]
            if socket.name == "Object" and node.object is not None:  # as it stands, which cannot be followed
                continue
            if socket.name in along_names:
                for each in targets:
                    tree.links.new(vector, each)
            elif targets and socket.name in against_names:
                if against is None:
                    against = tree.nodes.new("ShaderNodeVectorMath")
                    against.operation = "SCALE"
                    against.name = against.label = "Umbra Opposite"
                    against.inputs["Scale"].default_value = -1.0
                    tree.links.new(vector, against.inputs[0])
                for each in targets:
                    tree.links.new(against.outputs[0], each)


def _bend_group(tree: bpy.types.NodeTree, node: Any, inner: bpy.types.NodeTree, sources: _Sources) -> None:
    """Let a node's copy of its group look along bent rays: the results come in by sockets of its own."""
    inner[_COPY] = True
    node.node_tree = inner
    entry = inner.nodes.new("NodeGroupInput")
    entry.location = (min(each.location.x for each in inner.nodes) - 320.0, 0.0)
    passed = []
    for name, outer in (("Vector", sources.vector), ("Shift", sources.shift), ("Light", sources.light)):
        added = inner.interface.new_socket(tinting.PASSED + name, in_out="INPUT", socket_type="NodeSocketVector")
        tree.links.new(outer, next(each for each in node.inputs if each.identifier == added.identifier))
        passed.append(next(each for each in entry.outputs if each.identifier == added.identifier))
    _bend(inner, _Sources(*passed), {entry.name})


def renew(world: bpy.types.World) -> None:
    """Rebuild the groups of a lensed World that are not current; image nodes of a rebuilt one have no map."""
    group = group_of(world)
    if group is None:
        return
    tinting.renew(group, [world.node_tree, *(each for each in _inner_trees(world.node_tree) if _COPY in each)])
    world_group.mend(group)


def unbent(scene: bpy.types.Scene) -> list[str]:
    """Return what of a World is shown as it is, in sentences."""
    world = scene.get(BEFORE)
    if lensed_world(scene) is None or world is None or world.node_tree is None:
        return []
    found = []
    for node in _all_nodes(world.node_tree):
        linked = {each.name for each in node.outputs if each.is_linked}
        if node.type == "TEX_COORD" and (linked & {"Camera", "Window"} or ("Object" in linked and node.object)):
            found.append(f'What World "{world.name}" takes from the node "{node.name}" is not bent: use Generated.')
    return found
