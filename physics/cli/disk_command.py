# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk on the command line: options of ``bake`` and ``render``, and where the passes are."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from ..disk_passes.disk_pass import DiskPass
from ..files.disk_pass_file import read_disk_pass, write_disk_pass
from ..geodesics.disk_tracer import DEFAULT_CROSSINGS
from ..light.disk_look import PRESETS
from ..light.disk_texture import disk_texture
from ..maps.warp_map import WarpMap
from ..numerics.arrays import Array
from ..numerics.errors import BlackHoleError, WarpMapError
from ..reference.disk_render import disk_layers, over_sky
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


def add_render_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how the disk looks."""
    parser.add_argument("--disk", action="store_true", help="draw the disk whose passes were baked beside the map")
    parser.add_argument("--disk-look", choices=tuple(PRESETS), default="physical", help="how the disk looks")
    parser.add_argument("--disk-exposure", type=float, default=0.0, help="stops by which the disk is brightened")
    parser.add_argument("--disk-time", type=float, default=0.0, help="time at which it is seen, in M")


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
        raise BlackHoleError("The disk's settings are given without the disk; add --disk.")
    return Disk(**given) if options.disk else None


def pass_path(map_path: Path, crossing: int) -> Path:
    """Return where the pass of a crossing, counted from 1, lies beside its map: MAP_disk1.exr and so on."""
    return map_path.with_name(f"{map_path.stem}_disk{crossing}{map_path.suffix}")


def write_passes(map_path: Path, warp_map: WarpMap) -> list[Path]:
    """Write a map's passes beside it and return where.

    Raises
    ------
    ImageFileError
        When a file cannot be written.
    """
    paths = []
    for one in warp_map.disk_passes:
        paths.append(pass_path(map_path, one.metadata["crossing"]))
        write_disk_pass(paths[-1], one)
    return paths


def read_passes(map_path: Path, warp_map: WarpMap) -> list[DiskPass]:
    """Read the passes that were baked along with a map.

    Raises
    ------
    BlackHoleError
        When the map was baked without a disk.
    WarpMapError
        When a pass is missing or damaged, or belongs to another map.
    """
    disk = warp_map.metadata["parameters"].get("disk")
    if not disk:
        raise BlackHoleError(f"{map_path} was baked without a disk; bake it again with --disk.")
    passes = []
    for crossing in range(1, disk["crossings"] + 1):
        path = pass_path(map_path, crossing)
        one = read_disk_pass(path)
        if one.metadata["hash"] != warp_map.metadata["hash"] or one.metadata["crossing"] != crossing:
            raise WarpMapError(f"{path} does not belong to {map_path}; bake it again.")
        passes.append(one)
    return passes


def draw_disk(options: argparse.Namespace, warp_map: WarpMap, sky: Array) -> Array:
    """Return the picture, shape (height, width, 4), of the disk that the options of ``render`` ask for over a sky."""
    look = PRESETS[options.disk_look]
    look = dataclasses.replace(look, exposure=look.exposure + options.disk_exposure)
    layers = disk_layers(read_passes(options.map, warp_map), look, disk_texture(), options.disk_time)
    return over_sky(sky, *layers)
