# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place where the add-on imports the physics.

In the installed extension `physics` lies inside the package; in a checkout it lies beside it. Which of the two
holds is decided by where the folder is, not by catching an ImportError, so that a real import error (a missing
wheel, say) is seen as what it is.
"""

import importlib.util

if importlib.util.find_spec(f"{__package__}.physics") is not None:
    from . import physics
    from .physics import (
        accuracy,
        claim,
        colour,
        disk_flux,
        disk_look,
        disk_pass_file,
        disk_render,
        disk_texture,
        exit_map,
        exit_map_file,
        exr,
        frame_list,
        lens,
        map_check,
        map_file,
        metric,
        orbiting_matter,
        reference_render,
        star_sky,
        warp_map_file,
        world_map,
        world_map_file,
    )
else:
    import physics  # type: ignore[no-redef]
    from physics import (  # type: ignore[no-redef]
        accuracy,
        claim,
        colour,
        disk_flux,
        disk_look,
        disk_pass_file,
        disk_render,
        disk_texture,
        exit_map,
        exit_map_file,
        exr,
        frame_list,
        lens,
        map_check,
        map_file,
        metric,
        orbiting_matter,
        reference_render,
        star_sky,
        warp_map_file,
        world_map,
        world_map_file,
    )

__all__ = [
    "accuracy",
    "claim",
    "colour",
    "disk_flux",
    "disk_look",
    "disk_pass_file",
    "disk_render",
    "disk_texture",
    "exit_map",
    "exit_map_file",
    "exr",
    "frame_list",
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
