# SPDX-License-Identifier: GPL-3.0-or-later
"""From Blender's data to the parameters of a map: hole, camera, sky and animation.

Imports `settings` and `core`. Writes nothing to the scene.
"""
