# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes mangled by hand: whatever was deleted, cut, renamed or overwritten, it is repaired or told in one sentence.

Damage is dealt in random order from a list; what must hold afterwards holds always: no operator ends in a traceback, no
handler does, drawing the panel's lines does not, and a render either shows the hole, or is refused, or is magenta.
"""

import math
import random
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, compositor, render, shrink

import physics
from physics.images import exr

ROLE = "umbra_role"
MAGENTA = (1.0, 0.0, 1.0)


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    scene = bpy.context.scene
    shrink(scene, (32, 18))
    add_hole(scene)
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


def tree_of(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    return scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group


def nodes_of(scene: bpy.types.Scene, role: str) -> list[bpy.types.Node]:
    tree = tree_of(scene)
    return [] if tree is None else [node for node in tree.nodes if node.get(ROLE) == role]


def our_groups() -> list[bpy.types.NodeTree]:
    return [tree for tree in bpy.data.node_groups if "umbra_version" in tree]


# --- damage -----------------------------------------------------------------------------------------


def delete_group_datablock(scene: bpy.types.Scene, _: random.Random) -> None:
    for tree in our_groups():
        bpy.data.node_groups.remove(tree)


def empty_group(scene: bpy.types.Scene, _: random.Random) -> None:
    for tree in our_groups():
        tree.nodes.clear()


def remove_sockets(scene: bpy.types.Scene, source: random.Random) -> None:
    for tree in our_groups():
        items = [item for item in tree.interface.items_tree if item.item_type == "SOCKET"]
        for item in source.sample(items, min(3, len(items))):
            tree.interface.remove(item)


def rename_sockets(scene: bpy.types.Scene, source: random.Random) -> None:
    for tree in our_groups():
        for item in tree.interface.items_tree:
            if source.random() < 0.4:
                item.name = "Ünbekannt"


def change_socket_types(scene: bpy.types.Scene, source: random.Random) -> None:
    for tree in our_groups():
        for item in tree.interface.items_tree:
            if item.item_type == "SOCKET" and source.random() < 0.3:
                item.socket_type = source.choice(["NodeSocketFloat", "NodeSocketColor", "NodeSocketVector"])


def cut_links(scene: bpy.types.Scene, source: random.Random) -> None:
    tree = tree_of(scene)
    for link in list(tree.links) if tree is not None else ():
        if source.random() < 0.5:
            tree.links.remove(link)


def delete_our_nodes(scene: bpy.types.Scene, source: random.Random) -> None:
    tree = tree_of(scene)
    for node in list(tree.nodes) if tree is not None else ():
        if node.get(ROLE) and source.random() < 0.5:
            tree.nodes.remove(node)


def delete_all_nodes(scene: bpy.types.Scene, _: random.Random) -> None:
    if tree_of(scene) is not None:
        tree_of(scene).nodes.clear()


def duplicate_roles(scene: bpy.types.Scene, source: random.Random) -> None:
    tree = tree_of(scene)
    if tree is None:
        return
    for role in ("group", "map", "sky"):
        kind = "CompositorNodeGroup" if role == "group" else "CompositorNodeImage"
        tree.nodes.new(kind)[ROLE] = role


def misplace_roles(scene: bpy.types.Scene, source: random.Random) -> None:
    """The role on nodes that cannot play it, or of another type."""
    tree = tree_of(scene)
    if tree is None:
        return
    for node in tree.nodes:
        if source.random() < 0.5:
            node[ROLE] = source.choice(["group", "map", "sky", "render_layer", "output", 7, 1.5, [1, 2], ""])


def stamp(scene: bpy.types.Scene, source: random.Random) -> None:
    """Versions from the future, of other types, or none."""
    for tree in our_groups():
        tree["umbra_version"] = source.choice([999, -1, 0, "2", 1.5, [1, 2]])
        for key in ("umbra_content", "umbra_built_with_blender"):
            if key in tree:
                tree[key] = source.choice([7, "nonsense", [1.0]])


def unstamp(scene: bpy.types.Scene, _: random.Random) -> None:
    for tree in our_groups():
        del tree["umbra_version"]


def spoil_memory(scene: bpy.types.Scene, source: random.Random) -> None:
    """What is remembered for taking the set-up out again."""
    scene["umbra_before"] = source.choice([7, "text", [1, 2], {"film_transparent": "yes", "use_nodes": 3.5}, {}])


def delete_images(scene: bpy.types.Scene, source: random.Random) -> None:
    for image in list(bpy.data.images):
        if source.random() < 0.6:
            bpy.data.images.remove(image)


def swap_images(scene: bpy.types.Scene, _: random.Random) -> None:
    other = bpy.data.images.new("Other", 4, 4)
    for role in ("map", "sky"):
        for node in nodes_of(scene, role):
            if hasattr(node, "image"):
                node.image = other


def delete_hole(scene: bpy.types.Scene, _: random.Random) -> None:
    if scene.umbra.active_hole is not None:
        bpy.data.objects.remove(scene.umbra.active_hole)


def mesh_for_hole(scene: bpy.types.Scene, _: random.Random) -> None:
    mesh = bpy.data.objects.new("Mesh", bpy.data.meshes.new("Mesh"))
    scene.collection.objects.link(mesh)
    scene.umbra.active_hole = mesh


def flatten_hole(scene: bpy.types.Scene, source: random.Random) -> None:
    if scene.umbra.active_hole is not None:
        scene.umbra.active_hole.scale = source.choice([(0, 0, 0), (1, 2, 3), (-1, 1, 1), (math.inf, 1, 1)])


def delete_camera(scene: bpy.types.Scene, _: random.Random) -> None:
    if scene.camera is not None:
        bpy.data.objects.remove(scene.camera)


def light_for_camera(scene: bpy.types.Scene, _: random.Random) -> None:
    light = bpy.data.objects.new("Light", bpy.data.lights.new("Light", "POINT"))
    scene.collection.objects.link(light)
    scene.camera = light


def delete_world(scene: bpy.types.Scene, _: random.Random) -> None:
    if scene.world is not None:
        bpy.data.worlds.remove(scene.world)
    scene.umbra.environment_source = "WORLD"


def delete_tree(scene: bpy.types.Scene, _: random.Random) -> None:
    if bpy.app.version < (5, 0):
        scene.use_nodes = False
    elif scene.compositing_node_group is not None:
        bpy.data.node_groups.remove(scene.compositing_node_group)


def mute(scene: bpy.types.Scene, _: random.Random) -> None:
    for node in nodes_of(scene, "group"):
        node.mute = True


def foreign_group(scene: bpy.types.Scene, _: random.Random) -> None:
    """Our node shows somebody else's group."""
    other = bpy.data.node_groups.new("Umbra Black Hole", "CompositorNodeTree")
    for node in nodes_of(scene, "group"):
        if node.bl_idname == "CompositorNodeGroup":
            node.node_tree = other


DAMAGE = [
    delete_group_datablock, empty_group, remove_sockets, rename_sockets, change_socket_types, cut_links,
    delete_our_nodes, delete_all_nodes, duplicate_roles, misplace_roles, stamp, unstamp, spoil_memory, delete_images,
    swap_images, delete_hole, mesh_for_hole, flatten_hole, delete_camera, light_for_camera, delete_world, delete_tree,
    mute, foreign_group,
]  # fmt: skip

# --- what must hold ---------------------------------------------------------------------------------

OPERATORS = [
    "setup_compositor", "remove_compositor", "bake_frame", "check_accuracy", "set_output",
    "make_active", "add_black_hole", "set_up_foreground", "remove_foreground",
]  # fmt: skip


def one_sentence(text: str) -> bool:
    """A report as an operator gives it, with its code, and no traceback."""
    return "Traceback" not in text and re.fullmatch(r"Error: .*\. \[[a-z-]+\.[a-z-]+\]", text.strip()) is not None


def call(name: str, **arguments: object) -> bool:
    """Run an operator; whether it did its work. A refusal is one sentence, and not to be available is none."""
    operator = getattr(bpy.ops.umbra, name)
    try:
        return operator(**arguments) == {"FINISHED"}
    except RuntimeError as error:
        text = str(error)
        assert one_sentence(text) or "poll() failed" in text, text
        return False


def draw_and_handle(addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene, tmp_path: Path) -> None:
    """The panel's lines, saving and opening: none may fail."""
    assert addon_module("ui.status").lines(bpy.context)
    addon_module("outputs.registry").of(scene).sky_problem(scene)
    handlers = addon_module("render.handlers")
    handlers.on_save_pre(str(tmp_path / "saved.blend"))
    handlers.on_load_post("")
    bpy.context.view_layer.update()


def shows_or_refuses(
    addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Render as with a window, where a failure is told and the picture is magenta."""
    told: list[str] = []
    messages = addon_module("core.messages")
    monkeypatch.setattr(messages, "popup", told.append)
    monkeypatch.setattr(messages, "warn", told.append)
    monkeypatch.setattr(addon_module("core.messages"), "without_window", lambda: False)
    in_use = addon_module("outputs.shared.compositor_tree").is_in_use(scene)
    try:
        picture = render(scene, path, exr)
    except RuntimeError as error:  # Blender's own: no camera, no output
        told.append(str(error))
        picture = None
    except physics.ImageFileError:  # a compositor without an output writes no picture
        picture = None
    assert not any("unexpected fault" in text or "Traceback" in text for text in told), told
    if picture is None:
        return
    told = [text for text in told if "built anew" not in text and "sky" not in text.lower() and "World" not in text]
    if in_use and told and scene.umbra.output == "COMPOSITOR":
        magenta = np.isclose(picture[..., :3], MAGENTA, atol=1e-3).all(axis=-1)
        assert magenta.mean() > 0.9 or not picture[..., :3].any(), told


@pytest.mark.parametrize("damage", DAMAGE, ids=lambda damage: damage.__name__)
def test_each_damage_is_repaired_or_told(
    addon_module: Callable[[str], ModuleType],
    scene: bpy.types.Scene,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    damage: Callable[[bpy.types.Scene, random.Random], None],
) -> None:
    damage(scene, random.Random(1))
    draw_and_handle(addon_module, scene, tmp_path)
    shows_or_refuses(addon_module, scene, tmp_path / "damaged.exr", monkeypatch)
    call("setup_compositor")
    call("bake_frame")
    draw_and_handle(addon_module, scene, tmp_path)
    shows_or_refuses(addon_module, scene, tmp_path / "repaired.exr", monkeypatch)
    call("remove_compositor")
    assert not nodes_of(scene, "group")


@pytest.mark.parametrize("seed", range(4))
def test_random_damage_and_random_operators(
    addon_module: Callable[[str], ModuleType],
    scene: bpy.types.Scene,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    seed: int,
) -> None:
    source = random.Random(seed)
    for _ in range(5):
        for damage in source.sample(DAMAGE, source.randrange(1, 4)):
            damage(scene, source)
        name = source.choice(OPERATORS)
        call(name, **({"output": source.choice(["COMPOSITOR", "CYCLES_LENS"])} if name == "set_output" else {}))
        draw_and_handle(addon_module, scene, tmp_path)
    shows_or_refuses(addon_module, scene, tmp_path / "picture.exr", monkeypatch)


def test_a_mangled_scene_whole_again_shows_the_same_picture(
    addon_module: Callable[[str], ModuleType], scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All damage to the set-up itself is undone by Set Up Compositor, to the pixel."""
    monkeypatch.setattr(
        addon_module("core.messages"), "without_window", lambda: False
    )  # a failure must not end the test
    before = render(scene, tmp_path / "before.exr", exr)
    empty_group(scene, random.Random(0))  # found and mended by the render itself
    np.testing.assert_allclose(render(scene, tmp_path / "mended.exr", exr), before, atol=1e-6)
    source = random.Random(3)
    for damage in (empty_group, remove_sockets, change_socket_types, stamp, cut_links, swap_images, duplicate_roles):
        damage(scene, source)
        assert call("remove_compositor")
        assert call("setup_compositor")
    np.testing.assert_allclose(render(scene, tmp_path / "after.exr", exr), before, atol=1e-6)


def test_a_compositor_of_the_artists_own_survives(scene: bpy.types.Scene) -> None:
    """Only our nodes may go, whatever roles others were given."""
    tree = compositor(scene)
    own = tree.nodes.new("CompositorNodeExposure")
    own.name = "Artist's"
    own[ROLE] = "group"
    call("setup_compositor")
    call("remove_compositor")
    assert tree_of(scene) is None or not nodes_of(scene, "group")
