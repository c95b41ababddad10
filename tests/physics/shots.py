# SPDX-License-Identifier: GPL-3.0-or-later
"""Small shots that several tests bake."""

import math

from physics import PerspectiveCamera, WarpMapParameters, looking_at_hole

# A camera beside the hole, at +x, that looks away from it along +x, z up.
AWAY = ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def shot(width=48, height=27, radius=10.0, inclination=80.0, fov=60.0, spin=0.999, **others):
    theta = math.radians(inclination)
    position = (radius * math.sin(theta), 0.0, radius * math.cos(theta))
    settings = {
        "camera": PerspectiveCamera.from_field_of_view(width, height, math.radians(fov)),
        "camera_position": position,
        "camera_to_hole": looking_at_hole(position),
        "motion": "circular",
    }
    return WarpMapParameters(spin=spin, **{**settings, **others})
