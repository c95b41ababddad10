# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m physics render``: the picture of a warp map over a sky."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np

from ..files.disk_pass_file import find_pass
from ..files.light_layer_file import light_layer_path
from ..files.star_file import stars_path
from ..files.warp_map_file import read_warp_map, read_warp_map_metadata
from ..images.exr import replacing, write_exr
from ..images.picture import read_picture
from ..images.png import write_png
from ..light.color import redshift_gain
from ..light.sky_settings import GLARE, RENDER_ARGUMENTS, SKY_FILTER, SKY_SETTINGS
from ..numerics.errors import BlackHoleError
from ..reference.glare import add_glare
from ..reference.reference_render import over_sky, render
from . import disk_options, star_options
from .console import note, say
from .output_files import check_picture

NAME = "render"
HELP = "make the picture of a warp map over an equirectangular sky"

# What infinities in a sky are taken as: the largest half-precision number, which they were once above.
BRIGHTEST = 65504.0

PICTURE_ENDINGS = (".png", ".exr")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("map", metavar="MAP.exr", type=Path)
    parser.add_argument("sky", metavar="SKY", type=Path, help="EXR; also .hdr, .png or .jpg")
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
    parser.add_argument(
        SKY_FILTER.option,
        choices=[each.identifier.lower() for each in SKY_FILTER.choices],
        default=SKY_FILTER.identifier(int(SKY_FILTER.default)).lower(),
        help=SKY_FILTER.description,
    )
    parser.add_argument(
        GLARE.option,
        choices=[each.identifier.lower() for each in GLARE.choices],
        default=GLARE.identifier(int(GLARE.default)).lower(),
        help=GLARE.description,
    )
    star_options.add_render_options(parser)
    parser.add_argument("--light", action="store_true", help="draw the disk: its light that was baked beside the map")


def sky_arguments(options: argparse.Namespace) -> dict[str, Any]:
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
    for name in ("exposure", "redshift_color", "redshift_brightness"):
        problem = SKY_SETTINGS[name].problem(getattr(options, name))
        if problem is not None:
            raise BlackHoleError(f"The {SKY_SETTINGS[name].label.lower()} {problem}.", code="settings.range")
    redshift_gain(1.0, temperature=options.temperature)  # which refuses temperatures that cannot be
    disk = read_warp_map_metadata(options.map)["parameters"].get("disk")
    passes = [find_pass(options.map, crossing) for crossing in range(1, (disk["crossings"] if disk else 0) + 1)]
    light_path = light_layer_path(options.map)
    check_picture(options.output, [options.map, options.sky, *passes, Path(light_path), Path(stars_path(options.map))])
    warp_map = read_warp_map(options.map)
    layer = disk_options.read_layer(options.map, warp_map) if options.light else None
    camera = warp_map.metadata["parameters"]["camera"]
    environment = read_picture(options.sky)
    broken = ~np.isfinite(environment)
    if broken.any():
        count = int(broken.any(axis=-1).sum())
        note(f"note: {count} pixels of the sky are no finite numbers; they are taken as black or very bright")
        environment = np.nan_to_num(environment, nan=0.0, posinf=BRIGHTEST, neginf=0.0)
    if environment.shape[1] != 2 * environment.shape[0]:
        note("note: the sky is not twice as wide as high; is it an equirectangular panorama?")
    picture = render(
        warp_map,
        environment,
        rotation=[math.radians(angle) for angle in options.rotation],
        **sky_arguments(options),
        output_size=(camera["width"], camera["height"]),
        looks=next(int(each.value) for each in SKY_FILTER.choices if each.identifier == options.filter.upper()),
    )
    image = star_options.add_stars(options, warp_map, picture.image) if options.stars else picture.image
    if layer is not None:
        image = over_sky(image, layer.light, layer.transmittance)
    glare = next(int(each.value) for each in GLARE.choices if each.identifier == options.glare.upper())
    image = add_glare(image, glare)
    with replacing(options.output) as temporary:
        if options.output.suffix.lower() == ".png":
            write_png(temporary, image)
        else:
            write_exr(temporary, image.astype("float32"))
        say(f"wrote {options.output}")
