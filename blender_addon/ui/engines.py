# SPDX-License-Identifier: GPL-3.0-or-later
"""Switch a scene to the render engine that an output needs."""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ..core.errors import SceneError


@contextmanager
def switched(scene: bpy.types.Scene, engine: str) -> Iterator[None]:
    """Choose a render engine for what follows; the former one comes back if that fails.

    Raises
    ------
    SceneError
        This Blender has no such engine.
    """
    before = scene.render.engine
    try:
        scene.render.engine = engine
    except TypeError:  # none of the choices
        raise SceneError(
            f"The render engine {engine.title()} is switched off: enable the add-on {engine.title()} Render Engine in "
            "Preferences > Add-ons, or choose Output: Compositor.",
            code="lens.engine",
        ) from None
    try:
        yield
    except Exception:
        scene.render.engine = before
        raise
