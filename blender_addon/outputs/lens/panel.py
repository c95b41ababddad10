# SPDX-License-Identifier: GPL-3.0-or-later
"""The lens's settings in the sidebar. It only draws."""

import bpy


def draw(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Draw the settings, and the buttons of the foreground."""
    settings = scene.umbra
    layout.prop(settings, "lens_rays")
    layout.prop(settings, "sphere_radius")
    layout.prop(settings, "redshift_color")
    layout.prop(settings, "redshift_brightness")
    layout.prop(settings, "sky_temperature")
    layout.prop(settings, "cpu_fallback")
    layout.operator("umbra.set_up_foreground", icon="OUTLINER_COLLECTION")
    if settings.foreground is not None:
        layout.operator("umbra.remove_foreground", icon="X")
