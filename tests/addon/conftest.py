# SPDX-License-Identifier: GPL-3.0-or-later
"""Each test of the add-on starts from Blender's factory scene."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy  # before any test module asks for addon_utils, which comes with it
import pytest
import ready_groups
from small_scene import shrink


@pytest.fixture(scope="session")
def _ready_groups(addon_module: Callable[[str], ModuleType], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the node groups that are built already."""
    ready_groups.install(addon_module)
    return tmp_path_factory.mktemp("groups")


@pytest.fixture(autouse=True)
def _factory_scene(
    factory_scene: None, _ready_groups: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reset Blender for each test in this folder; those of the node groups build them all."""
    if not request.path.name.startswith("test_node_"):
        monkeypatch.setenv(ready_groups.FOLDER, str(_ready_groups))


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene of three frames with maps of its own; a test file that needs another one makes it itself."""
    scene = bpy.context.scene
    shrink(scene)
    scene.umbra.map_folder = str(tmp_path / "maps")
    scene.frame_start, scene.frame_end = 1, 3
    return scene


@pytest.fixture
def exr(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    """The installed add-on's own reader and writer of EXR files."""
    return addon_module("core.physics_api").physics
