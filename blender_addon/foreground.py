# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects nearer than the hole, unlensed."""
import bpy
def remove(scene: bpy.types.Scene) -> None:
    """Take it out."""
