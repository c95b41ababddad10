# SPDX-License-Identifier: GPL-3.0-or-later
"""What was verified is what Blender reads: the right picture, or a sentence and no exit status 0."""

import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, compositor, render

OUTPUTS = ["COMPOSITOR", "CYCLES_LENS", "WORLD"]

Reader = bpy.types.Node


@pytest.fixture
def told(addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Sentences of renders that are refused; without a window they would end the process."""
    shown: list[str] = []
    monkeypatch.setattr(addon_module("core.messages"), "popup", shown.append)
    monkeypatch.setattr(addon_module("core.messages"), "without_window", lambda: False)
    return shown


@pytest.fixture(params=OUTPUTS)
def shot(request: pytest.FixtureRequest, scene: bpy.types.Scene) -> bpy.types.Scene:
    """A scene with each of the outputs, with a disk where that is drawn."""
    hole = add_hole(scene, mass_scale=0.3)
    if request.param != "WORLD":
        hole.umbra.disk.enabled = True
    assert bpy.ops.umbra.set_output(output=request.param) == {"FINISHED"}
    scene.world.cycles.sampling_method = "NONE"
    return scene


def readers(scene: bpy.types.Scene) -> list[Reader]:
    """The nodes that read maps and passes."""
    if scene.umbra.output == "WORLD":
        group = scene.world.node_tree.nodes["Umbra World"].node_tree
        return [node for node in group.nodes if node.type == "TEX_IMAGE"]
    roles = ("map", "disk_pass", "disk_colors")
    return [node for node in compositor(scene).nodes if str(node.get("umbra_role", "")).startswith(roles)]


def user(node: Reader) -> bpy.types.bpy_struct:
    return getattr(node, "image_user", None) or node


def set_color_space(nodes: list[Reader]) -> None:
    for node in nodes:
        node.image.colorspace_settings.name = "sRGB"


def set_alpha(nodes: list[Reader]) -> None:
    for node in nodes:
        node.image.alpha_mode = "PREMUL"


def set_frames(nodes: list[Reader]) -> None:
    for node in nodes:
        if node.image.source == "SEQUENCE":
            user(node).frame_offset, user(node).use_cyclic, user(node).frame_duration = 7, False, 1


def set_source(nodes: list[Reader]) -> None:
    for node in nodes:
        if node.image.source == "SEQUENCE":
            node.image.source = "FILE"


def replace(nodes: list[Reader]) -> None:
    other = bpy.data.images.new("Other", 64, 36, float_buffer=True)
    for node in nodes:
        node.image = other


def take_image(nodes: list[Reader]) -> None:
    for node in nodes:
        node.image = None


@pytest.mark.parametrize("spoil", [set_color_space, set_alpha, set_frames, set_source, replace, take_image])
def test_settings_of_the_images(
    shot: bpy.types.Scene, tmp_path: Path, exr: ModuleType, spoil: Callable[[list[Reader]], None]
) -> None:
    """They are set again, by what the node is for and not by names."""
    good = render(shot, tmp_path / "good.exr", exr)
    for node in readers(shot):
        node.name = node.label = "Renamed"
        node.image.name = "Renamed"
    spoil(readers(shot))
    np.testing.assert_array_equal(render(shot, tmp_path / "bad.exr", exr), good)


def test_backslashes_in_the_folder(shot: bpy.types.Scene, tmp_path: Path, exr: ModuleType, told: list[str]) -> None:
    """As a file dialog on Windows stores them."""
    good = render(shot, tmp_path / "good.exr", exr)
    shot.umbra.map_folder = str(tmp_path / "other") + "\\maps\\"
    np.testing.assert_array_equal(render(shot, tmp_path / "other.exr", exr), good)
    assert list((tmp_path / "other" / "maps").glob("*.exr"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    shot.umbra.map_folder = "//beside\\the file\\"
    np.testing.assert_array_equal(render(shot, tmp_path / "beside.exr", exr), good)
    assert list((tmp_path / "beside" / "the file").glob("*.exr"))
    assert not told


@pytest.mark.skipif(os.sep != "/", reason="a backslash is a separator there")
def test_a_file_in_a_folder_with_a_backslash(
    shot: bpy.types.Scene, tmp_path: Path, exr: ModuleType, told: list[str]
) -> None:
    odd = tmp_path / "odd\\folder"
    odd.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(odd / "shot.blend"))
    shot.umbra.map_folder = "//maps"
    if "\\" in bpy.path.abspath("//maps"):
        render(shot, tmp_path / "picture.exr", exr)
        assert "[folder.path]" in told[0]


def test_a_path_beyond_what_blender_reads(
    shot: bpy.types.Scene, tmp_path: Path, exr: ModuleType, told: list[str]
) -> None:
    folder = str(tmp_path) + "/" + "/".join(["m" * 200] * 5)
    shot.umbra.map_folder = folder
    render(shot, tmp_path / "picture.exr", exr)
    assert "[folder.path]" in told[0]
    assert not Path(folder).exists(), "refused before any work"
    length = 1023 - 120
    shot.umbra.map_folder = folder[:length]
    told.clear()
    picture = render(shot, tmp_path / "picture.exr", exr)
    assert not told
    assert np.abs(picture[..., :3] - [1.0, 0.0, 1.0]).max(axis=-1).min() > 0.01


@pytest.mark.parametrize("harm", ["removed", "cut short", "replaced"])
def test_a_map_that_changes_after_the_check(
    shot: bpy.types.Scene,
    tmp_path: Path,
    exr: ModuleType,
    told: list[str],
    harm: str,
    addon_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    baking = addon_module("bake.baking")
    provide = baking.provide

    def harmed(wanted, **options):
        found = provide(wanted, **options)
        path = wanted.files[-1]
        if harm == "removed":
            path.unlink()
        elif harm == "cut short":
            os.truncate(path, path.stat().st_size // 2)
        else:
            (tmp_path / "copy").write_bytes(path.read_bytes())
            os.replace(tmp_path / "copy", path)
        return found

    monkeypatch.setattr(baking, "provide", harmed)
    render(shot, tmp_path / "picture.exr", exr)
    assert told, "nobody says it"
    assert "[render.map-changed]" in told[0] or "[file." in told[0]


ROLES = ["map", "sky", "disk_layer"]


@pytest.mark.parametrize("role", ROLES)
def test_muted_nodes(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, told: list[str], role: str) -> None:
    add_hole(scene).umbra.disk.enabled = True
    tree = compositor(scene)
    (node,) = [node for node in tree.nodes if node.get("umbra_role") == role]
    node.mute = True
    render(scene, tmp_path / "picture.exr", exr)
    assert "[compositor.muted]" in told[0]
    assert node.name in told[0]
    node.mute = False
    told.clear()
    (link,) = node.outputs[0].links
    link.is_muted = True
    render(scene, tmp_path / "picture.exr", exr)
    assert "[compositor.muted]" in told[0]


def test_a_muted_layer_over_the_lens(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, told: list[str]) -> None:
    add_hole(scene).umbra.disk.enabled = True
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    (node,) = [node for node in compositor(scene).nodes if node.get("umbra_role") == "disk_layer"]
    node.mute = True
    render(scene, tmp_path / "picture.exr", exr)
    assert "[compositor.muted]" in told[0]


@pytest.mark.parametrize("way", ["muted group", "muted tint", "cut tint"])
def test_a_world_whose_group_is_cut_off(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, told: list[str], way: str
) -> None:
    add_hole(scene)
    bpy.ops.umbra.set_output(output="WORLD")
    tree = scene.world.node_tree
    group = tree.nodes["Umbra World"]
    (link,) = group.outputs["Light"].links
    scene.world.cycles.sampling_method = "NONE"
    if way == "muted group":
        group.mute = True
    elif way == "muted tint":
        link.to_node.mute = True
    else:
        tree.links.remove(link)
    render(scene, tmp_path / "picture.exr", exr)
    assert "[sky.group-cut]" in told[0]


def test_a_world_map_whose_reader_is_muted(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    """Inside of the group, which is mended."""
    add_hole(scene)
    bpy.ops.umbra.set_output(output="WORLD")
    good = render(scene, tmp_path / "good.exr", exr)
    for node in readers(scene):
        node.mute = True
        node.interpolation = "Cubic"
    np.testing.assert_array_equal(render(scene, tmp_path / "bad.exr", exr), good)
