# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the folder of the maps is, however it was written."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest


@pytest.mark.parametrize(
    ("written", "place"),
    [
        ("//", "."),
        ("//maps", "maps"),
        ("//maps//", "maps"),
        ("//../maps/", "../maps"),
        ("maps", "maps"),
        ("  //maps/  ", "maps"),
        ("", "umbra_maps"),
        ("//maps\\\\deep\\\\", "maps/deep"),
        ("/", "/"),
        ("/maps", "/maps"),
    ],
)
def test_where_it_is(
    scene: bpy.types.Scene, tmp_path: Path, addon_module: Callable[[str], ModuleType], written: str, place: str
) -> None:
    """Blender's // is the folder of the .blend file, never the root of the disk."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    scene.umbra.map_folder = written.replace("\\\\", "\\")
    found = addon_module("bake.folder").folder(scene)
    assert found.path.resolve() == (tmp_path / place).resolve()
    assert Path(bpy.path.abspath(found.blender_path)).resolve() == found.path.resolve()
