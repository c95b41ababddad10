# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk on the command line: options of ``bake`` and ``render``."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from typing import TypeVar

from ..files.disk_pass_file import read_disk_passes
from ..geodesics.disk_tracer import DEFAULT_CROSSINGS
from ..light.disk_settings import DISK_SETTINGS, PRESETS, DiskLook
from ..light.disk_texture import disk_texture
from ..light.matter_settings import MATTER_PRESETS, MATTER_SETTINGS, MatterLook
from ..light.settings import Setting
from ..maps.warp_map import WarpMap
from ..matter.light_layer import check_time
from ..numerics.arrays import Array
from ..numerics.errors import BlackHoleError
from ..reference.disk_render import disk_layers, over_sky
from ..shot.disk import DEFAULT_OUTER_RADIUS, Disk

Look = TypeVar("Look", DiskLook, MatterLook)


def add_bake_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which disk is baked along."""
    parser.add_argument("--disk", action="store_true", help="bake a disk's passes too, beside the map")
    unset = argparse.SUPPRESS
    parser.add_argument(
        "--disk-crossings", type=int, default=unset, help=f"images of the disk to follow (default: {DEFAULT_CROSSINGS})"
    )
    parser.add_argument(
        "--disk-inner", type=float, default=unset, help="inner radius, in M (default: the innermost stable orbit)"
    )
    parser.add_argument(
        "--disk-outer", type=float, default=unset, help=f"outer radius, in M (default: {DEFAULT_OUTER_RADIUS:g})"
    )
    parser.add_argument("--disk-retrograde", action="store_true", default=unset, help="it turns against the hole")


def add_render_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how the disk looks."""
    parser.add_argument("--disk", action="store_true", help="draw the disk whose passes were baked beside the map")
    parser.add_argument("--disk-look", choices=tuple(PRESETS), default="physical", help="how the disk looks")
    parser.add_argument("--disk-time", type=float, default=0.0, help="time at which it is seen, in M")
    look = parser.add_argument_group("the disk's look", "in place of the values that --disk-look has")
    add_settings(look, DISK_SETTINGS)


def add_settings(look: argparse._ArgumentGroup, settings: Mapping[str, Setting]) -> None:
    """Add an option for each row of a table."""
    for setting in settings.values():
        added = "; added to the look's own value" if setting.is_added else ""
        look.add_argument(
            setting.option,
            type=type(setting.default),
            choices=[choice.value for choice in setting.choices] or None,
            default=argparse.SUPPRESS,
            metavar=None if setting.choices else "VALUE",
            help=(setting.sentence + added).replace("%", "%%"),
        )


def add_light_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which layer of light is rendered along with a map."""
    parser.add_argument("--light", action="store_true", help="render the disk's light too, as a layer beside the map")
    parser.add_argument("--light-look", choices=tuple(MATTER_PRESETS), default="physical", help="how the disk looks")
    parser.add_argument("--light-time", type=float, default=0.0, help="time at which it is seen, in M")
    parser.add_argument(
        "--light-clock",
        choices=("far", "camera"),
        default="far",
        help="whose time that is: that of clocks far away, or the camera's own, which runs slower",
    )
    look = parser.add_argument_group("the light's look", "in place of the values that --light-look has")
    add_settings(look, MATTER_SETTINGS)


def light_of(options: argparse.Namespace) -> tuple[MatterLook, float] | None:
    """Return the look that the options of ``bake`` ask for, and its time by the clock that they name.

    Raises
    ------
    BlackHoleError
        If a layer is described but not asked for, there is no disk, or a setting is out of its range.
    """
    look, changed = chosen(options, "light", MATTER_PRESETS[options.light_look], MATTER_SETTINGS)
    if not options.light:
        if changed:
            raise BlackHoleError("The light's settings are given without it; add --light.", code="command.no-disk")
        return None
    if not options.disk:
        raise BlackHoleError("There is no light without a disk; add --disk.", code="command.no-disk")
    return look, check_time(options.light_time)


def disk_of(options: argparse.Namespace) -> Disk | None:
    """Return the disk that the options of ``bake`` ask for.

    Raises
    ------
    BlackHoleError
        When a disk is described but not asked for.
    """
    given = {
        field.name: value
        for field, option in zip(dataclasses.fields(Disk), ("crossings", "inner", "outer", "retrograde"), strict=True)
        if (value := getattr(options, f"disk_{option}", None)) is not None
    }
    if given and not options.disk:
        raise BlackHoleError("The disk's settings are given without the disk; add --disk.", code="command.no-disk")
    return Disk(**given) if options.disk else None


def draw_disk(options: argparse.Namespace, warp_map: WarpMap, sky: Array) -> Array:
    """Return the picture, shape (height, width, 4), of the disk that the options of ``render`` ask for over a sky.

    Raises
    ------
    BlackHoleError
        If a setting of the look is out of its range.
    WarpMapError
        If a pass is missing or damaged, or belongs to another map.
    """
    look = look_of(options)
    layers = disk_layers(read_disk_passes(options.map, warp_map), look, disk_texture(), options.disk_time)
    return over_sky(sky, *layers)


def look_of(options: argparse.Namespace) -> DiskLook:
    """Return the look that the options of ``render`` ask for.

    Raises
    ------
    BlackHoleError
        If a setting is out of its range.
    """
    return chosen(options, "disk", PRESETS[options.disk_look], DISK_SETTINGS)[0]


def chosen(options: argparse.Namespace, prefix: str, look: Look, settings: Mapping[str, Setting]) -> tuple[Look, bool]:
    """Return a look with the settings that the options give in place of its own, and whether they give any.

    Raises
    ------
    BlackHoleError
        If a setting is out of its range.
    """
    changes = {name: value for name in settings if (value := getattr(options, f"{prefix}_{name}", None)) is not None}
    for name in changes:
        if settings[name].is_added:
            changes[name] += getattr(look, name)
    look = dataclasses.replace(look, **changes)
    look.validate()
    return look, bool(changes)
