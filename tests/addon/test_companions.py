# SPDX-License-Identifier: GPL-3.0-or-later
"""A further kind of file beside warp maps, in one place: it is baked, checked, shared, listed and cleaned with them."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole


@pytest.fixture
def shadows(addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> object:
    """A pass of the shadow alone."""
    physics = addon_module("core.physics_api").physics
    files = physics.files
    form = files.map_file.MapFormat("umbra shadow", 1, "a shadow pass", "R: what is not visible")

    def write(path: Path, warp_map: object, _number: int) -> None:
        plane = np.float32(1.0) - warp_map.visibility
        form.write(path, [plane, plane * 0, plane * 0, plane * 0], warp_map.metadata)

    def paths(map_path: Path, _parameters: object) -> tuple[Path, ...]:
        stem, number = Path(map_path).stem.rsplit("_", 1)
        return (Path(map_path).with_name(f"{stem}_shadow_{number}.exr"),)

    companion = files.companion.Companion(form, form.read, "shadow", paths, write)
    monkeypatch.setattr(files.companions, "COMPANIONS", (*files.companions.COMPANIONS, companion))
    monkeypatch.setitem(files.map_check.READERS, form, form.read)
    monkeypatch.setattr(physics, "COMPANION_MARKS", physics.COMPANION_MARKS + "|shadow")
    return form


def test_it_goes_with_its_map(scene: bpy.types.Scene, tmp_path: Path, shadows: object) -> None:
    hole = add_hole(scene)
    folder = tmp_path / "maps"
    bpy.ops.umbra.bake_frame()
    (own,) = folder.glob("*_shadow_0001.exr")
    planes, _metadata = shadows.read(own)
    assert planes[0].max() == 1.0
    assert len(list(folder.glob("*.exr"))) == 2
    own.write_bytes(own.read_bytes()[:-9])
    bpy.ops.umbra.bake_frame()  # a damaged one is a reason to bake
    shadows.read(own)
    hole.name = "Renamed"
    bpy.ops.umbra.bake_frame()  # it is taken over with its map
    assert len(list(folder.glob("*_shadow_0001.exr"))) == 2
    bpy.ops.umbra.clean_maps(everything=True)
    assert len(list(folder.glob("*.exr"))) == 2  # those of the other name
    assert own.exists()
