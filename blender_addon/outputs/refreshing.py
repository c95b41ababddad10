# SPDX-License-Identifier: GPL-3.0-or-later
"""Carry changed settings into the scenes that they concern."""

import bpy

from ..bake import star_sky
from ..core import messages
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..scene import frame_setup
from . import registry
from .shared import disk_light


def refresh(owner: bpy.types.ID) -> None:
    """Carry the settings of a scene into its output."""
    if isinstance(owner, bpy.types.Scene):
        output = registry.of(owner)
        if owner.library is None:
            _provide_stars(owner)
            output.prepare(owner)
        output.refresh(owner)


def _provide_stars(scene: bpy.types.Scene) -> None:
    try:
        star_sky.provide(scene, may_write=True)
    except physics.BlackHoleError as error:
        messages.warn(error.for_user())


def refresh_disk(scene: bpy.types.Scene) -> None:
    """Carry the settings of the disk into a scene: its light, and whatever shows it.

    Raises
    ------
    SceneError
        If the scene cannot show the disk.
    """
    disk_light.refresh(scene, frame_setup.find_active_hole(scene))
    registry.of(scene).refresh_disk(scene)


def refresh_disk_or_warn(scene: bpy.types.Scene) -> None:
    """Do the same where nobody could be told by an error."""
    try:
        refresh_disk(scene)
    except SceneError as error:
        messages.warn(error.for_user())


def on_disk_changed(owner: bpy.types.ID) -> None:
    """Carry the settings of a hole's disk into all scenes that render the hole."""
    for scene in bpy.data.scenes:
        if isinstance(owner, bpy.types.Object) and frame_setup.find_active_hole(scene) == owner:
            refresh_disk_or_warn(scene)


def on_hole_changed(owner: bpy.types.ID) -> None:
    """Carry a hole's settings into its disk: the innermost orbit depends on the spin, and the light on the size."""
    if isinstance(owner, bpy.types.Object) and owner.umbra.disk.enabled:
        on_disk_changed(owner)
