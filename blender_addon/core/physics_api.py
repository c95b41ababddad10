# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place where the add-on imports the physics.

In the installed extension `physics` lies inside the package; in a checkout it lies beside it. Which of the two
holds is decided by where the folder is, not by catching an ImportError, so that a real import error (a missing
wheel, say) is seen as what it is.
"""

import importlib.util
from typing import TYPE_CHECKING

PACKAGE = __package__.rpartition(".")[0]

if TYPE_CHECKING or importlib.util.find_spec(f"{PACKAGE}.physics") is None:
    import physics
    from physics.accuracy_check import accuracy
    from physics.files import disk_pass_file, exit_map_file, map_check, map_file, warp_map_file, world_map_file
    from physics.images import exr
    from physics.kerr import metric, orbiting_matter
    from physics.light import color, disk_flux, disk_look, disk_texture, star_sky
    from physics.maps import exit_map, lens, world_map
    from physics.reference import disk_render, reference_render
else:
    from .. import physics
    from ..physics.accuracy_check import accuracy
    from ..physics.files import disk_pass_file, exit_map_file, map_check, map_file, warp_map_file, world_map_file
    from ..physics.images import exr
    from ..physics.kerr import metric, orbiting_matter
    from ..physics.light import color, disk_flux, disk_look, disk_texture, star_sky
    from ..physics.maps import exit_map, lens, world_map
    from ..physics.reference import disk_render, reference_render

__all__ = [
    "PACKAGE",
    "accuracy",
    "color",
    "disk_flux",
    "disk_look",
    "disk_pass_file",
    "disk_render",
    "disk_texture",
    "exit_map",
    "exit_map_file",
    "exr",
    "lens",
    "map_check",
    "map_file",
    "metric",
    "orbiting_matter",
    "physics",
    "reference_render",
    "star_sky",
    "warp_map_file",
    "world_map",
    "world_map_file",
]
