# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: ``python -m physics bake``, ``render``, ``verify`` and ``accuracy``."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .cli import accuracy_command, disk_command, verify_command
from .files.warp_map_file import read_warp_map, write_warp_map
from .geodesics.tracer import DEFAULT_METHOD, DEFAULT_TOLERANCE, METHODS
from .images.exr import read_exr, write_exr
from .images.png import write_png
from .maps.warp_map import bake
from .numerics.errors import BlackHoleError
from .reference.reference_render import render
from .shot.cameras import Camera, PanoramaCamera, PerspectiveCamera
from .shot.map_parameters import (
    DEFAULT_INTERPOLATION,
    MOTIONS,
    SUPERSAMPLING,
    WarpMapParameters,
    looking_at_hole,
    unstable_orbit_warning,
)

# Motions as they are spelled on a command line; "velocity" has no short form there.
ORBITS = {motion.replace("_", "-"): motion for motion in MOTIONS if motion != "velocity"}

# What infinities in a sky are taken as: the largest half-precision number, which they were once above.
BRIGHTEST = 65504.0

PICTURE_ENDINGS = (".png", ".exr")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status: 0 done, 1 a sentence on standard error, 2 wrong usage."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except BlackHoleError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ncanceled: nothing was written", file=sys.stderr)
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m physics", description="Warp maps of a spinning black hole, without Blender."
    )
    commands = parser.add_subparsers(required=True, metavar="command")

    baking = commands.add_parser(
        "bake",
        help="trace a warp map of a camera that looks at the hole",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    baking.set_defaults(run=_bake)
    baking.add_argument("output", metavar="OUT.exr", type=Path)
    baking.add_argument("--spin", type=float, default=0.9, help="spin of the hole, above -1 and below 1")
    baking.add_argument("--radius", type=float, default=20.0, help="distance of the camera, in M")
    baking.add_argument("--inclination", type=float, default=80.0, help="degrees from the spin axis, 0 to 180")
    baking.add_argument("--azimuth", type=float, default=0.0, help="degrees about the spin axis")
    baking.add_argument("--orbit", choices=tuple(ORBITS), default="fido", help="how the camera moves")
    baking.add_argument("--width", type=int, default=1920, help="pixels of the picture")
    baking.add_argument("--height", type=int, default=1080, help="pixels of the picture")
    baking.add_argument("--fov", type=float, default=60.0, help="vertical field of view, degrees")
    baking.add_argument("--panorama", action="store_true", help="the whole sky, equirectangular, instead of --fov")
    baking.add_argument("--supersampling", type=int, choices=SUPERSAMPLING, default=1, help="map pixels per side")
    baking.add_argument("--tolerance", type=float, default=DEFAULT_TOLERANCE, help="error of a ray, radians")
    baking.add_argument(
        "--interpolation",
        type=float,
        default=DEFAULT_INTERPOLATION,
        help="error of direction between traced rays, radians; 0 traces every pixel",
    )
    baking.add_argument("--method", choices=tuple(METHODS), default=DEFAULT_METHOD, help="how rays are traced")

    disk_command.add_bake_options(baking)

    rendering = commands.add_parser(
        "render",
        help="make the picture of a warp map over an equirectangular sky",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    rendering.set_defaults(run=_render)
    rendering.add_argument("map", metavar="MAP.exr", type=Path)
    rendering.add_argument("sky", metavar="SKY.exr", type=Path)
    rendering.add_argument("output", metavar="PICTURE.png|exr", type=Path)
    rendering.add_argument(
        "--rotation", type=float, nargs=3, default=(0.0, 0.0, 0.0), metavar=("X", "Y", "Z"), help="of the sky, degrees"
    )
    rendering.add_argument("--exposure", type=float, default=0.0, help="stops by which the sky is brightened")
    rendering.add_argument("--redshift-color", type=float, default=1.0, help="0 off, 1 physical")
    rendering.add_argument("--redshift-brightness", type=float, default=1.0, help="0 off, 1 physical")
    rendering.add_argument("--temperature", type=float, default=6500.0, help="of the sky's light, kelvin")
    disk_command.add_render_options(rendering)

    verifying = commands.add_parser("verify", help="read maps and disk passes whole, and say which hold")
    verifying.set_defaults(run=verify_command.verify)
    verify_command.add_options(verifying)
    accuracy_command.add_command(commands, _ProgressPrinter)
    return parser


def _bake(options: argparse.Namespace) -> None:
    if options.output.suffix.lower() != ".exr":
        raise BlackHoleError(f"{options.output} does not end in .exr; warp maps are OpenEXR files.")
    if options.output.is_dir():
        raise BlackHoleError(f"{options.output} is a folder; give the name of a file.")
    if not 0.0 <= options.inclination <= 180.0:
        raise BlackHoleError(f"The inclination is {options.inclination:g} degrees; give 0 to 180.")
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
        raise BlackHoleError(f"The radius is {options.radius:g} M; it must be positive.")
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
        disk=disk_command.disk_of(options),
    )
    parameters.validate()
    warning = unstable_orbit_warning(parameters)
    if warning:
        print(f"note: {warning}", file=sys.stderr)
    started = time.perf_counter()
    warp_map = bake(parameters, progress=_ProgressPrinter())
    passes = disk_command.write_passes(options.output, warp_map)
    write_warp_map(options.output, warp_map)
    counts = dict(warp_map.counts)
    rays = counts.pop("rays") + counts.pop("shared") + counts.pop("disk_rays", 0)
    lost = counts.pop("disk_unresolved", 0)
    pixels = ", ".join(f"{count} {name}" for name, count in counts.items())
    print(f"wrote {options.output} in {time.perf_counter() - started:.1f} s: {pixels} pixels from {rays} rays")
    unresolved = warp_map.counts["unresolved"]
    for path in passes:
        print(f"wrote {path}")
    if lost:
        print(f"note: the disk could not be resolved in {lost} pixels and is missing there", file=sys.stderr)
    if unresolved:
        print(f"note: {unresolved} pixels could not be resolved and will show magenta", file=sys.stderr)


def _render(options: argparse.Namespace) -> None:
    if options.output.suffix.lower() not in PICTURE_ENDINGS:
        raise BlackHoleError(f"{options.output} must end in {' or '.join(PICTURE_ENDINGS)}.")
    if not options.temperature > 0.0:
        raise BlackHoleError(f"The temperature is {options.temperature:g} K; it must be positive.")
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
        color_amount=options.redshift_color,
        brightness_amount=options.redshift_brightness,
        temperature=options.temperature,
        exposure=options.exposure,
        output_size=(camera["width"], camera["height"]),
    )
    image = disk_command.draw_disk(options, warp_map, picture.image) if options.disk else picture.image
    if options.output.suffix.lower() == ".png":
        write_png(options.output, image)
    else:
        write_exr(options.output, image.astype("float32"))
    print(f"wrote {options.output}")


class _ProgressPrinter:
    """Shows a fraction: as a line that is rewritten on a terminal, at every tenth elsewhere."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._shown = -1

    def __call__(self, fraction: float) -> None:
        percent = int(100.0 * fraction)
        if not self._terminal:
            percent -= percent % 10
        if percent == self._shown:
            return
        self._shown = percent
        end = "\n" if percent >= 100 or not self._terminal else ""
        start = "\r" if self._terminal else ""
        print(f"{start}tracing {percent} %", end=end, file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
