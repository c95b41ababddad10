# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter of the sky as an artist uses it: chosen, baked, rendered, and switched off again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, compositor, environment_image, render, use_sky

import physics
from physics.reference import reference_render

# Of the larger of pixel and mean light, in 99 % of pixels: levels are stored in half precision, 2^-11, and looked up by
# coordinates of single precision.
TOLERANCE = 2e-3


def noise(seed: int = 2, rows: int = 256) -> np.ndarray:
    """A sky whose neighboring texels have nothing in common."""
    return np.random.default_rng(seed).random((rows, 2 * rows, 3)).astype(np.float32)


def ours(scene: bpy.types.Scene) -> dict[str, bpy.types.Node]:
    """The add-on's nodes by their roles."""
    return {node["umbra_role"]: node for node in compositor(scene).nodes if "umbra_role" in node}


def is_the_references(
    scene: bpy.types.Scene, picture: np.ndarray, sky: np.ndarray, looks: int, tolerance: float = TOLERANCE
) -> bool:
    """Whether a picture is what numpy makes of the scene's one map."""
    folder = Path(scene.umbra.map_folder)
    (path,) = (each for each in folder.glob("*_0001.exr") if "footprint" not in each.name and "sky" not in each.name)
    group = ours(scene)["group"]
    expected = reference_render.render(
        physics.read_warp_map(path), sky, exposure=group.inputs["Exposure"].default_value, looks=looks
    ).sky[..., :3]
    error = np.abs(picture[..., :3] - expected).max(axis=-1) / np.maximum(expected.max(axis=-1), expected.mean())
    return bool(np.quantile(error, 0.99) < tolerance)


def blocks(seed: int) -> np.ndarray:
    """A gray sky, even over 2 x 2 texels, as a movie can keep it."""
    gray = np.random.default_rng(seed).random((128, 256, 1)).astype(np.float32)
    return np.repeat(gray.repeat(2, axis=0).repeat(2, axis=1), 3, axis=2)


def encoded(linear: np.ndarray) -> np.ndarray:
    """Linear light as sRGB (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055).astype(np.float32)


def write_movie(folder: Path, frames: list[np.ndarray]) -> Path:
    """Write pictures, as they are encoded for display, as a movie: a scene shows them one after the other."""
    scene = bpy.data.scenes.new("movie")
    rows, columns = frames[0].shape[:2]
    editor = scene.sequence_editor_create()
    for number, frame in enumerate(frames, 1):
        image = bpy.data.images.new("frame", columns, rows)
        image.pixels.foreach_set(np.concatenate([frame[::-1], np.ones((rows, columns, 1), np.float32)], 2).ravel())
        image.file_format = "PNG"
        image.filepath_raw = str(folder / f"movie_{number}.png")
        image.save()
        strips = editor.strips if hasattr(editor, "strips") else editor.sequences
        strips.new_image(f"{number}", image.filepath_raw, 1, number)
    scene.frame_start, scene.frame_end = 1, len(frames)
    settings = scene.render
    settings.resolution_x, settings.resolution_y, settings.resolution_percentage = columns, rows, 100
    if hasattr(settings.image_settings, "media_type"):
        settings.image_settings.media_type = "VIDEO"
    settings.image_settings.file_format = "FFMPEG"
    settings.ffmpeg.format, settings.ffmpeg.codec, settings.ffmpeg.constant_rate_factor = "MKV", "H264", "LOSSLESS"
    scene.view_settings.view_transform = "Standard"
    settings.filepath = str(folder / "movie.mkv")
    settings.use_file_extension = False
    bpy.ops.render.render(animation=True, scene=scene.name)
    bpy.data.scenes.remove(scene)
    return folder / "movie.mkv"


@pytest.fixture
def filtered(scene: bpy.types.Scene) -> bpy.types.Scene:
    use_sky(scene, environment_image(noise()))
    add_hole(scene, sky=False)
    scene.umbra.sky_filter = "FAST"
    return scene


def test_each_filter_renders_what_numpy_does(filtered: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    pictures = {}
    for name, looks in (("FAST", 8), ("BEST", 16), ("OFF", 0), ("FAST", 8)):
        filtered.umbra.sky_filter = name
        pictures[name] = render(filtered, tmp_path / f"{name}.exr", exr)
        assert is_the_references(filtered, pictures[name], noise(), looks), name
        assert ("footprint" in ours(filtered)) == ("levels" in ours(filtered)) == (looks > 0)
    assert np.abs(pictures["FAST"] - pictures["OFF"]).mean() > 0.02
    assert len([tree for tree in bpy.data.node_groups if "umbra_version" in tree]) == 1


def test_another_sky_has_levels_of_its_own(filtered: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    folder = Path(filtered.umbra.map_folder)
    render(filtered, tmp_path / "one.exr", exr)
    maps = {path: path.stat().st_mtime_ns for path in folder.glob("*.exr")}
    filtered.umbra.environment_image = environment_image(noise(3), "Another")
    picture = render(filtered, tmp_path / "two.exr", exr)
    assert is_the_references(filtered, picture, noise(3), 8)
    assert {path: path.stat().st_mtime_ns for path in maps} == maps  # nothing was baked again
    assert len(list(folder.glob("umbra_sky_*.exr"))) == 2


def test_a_sequence_is_filtered_frame_by_frame(filtered: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    for number in (1, 2):
        exr.write_exr(tmp_path / f"sky_{number}.exr", noise(number))
    image = bpy.data.images.load(str(tmp_path / "sky_1.exr"))
    image.source = "SEQUENCE"
    filtered.umbra.environment_image = image
    for number in (1, 2):
        filtered.frame_set(number)
        picture = render(filtered, tmp_path / "picture.exr", exr)
        # the camera is still: the map of the first frame is that of the second
        assert is_the_references(filtered, picture, noise(number), 8), number


def test_a_movie_is_filtered_frame_by_frame(filtered: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    path = write_movie(tmp_path, [encoded(blocks(number)) for number in (1, 2, 3)])
    filtered.umbra.environment_image = bpy.data.images.load(str(path))
    for number in (1, 3, 2):
        filtered.frame_set(number)
        picture = render(filtered, tmp_path / "picture.exr", exr)
        # 8 bits, and colors that the movie keeps at half resolution
        assert is_the_references(filtered, picture, blocks(number), 8, tolerance=0.05), number
        assert not is_the_references(filtered, picture, blocks(number), 0, tolerance=0.05)


def test_two_scenes_have_filters_of_their_own(filtered: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    bpy.ops.scene.new(type="FULL_COPY")
    other = bpy.context.scene
    assert other != filtered
    other.umbra.map_folder = str(tmp_path / "other maps")
    other.umbra.sky_filter = "OFF"
    assert is_the_references(filtered, render(filtered, tmp_path / "one.exr", exr), noise(), 8)
    assert is_the_references(other, render(other, tmp_path / "two.exr", exr), noise(), 0)
    other.umbra.sky_filter = "BEST"
    assert is_the_references(other, render(other, tmp_path / "two.exr", exr), noise(), 16)
    assert is_the_references(filtered, render(filtered, tmp_path / "one.exr", exr), noise(), 8)


def test_levels_that_may_not_be_made_are_an_error(
    filtered: bpy.types.Scene, tmp_path: Path, exr: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    render(filtered, tmp_path / "picture.exr", exr)
    (levels,) = Path(filtered.umbra.map_folder).glob("umbra_sky_*.exr")
    levels.unlink()
    module = addon_module("bake.sky_levels")
    with pytest.raises(exr.BlackHoleError, match="are missing") as caught:
        module.ensure(filtered, filtered.umbra.environment_image, may_bake=False)
    assert caught.value.code == "sky.levels-missing"
    module.ensure(filtered, filtered.umbra.environment_image, may_bake=True)
    assert levels.is_file()


def test_a_sky_of_other_nodes_is_said_not_to_be_filtered(
    filtered: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    notice = addon_module("outputs.compositor.sky_filter").notice
    find_setup = addon_module("outputs.shared.compositor_tree").find_setup
    assert notice(filtered, find_setup(filtered)) is None
    tree, nodes = compositor(filtered), ours(filtered)
    between = tree.nodes.new("CompositorNodeExposure")
    tree.links.new(nodes["sky"].outputs["Image"], between.inputs["Image"])
    tree.links.new(between.outputs[0], nodes["group"].inputs["Environment"])
    assert "is not filtered" in notice(filtered, find_setup(filtered))
