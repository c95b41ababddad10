# SPDX-License-Identifier: GPL-3.0-or-later
"""Carry a frame into the camera that bends its rays: for the viewport at once, for a render with its exit map."""

import contextlib
from dataclasses import asdict, replace
from pathlib import Path

import bpy

from ...core.blender_version import OSL_COUNTS_ROWS_UPWARDS
from ...core.errors import SceneError
from ...core.physics_api import physics
from ...scene import cameras, frame_setup
from ...scene.camera_type import is_converted
from ...settings.scene_properties import EXIT_MAP
from . import lens_camera, lens_shader

# A camera that bends its rays can render a part of the picture.
TRAITS = cameras.Traits(crops=True, blurs=False)
# Of the viewport, which does not blur.
LIVE_TRAITS = replace(TRAITS, blurs=True)

# A picture without anything in it: the parameters are not valid.
BROKEN = {"broken": 1}


def uses_maps(scene: bpy.types.Scene) -> bool:
    """Whether a render of the lens looks its rays up."""
    return scene.umbra.lens_rays == EXIT_MAP


def exit_parameters(parameters: "physics.WarpMapParameters") -> "physics.WarpMapParameters":
    """What an exit map is made from: lines in the hole's frame do not depend on how that stands in the world.

    A disk has no part in it: the compositor draws that, from passes of its own.
    """
    return replace(parameters, hole_to_world=physics.IDENTITY, disk=None)


def values_of(scene: bpy.types.Scene, frame: frame_setup.FrameSetup, map_path: Path | None = None) -> dict[str, object]:
    """The shader's parameters for a frame; with an exit map, those of the variant that looks rays up."""
    settings = scene.umbra
    values = asdict(physics.LensNumbers.of(frame.parameters))
    values |= {
        "broken": 0,
        "shift": (*frame.shift, 0.0),
        "aperture": frame.aperture,
        "length_of_m": frame.length_of_m,
        "sphere_radius": float(settings.sphere_radius),
        "redshift_color": float(settings.redshift_color),
        "redshift_brightness": float(settings.redshift_brightness),
        "temperature": float(settings.sky_temperature),
    }
    if map_path is not None:
        width, height = frame.parameters.map_size
        values |= {"exit_map": str(map_path), "map_size": (float(width), float(height), 0.0)}
        values["map_upwards"] = int(OSL_COUNTS_ROWS_UPWARDS)
    return values


def check(scene: bpy.types.Scene) -> None:
    """Refuse a scene that cannot be rendered with the lens.

    Raises
    ------
    SceneError
        Another engine than Cycles.
    """
    if scene.render.engine != "CYCLES":
        raise SceneError(
            "The Cycles Lens needs the render engine Cycles: choose it in Render Properties, or Output: Compositor.",
            code="lens.engine",
        )


def camera_of(scene: bpy.types.Scene) -> bpy.types.Camera:
    """Return the data of the scene's camera, converted if it is not yet.

    Raises
    ------
    SceneError
        If there is no camera, or it cannot be converted.
    """
    camera: bpy.types.Camera = cameras.active_camera(scene).data
    lens_camera.convert(camera)
    return camera


def break_camera(scene: bpy.types.Scene) -> None:
    """Let the camera see nothing until `show` gives it valid parameters."""
    if scene.camera is not None and scene.camera.type == "CAMERA" and is_converted(scene.camera.data):
        lens_shader.write(scene.camera.data, BROKEN)


def show(scene: bpy.types.Scene, frame: frame_setup.FrameSetup, map_path: Path | None = None) -> None:
    """Let the camera see a frame, by its exit map or without.

    Raises
    ------
    SceneError
        There is no camera, or its shader cannot be made.
    """
    lens_shader.write(camera_of(scene), values_of(scene, frame, map_path))


def show_live(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """Let the viewport see the scene as it stands, without a map; black where that is not possible.

    The camera's own speed, which would take steps to other frames, is not measured here.
    """
    if depsgraph is None:
        depsgraph = frame_setup.depsgraph_of(scene)
    try:
        check(scene)
        camera_of(scene)
        show(scene, frame_setup.read(scene, depsgraph, False, LIVE_TRAITS))
    except physics.BlackHoleError:  # the panel and the render say why
        with contextlib.suppress(physics.BlackHoleError):  # a Blender without OSL
            break_camera(scene)
