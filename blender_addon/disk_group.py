# SPDX-License-Identifier: GPL-3.0-or-later
"""The compositor node group "Umbra Disk": its sockets and its version.

It draws a disk from the passes that were baked along with a warp map, for the input Disk of the group "Umbra Black
Hole". Pass 1 to Pass 3 must be Image nodes with the baked EXRs, Non-Color and Channel Packed like the warp map;
Profile and Colours are tables, and Texture is a picture with azimuth across and ln(radius) down, see `disk_images`.
"""

from __future__ import annotations

from . import disk_nodes
from ._physics import disk_look
from .node_helpers import Socket, TreeBuilder
from .stamped_group import SocketSpec, StampedGroup

GROUP_NAME = "Umbra Disk"
GROUP_VERSION = 1
"""Raised whenever the group's sockets or nodes change; groups with another number are rebuilt."""

VERSION_KEY = "umbra_disk_version"


def _picture(name: str, description: str) -> SocketSpec:
    return SocketSpec(name, "NodeSocketColor", description, default=(0.0, 0.0, 0.0, 0.0), hide_value=True)


def _number(name: str, description: str, default: float, low: float = -1e6, high: float = 1e6) -> SocketSpec:
    return SocketSpec(name, "NodeSocketFloat", description, default=default, minimum=low, maximum=high)


def _factor(name: str, description: str, default: float) -> SocketSpec:
    return SocketSpec(
        name, "NodeSocketFloat", description, default=default, minimum=0.0, maximum=1.0, subtype="FACTOR"
    )


PASS_NAMES = tuple(f"Pass {number}" for number in range(1, disk_nodes.PASSES + 1))
PROFILE, COLOURS, TEXTURE = "Profile", "Colours", "Texture"
OUTPUT = "Disk"

_LOOK = disk_look.DiskLook()

LOOK_SOCKETS = {
    "temperature": "Temperature",
    "doppler_colour": "Doppler Colour",
    "doppler_brightness": "Doppler Brightness",
    "colour_variation": "Colour Variation",
    "falloff": "Falloff",
    "exposure": "Disk Exposure",
    "opacity": "Opacity",
    "streaks": "Streaks",
    "clumps": "Clumps",
    "inner_softness": "Inner Softness",
    "outer_softness": "Outer Softness",
    "gain": "Contrast of Light",
}
"""Field of `DiskLook`, and property of the disk -> the socket that follows it."""

BEAMING, IMAGES, PERIOD = "Beaming", "Images", "Pattern Period"
PHASE, FIRST_TURN, SECOND_TURN = "Pattern Phase", "First Turn", "Second Turn"
SPIN, DIRECTION, INNER, OUTER = "Spin", "Direction", "Inner Edge", "Outer Edge"

INPUTS = (
    *(
        _picture(name, f"The baked pass of image {number} of the disk (Non-Color), 1 being in front")
        for number, name in enumerate(PASS_NAMES, start=1)
    ),
    _picture(PROFILE, "Table of the brightness from the inner to the outer edge (Non-Color)"),
    _picture(COLOURS, "Table of the colours of hot bodies (Non-Color)"),
    _picture(TEXTURE, "Azimuth across, from the inner edge down: streaks in red, clumps in green"),
    _number(IMAGES, "How many images of the disk were baked; magenta means that one is missing", 3.0, 0.0, 3.0),
    _number(PHASE, "How far the pattern of the streaks is through its life, 0 to 1", 0.0, 0.0, 1.0),
    _number(FIRST_TURN, "Angle by which the first pattern is turned, radians", 0.0),
    _number(SECOND_TURN, "Angle by which the second pattern is turned, radians", 0.0),
    _number(PERIOD, "How long a pattern of the streaks lives, units of M", 100.0, 0.0),
    _number(SPIN, "Spin of the hole, from 0 to 1", 0.9, -1.0, 1.0),
    _number(DIRECTION, "The way that the disk turns: 1 or, against the hole, -1", 1.0, -1.0, 1.0),
    _number(INNER, "Radius of the inner edge, units of M", 6.0, 0.0),
    _number(OUTER, "Radius of the outer edge, units of M", 20.0, 0.0),
    SocketSpec(
        LOOK_SOCKETS["temperature"],
        "NodeSocketFloat",
        "Temperature where the disk is brightest (kelvin)",
        default=_LOOK.temperature,
        minimum=disk_look.COLDEST,
        maximum=disk_look.HOTTEST,
        subtype="COLOR_TEMPERATURE",
    ),
    _factor(LOOK_SOCKETS["doppler_colour"], "How much the disk's motion changes its colour", _LOOK.doppler_colour),
    _factor(
        LOOK_SOCKETS["doppler_brightness"],
        "How much the disk's motion changes its brightness",
        _LOOK.doppler_brightness,
    ),
    _number(BEAMING, "Power of the frequency ratio in the brightness: 4, or 3 for one colour", 4.0, 3.0, 4.0),
    _factor(LOOK_SOCKETS["colour_variation"], "How much cooler the dim parts are", _LOOK.colour_variation),
    _factor(LOOK_SOCKETS["falloff"], "How far the brightness follows the profile", _LOOK.falloff),
    _number(LOOK_SOCKETS["exposure"], "Brightens the disk by this many stops", _LOOK.exposure, -32.0, 32.0),
    _factor(LOOK_SOCKETS["opacity"], "How much the densest parts hide what is behind", _LOOK.opacity),
    _factor(LOOK_SOCKETS["streaks"], "How much the streaks thin the disk out", _LOOK.streaks),
    _factor(LOOK_SOCKETS["clumps"], "How much the clumps thin the disk out", _LOOK.clumps),
    _factor(
        LOOK_SOCKETS["inner_softness"], "Share of the disk over which its inner edge fades in", _LOOK.inner_softness
    ),
    _factor(
        LOOK_SOCKETS["outer_softness"], "Share of the disk over which its outer edge fades out", _LOOK.outer_softness
    ),
    _number(LOOK_SOCKETS["gain"], "How much brighter dense streaks are than thin ones", _LOOK.gain, 1.0, 8.0),
)
OUTPUTS = (
    SocketSpec(OUTPUT, "NodeSocketColor", "The disk, premultiplied, with its coverage as alpha", in_out="OUTPUT"),
)


def _build(builder: TreeBuilder, sockets: dict[str, Socket]) -> dict[str, Socket]:
    inputs = disk_nodes.DiskInputs(
        passes=tuple(sockets[name] for name in PASS_NAMES),
        images=sockets[IMAGES],
        profile=sockets[PROFILE],
        colours=sockets[COLOURS],
        texture=sockets[TEXTURE],
        phase=sockets[PHASE],
        first_turn=sockets[FIRST_TURN],
        second_turn=sockets[SECOND_TURN],
        period=sockets[PERIOD],
        spin=sockets[SPIN],
        direction=sockets[DIRECTION],
        inner=sockets[INNER],
        outer=sockets[OUTER],
        beaming=sockets[BEAMING],
        **{field: sockets[name] for field, name in LOOK_SOCKETS.items()},
    )
    return {OUTPUT: disk_nodes.build(builder, inputs)}


GROUP = StampedGroup(GROUP_NAME, GROUP_VERSION, VERSION_KEY, INPUTS, OUTPUTS, _build)
