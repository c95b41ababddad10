# SPDX-License-Identifier: GPL-3.0-or-later
"""Step a scene to other frames and back."""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ..core.session import SESSION, Life

# True while a scene is at another frame only to be read there.
is_stepping = SESSION.value(bool, Life.FILE)


@contextmanager
def frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Go back to the current frame afterwards, whatever happens."""
    frame, part = scene.frame_current, scene.frame_subframe
    was_stepping, is_stepping.now = is_stepping.now, True
    try:
        yield
    finally:
        if (scene.frame_current, scene.frame_subframe) != (frame, part):
            scene.frame_set(frame, subframe=part)
        is_stepping.now = was_stepping
