# SPDX-License-Identifier: GPL-3.0-or-later
"""From Blender's camera and render settings to the physics' camera, and what an output can do with them."""

from dataclasses import dataclass
from typing import Any

import bpy

from ..core.errors import SceneError
from ..core.physics_api import physics
from .camera_type import original_type


@dataclass(frozen=True)
class Traits:
    """What an output can do with cameras and render settings; the defaults are those of a picture made of maps."""

    crops: bool = False
    """Whether Crop to Render Region is supported."""
    any_camera: bool = False
    """Whether the map is looked up by direction, so that the camera's lens does not matter."""
    blurs: bool = True
    """Whether motion blur of camera or hole makes no wrong picture, at most a sharp one; else it is refused."""


PLAIN = Traits()


def render_size(render: bpy.types.RenderSettings) -> tuple[int, int]:
    """Width and height of the picture that is rendered now, in pixels (the resolution percentage counts)."""
    percentage = render.resolution_percentage
    return (
        max(render.resolution_x * percentage // 100, 1),
        max(render.resolution_y * percentage // 100, 1),
    )


def check_render(render: bpy.types.RenderSettings, traits: Traits = PLAIN) -> None:
    """Refuse render settings for which the map would not fit the picture.

    Raises
    ------
    SceneError
        Crop to Render Region, or Stereoscopy.
    """
    if render.use_border and render.use_crop_to_border and not traits.crops:
        raise SceneError(
            "Crop to Render Region is not supported with a black hole in the compositor: switch it off in Output "
            "Properties > Format (the render region itself works), or choose Output: Cycles Lens.",
            code="camera.crop",
        )
    if render.use_multiview:
        raise SceneError(
            "Stereoscopy is not supported with a black hole: switch it off in Output Properties, or render "
            "each eye as a camera of its own.",
            code="camera.stereo",
        )


def _panorama_setting(camera: bpy.types.Camera, name: str) -> Any:
    """A panorama setting, which Cycles kept for itself before Blender took it over."""
    owner = camera if hasattr(camera, name) else camera.cycles
    return getattr(owner, name)


def active_camera(scene: bpy.types.Scene) -> bpy.types.Object:
    """Return the scene's camera.

    Raises
    ------
    SceneError
        If there is none.
    """
    camera = scene.camera
    if camera is None or camera.type != "CAMERA":
        raise SceneError(
            f'Scene "{scene.name}" has no camera: add one, or choose one in Scene Properties > Scene.',
            code="camera.none",
        )
    return camera


def camera_model(
    camera: bpy.types.Camera, render: bpy.types.RenderSettings, engine: str, traits: Traits = PLAIN
) -> "physics.PerspectiveCamera | physics.PanoramaCamera":
    """Return the physics' camera for a Blender camera's (evaluated) settings.

    Raises
    ------
    SceneError
        An orthographic or custom camera, a panorama other than equirectangular, or one outside Cycles.
    """
    width, height = render_size(render)
    kind_of_lens = original_type(camera)
    if traits.any_camera and kind_of_lens != "ORTHO":
        return physics.PanoramaCamera(width, height)  # the World is looked up by direction, whatever the lens
    if kind_of_lens == "PERSP":
        return physics.PerspectiveCamera(
            width,
            height,
            focal_length=camera.lens,
            sensor_width=camera.sensor_width,
            sensor_height=camera.sensor_height,
            sensor_fit=camera.sensor_fit,
            shift_x=camera.shift_x,
            shift_y=camera.shift_y,
            pixel_aspect_x=render.pixel_aspect_x,
            pixel_aspect_y=render.pixel_aspect_y,
        )
    if kind_of_lens == "PANO":
        kind = _panorama_setting(camera, "panorama_type")
        if kind != "EQUIRECTANGULAR":
            raise SceneError(
                f'Camera "{camera.name}" is a panorama of type {str(kind).replace("_", " ").title()}: only '
                "Equirectangular panoramas can show a black hole; choose that, or a perspective camera.",
                code="camera.type",
            )
        if engine != "CYCLES":
            raise SceneError(
                f'Camera "{camera.name}" is a panorama, which only Cycles renders: choose Cycles, or a '
                "perspective camera.",
                code="camera.panorama-engine",
            )
        limits = ("latitude_min", "latitude_max", "longitude_min", "longitude_max")
        return physics.PanoramaCamera(width, height, **{name: _panorama_setting(camera, name) for name in limits})
    if kind_of_lens == "ORTHO":
        raise SceneError(
            f'Camera "{camera.name}" is orthographic: a black hole needs a place to be seen from; make the '
            "camera perspective.",
            code="camera.orthographic",
        )
    raise SceneError(
        f'Camera "{camera.name}" is of type {camera.type.title()}, which cannot show a black hole: make it '
        "perspective or an equirectangular panorama.",
        code="camera.type",
    )


def aperture(camera: bpy.types.Camera) -> float:
    """Return the radius of a camera's aperture in scene units, 0 without depth of field."""
    if not camera.dof.use_dof:
        return 0.0
    return camera.lens * 1e-3 / (2.0 * max(camera.dof.aperture_fstop, 1e-5))
