# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo scenes, opened with the installed extension: they stand alone, move, and show what physics says."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import physics
from physics import read_light_layer, read_warp_map
from physics.images import exr
from physics.reference import reference_render

BLEND_FILES = Path(__file__).resolve().parents[2] / "blend_files"
SIZE = (160, 90)
FRAME = 40
COMPOSED, LENSED = ("station", "plinth"), ("planets", "flyby")
WITH_DISK = ("disk",)  # its picture glows, and is compared with numpy in the tests of the add-on

# Differences from the reference, as shares of the pixel's value. The compositor computes in float32, so it finds its
# place in a panorama 4096 wide to about 1e-3 texel: beside a star that is a noticeable share of a pixel's value.
TOLERANCE_NEARLY_EVERYWHERE = 1e-4
TOLERANCE_EVERYWHERE = 2e-3
# Where people keep files on common systems, and where this checkout is.
HERE = re.escape(str(BLEND_FILES.parent).encode())
# Files beside warp maps.
OTHERS = re.compile(r"_(light|stars|footprint)_")
MACHINE_PATH = re.compile(rb"(?:" + HERE + rb"|/home/|/Users/|/usr/|/var/|/opt/|[A-Z]:\\Users)[ -~]*")


@dataclass(frozen=True)
class Rendered:
    """One frame of a scene as the compositor made it, with everything to make it again."""

    picture: np.ndarray
    foreground: np.ndarray
    reference: reference_render.ReferencePicture


def open_scene(name: str, maps: Path) -> object:
    """A demo scene, opened, small, with its maps in a folder of the test's own."""
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(BLEND_FILES / f"{name}.blend"))
    opened = bpy.context.scene
    opened.umbra.map_folder = str(maps)
    opened.umbra.sky_filter = "OFF"  # what it makes of a sky has tests of its own
    opened.render.resolution_x, opened.render.resolution_y = SIZE
    opened.cycles.samples = 4
    opened.cycles.use_denoising = False
    settings = opened.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    settings.exr_codec = "ZIP"
    return opened


@pytest.fixture(params=(*COMPOSED, *LENSED))
def scene(request: pytest.FixtureRequest, addon: ModuleType, tmp_path: Path) -> object:
    """Any of the scenes."""
    return open_scene(request.param, tmp_path / "maps")


@pytest.fixture(params=COMPOSED)
def composed(request: pytest.FixtureRequest, addon: ModuleType, tmp_path: Path) -> object:
    """A scene whose sky the compositor bends."""
    return open_scene(request.param, tmp_path / "maps")


@pytest.fixture(params=LENSED)
def lensed(request: pytest.FixtureRequest, addon: ModuleType, tmp_path: Path) -> object:
    """A scene whose camera bends its rays."""
    return open_scene(request.param, tmp_path / "maps")


@pytest.fixture
def rendered(composed: object, addon_module: Callable[[str], ModuleType], tmp_path: Path) -> Rendered:
    """The scene's frame, once with the black hole and once the objects alone."""
    scene = composed
    scene.frame_set(FRAME)
    picture = _render(scene, tmp_path / "picture.exr")
    (map_path,) = (tmp_path / "maps").glob("*.exr")
    tree = addon_module("outputs.shared.compositor_tree").find_setup(scene).tree
    group = addon_module("outputs.shared.compositor_tree").find_setup(scene).group
    inputs = {each.name: each for each in group.inputs}
    layers = inputs["Render"].links[0].from_socket
    for link in list(group.outputs["Image"].links):
        tree.links.new(layers, link.to_socket)
    foreground = _render(scene, tmp_path / "foreground.exr")
    sky = addon_module("scene.sky.environment").read(scene)
    rotation = sky.rotation if sky.rotation_at else tuple(inputs["Environment Rotation"].default_value)
    reference = reference_render.render(
        read_warp_map(map_path),
        _packed_pixels(sky.image, tmp_path / "sky.exr"),
        rotation=rotation,
        color_amount=inputs["Redshift Color"].default_value,
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


def test_camera_moves_for_two_seconds_and_more(scene: object, addon_module: Callable[[str], ModuleType]) -> None:
    read_at = addon_module("outputs.frames").read_at
    frames = range(scene.frame_start, scene.frame_end + 1, 6)
    assert scene.frame_end - scene.frame_start + 1 >= 48
    places = np.array([read_at(scene, frame).parameters.camera_position for frame in frames])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert np.all(steps > 1e-3)
    fastest = 0.15 if scene.name == "Flyby" else 0.05
    assert np.all(steps < fastest * np.linalg.norm(places[0])), "no faster than the eye can follow"


@pytest.mark.parametrize("scene", [*COMPOSED, *LENSED, *WITH_DISK], indirect=True)
def test_file_stands_alone(scene: object, tmp_path: Path) -> None:
    """All is packed but the built-in sky, which is made where it is missing; no path of the computer that built it is
    left, not even in the file browser."""
    import bpy

    for image in bpy.data.images:
        is_sky = image.name in ("Umbra Star Sky", "Umbra Milky Way")
        own = image.packed_file is not None or image.source in {"GENERATED", "VIEWER", "SEQUENCE"}
        assert own or is_sky, image.name
    scene.umbra.map_folder = "//umbra_maps/"
    scene.render.filepath = "//"
    copy = tmp_path / "copy.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, compress=False, relative_remap=False)
    found = {each for each in MACHINE_PATH.findall(copy.read_bytes()) if str(tmp_path).encode() not in each}
    assert not found
    # Appended, a camera comes as it lies in the file: opening the file lets the add-on compile its shader anew.
    original = tmp_path / "original.blend"  # an open file cannot be appended from
    shutil.copyfile(bpy.data.filepath, original)
    with bpy.data.libraries.load(str(original)) as (source, target):
        target.cameras = list(source.cameras)
    for camera in target.cameras:
        comments = [line for line in camera.custom_bytecode.splitlines() if line.startswith("#")]
        assert not comments, "where the shader was compiled"
    assert (BLEND_FILES / bpy.path.basename(bpy.data.filepath)).stat().st_size < 8_000_000


@pytest.mark.parametrize("scene", WITH_DISK, indirect=True)
def test_orbit_with_a_disk_shares_its_rays(
    scene: object, addon_module: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    """Only the first frame is traced; the picture has the layer's light, which outshines the sky."""
    import bpy

    scene.frame_end = 2
    assert bpy.ops.umbra.bake_animation() == {"FINISHED"}
    first, second = sorted(path for path in (tmp_path / "maps").glob("*_000?.exr") if not OTHERS.search(path.name))
    assert read_warp_map(first).metadata["counts"]["rays"] > 0
    assert read_warp_map(second).metadata["counts"]["rays"] == 0
    layers = sorted((tmp_path / "maps").glob("*_light*.exr"))
    assert len(layers) == 2
    scene.frame_set(1)
    picture = _render(scene, tmp_path / "picture.exr")[..., :3]
    disk = scene.umbra.active_hole.umbra.disk
    light = read_light_layer(layers[0]).light * np.array(disk.tint) * (2.0**disk.exposure * disk.opacity)
    assert np.all(picture >= light * (1.0 - TOLERANCE_EVERYWHERE))
    assert light.sum() > 0.5 * picture.sum()
    assert np.mean(picture.max(axis=-1) > 0.25) > 0.1


def seen_objects(scene: object, addon_module: Callable[[str], ModuleType]) -> tuple[np.ndarray, np.ndarray]:
    """Per pixel the pass index of the object that the ray of its center meets, 0 for none; and where there is sky."""
    import bpy

    frame = addon_module("outputs.frames").read_at(scene, FRAME)
    exits = addon_module("core.physics_api").physics.bake_exit_map(replace(frame.parameters, interpolation=0.0))
    scene.frame_set(FRAME)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    camera = np.array(frame.parameters.camera_position)
    axes = np.array(frame.parameters.hole_to_world)
    hole = np.array(scene.umbra.active_hole.matrix_world.translation)
    index = np.zeros(exits.usable.shape, dtype=int)
    sky = np.linalg.norm(exits.direction, axis=-1) > 0.5
    for row, column in np.argwhere(sky):
        along = exits.direction[row, column].astype(np.float64)
        impact = exits.impact[row, column].astype(np.float64)
        reach = math.sqrt(max(scene.umbra.sphere_radius**2 - impact @ impact, 0.0))
        start = impact + max(reach, camera @ along) * along
        start, along = hole + frame.length_of_m * (axes @ start), axes @ along
        found, *_, thing, _ = scene.ray_cast(depsgraph, start.tolist(), along.tolist())
        index[row, column] = thing.pass_index if found else 0
    return index, sky


def light_up_by_index(scene: object) -> None:
    """Give each mesh a number, let it shine as brightly as its number says, and switch everything else off."""
    import bpy

    for number, each in enumerate((each for each in scene.objects if each.type == "MESH"), start=1):
        each.pass_index = number
    shine = bpy.data.materials.new("Number")
    shine.use_nodes = True
    nodes, links = shine.node_tree.nodes, shine.node_tree.links
    nodes.clear()
    number, light, output = (
        nodes.new(kind) for kind in ("ShaderNodeObjectInfo", "ShaderNodeEmission", "ShaderNodeOutputMaterial")
    )
    links.new(number.outputs["Object Index"], light.inputs["Strength"])
    links.new(light.outputs["Emission"], output.inputs["Surface"])
    scene.view_layers[0].material_override = shine
    scene.world = None
    scene.umbra.redshift_color = scene.umbra.redshift_brightness = 0.0


def surrounded(same: np.ndarray) -> np.ndarray:
    """Where a pixel and its eight neighbors are true; Cycles' filter is 1.5 pixels wide."""
    inner = np.pad(same, 1, constant_values=False)
    rows, columns = same.shape
    shifted = [inner[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    return np.logical_and.reduce(shifted)


@pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")
def test_lens_shows_each_object_where_rays_meet_it(
    lensed: object, addon_module: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    """Against rays cast at the meshes along the traced lines, one a pixel; outlines, which fall between, left out."""
    lensed.frame_set(FRAME)
    light_up_by_index(lensed)
    picture = _render(lensed, tmp_path / "numbers.exr")[..., 0]
    index, sky = seen_objects(lensed, addon_module)
    assert 0.03 < np.mean(~sky) < 0.3
    compared = 0
    for number in np.unique(index):
        inside = surrounded((index == number) & sky)
        compared += int(inside.sum())
        right = np.abs(picture[inside] - number) < 1e-3 * max(number, 1)
        # what is thinner than a pixel lies between the rays, too
        assert inside.sum() < 20 or np.mean(right) > 0.97, f"object {number}"
    assert compared > 0.3 * index.size
    assert np.all(picture[surrounded(~sky)] == 0.0)
    around = {each.pass_index for each in lensed.objects if each.name.startswith(("Giant", "Wheel"))}
    row, column = np.nonzero(np.isin(index, list(around)))
    middle_row, middle_column = (np.mean(each) for each in np.nonzero(~sky))
    angles = np.arctan2(row - middle_row, column - middle_column)
    directions = np.histogram(angles, bins=16, range=(-math.pi, math.pi))[0]
    assert np.all(directions > 0), "no ring around the hole"


def test_lensed_frame_has_a_black_shadow_and_light_around(
    lensed: object, addon_module: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    lensed.frame_set(FRAME)
    picture = _render(lensed, tmp_path / "picture.exr")[..., :3]
    visibility = physics.bake(physics_parameters(lensed, addon_module)).visibility
    assert np.all(picture[surrounded(visibility == 0.0)] == 0.0)
    clear = surrounded(visibility == 1.0)
    assert np.mean(picture[clear].max(axis=-1) > 0.0) > 0.99
    assert 0.005 < picture[clear].mean() < 2.0
    assert np.isfinite(picture).all()


def physics_parameters(scene: object, addon_module: Callable[[str], ModuleType]) -> physics.WarpMapParameters:
    """The frame's parameters, for this checkout's own physics."""
    return physics.WarpMapParameters.from_metadata(
        addon_module("outputs.frames").read_at(scene, FRAME).parameters.to_metadata()
    )


def test_nothing_stands_where_the_lens_does_not_show_it(
    lensed: object, addon_module: Callable[[str], ModuleType]
) -> None:
    import bpy

    for number in range(lensed.frame_start, lensed.frame_end + 1, 12):
        frame = addon_module("outputs.frames").read_at(lensed, number)
        lensed.frame_set(number)
        found = addon_module("outputs.lens.lens_objects").place(lensed, bpy.context.evaluated_depsgraph_get(), frame)
        assert found.inside == found.nearer == ()
