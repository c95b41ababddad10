# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m physics bake``: trace a warp map."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import time
from pathlib import Path

from ..files import light_layer_file, star_file, warp_map_file
from ..files.companions import files_beside, write_companions
from ..files.light_layer_file import light_layer_path, write_light_layer
from ..files.warp_map_file import write_warp_map
from ..geodesics.tracer import DEFAULT_METHOD, DEFAULT_TOLERANCE, METHODS
from ..images.exr import replacing
from ..maps.disk_passes import DiskPasses
from ..maps.warp_map import WarpMap, bake
from ..matter.light_layer import LightParameters, clock_rate, render_matter
from ..numerics.errors import BlackHoleError
from ..shot.cameras import Camera, PanoramaCamera, PerspectiveCamera
from ..shot.map_parameters import (
    DEFAULT_INTERPOLATION,
    MOTIONS,
    SUPERSAMPLING,
    WarpMapParameters,
    looking_at_hole,
    unstable_orbit_warning,
)
from . import disk_options, star_options
from .console import note, say
from .output_files import check_maps
from .progress import ProgressPrinter

NAME = "bake"
HELP = "trace a warp map of a camera that looks at the hole"

# Motions as they are spelled on a command line; "velocity" has no short form there.
ORBITS = {motion.replace("_", "-"): motion for motion in MOTIONS if motion != "velocity"}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("output", metavar="OUT.exr", type=Path)
    parser.add_argument("--spin", type=float, default=0.9, help="spin of the hole, above -1 and below 1")
    parser.add_argument("--radius", type=float, default=20.0, help="distance of the camera, in M")
    parser.add_argument("--inclination", type=float, default=80.0, help="degrees from the spin axis, 0 to 180")
    parser.add_argument("--azimuth", type=float, default=0.0, help="degrees about the spin axis")
    parser.add_argument("--orbit", choices=tuple(ORBITS), default="fido", help="how the camera moves")
    parser.add_argument("--width", type=int, default=1920, help="pixels of the picture")
    parser.add_argument("--height", type=int, default=1080, help="pixels of the picture")
    parser.add_argument("--fov", type=float, default=60.0, help="vertical field of view, degrees")
    parser.add_argument("--panorama", action="store_true", help="the whole sky, equirectangular, instead of --fov")
    parser.add_argument("--supersampling", type=int, choices=SUPERSAMPLING, default=1, help="map pixels per side")
    parser.add_argument("--tolerance", type=float, default=DEFAULT_TOLERANCE, help="error of a ray, radians")
    parser.add_argument(
        "--interpolation",
        type=float,
        default=DEFAULT_INTERPOLATION,
        help="error of direction between traced rays, radians; 0 traces every pixel",
    )
    parser.add_argument("--method", choices=tuple(METHODS), default=DEFAULT_METHOD, help="how rays are traced")
    parser.add_argument(
        "--footprint",
        action="store_true",
        help="write the sizes of the pixels on the sky as well, by which Blender's compositor filters it",
    )
    disk_options.add_bake_options(parser)
    star_options.add_bake_options(parser)
    disk_options.add_light_options(parser)


def run(options: argparse.Namespace) -> None:
    """Trace the map and write it, with what is baked beside it.

    Raises
    ------
    BlackHoleError
        If no map can be made from the options, or a file cannot be written.
    """
    if options.output.suffix.lower() != ".exr":
        raise BlackHoleError(
            f"{options.output} does not end in .exr; warp maps are OpenEXR files.", code="command.file-name"
        )
    if os.path.isdir(options.output):
        raise BlackHoleError(f"{options.output} is a folder; give the name of a file.", code="command.file-name")
    if not 0.0 <= options.inclination <= 180.0:
        raise BlackHoleError(
            f"The inclination is {options.inclination:g} degrees; give 0 to 180.", code="settings.range"
        )
    camera: Camera
    if options.panorama:
        camera = PanoramaCamera(options.width, options.height)
    else:
        camera = PerspectiveCamera.from_field_of_view(options.width, options.height, math.radians(options.fov))
    theta, phi = math.radians(options.inclination), math.radians(options.azimuth)
    position = (
        options.radius * math.sin(theta) * math.cos(phi),
        options.radius * math.sin(theta) * math.sin(phi),
        options.radius * math.cos(theta),
    )
    if not options.radius > 0.0:
        raise BlackHoleError(f"The radius is {options.radius:g} M; it must be positive.", code="settings.range")
    parameters = WarpMapParameters(
        spin=options.spin,
        camera=camera,
        camera_position=position,
        camera_to_hole=looking_at_hole(position),
        motion=ORBITS[options.orbit],
        supersampling=options.supersampling,
        tolerance=options.tolerance,
        method=options.method,
        interpolation=options.interpolation,
        disk=disk_options.disk_of(options),
    )
    parameters.validate()
    light = disk_options.light_of(options)
    beside = dict(files_beside(options.output, parameters, optional=options.footprint))
    if options.stars:
        beside[Path(star_file.stars_path(options.output))] = star_file.FORMAT
    if light:
        beside[Path(light_layer_path(options.output))] = light_layer_file.FORMAT
    check_maps({options.output: warp_map_file.FORMAT, **beside})
    warning = unstable_orbit_warning(parameters)
    if warning:
        note(f"note: {warning}")
    started = time.perf_counter()
    stars = star_options.layer_of(options, parameters)
    warp_map = bake(parameters, progress=ProgressPrinter())
    layer = None
    if light:
        look, moment = light
        if options.light_clock == "camera":
            moment /= clock_rate(parameters.spin, parameters.observer())
        layer = render_matter(LightParameters(parameters, look, moment), DiskPasses.of(warp_map))
    with contextlib.ExitStack() as together:  # all files or none, and the map, which counts, as the last
        map_file = together.enter_context(replacing(options.output))
        write_companions(
            options.output,
            warp_map,
            lambda path: together.enter_context(replacing(path)),
            optional=options.footprint,
        )
        if stars is not None:
            star_file.write_stars(together.enter_context(replacing(star_file.stars_path(options.output))), stars)
        if layer is not None:
            write_light_layer(together.enter_context(replacing(light_layer_path(options.output))), layer)
        write_warp_map(map_file, warp_map)
        say("\n".join(_summary(options.output, list(beside), warp_map, time.perf_counter() - started)))
    lost, unresolved = warp_map.counts.get("disk_unresolved", 0), warp_map.counts["unresolved"]
    if lost:
        note(f"note: the disk could not be resolved in {lost} pixels and is missing there")
    if unresolved:
        note(f"note: {unresolved} pixels could not be resolved and will show magenta")


def _summary(output: Path, passes: list[Path], warp_map: WarpMap, seconds: float) -> list[str]:
    """Return what is said of a map that was baked."""
    counts = dict(warp_map.counts)
    counts.pop("disk_unresolved", 0)
    rays = counts.pop("rays") + counts.pop("shared") + counts.pop("disk_rays", 0)
    pixels = ", ".join(f"{count} {name}" for name, count in counts.items())
    first = f"wrote {output} in {seconds:.1f} s: {pixels} pixels from {rays} rays"
    return [first, *(f"wrote {path}" for path in passes)]
