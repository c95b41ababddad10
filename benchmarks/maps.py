# SPDX-License-Identifier: GPL-3.0-or-later
"""How long warp maps take: by size, with and without interpolation, on the disk."""

# isort: off
import measuring  # before numpy
# isort: on

import dataclasses
import tempfile
from collections.abc import Iterator
from pathlib import Path

import OpenEXR
from measuring import Row

import physics

SIZES = ((480, 270), (1920, 1080), (3840, 2160))
PANORAMA = (8192, 4096)

# Lossless, and read by every Blender that is supported. ZIP is what maps are written with.
COMPRESSIONS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ")


def rows(repeats: int) -> Iterator[Row | str]:
    for width, height in SIZES:
        parameters = measuring.shot(width, height)
        exact = dataclasses.replace(parameters, interpolation=0.0)
        every = physics.bake(exact)
        warp_map = physics.bake(parameters)
        typical, largest = measuring.map_errors(warp_map, every)
        yield map_row(f"map {width} x {height}", parameters, warp_map, repeats, typical, largest)
        yield map_row(f"map {width} x {height}, every pixel traced", exact, every, 1)
    parameters = measuring.shot(1, 1, camera=physics.PanoramaCamera(*PANORAMA))
    yield map_row("panorama {} x {}".format(*PANORAMA), parameters, physics.bake(parameters), 1)


def map_row(
    name: str,
    parameters: physics.WarpMapParameters,
    warp_map: physics.WarpMap,
    repeats: int,
    typical: float | None = None,
    largest: float | None = None,
) -> Row:
    seconds = measuring.best_time(lambda: physics.bake(parameters), repeats)
    peak = measuring.peak_memory(lambda: physics.bake(parameters))
    pixels = warp_map.theta.size
    return Row(name, seconds, pixels, "pixels/s", peak, warp_map.counts["rays"], typical, largest)


def file_lines(repeats: int) -> Iterator[str]:
    """Time and size of one full-HD map on the disk, and what OpenEXR's other lossless compressions would make of it."""
    warp_map = physics.bake(measuring.shot(1920, 1080))
    planes = (warp_map.theta, warp_map.phi, warp_map.one_plus_z, warp_map.visibility)
    channels = dict(zip("RGBA", planes, strict=True))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.exr"
        written = measuring.best_time(lambda: physics.write_warp_map(path, warp_map), repeats)
        read = measuring.best_time(lambda: physics.read_warp_map(path), repeats)
        size = path.stat().st_size / 1e6
        yield f"1920 x 1080 file: {size:.1f} MB, {written:.3f} s to write, {read:.3f} s to read and check, all cores"
        yield "one core:  compression   write (s)   read (s)      MB"
        for name in COMPRESSIONS:
            header = {"compression": getattr(OpenEXR, f"{name}_COMPRESSION"), "type": OpenEXR.scanlineimage}

            def write(header: dict = header) -> None:
                with OpenEXR.File(header, channels) as file:
                    file.write(str(path))

            def read_back() -> None:
                with OpenEXR.File(str(path), separate_channels=True) as file:
                    file.channels()

            written, read = measuring.best_time(write, repeats), measuring.best_time(read_back, repeats)
            yield f"           {name:11s}   {written:9.3f}   {read:8.3f}   {path.stat().st_size / 1e6:5.1f}"


def time_against_pixels(repeats: int) -> dict[str, list[tuple[int, float]]]:
    """(pixels, seconds) of maps of all sizes: interpolated, every pixel traced, and every pixel by steps."""
    curves: dict[str, list[tuple[int, float]]] = {}
    for label, changes, tallest in (
        ("adaptive", {}, 4320),
        ("every pixel, Fast", {"interpolation": 0.0}, 2160),
        ("every pixel, Reference", {"interpolation": 0.0, "method": "cash-karp"}, 540),
    ):
        curves[label] = []
        for height in (135, 270, 540, 1080, 2160, 4320):
            if height > tallest:
                break
            parameters = measuring.shot(height * 16 // 9, height, **changes)
            rounds = repeats if height <= 540 else 2
            seconds = measuring.best_time(lambda parameters=parameters: physics.bake(parameters), rounds)
            curves[label].append((parameters.map_size[0] * height, seconds))
    return curves
