# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators have in common: errors become reports."""

from collections.abc import Callable, Iterable
from functools import wraps
from typing import TypeVar

import bpy

from ..core.physics_api import physics
from ..scene import frame_setup

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


def only_one_is_rendered(scene: bpy.types.Scene) -> str:
    """Return the warning about a scene with several holes."""
    chosen = scene.umbra.active_hole
    return (
        f'The scene contains {len(frame_setup.holes(scene))} black holes, and one can be rendered: "'
        f'{"" if chosen is None else chosen.name}". Choose another one in the Umbra panel.'
    )
