# SPDX-License-Identifier: GPL-3.0-or-later
"""What the maps that the viewport's compositor shows are made from, and which files could take their place."""

import math
from dataclasses import replace

import bpy

from ..bake.request import MapRequest
from ..core.physics_api import physics
from ..outputs import frames
from ..scene import frame_setup
from ..scene.frame_setup import FrameSetup
from ..settings.hole_properties import CAMERA_ANIMATION
from ..settings.scene_properties import ACCURACIES

Camera = physics.Camera

# Pixels of the map that follows, and at the most of the one that takes its place; and those of the smallest that
# follows on a slow machine: with fewer, stars are squares.
SMALL_PIXELS, FULL_PIXELS, LEAST_PIXELS = 480 * 270, 1920 * 1080, 320 * 180

# Pixels of layers of a thick disk, each of which takes some 20 microseconds.
SMALL_THICK_PIXELS, FULL_THICK_PIXELS = 160 * 90, 480 * 270

# Error of interpolation of a small disk, radians: a few of its pixels. Less would take half as long again.
DISK_INTERPOLATION = 1e-2


def shrunk(camera: Camera, pixels: float) -> Camera:
    """Return the camera that sees the same in at most so many pixels, about, of the same aspect."""
    scale = min(math.sqrt(pixels / (camera.width * camera.height)), 1.0)
    return camera.resized(max(round(camera.width * scale), 1), max(round(camera.height * scale), 1))


def small(parameters: physics.WarpMapParameters, pixels: float = SMALL_PIXELS) -> physics.WarpMapParameters:
    """Return what the small map of a frame is made from."""
    return _of_size(parameters, pixels, ACCURACIES["DRAFT"], None)


def small_light(light: physics.LightParameters) -> physics.LightParameters:
    """Return what the small layer of light of a frame is made from."""
    tolerance, _ = ACCURACIES["DRAFT"]
    pixels = SMALL_THICK_PIXELS if light.look.thickness > 0.0 else SMALL_PIXELS
    return replace(light, view=_of_size(light.view, pixels, (tolerance, DISK_INTERPOLATION), light.view.disk))


def full(parameters: physics.WarpMapParameters) -> physics.WarpMapParameters:
    """Return what the full map of a frame is made from, where its files are not up to date."""
    return _of_size(parameters, FULL_PIXELS, ACCURACIES["STANDARD"], None)


def full_light(light: physics.LightParameters) -> physics.LightParameters:
    """Return what the full layer of light of a frame is made from."""
    pixels = FULL_THICK_PIXELS if light.look.thickness > 0.0 else FULL_PIXELS
    return replace(light, view=_of_size(light.view, pixels, ACCURACIES["STANDARD"], light.view.disk))


def _of_size(
    parameters: physics.WarpMapParameters, pixels: float, accuracy: tuple[float, float], disk: physics.Disk | None
) -> physics.WarpMapParameters:
    tolerance, interpolation = accuracy
    return replace(
        parameters,
        camera=shrunk(parameters.camera, pixels),
        supersampling=1,
        tolerance=tolerance,
        interpolation=interpolation,
        method=physics.DEFAULT_METHOD,
        disk=disk,
    )


def requests_of(scene: bpy.types.Scene, frame: FrameSetup) -> list[MapRequest]:
    """Return the files that a frame needs; none where it cannot have any.

    The velocity of an animated camera was not measured, so that of the file is taken.
    """
    try:
        requests = frames.requests_of(scene, frame)
        if frame_setup.active_hole(scene).umbra.motion != CAMERA_ANIMATION:
            return requests
        return [replace(each, parameters=_with_velocity_of_file(each)) for each in requests]
    except physics.BlackHoleError:
        return []


def _with_velocity_of_file(wanted: MapRequest) -> physics.MapOrigin:
    made = wanted.kind.format.read_metadata(wanted.path)["parameters"]
    velocity, origin = physics.WarpMapParameters.from_metadata(made).velocity, wanted.parameters
    if isinstance(origin, physics.WarpMapParameters):
        return replace(origin, velocity=velocity)
    assert isinstance(origin, physics.LightParameters)
    return replace(origin, view=replace(origin.view, velocity=velocity))
