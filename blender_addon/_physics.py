# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place where the add-on imports the physics.

In the installed extension `physics` lies inside the package; in a checkout it lies beside it. Which of the two
holds is decided by where the folder is, not by catching an ImportError, so that a real import error (a missing
wheel, say) is seen as what it is.
"""

import importlib.util

if importlib.util.find_spec(f"{__package__}.physics") is not None:
    from . import physics
    from .physics import colour, exit_map, exit_map_file, exr, lens, metric, reference_render, star_sky
else:
    import physics  # type: ignore[no-redef]
    from physics import colour, exit_map, exit_map_file, exr, lens, metric, reference_render, star_sky  # type: ignore[no-redef]

__all__ = ["colour", "exit_map", "exit_map_file", "exr", "lens", "metric", "physics", "reference_render", "star_sky"]
