# SPDX-License-Identifier: GPL-3.0-or-later
"""The compositor node group "Umbra Black Hole": its sockets and its version.

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
Disk
    The output of the node group "Umbra Disk" (see `disk_group`), of the render's size. If it is not linked, there is
    no disk.
Depth, Hole Depth, Hide Behind
    The Depth output of the Render Layers node that feeds Render; the depth of the hole's center in the same measure
    (along the camera's axis for a perspective camera, from the camera for a panorama); and 1 to hide, inside the
    shadow, what is deeper than that. If Depth is not linked, nothing is hidden.
Environment Rotation, Environment Strength
    The values of the World's Mapping node (type Point) and of its Background node.

The scene's compositor must work in full precision (`scene.render.compositor_precision = "FULL"`): half floats
cannot hold texture coordinates. In background it must work on the CPU (`compositor_device = "CPU"`).
"""

from __future__ import annotations

import bpy

from ..core.physics_api import physics
from . import black_hole_nodes
from .builder import TreeBuilder
from .versioned_group import GROUP_NODE_TYPE, SocketSpec, Values, VersionedGroup, setting_socket

GROUP_NAME = "Umbra Black Hole"
GROUP_VERSION = 4
"""Raised whenever the group's sockets or nodes change; `ensure_group` migrates files with another number."""

VERSION_KEY = "umbra_version"

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
DISK = SocketSpec(
    "Disk",
    "NodeSocketColor",
    "The accretion disk of the node group Umbra Disk, premultiplied: in front of the sky and behind the scene",
    default=(0.0, 0.0, 0.0, 0.0),
    hide_value=True,
)
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
    DISK,
    DEPTH,
    HOLE_DEPTH,
    HIDE_BEHIND,
)
OUTPUTS = (IMAGE, SKY, SHADOW, REDSHIFT)


def _build(builder: TreeBuilder, values: Values) -> Values:
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
        disk=values[DISK.name],
        depth=values[DEPTH.name],
        hole_depth=values[HOLE_DEPTH.name],
        hide_behind=values[HIDE_BEHIND.name],
    )
    results = black_hole_nodes.build(builder, inputs)
    return {
        IMAGE.name: results.image,
        SKY.name: results.sky,
        SHADOW.name: results.shadow,
        REDSHIFT.name: results.redshift,
    }


_GROUP = VersionedGroup(GROUP_NAME, GROUP_VERSION, VERSION_KEY, INPUTS, OUTPUTS, _build)

is_group = _GROUP.owns
is_current = _GROUP.is_current
find_group = _GROUP.find
ensure_group = _GROUP.ensure
add_group_node = _GROUP.add_node


def group_nodes(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    """Return the nodes of a compositor tree (not of groups inside it) that use the group."""
    return [node for node in tree.nodes if node.bl_idname == GROUP_NODE_TYPE and is_group(node.node_tree)]
