# SPDX-License-Identifier: GPL-3.0-or-later
"""The catalog of stars of a farm copy, which lies beside it or below, where a farm finds it."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from ..core.errors import SceneError
from ..settings.scene_properties import NEVER


@contextmanager
def brought_along(scene: bpy.types.Scene, blend: Path) -> Iterator[None]:
    """Have the scene refer, for as long as the block lasts, to its catalog by a path relative to a file.

    A catalog that is not in the file's folder, or below that, is copied there.

    Raises
    ------
    SceneError
        If the catalog cannot be copied.
    """
    before = scene.umbra.star_catalog
    if not before or scene.umbra.stars == NEVER:
        yield
        return
    table = Path(bpy.path.abspath(before)).resolve()
    folder = blend.parent.resolve()
    if not table.is_relative_to(folder):
        target = folder / f"{blend.stem}_{table.name}"
        try:
            shutil.copyfile(table, target)
        except OSError as error:
            raise SceneError(
                f"The star catalog {table} cannot be copied beside the farm copy ({error.strerror}): choose one that "
                "is there, or switch Stars off.",
                code="farm.not-written",
            ) from error
        table = target
    scene.umbra.star_catalog = f"//{table.relative_to(folder).as_posix()}"
    try:
        yield
    finally:
        scene.umbra.star_catalog = before
