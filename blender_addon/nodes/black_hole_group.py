# SPDX-License-Identifier: GPL-3.0-or-later
"""The compositor node groups "Umbra Black Hole": their sockets and their version.

There is one per number of looks at the sky and kind of glare (`group_of`); they differ in nothing else.

What to link to its inputs
--------------------------
Render
    The render with a transparent film (`scene.render.film_transparent = True`), which is the Image output of
    a Render Layers node: premultiplied, of the render's size. If it is not linked, there is only sky.
Environment
    An Image node with an equirectangular picture of any size, row by row as Blender shows it (zenith at the
    top), in the color space the file was made in (it is converted to scene-linear by Blender). Its alpha
    is ignored. If it is not linked, the socket's own color is the sky in all directions, like a World with a
    plain background color.
Warp Map
    An Image node with the baked EXR, a single image or a sequence. The image must be Non-Color
    (`image.colorspace_settings.name`) and Channel Packed (`image.alpha_mode = "CHANNEL_PACKED"`). Its
    size is the render's, or 2 or 4 times that. It must be linked directly, without other nodes in between.
Disk, Disk Exposure, Disk Tint, Disk Opacity
    An Image node with the baked layer of light, set like the warp map's, and what is done to it; see `disk_layer`. If
    it is not linked, there is no disk.
Depth, Hole Depth, Hide Behind
    The Depth output of the Render Layers node that feeds Render; the depth of the hole's center in the same measure
    (along the camera's axis for a perspective camera, from the camera for a panorama); and 1 to hide, inside the
    shadow, what is deeper than that. If Depth is not linked, nothing is hidden.
Sky Levels
    An Image node with `physics.sky_levels(...).atlas()` of the same sky, scene-linear. If it is not linked, the sky is
    not filtered.
Footprint
    An Image node with the baked EXR beside the warp map's, set like that. If it is not linked, the sky is not filtered.
Stars
    An Image node with a baked layer of stars (`physics.StarLayer`), set like the warp map's, of the render's size. If
    it is not linked, no points are drawn, and the stars are those of the environment.
Environment Rotation, Environment Strength
    The values of the World's Mapping node (type Point) and of its Background node.

The scene's compositor must work in full precision (`scene.render.compositor_precision = "FULL"`): half floats
cannot hold texture coordinates. In background it must work on the CPU (`compositor_device = "CPU"`).
"""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import bpy

from ..core.physics_api import physics
from . import black_hole_nodes, disk_layer, filtered_sky
from .builder import TreeBuilder
from .versioned_group import GROUP_NODE_TYPE, SocketSpec, Values, VersionedGroup, setting_socket

GROUP_NAME = "Umbra Black Hole"
GROUP_VERSION = 8
"""Raised whenever the group's sockets or nodes change; `ensure_group` migrates files with another number."""

VERSION_KEY = "umbra_version"
LOOKS_KEY, GLARE_KEY = "umbra_looks", "umbra_glare"
"""Custom properties of a group: its number of looks, and its kind of glare."""

RENDER = SocketSpec(
    "Render",
    "NodeSocketColor",
    "The rendered scene with a transparent film; it is laid over the sky",
    default=(0.0, 0.0, 0.0, 0.0),
    hide_value=True,
)
ENVIRONMENT = SocketSpec(
    "Environment",
    "NodeSocketColor",
    "Equirectangular picture of the sky, of any size, or one color for all of the sky",
    default=(0.0, 0.0, 0.0, 1.0),
)
WARP_MAP = SocketSpec(
    "Warp Map",
    "NodeSocketColor",
    "The baked map of where the light comes from (Non-Color). Magenta in the picture means that it is "
    "missing or is not a warp map",
    default=(0.0, 0.0, 0.0, 0.0),
    hide_value=True,
)
ROTATION = SocketSpec(
    "Environment Rotation",
    "NodeSocketVector",
    "Rotation of the sky, the same as in the Mapping node of the World",
    default=(0.0, 0.0, 0.0),
    subtype="EULER",
)
STRENGTH = SocketSpec(
    "Environment Strength",
    "NodeSocketFloat",
    "Brightness factor of the sky, the same as the strength of the World's background",
    default=1.0,
    minimum=0.0,
    maximum=1.0e6,
)
EXPOSURE, REDSHIFT_COLOR, REDSHIFT_BRIGHTNESS, TEMPERATURE = map(setting_socket, physics.SKY_SETTINGS.values())
DEPTH = SocketSpec(
    "Depth",
    "NodeSocketFloat",
    "The depth pass of the render: what is deeper than the hole is hidden inside the shadow",
    default=0.0,
    hide_value=True,
)
HOLE_DEPTH = SocketSpec(
    "Hole Depth",
    "NodeSocketFloat",
    "Depth of the hole's center, as the depth pass measures it; it follows camera and hole by a driver",
    default=0.0,
)
HIDE_BEHIND = SocketSpec(
    "Hide Behind",
    "NodeSocketFloat",
    "1 hides what is behind the hole and inside its shadow, by the depth pass; 0 shows all of the render",
    default=0.0,
    minimum=0.0,
    maximum=1.0,
    subtype="FACTOR",
)
LEVELS = SocketSpec(
    "Sky Levels",
    "NodeSocketColor",
    "The sky at ever coarser resolution, made by the add-on, by which it is filtered",
    default=(0.0, 0.0, 0.0, 0.0),
    hide_value=True,
)
FOOTPRINT = SocketSpec(
    "Footprint",
    "NodeSocketColor",
    "The baked sizes of the pixels on the sky (Non-Color), over which it is averaged",
    default=(0.0, 0.0, 0.0, 0.0),
    hide_value=True,
)
STARS = SocketSpec(
    "Stars",
    "NodeSocketColor",
    "The baked layer of stars as points (Non-Color), which is added to the sky. Magenta in the picture means that it "
    "is missing",
    default=(0.0, 0.0, 0.0, 1.0),
    hide_value=True,
)
STAR_BRIGHTNESS = SocketSpec(
    "Star Brightness",
    "NodeSocketFloat",
    "Stops by which the stars are brighter than real ones beside the same sky",
    default=0.0,
    minimum=-20.0,
    maximum=20.0,
)
IMAGE = SocketSpec("Image", "NodeSocketColor", "The scene in front of the black hole and the sky", in_out="OUTPUT")
SKY = SocketSpec("Sky", "NodeSocketColor", "The black hole, its disk and the sky without the scene", in_out="OUTPUT")
SHADOW = SocketSpec(
    "Shadow", "NodeSocketFloat", "Mask of the black hole's shadow: 1 inside, 0 outside", in_out="OUTPUT"
)
REDSHIFT = SocketSpec(
    "Redshift",
    "NodeSocketFloat",
    "Frequency ratio 1 + z: above 1 is redshift, below 1 blueshift",
    in_out="OUTPUT",
)

INPUTS = (
    RENDER,
    ENVIRONMENT,
    WARP_MAP,
    ROTATION,
    STRENGTH,
    EXPOSURE,
    REDSHIFT_COLOR,
    REDSHIFT_BRIGHTNESS,
    TEMPERATURE,
    *disk_layer.SOCKETS,
    DEPTH,
    HOLE_DEPTH,
    HIDE_BEHIND,
    LEVELS,
    FOOTPRINT,
    STARS,
    STAR_BRIGHTNESS,
)
OUTPUTS = (IMAGE, SKY, SHADOW, REDSHIFT)


def _build(looks: int, glare: int, builder: TreeBuilder, values: Values) -> Values:
    with builder.frame("Disk"):
        disk = disk_layer.disk_light(*(values[each.name] for each in disk_layer.SOCKETS))
    inputs = black_hole_nodes.GroupInputs(
        render=values[RENDER.name],
        environment=values[ENVIRONMENT.name],
        warp_map=values[WARP_MAP.name],
        rotation=values[ROTATION.name],
        strength=values[STRENGTH.name],
        exposure=values[EXPOSURE.name],
        redshift_color=values[REDSHIFT_COLOR.name],
        redshift_brightness=values[REDSHIFT_BRIGHTNESS.name],
        temperature=values[TEMPERATURE.name],
        disk=disk,
        depth=values[DEPTH.name],
        hole_depth=values[HOLE_DEPTH.name],
        hide_behind=values[HIDE_BEHIND.name],
        levels=values[LEVELS.name],
        footprint=values[FOOTPRINT.name],
        stars=values[STARS.name],
        star_brightness=values[STAR_BRIGHTNESS.name],
    )
    results = black_hole_nodes.build(builder, inputs, looks, glare)
    return {
        IMAGE.name: results.image,
        SKY.name: results.sky,
        SHADOW.name: results.shadow,
        REDSHIFT.name: results.redshift,
    }


@cache
def group_of(looks: int, glare: int) -> VersionedGroup:
    """Return the kind of group for a number of looks at the sky per pixel, and for a glare; 0 is without.

    The compositor evaluates all nodes of a group, needed or not: hence one group per number.
    """
    variant = (LOOKS_KEY, looks), (GLARE_KEY, glare)
    build = partial(_build, looks, glare)
    return VersionedGroup(GROUP_NAME, GROUP_VERSION, VERSION_KEY, INPUTS, OUTPUTS, build, variant=variant)


_KINDS = tuple(
    group_of(looks.value, glare.value) for looks in physics.SKY_FILTER.choices for glare in physics.GLARE.choices
)


def kind_of(tree: bpy.types.NodeTree | None) -> VersionedGroup | None:
    """Return which kind of the group a node tree is, whatever its version and state."""
    return next((kind for kind in _KINDS if kind.owns(tree)), None)


def is_group(tree: bpy.types.NodeTree | None) -> bool:
    """Whether a node tree is one of these groups, whatever its version and state."""
    return kind_of(tree) is not None


def is_current(tree: bpy.types.NodeTree) -> bool:
    """Whether a group is of this version, built by this version of Blender, and unchanged inside."""
    kind = kind_of(tree)
    inner = filtered_sky.LOOK.find()
    whole = not tree.get(LOOKS_KEY) or (inner is not None and filtered_sky.LOOK.is_current(inner))
    return kind is not None and kind.is_current(tree) and whole


def ensure_group(looks: int = 0, tree: bpy.types.NodeTree | None = None, glare: int = 0) -> bpy.types.NodeTree:
    """Return the group for a number of looks and a glare, and build it and the group inside it if they are not current.

    A group that is given becomes it; by default it is this file's.
    """
    if looks:
        filtered_sky.LOOK.ensure()
    return group_of(looks, glare).ensure(tree)


def find_group(looks: int = 0, glare: int = 0) -> bpy.types.NodeTree | None:
    """Return this file's group for a number of looks and a glare, or None."""
    return group_of(looks, glare).find()


def add_group_node(tree: bpy.types.NodeTree, looks: int = 0, glare: int = 0) -> bpy.types.Node:
    """Add a group node to a compositor tree."""
    ensure_group(looks, glare=glare)
    return group_of(looks, glare).add_node(tree)


def use(node: bpy.types.Node, looks: int, glare: int = 0) -> None:
    """Let a group node use the group for a number of looks and a glare; what is linked to it and set on it stays.

    Parameters
    ----------
    node : bpy.types.Node
        A group node.
    looks : int
        0 or one of the choices of `physics.SKY_FILTER`.
    glare : int
        One of `physics.GLARES`.
    """
    former = node.node_tree
    kind = kind_of(former)
    if former is not None and kind is not None and former.library is None:
        present = group_of(looks, glare).find()
        if former.users == 1 and present in (None, former):
            ensure_group(looks, former, glare)  # in place: nobody else uses it
            remove_unused()
            return
        kind.ensure(former)  # now its inputs are those of the other group
    group = ensure_group(looks, glare=glare)
    if former == group:
        return
    links = node.id_data.links
    values = {socket.name: _copied(socket.default_value) for socket in node.inputs}
    origins = {socket.name: socket.links[0].from_socket for socket in node.inputs if socket.is_linked}
    targets = {socket.name: [link.to_socket for link in socket.links] for socket in node.outputs}
    for link in [link for socket in (*node.inputs, *node.outputs) for link in socket.links]:
        links.remove(link)  # kept, they would go by the order of the sockets
    node.node_tree = group
    for socket in node.inputs:
        if socket.name in values:
            socket.default_value = values[socket.name]
        if socket.name in origins:
            links.new(origins[socket.name], socket)
    for socket in node.outputs:
        for target in targets.get(socket.name, ()):
            links.new(socket, target)
    remove_unused()


def _copied(value: Any) -> Any:
    return value if isinstance(value, float | int | str) else tuple(value)


def remove_unused() -> None:
    """Remove the groups that nothing uses, then the one that was used only inside them."""
    for is_ours in (is_group, filtered_sky.LOOK.owns):
        for tree in list(bpy.data.node_groups):
            if tree.users == 0 and tree.library is None and is_ours(tree):
                bpy.data.node_groups.remove(tree)


def group_nodes(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    """Return the nodes of a compositor tree (not of groups inside it) that use the group."""
    return [node for node in tree.nodes if node.bl_idname == GROUP_NODE_TYPE and is_group(node.node_tree)]
