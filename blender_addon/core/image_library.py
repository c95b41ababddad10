# SPDX-License-Identifier: GPL-3.0-or-later
"""Make sure that maps can be read and written: by the extension's own OpenEXR, or else by Blender's OpenImageIO."""

import sys
from pathlib import Path

import bpy

from . import messages
from .errors import SceneError
from .physics_api import physics


def check() -> None:
    """Raise where maps can be neither read nor written.

    Raises
    ------
    SceneError
        As one sentence, which says what to do.
    """
    try:
        physics.exr_library(_folders())
    except physics.ImageFileError as error:
        raise SceneError(
            "Maps can be neither read nor written, because the package OpenEXR that comes with Umbra Black Hole could "
            "not be loaded and this Blender has no OpenImageIO: install the extension again from the zip for this "
            "system, and disable other add-ons that bring an OpenEXR of their own.",
            code=error.code,
        ) from error


def register() -> None:
    """Say it as soon as the extension is enabled; the panel and every operation say it too."""
    try:
        check()
    except SceneError as error:
        messages.warn(error.for_user())
        if not messages.without_window():
            messages.popup(error.for_user())


def unregister() -> None:
    """Nothing to undo: a loaded library stays."""


def _folders() -> list[str]:
    """Where Blender has its own Python packages: on Python's path in the executable, but not in the bpy module."""
    python = Path(bpy.utils.resource_path("LOCAL"), "python")
    names = (f"python{sys.version_info.major}.{sys.version_info.minor}/site-packages", "site-packages")
    return [str(folder) for name in names if (folder := python / "lib" / name).is_dir()]
