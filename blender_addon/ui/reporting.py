# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators have in common: errors become reports."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import TypeVar

import bpy

from ..core.physics_api import physics
from ..outputs import switched
from ..scene import frame_setup
from ..scene.sky import environment

Operator = TypeVar("Operator", bound=bpy.types.Operator)

# Seconds between two slices of work that runs beside the interface, and for which one lasts: Blender draws after each.
TIMER_INTERVAL, SLICE = 0.01, 0.1


def reporting(
    execute: Callable[[Operator, bpy.types.Context], set[str]],
) -> Callable[[Operator, bpy.types.Context], set[str]]:
    """Turn errors into the operator's report: the sentence and the code."""

    @wraps(execute)
    def guarded(self: Operator, context: bpy.types.Context) -> set[str]:
        try:
            return execute(self, context)
        except physics.BlackHoleError as error:
            self.report({"ERROR"}, error.for_user())
            return {"CANCELLED"}

    return guarded


def report_notes(operator: bpy.types.Operator, notes: Iterable[str]) -> None:
    """Report what the artist should know."""
    for note in notes:
        operator.report({"WARNING"}, note)


@contextmanager
def reporting_switches(operator: bpy.types.Operator, scene: bpy.types.Scene) -> Iterator[None]:
    """Report in one line which settings of a scene a block has changed."""
    before = switched.state(scene)
    yield
    text = switched.sentence(before, switched.state(scene))
    if text:
        operator.report({"INFO"}, text)


@contextmanager
def reporting_sky(operator: bpy.types.Operator, scene: bpy.types.Scene) -> Iterator[None]:
    """Report it where a block chooses an image as the sky because the World shows none."""
    settings = scene.umbra
    was_world = settings.environment_source == "WORLD"
    yield
    image = settings.environment_image
    has_changed = was_world and settings.environment_source == "IMAGE"
    if has_changed and image is not None and environment.world_left_out(scene) is None:
        why = "The scene has no World" if scene.world is None else f'World "{scene.world.name}" is a plain color'
        operator.report({"INFO"}, f'{why}: the sky is the image "{image.name}".')


def report_missing_camera(operator: bpy.types.Operator, scene: bpy.types.Scene) -> None:
    """Report it where nothing can be rendered yet for want of a camera."""
    if scene.camera is None:
        operator.report({"WARNING"}, "The scene has no camera yet: add one to render the black hole.")


def only_one_is_rendered(scene: bpy.types.Scene) -> str:
    """Return the warning about a scene with several holes."""
    chosen = scene.umbra.active_hole
    return (
        f'The scene contains {len(frame_setup.holes(scene))} black holes, and one can be rendered: "'
        f'{"" if chosen is None else chosen.name}". Choose another one in the Umbra panel.'
    )
