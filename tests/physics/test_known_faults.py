# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults that are known and not yet mended: each test says what should be, and fails until it is."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from exr_files import written

from physics import PerspectiveCamera, WarpMapParameters, bake, looking_at_hole, write_warp_map

ROOT = Path(__file__).parents[2]

# The primaries of ACES 2065-1 and its white, and what turns linear Rec.709 into it.
ACES_AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
TO_ACES_AP0 = np.array([[0.4397, 0.3830, 0.1773], [0.0898, 0.8134, 0.0968], [0.0175, 0.1115, 0.8710]])


def run(*arguments):
    command = [sys.executable, "-m", "physics", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)


def even_sky(path, color, **header):
    planes = {name: np.full((32, 64), value, np.float32) for name, value in zip("RGB", color, strict=True)}
    written(path, planes, compression=OpenEXR.ZIP_COMPRESSION, **header)
    return path


def corner(path):
    with OpenEXR.File(str(path)) as file:
        (pixels,) = (channel.pixels for channel in file.channels().values())
    return pixels[2, 2, :3]


@pytest.mark.xfail(
    strict=True, raises=AssertionError, reason="The chromaticities of an OpenEXR sky are ignored without a word."
)
def test_a_sky_with_other_primaries_shows_the_same_color(tmp_path):
    """A color is the same in Rec.709 and in ACES AP0, if the file says which of them it has."""
    color = np.array([0.8, 0.1, 0.05])
    skies = {
        "rec709": even_sky(tmp_path / "rec709.exr", color),
        "ap0": even_sky(tmp_path / "ap0.exr", TO_ACES_AP0 @ color, chromaticities=ACES_AP0),
    }
    camera = PerspectiveCamera.from_field_of_view(32, 16, np.radians(60.0))
    place = (1e5, 0.0, 0.0)
    parameters = WarpMapParameters(0.5, camera, place, looking_at_hole(place))
    write_warp_map(tmp_path / "map.exr", bake(parameters))
    pictures = {}
    for name, sky in skies.items():
        pictures[name] = tmp_path / f"{name}_picture.exr"
        run("render", tmp_path / "map.exr", sky, pictures[name])
    np.testing.assert_allclose(corner(pictures["ap0"]), corner(pictures["rec709"]), atol=0.01)
