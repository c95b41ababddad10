# SPDX-License-Identifier: GPL-3.0-or-later
"""A map that bends nothing, for a scene whose hole is hidden or deleted."""

import math
from dataclasses import dataclass

import bpy
import numpy as np

from ..core.physics_api import physics
from ..outputs import registry
from ..scene import cameras, frame_setup
from .small_maps import SMALL_PIXELS, Camera, shrunk


@dataclass(frozen=True)
class View:
    """What a plain map depends on."""

    camera: Camera
    axes: tuple[float, ...]
    """The camera's axes in the world, row by row."""


def read(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> View:
    """Return how the scene's camera looks.

    Raises
    ------
    SceneError
        There is no camera, or one that no map can be made for.
    """
    camera = cameras.active_camera(scene).evaluated_get(depsgraph)
    model = cameras.camera_model(camera.data, scene.render, scene.render.engine, registry.of(scene).traits)
    pose = frame_setup.pose(camera, "The camera", keep_scale=False)
    return View(shrunk(model, SMALL_PIXELS), tuple(float(each) for each in np.ravel(pose.rotation)))


def make(view: View) -> "physics.WarpMap":
    """Return the map: each pixel sees the sky straight ahead, and no disk."""
    width, height = view.camera.width, view.camera.height
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    direction = view.camera.directions(x, y) @ np.reshape(view.axes, (3, 3)).T
    theta = np.arccos(np.clip(direction[..., 2], -1.0, 1.0)).astype(np.float32)
    phi = (np.arctan2(direction[..., 1], direction[..., 0]) % (2.0 * math.pi)).astype(np.float32)
    one, zero = np.ones_like(theta), np.zeros_like(theta)
    nothing = physics.DiskPass(zero, zero, zero, zero, {})
    return physics.WarpMap(theta, phi, one, one, {}, (nothing,) * physics.MOST_CROSSINGS)
