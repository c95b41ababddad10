# SPDX-License-Identifier: GPL-3.0-or-later
"""How the hole's Empty is drawn in the viewport."""

import bpy

from ..core.physics_api import physics

# Blender draws Empties no smaller (scene units).
SMALLEST_DISPLAY = 1e-4


def show_size(hole: bpy.types.ID) -> None:
    """Draw the Empty's sphere at the size of the horizon."""
    if isinstance(hole, bpy.types.Object) and hole.umbra.is_black_hole and hole.type == "EMPTY":
        settings = hole.umbra
        hole.empty_display_size = max(physics.horizon_radius(settings.spin) * settings.mass_scale, SMALLEST_DISPLAY)
