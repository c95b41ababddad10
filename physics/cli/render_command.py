# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m physics render``: the picture of a warp map over a sky."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np

from ..files.warp_map_file import read_warp_map
from ..images.exr import read_exr, write_exr
from ..images.png import write_png
from ..light.sky_settings import RENDER_ARGUMENTS, SKY_SETTINGS
from ..numerics.errors import BlackHoleError
from ..reference.reference_render import render
from . import disk_options

NAME = "render"
HELP = "make the picture of a warp map over an equirectangular sky"

# What infinities in a sky are taken as: the largest half-precision number, which they were once above.
BRIGHTEST = 65504.0

PICTURE_ENDINGS = (".png", ".exr")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("map", metavar="MAP.exr", type=Path)
    parser.add_argument("sky", metavar="SKY.exr", type=Path)
    parser.add_argument("output", metavar="PICTURE.png|exr", type=Path)
    parser.add_argument(
        "--rotation", type=float, nargs=3, default=(0.0, 0.0, 0.0), metavar=("X", "Y", "Z"), help="of the sky, degrees"
    )
    for setting in SKY_SETTINGS.values():
        parser.add_argument(setting.option, type=float, default=setting.default, metavar="VALUE", help=setting.sentence)
    # The British spelling, for command lines that have it.
    parser.add_argument(
        "--redshift-colour", dest="redshift_color", type=float, default=argparse.SUPPRESS, help=argparse.SUPPRESS
    )
    disk_options.add_render_options(parser)


def sky_arguments(options: argparse.Namespace) -> dict[str, float]:
    """Return how the sky looks by the options, as arguments of `reference_render.render`."""
    values = {name: getattr(options, row.option[2:].replace("-", "_")) for name, row in SKY_SETTINGS.items()}
    return {RENDER_ARGUMENTS[name]: value for name, value in values.items()}


def run(options: argparse.Namespace) -> None:
    """Make the picture and write it.

    Raises
    ------
    BlackHoleError
        If the options cannot be used, or a file cannot be read or written.
    """
    if options.output.suffix.lower() not in PICTURE_ENDINGS:
        raise BlackHoleError(f"{options.output} must end in {' or '.join(PICTURE_ENDINGS)}.", code="command.file-name")
    if not options.temperature > 0.0:
        raise BlackHoleError(
            f"The temperature is {options.temperature:g} K; it must be positive.", code="sky.temperature"
        )
    warp_map = read_warp_map(options.map)
    camera = warp_map.metadata["parameters"]["camera"]
    environment, _ = read_exr(options.sky)
    broken = ~np.isfinite(environment)
    if broken.any():
        count = int(broken.any(axis=-1).sum())
        print(
            f"note: {count} pixels of the sky are no finite numbers; they are taken as black or very bright",
            file=sys.stderr,
        )
        environment = np.nan_to_num(environment, nan=0.0, posinf=BRIGHTEST, neginf=0.0)
    if environment.shape[1] != 2 * environment.shape[0]:
        print("note: the sky is not twice as wide as high; is it an equirectangular panorama?", file=sys.stderr)
    picture = render(
        warp_map,
        environment,
        rotation=[math.radians(angle) for angle in options.rotation],
        **sky_arguments(options),
        output_size=(camera["width"], camera["height"]),
    )
    image = disk_options.draw_disk(options, warp_map, picture.image) if options.disk else picture.image
    if options.output.suffix.lower() == ".png":
        write_png(options.output, image)
    else:
        write_exr(options.output, image.astype("float32"))
    print(f"wrote {options.output}")
