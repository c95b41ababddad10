# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a way of making the picture is off beside the shadow, and how much it flickers there.

A window beside the shadow at the scale of full HD: spin 0.9, 30 M away, 10 degrees above the equator, an orbit of 0.1
degrees per frame. The truth has many rays per pixel. Rings are counted from the shadow's edge in units of its radius.
"""

import importlib.util
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import physics
from physics.reference.reference_render import render

RINGS = ((0.01, 0.03), (0.03, 0.1), (0.1, 0.2))

# Pixels, at 40 degrees over 1080 rows. The window reaches 20 % of the radius to the right of the shadow.
_WIDTH, _HEIGHT, _WINDOW, _RADIUS = 144, 180, math.radians(6.667), 270.0
_ASIDE = math.radians(-11.0)
FIRST, STEP = 20.0, 0.1
_STRIP = 30

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

Picture = Callable[[float, np.ndarray], np.ndarray]
"""Makes a picture, shape (180, 144, 3), from the camera's azimuth in degrees and the sky."""


@dataclass(frozen=True)
class Flicker:
    """What was measured in one ring, relative to the mean light there."""

    error: float
    """Mean difference from the truth."""
    change: float
    """Mean change of a pixel from one frame to the next."""


def hdri() -> np.ndarray | None:
    """An HDRI that comes with Blender's module, 1024 x 512; None without it."""
    blender = importlib.util.find_spec("bpy")
    found = list(Path(blender.origin).parent.glob("**/studiolights/world/city.exr")) if blender is not None else []
    return np.maximum(physics.read_exr(found[0])[0][..., :3].astype(np.float64), 0.0) if found else None


def looks(count: int) -> Picture:
    """One ray per pixel, and so many looks at the sky along what the pixel sees of it; 0: unfiltered."""
    return lambda azimuth, sky: render(physics.bake(parameters_at(azimuth, 1)), sky, looks=count).sky[..., :3]


def rays(samples: int) -> Picture:
    """Samples x samples rays per pixel."""

    def picture(azimuth: float, sky: np.ndarray) -> np.ndarray:
        strips = []
        for row in range(0, _HEIGHT, _STRIP):
            fine = render(physics.bake(parameters_at(azimuth, samples, row)), sky).sky[..., :3]
            strips.append(fine.reshape(_STRIP, samples, _WIDTH, samples, 3).mean(axis=(1, 3)))
        return np.concatenate(strips)

    return picture


def measure(ways: dict[str, Picture], truth: str, sky: np.ndarray, frames: int = 2) -> dict[str, list[Flicker]]:
    """Judge ways of making the picture by one of them; the result has an entry for each ring."""
    distance = distance_from_the_shadow()
    light = {
        name: np.array([way(FIRST + STEP * frame, sky) @ LUMINANCE for frame in range(frames)])
        for name, way in ways.items()
    }
    return {name: list(_judge(pictures, light[truth], distance)) for name, pictures in light.items()}


def _judge(pictures: np.ndarray, truth: np.ndarray, distance: np.ndarray) -> Iterable[Flicker]:
    for low, high in RINGS:
        inside = (distance > low) & (distance <= high)
        ours, right = pictures[:, inside], truth[:, inside]
        yield Flicker(
            float(np.abs(ours - right).mean() / right.mean()),
            float(np.abs(np.diff(ours, axis=0)).mean() / ours.mean()),
        )


def parameters_at(azimuth: float, samples: int = 1, row: int | None = None) -> physics.WarpMapParameters:
    theta, phi = math.radians(80.0), math.radians(azimuth)
    place = tuple(30.0 * np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]))
    cosine, sine = math.cos(_ASIDE), math.sin(_ASIDE)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    look = np.array(physics.looking_at_hole(place)) @ turn
    camera = physics.PerspectiveCamera.from_field_of_view(_WIDTH * samples, _HEIGHT * samples, _WINDOW)
    if row is not None:
        camera = camera.cropped(0, row * samples, _WIDTH * samples, _STRIP * samples)
    return physics.WarpMapParameters(
        spin=0.9,
        camera=camera,
        camera_position=place,
        camera_to_hole=tuple(map(tuple, look.tolist())),
        motion="fido",
    )


def distance_from_the_shadow() -> np.ndarray:
    """Distance of each pixel from the shadow, in units of its radius; 0 inside."""
    dark = physics.bake(parameters_at(FIRST, 1)).visibility == 0.0
    rows, columns = np.mgrid[:_HEIGHT, :_WIDTH]
    squares = np.full(dark.shape, np.inf)
    for row, column in zip(*np.nonzero(dark), strict=True):
        if dark[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].all():
            continue  # not at the edge
        np.minimum(squares, (rows - row) ** 2 + (columns - column) ** 2, out=squares)
    return np.where(dark, 0.0, np.sqrt(squares)) / _RADIUS
