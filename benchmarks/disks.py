# SPDX-License-Identifier: GPL-3.0-or-later
"""What an accretion disk adds to a map: tracing, and writing its passes."""

# isort: off
import measuring  # before numpy
# isort: on

import dataclasses
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

import physics

# Spin, radius and field of view, degrees, from 10 degrees above the plane: a disk that fills a fifth of a full-HD
# picture, half of it, most of it.
VIEWS = ((0.6, 48.0, 42.0), (0.9, 30.0, 50.0), (0.999, 10.0, 60.0))
HEIGHT = math.radians(10.0)


def lines(repeats: int) -> Iterator[str]:
    """Seconds of maps in full HD and 4K with and without a disk of three crossings, and with their files written."""
    yield "with a disk                          map   with disk   times      rays   files too:  map   with disk   times"
    for width, height in ((1920, 1080), (3840, 2160)):
        for spin, radius, degrees in VIEWS:
            place = (radius * math.cos(HEIGHT), 0.0, radius * math.sin(HEIGHT))
            bare = measuring.shot(
                width,
                height,
                spin=spin,
                camera=physics.PerspectiveCamera.from_field_of_view(width, height, math.radians(degrees)),
                camera_position=place,
                camera_to_hole=physics.looking_at_hole(place),
            )
            disk = dataclasses.replace(bare, disk=physics.Disk())
            alone, both = (measuring.best_time(lambda each=each: physics.bake(each), repeats) for each in (bare, disk))
            with tempfile.TemporaryDirectory() as folder:
                file, files = (
                    measuring.best_time(lambda each=each: _frame(each, Path(folder)), repeats) for each in (bare, disk)
                )
            rays = physics.bake(disk).counts["disk_rays"]
            yield (
                f"  {width} x {height}, {spin:5.3f}, {radius:2.0f} M  {alone:7.3f} s  {both:8.3f} s"
                f"  {both / alone:6.1f}  {rays:8,d}         {file:8.3f} s  {files:8.3f} s  {files / file:6.1f}"
            )


def _frame(parameters: physics.WarpMapParameters, folder: Path) -> None:
    warp_map = physics.bake(parameters)
    physics.write_warp_map(folder / "map.exr", warp_map)
    for order, one in enumerate(warp_map.disk_passes, start=1):
        physics.write_disk_pass(folder / f"disk{order}.exr", one)
