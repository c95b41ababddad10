# SPDX-License-Identifier: GPL-3.0-or-later
"""Stars as points: how long their layers take, and how steady their light is beside stars in the sky's texture."""

# isort: off
import measuring  # before numpy
# isort: on

import math
from collections.abc import Iterator

import flicker
import numpy as np
from flicker import Picture

import physics

SIZES = ((480, 270), (1920, 1080), (3840, 2160))
MANY = 118_000

# Frames of an orbit of 0.1 degrees each.
FRAMES = 12


def lines(repeats: int) -> Iterator[str]:
    yield "stars as points, spin 0.9, 22 M away, 60 degrees across; the file is written apart"
    stars = physics.load_stars()
    for count, sizes in ((len(stars.magnitude), SIZES), (MANY, SIZES[1:])):
        catalog = stars if count == len(stars.magnitude) else _even(count)
        for width, height in sizes:
            parameters = measuring.shot(width, height, radius=22.0, spin=0.9)
            layer = physics.StarBaker().bake(parameters, catalog)
            seconds = measuring.best_time(lambda p=parameters, c=catalog: physics.StarBaker().bake(p, c), repeats)
            yield f"  {count} stars, {width} x {height}: {seconds:.2f} s, {layer.counts['images']} images"
    yield f"  beside the shadow, {FRAMES} frames of 0.1 degrees; in rings of " + ", ".join(
        f"{low:g} to {high:g}" for low, high in flicker.RINGS
    )
    yield "    change of a ring's whole light per frame, and mean change of a pixel, of the mean light:"
    for name, (whole, each) in steadiness().items():
        text = ", ".join(f"{100 * one:.1f} % {100 * two:.0f} %" for one, two in zip(whole, each, strict=True))
        yield f"    {name}: {text}"


def steadiness() -> dict[str, tuple[list[float], list[float]]]:
    """Changes from frame to frame by way of showing the stars, in each ring: of all its light, and of its pixels."""
    texture, band = (physics.star_sky(2048), physics.milky_way_sky(1024))
    baker = physics.StarBaker()

    def points(azimuth: float, sky: np.ndarray) -> np.ndarray:
        return flicker.looks(8)(azimuth, sky) + baker.bake(flicker.parameters_at(azimuth)).image

    ways: dict[str, tuple[Picture, np.ndarray]] = {
        "in the texture, unfiltered": (flicker.looks(0), texture),
        "in the texture, filtered": (flicker.looks(8), texture),
        "as points": (points, band),
    }
    distance = flicker.distance_from_the_shadow()
    found = {}
    for name, (way, sky) in ways.items():
        azimuths = flicker.FIRST + flicker.STEP * np.arange(FRAMES)
        light = np.array([way(azimuth, sky) @ flicker.LUMINANCE for azimuth in azimuths])
        whole, each = [], []
        for low, high in flicker.RINGS:
            inside = light[:, (distance > low) & (distance <= high)]
            whole.append(float(np.abs(np.diff(inside.sum(axis=1))).mean() / inside.sum(axis=1).mean()))
            each.append(float(np.abs(np.diff(inside, axis=0)).mean() / inside.mean()))
        found[name] = whole, each
    return found


def _even(count: int) -> physics.Stars:
    """Stars in random directions."""
    random = np.random.default_rng(1)
    return physics.Stars(
        random.uniform(0.0, 2.0 * math.pi, count),
        np.arcsin(random.uniform(-1.0, 1.0, count)),
        np.full(count, 8.0),
        np.full(count, 0.6),
    )
