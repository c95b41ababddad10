# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place where the add-on imports the physics, through its API: `physics.NAME`.

In the installed extension `physics` lies inside the package; in a checkout it lies beside it. Which of the two is true
is decided by where the folder is, not by catching an ImportError, so that a real import error (a missing wheel, say) is
seen as what it is.
"""

import importlib
import importlib.util
from typing import TYPE_CHECKING

# The add-on's own package, which Blender knows it by.
PACKAGE = __package__.rpartition(".")[0]

if TYPE_CHECKING:
    import physics
else:
    _INSIDE = f"{PACKAGE}.physics"
    physics = importlib.import_module(_INSIDE if importlib.util.find_spec(_INSIDE) is not None else "physics")

__all__ = ["PACKAGE", "physics"]
