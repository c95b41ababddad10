# SPDX-License-Identifier: GPL-3.0-or-later
"""Offer the outputs to artists, and let them follow changes of the settings."""

from ..core import changes
from ..core.changes import Change
from ..scene import hole_display
from . import refreshing, registry, switching
from .compositor.output import CompositorOutput
from .lens.output import LensOutput
from .world.output import WorldOutput

OUTPUTS = (CompositorOutput(), LensOutput(), WorldOutput())

_SUBSCRIPTIONS = (
    (Change.HOLE, hole_display.show_size),
    (Change.HOLE, refreshing.on_hole_changed),
    (Change.DISK, refreshing.on_disk_changed),
    (Change.SCENE, refreshing.refresh),
    (Change.OUTPUT, switching.on_setting_changed),
)


def register() -> None:
    """Add the outputs, and subscribe to the settings."""
    for output in OUTPUTS:
        registry.add(output)
    for subscription in _SUBSCRIPTIONS:
        changes.subscribe(*subscription)


def unregister() -> None:
    """Undo `register`."""
    for subscription in _SUBSCRIPTIONS:
        changes.unsubscribe(*subscription)
    for output in OUTPUTS:
        registry.remove(output)
