# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups compared with recorded texts, one line per socket and node, in tests/data/node_groups.

After a wanted change, renew the texts with each Blender and read the difference:

    UMBRA_RENEW_SNAPSHOTS=1 python -m pytest tests/addon/test_node_snapshots.py
    git diff tests/data/node_groups
"""

import os
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import TypeAlias

import bpy
import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[1] / "data" / "node_groups"
RENEW = "UMBRA_RENEW_SNAPSHOTS"
BLENDER = f"blender{bpy.app.version[0]}"
GROUPS = ("black_hole", "black_hole_filtered", "black_hole_film", "disk_layer", "world", "world_tint")
ALIKE = ("world", "world_tint")  # the same nodes in each version of Blender
UNBOUNDED = 1e30

Places: TypeAlias = dict[bpy.types.Node, tuple[str, int]]
"""Label of the frame that a node lies in, and the node's number within it."""


@pytest.fixture
def build(addon_module: Callable[[str], ModuleType]) -> Callable[[str], bpy.types.NodeTree]:
    """A function that builds a group by its name in `GROUPS`."""
    black_hole, world = (addon_module(f"nodes.{name}_group") for name in ("black_hole", "world"))
    builders = {
        "black_hole": black_hole.ensure_group,
        "black_hole_filtered": lambda: black_hole.ensure_group(8),
        "black_hole_film": lambda: black_hole.ensure_group(glare=2),
        "disk_layer": addon_module("nodes.disk_layer").GROUP.ensure,
        "world": world.new_group,
        "world_tint": addon_module("nodes.world_tint").GROUP.ensure,
    }
    return lambda name: builders[name]()


@pytest.mark.parametrize("name", GROUPS)
def test_node_group_is_as_recorded(build: Callable[[str], bpy.types.NodeTree], name: str) -> None:
    path = FOLDER / (f"{name}.txt" if name in ALIKE else f"{name}_{BLENDER}.txt")
    text = "\n".join(describe(build(name))) + "\n"
    if RENEW in os.environ:
        path.write_text(text, encoding="utf-8")
    assert path.is_file(), f"Record {path.name} with {RENEW}=1."
    assert text.splitlines() == path.read_text(encoding="utf-8").splitlines()


def describe(tree: bpy.types.NodeTree) -> Iterator[str]:
    """Describe a group in lines: its sockets, then its nodes, frame by frame in the order in which they were added.

    Nodes are numbered within their frames, so that a node more in one frame leaves the other lines as they are.
    """
    yield f"{tree.name} ({tree.bl_idname})"
    yield from map(socket_line, tree.interface.items_tree)
    counts: Counter[str] = Counter()
    places: dict[bpy.types.Node, tuple[str, int]] = {}
    frame = None
    for node in tree.nodes:
        if node.bl_idname == "NodeFrame":
            continue
        parent = "no frame" if node.parent is None else node.parent.label
        counts[parent] += 1
        places[node] = parent, counts[parent]
        if parent != frame:
            frame = parent
            yield f"\n[{frame}]"
        yield node_line(node, places)


def socket_line(item: bpy.types.NodeTreeInterfaceItem) -> str:
    words = [item.in_out.lower(), f'"{item.name}"', item.socket_type.removeprefix("NodeSocket")]
    if getattr(item, "subtype", "NONE") != "NONE":
        words.append(item.subtype)
    if item.in_out == "INPUT":
        if hasattr(item, "min_value") and item.max_value < UNBOUNDED:
            words.append(f"from {text_of(item.min_value)} to {text_of(item.max_value)}")
        words.append(f"default {text_of(item.default_value)}")
    if item.hide_value:
        words.append("hidden")
    return f"{' '.join(words)}: {item.description}"


def node_line(node: bpy.types.Node, places: Places) -> str:
    """Describe a node in the form `number = kind.operation(operands) {settings} "label"`."""
    kind = node.bl_idname.removeprefix("ShaderNode").removeprefix("CompositorNode")
    if kind == "NodeGroupInput":
        return f"%{places[node][1]} = {kind}"
    if hasattr(node, "operation"):
        kind += f".{node.operation}"
    used = [socket for socket in node.inputs if not socket.is_unavailable and socket.bl_idname != "NodeSocketVirtual"]
    names = [socket.name for socket in used]
    named = len(names) > 1 and len(set(names)) == len(names)
    operands = (f"{socket.name}={operand(socket, places)}" if named else operand(socket, places) for socket in used)
    line = f"%{places[node][1]} = {kind}({', '.join(operands)})"
    own = set(node.bl_rna.properties.keys()) - set(bpy.types.Node.bl_rna.properties.keys()) - {"operation"}
    settings = [
        f"{name}={getattr(node, name)}"
        for name in sorted(own)
        if isinstance(getattr(node, name), str | bool) and getattr(node, name) != node.bl_rna.properties[name].default
    ]
    settings.extend(node.keys())
    if getattr(node, "node_tree", None) is not None:
        settings.append(node.node_tree.name)
    if settings and kind != "NodeGroupOutput":
        line += f" {{{', '.join(settings)}}}"
    return line + (f' "{node.label}"' if node.label else "") + (" muted" if node.mute else "")


def operand(socket: bpy.types.NodeSocket, places: Places) -> str:
    """Name the node and the output that an input is linked to, or the input's own value."""
    if not socket.is_linked:
        return text_of(getattr(socket, "default_value", None))
    source = socket.links[0].from_socket
    if source.node.bl_idname == "NodeGroupInput":
        return f'"{source.name}"'
    frame, number = places[source.node]
    text = f"%{number}" if frame == places[socket.node][0] else f"[{frame}] %{number}"
    several = sum(not each.is_unavailable for each in source.node.outputs) > 1
    return f"{text}.{source.name}" if several else text


def text_of(value: object) -> str:
    """Write a value; a float as the shortest text that gives the same float32."""
    if isinstance(value, float):
        return str(float(str(np.float32(value))))  # versions of numpy write large numbers differently
    if value is None or isinstance(value, str | bool | int):
        return str(value)
    return "(" + ", ".join(map(text_of, value)) + ")"
