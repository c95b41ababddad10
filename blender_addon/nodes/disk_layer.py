# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk's layer of light in the compositor: what its live controls make of it.

The layer is an Image node with the baked EXR, Non-Color and Channel Packed like the warp map: premultiplied light, and
in alpha the share of what is behind that passes. The group "Umbra Black Hole" lays it over the sky. Where the camera
itself bends the rays, the group "Umbra Disk Light" here lays it over the render.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..core.blender_version import COMPOSITOR_SETTINGS_ARE_SOCKETS
from ..core.physics_api import physics
from .arithmetic import multiply_add, where
from .builder import Float, TreeBuilder, Vector
from .image_nodes import combine_color, separate_color
from .render_size import stretched_to_render
from .versioned_group import SocketSpec, Values, VersionedGroup

NOTHING = (0.0, 0.0, 0.0, 1.0)
"""A layer in which there is nothing: all of what is behind passes."""

DISK = SocketSpec(
    "Disk",
    "NodeSocketColor",
    "The baked light of the disk (Non-Color), premultiplied; alpha is the share of what is behind that passes. Magenta "
    "in the picture means that it is missing",
    default=NOTHING,
    hide_value=True,
)
EXPOSURE = SocketSpec(
    "Disk Exposure",
    "NodeSocketFloat",
    "Brightens the disk by this many stops",
    default=0.0,
    minimum=-32.0,
    maximum=32.0,
)
TINT = SocketSpec("Disk Tint", "NodeSocketColor", "Color by which the disk's light is multiplied", default=(1.0,) * 4)
OPACITY = SocketSpec(
    "Disk Opacity",
    "NodeSocketFloat",
    "Share of the whole disk that is shown, its light and what it hides: at 0 there is none",
    default=1.0,
    minimum=0.0,
    maximum=1.0,
    subtype="FACTOR",
)
SOCKETS = (DISK, EXPOSURE, TINT, OPACITY)

BEHIND, IMAGE = "Behind", "Image"

# Stretched bilinearly, Blender 4.5 mixes black into the outermost pixels.
_STRETCHED = "Bilinear" if COMPOSITOR_SETTINGS_ARE_SOCKETS else "Nearest"


@dataclass(frozen=True)
class DiskLight:
    """The layer, ready to be laid over what is behind it."""

    light: Vector
    """Premultiplied."""
    covers: Float
    """Share of what is behind that does not pass."""
    there: Float
    """1 where there is a layer, 0 where its file is missing."""


def disk_light(disk: Vector, exposure: Float, tint: Vector, opacity: Float) -> DiskLight:
    """Return what the values of `SOCKETS` give."""
    # Layers that previews make are smaller than the render.
    light, passes = stretched_to_render(disk.builder, disk, _STRETCHED)
    light = light * tint * (2.0**exposure * opacity)
    return DiskLight(light, (1.0 - passes) * opacity, passes.greater_than(0.0).labeled("Is there a layer?"))


def _build(builder: TreeBuilder, values: Values) -> Values:
    with builder.frame("Disk"):
        disk = disk_light(*(values[each.name] for each in SOCKETS))
    behind = values[BEHIND]
    _, _, _, alpha = separate_color(behind)
    left = 1.0 - disk.covers
    picture = multiply_add(behind, left, disk.light)
    red, green, blue = where(disk.there, picture, physics.INVALID_MAP_COLOR).labeled("Magenta if missing").separate()
    return {IMAGE: combine_color(red, green, blue, multiply_add(alpha, left, disk.covers))}


GROUP = VersionedGroup(
    "Umbra Disk Light",
    1,
    "umbra_disk_light_version",
    (
        SocketSpec(
            BEHIND,
            "NodeSocketColor",
            "What is behind the disk, of the render's size",
            default=(0.0, 0.0, 0.0, 0.0),
            hide_value=True,
        ),
        *SOCKETS,
    ),
    (SocketSpec(IMAGE, "NodeSocketColor", "The disk in front of what is behind", in_out="OUTPUT"),),
    _build,
)


def remove_unused() -> None:
    """Remove the group if nothing uses it, and the groups and images by which former versions drew the disk."""
    for _ in range(2):  # one former group was inside the other
        for tree in list(bpy.data.node_groups):
            if tree.users == 0 and tree.library is None and (GROUP.owns(tree) or is_former(tree)):
                bpy.data.node_groups.remove(tree)
    for image in list(bpy.data.images):
        if image.users == 0 and image.name.startswith(_FORMER_IMAGES):
            bpy.data.images.remove(image)


# Version 0.1 drew the disk with node groups, whose custom properties begin like this, from packed tables.
_FORMER_KEY = "umbra_disk_version"
_FORMER_IMAGES = ("Umbra Disk Profile", "Umbra Disk Colors", "Umbra Disk Streaks")


def is_former(tree: bpy.types.NodeTree | None) -> bool:
    """Return whether a node tree is a group by which version 0.1 drew the disk."""
    return tree is not None and any(key.startswith(_FORMER_KEY) for key in tree.keys())  # noqa: SIM118
