# SPDX-License-Identifier: GPL-3.0-or-later
"""What the lens carries into each frame, for a file that renders without the add-on.

There the lens traces its rays itself (as with Rays: No Bake), because the name of an exit map cannot be a keyframe.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ...scene.frame_setup import FrameSetup
from ...settings.scene_properties import IN_SHADER
from ..protocol import Track
from . import foreground, lens_shader, lens_sync


class LensCarrier:
    """Reads the camera's parameters frame by frame, and holds the file as it needs to be saved."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self._scene = scene
        self._first: dict[bpy.types.Camera, dict[str, object]] = {}
        """The parameters of each camera at the first of its frames."""

    def read(self, frame: FrameSetup) -> dict[Track, Any]:
        """Return the parameters of the frame; the plain camera of the foreground follows it."""
        camera = lens_sync.camera_of(self._scene)
        values = lens_sync.values_of(self._scene, frame)
        self._first.setdefault(camera, values)
        tracks: dict[Track, Any] = {}
        for name, value in values.items():
            for index, number in enumerate(value if isinstance(value, tuple) else (value,)):
                tracks[camera, f'cycles_custom["{name}"]', index] = number
        second = self._scene.umbra.foreground_scene
        if second is None or second.camera is None:
            return tracks
        for prefix, owner, names in (
            ("", camera, foreground.CAMERA_SETTINGS),
            ("dof.", camera.dof, foreground.DEPTH_OF_FIELD),
        ):
            for name in names:
                value = getattr(owner, name)
                if isinstance(value, float):
                    tracks[second.camera.data, prefix + name, 0] = value
        return tracks

    @contextmanager
    def held(self) -> Iterator[None]:
        """Let the lens trace its rays itself, so that a machine with the add-on renders the same."""
        settings = self._scene.umbra
        rays = settings.lens_rays
        try:
            settings.lens_rays = IN_SHADER
            for camera, values in self._first.items():
                lens_shader.write(camera, values)
            yield
        finally:
            settings.lens_rays = rays
            lens_sync.show_live(self._scene)
