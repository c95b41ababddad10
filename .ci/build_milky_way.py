# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the picture of the Milky Way that the built-in sky shows, from a JPEG of the whole sky in Gaia's colors.

    PYTHONPATH=. python .ci/build_milky_way.py SOURCE.jpg

The source is equirectangular in galactic coordinates, the center in the middle, sRGB; physics/light/data/README.md
names it and its license. Single stars, the raised black and the grain are taken out.
"""

import argparse
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.lib.stride_tricks import sliding_window_view
from PIL import Image

import physics
from physics.light import black_body, milky_way
from physics.light.black_body import LUMINANCE_WEIGHTS
from physics.light.star_color import temperature_from_color_index

ROWS = 1280

# Pixels of the source: the median over this square knows no star and little grain, the mean over the other gives color.
MEDIAN, MEAN = 7, 15
# A pixel counts to the color up to so many times the median.
BRIGHTEST = 1.5

# What remains of the black at the poles is this much of it; light is raised to the power, since the source is stretched
# for display: so the center is six times as bright as the anticenter.
BLACK, POWER = 1.1, 1.2

# B-V of the stars in the disc: see `milky_way.BRIGHTNESS`.
COLOR_INDEX = 0.725

COMPRESSION_LEVEL = 45.0  # of DWAA: 0.4 % of the mean light


def main() -> None:
    """Read the source and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path)
    with Image.open(parser.parse_args().source) as picture:
        light = physics.linear_from_srgb(np.asarray(picture.convert("RGB"), np.float32) / 255.0)
    luminance = (light @ LUMINANCE_WEIGHTS).astype(np.float32)
    diffuse = median(luminance, MEDIAN)
    starless = np.minimum(light, BRIGHTEST * diffuse[..., np.newaxis])
    color = mean(starless, MEAN)
    color /= np.maximum(color @ LUMINANCE_WEIGHTS, 1e-6)[..., np.newaxis]
    picture = resampled(resampled(diffuse[..., np.newaxis] * color, ROWS, 0), 2 * ROWS, 1)

    latitude = np.pi * (0.5 - (np.arange(ROWS) + 0.5) / ROWS)
    black = np.median(picture[np.abs(latitude) > np.radians(75.0)].reshape(-1, 3), axis=0)
    picture = np.maximum(picture - BLACK * black, 0.0) ** POWER
    inside = np.abs(latitude) < milky_way.BAND
    in_band = np.average(picture[inside].mean(axis=1), axis=0, weights=np.cos(latitude[inside]))
    picture *= black_body.color(temperature_from_color_index(COLOR_INDEX)) / in_band

    header = {"compression": OpenEXR.DWAA_COMPRESSION, "type": OpenEXR.scanlineimage}
    header["dwaCompressionLevel"] = COMPRESSION_LEVEL
    pixels = np.ascontiguousarray(picture.astype(np.float16))
    OpenEXR.File(header, {"RGB": OpenEXR.Channel(pixels)}).write(str(milky_way.PICTURE))
    print(f"{milky_way.PICTURE.name}: {milky_way.PICTURE.stat().st_size / 1e6:.1f} MB")


def around(picture: np.ndarray, reach: int) -> np.ndarray:
    """The picture with a margin: columns go on around the sky, rows are extended."""
    rest = ((0, 0),) * (picture.ndim - 2)
    wide = np.pad(picture, ((0, 0), (reach, reach), *rest), mode="wrap")
    return np.pad(wide, ((reach, reach), (0, 0), *rest), mode="edge")


def median(picture: np.ndarray, width: int) -> np.ndarray:
    """Median over a square around each pixel."""
    windows = sliding_window_view(around(picture, width // 2), (width, width))
    result = np.empty_like(picture)
    for row in range(len(picture)):
        result[row] = np.median(windows[row].reshape(picture.shape[1], -1), axis=-1)
    return result


def mean(picture: np.ndarray, width: int) -> np.ndarray:
    """Mean over a square around each pixel."""
    total = around(picture, width // 2).astype(np.float64)
    for axis in (0, 1):
        total = np.cumsum(np.insert(total, 0, 0.0, axis=axis), axis=axis)
        total = np.take(total, range(width, total.shape[axis]), axis) - np.take(
            total, range(total.shape[axis] - width), axis
        )
    return total / width**2


def resampled(picture: np.ndarray, count: int, axis: int) -> np.ndarray:
    """Means of the picture over fewer rows or columns."""
    lines = np.moveaxis(picture, axis, 0)
    total = np.concatenate([np.zeros((1, *lines.shape[1:])), np.cumsum(lines, axis=0, dtype=np.float64)])
    places = np.linspace(0.0, len(lines), count + 1)
    before = np.minimum(places.astype(int), len(lines) - 1)
    share = (places - before)[:, np.newaxis, np.newaxis]
    at = total[before] * (1.0 - share) + total[before + 1] * share
    return np.moveaxis(np.diff(at, axis=0) * (count / len(lines)), 0, axis)


if __name__ == "__main__":
    main()
