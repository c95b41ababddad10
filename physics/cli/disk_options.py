# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk on the command line: options of ``bake``, and the layer that ``render`` shows."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from ..files.light_layer_file import light_layer_path, read_light_layer
from ..geodesics.disk_tracer import DEFAULT_CROSSINGS
from ..light.matter_settings import MATTER_PRESETS, MATTER_SETTINGS, MatterLook
from ..maps.warp_map import WarpMap
from ..matter.light_layer import LightLayer, check_time
from ..numerics.errors import BlackHoleError, WarpMapError
from ..shot.disk import DEFAULT_OUTER_RADIUS, Disk


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
    for setting in MATTER_SETTINGS.values():
        added = "; added to the look's own value" if setting.is_added else ""
        look.add_argument(
            setting.option,
            type=type(setting.default),
            choices=[choice.value for choice in setting.choices] or None,
            default=argparse.SUPPRESS,
            metavar=None if setting.choices else "VALUE",
            help=(setting.sentence + added).replace("%", "%%"),
        )


def light_of(options: argparse.Namespace) -> tuple[MatterLook, float] | None:
    """Return the look that the options of ``bake`` ask for, and its time by the clock that they name.

    Raises
    ------
    BlackHoleError
        If a layer is described but not asked for, there is no disk, or a setting is out of its range.
    """
    look = MATTER_PRESETS[options.light_look]
    changes = {
        name: value for name in MATTER_SETTINGS if (value := getattr(options, f"light_{name}", None)) is not None
    }
    for name in changes:
        if MATTER_SETTINGS[name].is_added:
            changes[name] += getattr(look, name)
    look = dataclasses.replace(look, **changes)
    look.validate()
    if not options.light:
        if changes:
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


def read_layer(map_path: Path, warp_map: WarpMap) -> LightLayer:
    """Return the layer of light that was baked beside a map.

    Raises
    ------
    WarpMapError
        If it is missing or damaged, or belongs to another map.
    """
    path = Path(light_layer_path(map_path))
    if not path.exists():
        raise WarpMapError(f"{path} does not exist; bake the map again with --disk --light.", code="file.missing")
    layer = read_light_layer(path)
    if layer.metadata["hash"] != warp_map.metadata["hash"]:
        raise WarpMapError(f"{path} does not belong to {map_path}; bake it again.", code="map.passes-mixed")
    return layer
