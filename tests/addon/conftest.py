# SPDX-License-Identifier: GPL-3.0-or-later
"""Each test of the add-on starts from Blender's factory scene."""

from collections.abc import Callable
from types import ModuleType

import bpy  # noqa: F401  before any test module asks for addon_utils, which comes with it
import pytest


@pytest.fixture(autouse=True)
def _factory_scene(factory_scene: None) -> None:
    """Reset Blender for each test in this folder."""


@pytest.fixture
def exr(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    """The installed add-on's own reader and writer of EXR files."""
    return addon_module("_physics").exr
