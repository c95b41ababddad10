# SPDX-License-Identifier: GPL-3.0-or-later
"""A black hole that comes from another file: appended or linked, as an object, a collection, an instance or a scene."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, environment_image, render, shrink

STAR_SKY = "Umbra Star Sky"
COLLECTION = "Set"


@pytest.fixture(scope="module")
def shot(
    addon_module: Callable[[str], ModuleType], tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, np.ndarray]:
    """A file with a scene Shot, whose hole is in a collection of its own, and its picture."""
    folder = tmp_path_factory.mktemp("shot")
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    scene = bpy.context.scene
    shrink(scene)
    scene.umbra.map_folder = str(folder / "maps")
    scene.name = "Shot"
    home = bpy.data.collections.new(COLLECTION)
    scene.collection.children.link(home)
    layers = bpy.context.view_layer
    layers.active_layer_collection = layers.layer_collection.children[COLLECTION]
    environment_image(name=STAR_SKY)
    add_hole(scene, sky=False)
    picture = render(scene, folder / "shot.exr", addon_module("core.physics_api").physics)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    return folder / "shot.blend", picture


@pytest.fixture
def other(shot: tuple[Path, np.ndarray], tmp_path: Path) -> bpy.types.Scene:
    """Another file, with its own camera and a plain World."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    environment_image(name=STAR_SKY)
    scene = bpy.context.scene
    shrink(scene)
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


def bring(how: str, file: Path, kind: str, name: str, **options: bool) -> None:
    """Append or link as File > Append and File > Link do."""
    operator = getattr(bpy.ops.wm, how)
    assert operator(directory=f"{file}/{kind}/", filename=name, **options) == {"FINISHED"}


WAYS: dict[str, tuple[str, str, str, dict[str, bool]]] = {
    "object": ("append", "Object", "Black Hole", {}),
    "collection": ("append", "Collection", COLLECTION, {}),
    "linked": ("link", "Collection", COLLECTION, {"instance_collections": False}),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_hole_of_another_file_is_set_up_as_a_new_one(
    shot: tuple[Path, np.ndarray],
    other: bpy.types.Scene,
    tmp_path: Path,
    exr: ModuleType,
    capfd: pytest.CaptureFixture[str],
    way: str,
) -> None:
    """The picture is that of the file that it comes from, whose camera and sky are the same."""
    file, picture = shot
    how, kind, name, options = WAYS[way]
    bring(how, file, kind, name, **options)
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    assert f'World "World" is a plain color: the sky is the image "{STAR_SKY}"' in capfd.readouterr().out
    assert other.umbra.active_hole is not None
    assert (other.umbra.hide_behind, other.view_layers[0].use_pass_z) == (True, True)
    np.testing.assert_array_equal(render(other, tmp_path / "other.exr", exr), picture)
    other.umbra.hide_behind = False
    assert bpy.ops.umbra.remove_compositor() == {"FINISHED"}
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    assert not other.umbra.hide_behind  # the artist's choice stays


@pytest.mark.parametrize("how", ["append", "link"])
def test_a_scene_of_another_file(
    shot: tuple[Path, np.ndarray], other: bpy.types.Scene, tmp_path: Path, exr: ModuleType, how: str
) -> None:
    file, picture = shot
    bring(how, file, "Scene", "Shot")
    scene = next(each for each in bpy.data.scenes if each != other)
    assert (scene.library is not None) == (how == "link")
    bpy.context.window.scene = scene
    np.testing.assert_array_equal(render(scene, tmp_path / "again.exr", exr), picture)


def test_a_collection_instance_is_refused_by_name(
    shot: tuple[Path, np.ndarray],
    other: bpy.types.Scene,
    tmp_path: Path,
    exr: ModuleType,
    addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At once, in the panel, and in a render that would show it; what the sentence says to do helps."""
    file, picture = shot
    bring("link", file, "Collection", COLLECTION)
    (instance,) = (each for each in other.objects if each.instance_collection is not None)
    instance.name = "Set Piece"
    before = other.render.film_transparent, other.umbra.environment_source, len(bpy.data.node_groups)
    with pytest.raises(RuntimeError, match=r'collection instance "Set Piece".*hole\.instanced'):
        bpy.ops.umbra.setup_compositor()
    assert (other.render.film_transparent, other.umbra.environment_source, len(bpy.data.node_groups)) == before
    said = " ".join(line.text for line in addon_module("ui.status").lines(bpy.context))
    assert '"Set Piece"' in said
    ended: list[str] = []
    monkeypatch.setattr(addon_module("core.messages"), "end_process", ended.append)
    bpy.ops.umbra.set_output(output="WORLD")
    render(other, tmp_path / "refused.exr", exr)
    assert "hole.instanced" in ended[0]
    instance.hide_render = True  # a hidden one is not asked for
    ended.clear()
    render(other, tmp_path / "hidden.exr", exr)
    assert not ended
    instance.hide_render = False
    bpy.ops.umbra.set_output(output="COMPOSITOR")
    bpy.ops.object.select_all(action="DESELECT")
    instance.select_set(True)
    bpy.context.view_layer.objects.active = instance
    bpy.ops.object.duplicates_make_real()
    bpy.ops.umbra.setup_compositor()
    np.testing.assert_array_equal(render(other, tmp_path / "real.exr", exr), picture)


def test_a_refused_hole_is_not_added(scene: bpy.types.Scene) -> None:
    if bpy.app.version < (5, 0):
        pytest.skip("before 5.0 the compositor's tree is part of the scene")
    tree = bpy.data.node_groups.new("Shared", "CompositorNodeTree")
    scene.compositing_node_group = tree
    bpy.data.scenes.new("Other").compositing_node_group = tree
    objects, selected = set(bpy.data.objects), set(bpy.context.selected_objects)
    with pytest.raises(RuntimeError, match="also belongs to scene"):
        bpy.ops.umbra.add_black_hole()
    assert set(bpy.data.objects) == objects
    assert set(bpy.context.selected_objects) == selected
    assert scene.umbra.active_hole is None
    assert scene.umbra.environment_source == "WORLD"
