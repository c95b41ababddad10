# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels of the tab Umbra in the 3D view's sidebar have in common."""

import bpy

from ..scene import frame_setup


class UmbraPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Umbra"


class HolePanel(UmbraPanel):
    """A panel below the first that is there when a black hole is."""

    bl_parent_id = "VIEW3D_PT_umbra"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return frame_setup.find_active_hole(context.scene) is not None
