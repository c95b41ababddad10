# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo scenes, opened with the installed extension: they stand alone, move, and show what physics says."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from physics import exr, read_warp_map, reference_render

BLEND_FILES = Path(__file__).resolve().parents[2] / "blend_files"
SIZE = (160, 90)
FRAME = 40
SCENES = ("station", "plinth")
WITH_DISK = ("disk",)  # its picture glows, and is compared with numpy in the tests of the add-on

# Differences from the reference, as shares of the pixel's value. The compositor computes in float32, so it finds its
# place in a panorama 4096 wide to about 1e-3 texel: beside a star that is a noticeable share of a pixel's value.
TOLERANCE_NEARLY_EVERYWHERE = 1e-4
TOLERANCE_EVERYWHERE = 2e-3
# Where people keep files on common systems, and where this checkout is.
HERE = re.escape(str(BLEND_FILES.parent).encode())
MACHINE_PATH = re.compile(rb"(?:" + HERE + rb"|/home/|/Users/|/usr/|/var/|/opt/|[A-Z]:\\Users)[ -~]*")


@dataclass(frozen=True)
class Rendered:
    """One frame of a scene as the compositor made it, with everything to make it again."""

    picture: np.ndarray
    foreground: np.ndarray
    reference: reference_render.ReferencePicture


@pytest.fixture(params=SCENES)
def scene(request: pytest.FixtureRequest, addon: ModuleType, tmp_path: Path) -> object:
    """A demo scene, opened, small, with its warp maps in a folder of the test's own."""
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(BLEND_FILES / f"{request.param}.blend"))
    opened = bpy.context.scene
    opened.umbra.map_folder = str(tmp_path / "maps")
    opened.render.resolution_x, opened.render.resolution_y = SIZE
    opened.cycles.samples = 4
    opened.cycles.use_denoising = False
    settings = opened.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    settings.exr_codec = "ZIP"
    return opened


@pytest.fixture
def rendered(scene: object, addon_module: Callable[[str], ModuleType], tmp_path: Path) -> Rendered:
    """The scene's frame, once with the black hole and once the objects alone."""
    scene.frame_set(FRAME)
    picture = _render(scene, tmp_path / "picture.exr")
    (map_path,) = (tmp_path / "maps").glob("*.exr")
    tree = addon_module("compositor_tree").find_setup(scene).tree
    group = addon_module("compositor_tree").find_setup(scene).group
    inputs = {each.name: each for each in group.inputs}
    layers = inputs["Render"].links[0].from_socket
    for link in list(group.outputs["Image"].links):
        tree.links.new(layers, link.to_socket)
    foreground = _render(scene, tmp_path / "foreground.exr")
    sky = addon_module("environment").read(scene)
    rotation = sky.rotation if sky.rotation_path else tuple(inputs["Environment Rotation"].default_value)
    reference = reference_render.render(
        read_warp_map(map_path),
        _packed_pixels(sky.image, tmp_path / "sky.exr"),
        rotation=rotation,
        colour_amount=inputs["Redshift Colour"].default_value,
        brightness_amount=inputs["Redshift Brightness"].default_value,
        temperature=inputs["Sky Temperature"].default_value,
        exposure=inputs["Exposure"].default_value,
        strength=sky.strength,
        foreground=foreground,
    )
    return Rendered(picture, foreground, reference)


def _render(scene: object, path: Path) -> np.ndarray:
    import bpy

    scene.render.filepath = str(path)
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    return exr.read_exr(path)[0]


def _packed_pixels(image: object, path: Path) -> np.ndarray:
    path.write_bytes(image.packed_file.data)
    return exr.read_exr(path)[0][..., :3].astype(np.float64)


def test_frame_is_what_the_reference_makes_of_its_warp_map(rendered: Rendered) -> None:
    """Per pixel, behind the objects and beside them; relative, because the sun and the stars are bright."""
    expected = rendered.reference.image[..., :3]
    wrong = np.abs(rendered.picture[..., :3] - expected)
    clear = rendered.foreground[..., 3] == 0.0
    assert clear.mean() > 0.4
    assert np.median(wrong[clear]) < 1e-5
    scale = np.maximum(np.abs(expected).max(axis=-1, keepdims=True), np.median(expected[clear]))
    relative = wrong / scale
    for part in (relative[clear], relative):
        assert np.percentile(part, 99.0) < TOLERANCE_NEARLY_EVERYWHERE
        assert part.max() < TOLERANCE_EVERYWHERE


def test_hole_and_objects_are_both_in_the_picture(rendered: Rendered) -> None:
    shadow = rendered.reference.shadow
    cover = rendered.foreground[..., 3]
    assert 0.03 < np.mean(shadow > 0.99) < 0.4
    assert 0.05 < np.mean(cover > 0.99) < 0.5
    seen_shadow = (shadow == 1.0) & (cover == 0.0)
    assert seen_shadow.sum() > 0.5 * np.sum(shadow == 1.0)
    assert np.all(rendered.picture[seen_shadow][..., :3] == 0.0)
    assert np.any((shadow > 0.99) & (cover > 0.0)), "something should be in front of the shadow"
    assert rendered.foreground[cover > 0.99][..., :3].mean() > 0.01
    # nowhere the magenta of a missing map
    red, green, blue = np.moveaxis(rendered.picture[..., :3], -1, 0)
    assert not np.any((red == 1.0) & (green == 0.0) & (blue == 1.0))


@pytest.mark.parametrize("scene", [*SCENES, *WITH_DISK], indirect=True)
def test_camera_moves_for_two_seconds_and_more(scene: object, addon_module: Callable[[str], ModuleType]) -> None:
    read_at = addon_module("shot").read_at
    frames = range(scene.frame_start, scene.frame_end + 1, 6)
    assert scene.frame_end - scene.frame_start + 1 >= 48
    places = np.array([read_at(scene, frame).parameters.camera_position for frame in frames])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert np.all(steps > 1e-3)
    assert np.all(steps < 0.05 * np.linalg.norm(places[0])), "a slow move"


@pytest.mark.parametrize("scene", [*SCENES, *WITH_DISK], indirect=True)
def test_file_stands_alone(scene: object, tmp_path: Path) -> None:
    """Everything is packed, and no path of the computer that built it is left, not even in the file browser."""
    import bpy

    for image in bpy.data.images:
        assert image.packed_file is not None or image.source in {"GENERATED", "VIEWER", "SEQUENCE"}, image.name
    scene.umbra.map_folder = "//umbra_maps/"
    scene.render.filepath = "//"
    copy = tmp_path / "copy.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, compress=False, relative_remap=False)
    found = {each for each in MACHINE_PATH.findall(copy.read_bytes()) if str(tmp_path).encode() not in each}
    assert not found
    assert (BLEND_FILES / bpy.path.basename(bpy.data.filepath)).stat().st_size < 8_000_000


@pytest.mark.parametrize("scene", WITH_DISK, indirect=True)
def test_orbit_with_a_disk_shares_its_rays(
    scene: object, addon_module: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    """Only the first frame is traced; the disk is in the picture, and bright."""
    import bpy

    scene.frame_end = 2
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    first, second = sorted(path for path in (tmp_path / "maps").glob("*.exr") if "_disk" not in path.name)
    assert read_warp_map(first).metadata["counts"]["rays"] > 0
    assert read_warp_map(second).metadata["counts"]["rays"] == 0
    assert len(list((tmp_path / "maps").glob("*_disk*.exr"))) == 6
    picture = _render(scene, tmp_path / "picture.exr")
    assert np.mean(picture[..., :3].max(axis=-1) > 0.5) > 0.1
