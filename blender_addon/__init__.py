# SPDX-License-Identifier: GPL-3.0-or-later
"""Umbra Black Hole: a physically exact rotating black hole in a Blender scene."""

import atexit
import functools
from collections.abc import Callable

import bpy

from .command import command_line
from .core import image_library
from .core.session import SESSION, Life
from .outputs import registration as outputs
from .preview import live_preview, viewport
from .render import handlers
from .settings import disk_properties, hole_properties, scene_properties
from .ui import (
    accuracy_check,
    bake_operators,
    cache_panel,
    disk_panel,
    farm_operators,
    hole_overlay,
    operators,
    panels,
    preview_panel,
    render_operators,
    viewport_operators,
)

_CLASSES = (
    *disk_properties.CLASSES,
    *hole_properties.CLASSES,
    *scene_properties.CLASSES,
    *operators.CLASSES,
    *bake_operators.CLASSES,
    *render_operators.CLASSES,
    *panels.CLASSES,
    *disk_panel.CLASSES,
    *cache_panel.CLASSES,
    *farm_operators.CLASSES,
    *accuracy_check.CLASSES,
    *preview_panel.CLASSES,
    *viewport_operators.CLASSES,
)

# Each has a function `register` and one that undoes it.
_MODULES = (
    image_library,
    hole_properties,
    scene_properties,
    outputs,
    live_preview,
    viewport,
    operators,
    render_operators,
    preview_panel,
    hole_overlay,
    handlers,
    command_line,
)

# What was registered, undone in reverse order. A registration that fails half-way undoes what it did and then
# fails loudly, so that it can be tried again.
_undo: list[Callable[[], None]] = []


def register() -> None:
    """Register the add-on with Blender."""
    if _undo:
        raise RuntimeError("Umbra Black Hole is registered already.")
    _undo.append(lambda: SESSION.end(Life.REGISTRATION))
    try:
        for each in _CLASSES:
            bpy.utils.register_class(each)
            _undo.append(functools.partial(bpy.utils.unregister_class, each))
        for module in _MODULES:
            module.register()
            _undo.append(module.unregister)
    except BaseException:
        unregister()
        raise
    # Blender 4.5 as a Python module hangs when the process ends with classes or handlers still registered.
    atexit.register(unregister)


def unregister() -> None:
    """Take everything out of Blender again."""
    atexit.unregister(unregister)
    while _undo:
        _undo.pop()()
