# SPDX-License-Identifier: GPL-3.0-or-later
"""Stars on the command line: options of ``bake`` and ``render``."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

from ..files.star_file import read_stars, stars_path
from ..maps.warp_map import WarpMap
from ..numerics.arrays import Array
from ..numerics.errors import BlackHoleError, WarpMapError
from ..shot.map_parameters import WarpMapParameters
from ..stars.catalog_file import catalog_digest, read_star_catalog
from ..stars.star_layer import StarBaker, StarLayer
from ..stars.star_settings import StarSettings, star_view


def add_bake_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which stars are baked along."""
    parser.add_argument("--stars", action="store_true", help="bake a layer of stars too, beside the map")
    unset = argparse.SUPPRESS
    parser.add_argument("--star-limit", type=float, default=unset, metavar="MAGNITUDE", help="the faintest one drawn")
    parser.add_argument(
        "--star-catalog",
        type=Path,
        default=unset,
        metavar="TABLE.csv",
        help="right ascension, declination (degrees), magnitude, B-V (default: 41,411 real stars)",
    )
    parser.add_argument(
        "--star-rotation", type=float, nargs=3, default=unset, metavar=("X", "Y", "Z"), help="of the sky, degrees"
    )


def add_render_options(parser: argparse.ArgumentParser) -> None:
    """Add the option that draws the stars."""
    parser.add_argument("--stars", action="store_true", help="add the stars that were baked beside the map")


def layer_of(options: argparse.Namespace, parameters: WarpMapParameters) -> StarLayer | None:
    """Return the stars that the options of ``bake`` ask for.

    Raises
    ------
    BlackHoleError
        If stars are described but not asked for, or the catalog cannot be read.
    """
    given = [name for name in ("star_limit", "star_catalog", "star_rotation") if hasattr(options, name)]
    if not options.stars:
        if given:
            raise BlackHoleError(
                "The stars' settings are given without the stars; add --stars.", code="command.no-stars"
            )
        return None
    catalog: Path | None = getattr(options, "star_catalog", None)
    x, y, z = (math.radians(angle) for angle in getattr(options, "star_rotation", (0.0, 0.0, 0.0)))
    settings = StarSettings(rotation=(x, y, z), magnitude_limit=getattr(options, "star_limit", math.inf))
    if catalog is None:
        return StarBaker().bake(parameters, None, settings)
    settings = replace(settings, catalog=catalog.name, catalog_digest=catalog_digest(catalog))
    return StarBaker().bake(parameters, read_star_catalog(catalog), settings)


def add_stars(options: argparse.Namespace, warp_map: WarpMap, sky: Array) -> Array:
    """Return a picture, shape (height, width, 4), with the stars that were baked beside its map.

    Raises
    ------
    WarpMapError
        If the stars are missing or damaged, belong to another map, or to a sky that is turned in another way.
    """
    path = stars_path(options.map)
    layer = read_stars(path)
    wanted = WarpMapParameters.from_metadata(warp_map.metadata["parameters"])
    if layer.metadata["hash"] != star_view(wanted).hash:
        raise WarpMapError(f"{path} does not belong to {options.map}; bake it again.", code="map.passes-mixed")
    turned = [math.radians(angle) for angle in options.rotation]
    if any(abs(a - b) > 1e-9 for a, b in zip(layer.metadata["stars"]["rotation"], turned, strict=True)):
        raise WarpMapError(
            f"The sky is turned in another way than the stars of {path}; bake them with the same --star-rotation.",
            code="map.passes-mixed",
        )
    picture: Array = sky.copy()
    picture[..., :3] += layer.image * 2.0**options.exposure
    return picture
