# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that are built once per session and appended from a file afterwards, which is some 50 times faster.

The add-on builds each of its groups once per file, and almost each test begins with a new one. It compares what is
appended with its own hash, as it does with every group of a file that is opened.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy

FOLDER = "UMBRA_TESTS_READY_GROUPS"
"""Environment variable: where the groups are kept, for this process and those that it starts."""


_handlers = ""


def install(module: Callable[[str], ModuleType]) -> None:
    """Let the add-on, whose modules this function gives, take groups from the folder; without one, nothing changes."""
    global _handlers
    _handlers = module("render.handlers").__file__
    kind = module("nodes.versioned_group").VersionedGroup
    world_group = module("nodes.world_group")
    find, rebuild, new_group = kind.find, kind._rebuild, world_group.new_group

    @functools.wraps(find)
    def find_or_append(group):
        return find(group) or _append(group)

    @functools.wraps(rebuild)
    def rebuild_and_keep(group, tree):
        is_new = not tree.nodes
        rebuild(group, tree)
        path = _path(group)
        if is_new and path is not None and tree.name == group.name and not path.exists():
            unfinished = path.with_suffix(f".{os.getpid()}")
            bpy.data.libraries.write(str(unfinished), {tree})
            unfinished.replace(path)

    kind.find, kind._rebuild = find_or_append, rebuild_and_keep
    world_group.new_group = lambda: _append(world_group._GROUP) or new_group()


def _path(group: object) -> Path | None:
    folder = os.environ.get(FOLDER)
    if not folder:
        return None
    kind = f"{group.name} {group.version} {group.variant} {group.inputs} {group.outputs} {bpy.app.version}"
    return Path(folder, f"{hashlib.sha256(kind.encode()).hexdigest()[:16]}.blend")


def _append(group: object) -> bpy.types.NodeTree | None:
    """Append the group, with the groups inside it unless the file has them."""
    path = _path(group)
    if path is None or not path.exists() or _in_a_handler():
        return None
    present = {tree["umbra_content"]: tree for tree in bpy.data.node_groups if "umbra_content" in tree}
    before = set(bpy.data.node_groups)
    with bpy.data.libraries.load(str(path)) as (_, wanted):
        wanted.node_groups = [group.name]
    (tree,) = wanted.node_groups
    for library in [each for each in bpy.data.libraries if Path(each.filepath) == path]:
        bpy.data.libraries.remove(library)
    for inside in set(bpy.data.node_groups) - before - {tree}:
        if inside.get("umbra_content") in present:
            inside.user_remap(present[inside["umbra_content"]])
            bpy.data.node_groups.remove(inside)
    return tree


def _in_a_handler() -> bool:
    """Whether a handler of the add-on runs: Blender does not survive it that a file is read while it renders."""
    frame = sys._getframe()
    while frame is not None:
        if frame.f_code.co_filename == _handlers:
            return True
        frame = frame.f_back
    return False
