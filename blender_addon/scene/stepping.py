# SPDX-License-Identifier: GPL-3.0-or-later
"""Step a scene to other frames and back."""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy


@contextmanager
def frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Go back to the current frame afterwards, whatever happens."""
    frame, part = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        if (scene.frame_current, scene.frame_subframe) != (frame, part):
            scene.frame_set(frame, subframe=part)
