# SPDX-License-Identifier: GPL-3.0-or-later
"""The compositor node groups "Umbra Disk": their sockets and their version.

They draw a disk from the passes that were baked along with a warp map: for the input Disk of the group "Umbra Black
Hole", or over the picture of a camera that bends its rays. Pass 1 and so on must be Image nodes with the baked EXRs,
Non-Color and Channel Packed like the warp map; Colors is a table, and Texture is a picture with azimuth across and
ln(radius) down (see `disk_images`).

The compositor evaluates all nodes of a group, needed or not. So there is one group per number of images and per way to
use the texture; a file has those that it needs. Inside, each image is drawn by another group, "Umbra Disk Image".
"""

from __future__ import annotations

from functools import cache

import bpy

from ..core.physics_api import physics
from . import disk_images, disk_nodes
from .builder import TreeBuilder
from .versioned_group import GROUP_NODE_TYPE, SocketSpec, Values, VersionedGroup, setting_socket

GROUP_NAME = "Umbra Disk"
GROUP_VERSION = 4
"""Raised whenever the groups' sockets or nodes change; groups with another number are rebuilt."""

VERSION_KEY = "umbra_disk_version"
"""Key of the single group of version 1; since version 2 the kind of the group is appended."""


def _picture(name: str, description: str) -> SocketSpec:
    return SocketSpec(name, "NodeSocketColor", description, default=(0.0, 0.0, 0.0, 0.0), hide_value=True)


def _number(name: str, description: str, default: float, low: float = -1e6, high: float = 1e6) -> SocketSpec:
    return SocketSpec(name, "NodeSocketFloat", description, default=default, minimum=low, maximum=high)


BEHIND = "Behind"
OUTPUT, IMAGE = "Disk", "Image"
PASS, LIGHT, THROUGH = "Pass", "Light", "Through"  # of the group inside

LOOK_SOCKETS = {name: setting.socket for name, setting in physics.DISK_SETTINGS.items()}
"""Field of `DiskLook`, and property of the disk -> the socket that follows it."""

PHASE, FIRST_TURN, SECOND_TURN, PERIOD = "Pattern Phase", "First Turn", "Second Turn", "Pattern Period"
SPIN, DIRECTION, INNER, OUTER = "Spin", "Direction", "Inner Edge", "Outer Edge"
INNERMOST, FLUX_FACTOR = "Innermost Orbit", "Flux Factor"

_BEHIND = _picture(BEHIND, "What is behind the disk, of the render's size")
_INPUTS = (
    *(_picture(each.socket, each.description) for each in disk_images.PICTURES.values()),
    _number(PHASE, "How far the pattern of the streaks is through its life, 0 to 1", 0.0, 0.0, 1.0),
    _number(FIRST_TURN, "Angle by which the first pattern is turned, radians", 0.0),
    _number(SECOND_TURN, "Angle by which the second pattern is turned, radians", 0.0),
    _number(PERIOD, "How long a pattern of the streaks lives, units of M", 100.0, 0.0),
    _number(SPIN, "Spin of the hole, from 0 to 1", 0.9, -1.0, 1.0),
    _number(DIRECTION, "The way that the disk turns: 1 or, against the hole, -1", 1.0, -1.0, 1.0),
    _number(INNER, "Radius of the inner edge, units of M", 6.0, 0.0),
    _number(OUTER, "Radius of the outer edge, units of M", 20.0, 0.0),
    _number(INNERMOST, "Radius of the innermost stable orbit, units of M", 6.0, 0.0),
    _number(FLUX_FACTOR, "By which Page and Thorne's flux becomes 1 where it is largest", 7000.0, 0.0),
    *(setting_socket(setting) for setting in physics.DISK_SETTINGS.values()),
)
_OUTPUTS = (
    SocketSpec(OUTPUT, "NodeSocketColor", "The disk, premultiplied, with its coverage as alpha", in_out="OUTPUT"),
    SocketSpec(IMAGE, "NodeSocketColor", "The disk in front of what is behind", in_out="OUTPUT"),
)


def pass_names(images: int) -> tuple[str, ...]:
    """Names of the sockets of this many passes."""
    return tuple(f"Pass {number}" for number in range(1, images + 1))


@cache
def group_of(images: int, picture: bool = False) -> VersionedGroup:
    """Return the kind of group for a number of images of the disk.

    Parameters
    ----------
    images : int
        Number of passes, from 1.
    picture : bool
        Whether the texture's colors are the disk's; otherwise it holds streaks and clumps.

    Returns
    -------
    VersionedGroup
        Its nodes use `image_group(picture)`; `ensure` builds both.
    """
    kind = f"{images} Picture" if picture else f"{images}"
    names = pass_names(images)
    passes = tuple(
        _picture(name, f"The baked pass of image {number} of the disk (Non-Color), 1 being in front")
        for number, name in enumerate(names, start=1)
    )

    def build(builder: TreeBuilder, values: Values) -> Values:
        inner = image_group(picture).ensure()
        shared = {spec.name: values[spec.name] for spec in _INPUTS}
        so_far: Values = {LIGHT: (0.0, 0.0, 0.0), THROUGH: 1.0}
        for name in names:
            node = builder.node(GROUP_NODE_TYPE, name)
            node.node_tree = inner
            for socket, value in {PASS: values[name], **shared, **so_far}.items():
                builder.feed(node.inputs[socket], value)
            so_far = {socket: builder.value(node.outputs[socket]) for socket in so_far}
        passes = [values[name] for name in names]
        disk, image = disk_nodes.build_whole(builder, passes, values[BEHIND], so_far[LIGHT], so_far[THROUGH])
        return {OUTPUT: disk, IMAGE: image}

    key = f"{VERSION_KEY}_{kind.lower().replace(' ', '_')}"
    return VersionedGroup(f"{GROUP_NAME} {kind}", GROUP_VERSION, key, (*passes, _BEHIND, *_INPUTS), _OUTPUTS, build)


@cache
def image_group(picture: bool) -> VersionedGroup:
    """Return the kind of group that draws one image of the disk."""
    kind = "Image Picture" if picture else "Image"

    def build(builder: TreeBuilder, values: Values) -> Values:
        inputs = _disk_inputs(values)
        light, through = disk_nodes.build_image(builder, inputs, values[LIGHT], values[THROUGH], picture=picture)
        return {LIGHT: light, THROUGH: through}

    inputs = (
        _picture(PASS, "The baked pass of the image"),
        SocketSpec(LIGHT, "NodeSocketVector", "Light of the images in front", default=(0.0, 0.0, 0.0)),
        SocketSpec(THROUGH, "NodeSocketFloat", "Share of what is behind that they leave", default=1.0),
        *_INPUTS,
    )
    outputs = (
        SocketSpec(LIGHT, "NodeSocketVector", "Light of this image and those in front", in_out="OUTPUT"),
        SocketSpec(THROUGH, "NodeSocketFloat", "Share of what is behind that is left", in_out="OUTPUT"),
    )
    key = f"{VERSION_KEY}_{kind.lower().replace(' ', '_')}"
    return VersionedGroup(f"{GROUP_NAME} {kind}", GROUP_VERSION, key, inputs, outputs, build)


def ensure(images: int, picture: bool) -> bpy.types.NodeTree:
    """Return the group for a number of images, and build it and the group inside it if they are not current."""
    image_group(picture).ensure()
    return group_of(images, picture).ensure()


def remove_unused() -> None:
    """Remove the groups that nothing uses, then those that were used only inside them."""
    for inside in (False, True):
        for tree in list(bpy.data.node_groups):
            is_inside = any(image_group(picture).owns(tree) for picture in (False, True))
            if tree.users == 0 and tree.library is None and owns(tree) and is_inside == inside:
                bpy.data.node_groups.remove(tree)


def owns(tree: bpy.types.NodeTree | None) -> bool:
    """Whether a node tree is one of these groups, whatever its kind and version."""
    return tree is not None and any(key.startswith(VERSION_KEY) for key in tree.keys())  # noqa: SIM118


def _disk_inputs(values: Values) -> disk_nodes.DiskInputs:
    return disk_nodes.DiskInputs(
        disk_pass=values[PASS],
        phase=values[PHASE],
        first_turn=values[FIRST_TURN],
        second_turn=values[SECOND_TURN],
        period=values[PERIOD],
        spin=values[SPIN],
        direction=values[DIRECTION],
        inner=values[INNER],
        outer=values[OUTER],
        innermost=values[INNERMOST],
        flux_factor=values[FLUX_FACTOR],
        **{field: values[picture.socket] for field, picture in disk_images.PICTURES.items()},
        **{field: values[name] for field, name in LOOK_SOCKETS.items()},
    )
