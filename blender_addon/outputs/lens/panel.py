# SPDX-License-Identifier: GPL-3.0-or-later
"""The lens's settings in the sidebar. It only draws."""

import bpy

from ..shared.drawing import draw_sky_choice
from . import lens_sky


def draw(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Draw the settings, and the buttons of the foreground."""
    settings = scene.umbra
    layout.prop(settings, "lens_rays")
    layout.prop(settings, "sphere_radius")
    draw_sky_choice(layout, settings)
    layout.use_property_split = False  # the names are too long to stand beside their fields
    for name, socket in lens_sky.controls(scene).items():
        layout.prop(socket, "default_value", text=name)
    layout.prop(settings, "redshift_color")
    layout.prop(settings, "redshift_brightness")
    layout.prop(settings, "sky_temperature")
    layout.prop(settings, "cpu_fallback")
    layout.operator("umbra.set_up_foreground", icon="OUTLINER_COLLECTION")
    if settings.foreground is not None:
        layout.operator("umbra.remove_foreground", icon="X")
