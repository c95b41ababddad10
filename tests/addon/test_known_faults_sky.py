# SPDX-License-Identifier: GPL-3.0-or-later
"""Known faults of the sky, not yet mended: each test says what should be, and fails until it is."""

from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, environment_image, read, refused, render, run_python, use_sky

# An image of this name stands in for the star sky, which takes long to load.
STAR_SKY = "Umbra Star Sky"
PANORAMA = "Panorama"
MAGENTA = (1.0, 0.0, 1.0)

BEGIN = """
import os
from pathlib import Path
from small_scene import add_hole, shrink
folder = Path({folder!r})
scene = bpy.context.scene
shrink(scene)
scene.umbra.map_folder = str(folder / "maps")
scene.render.filepath = str(folder / "picture.exr")
scene.world.cycles.sampling_method = "NONE"  # a table of the sky's light would take longer than the render
tree = scene.world.node_tree
background = tree.nodes["Background"]
texture = tree.nodes.new("ShaderNodeTexEnvironment")
"""

END = """
tree.links.new(texture.outputs["Color"], background.inputs["Color"])
add_hole(scene, sky=False, mass_scale=0.1)
bpy.ops.render.render(write_still=True)
os._exit(0)
"""


def corner(picture: np.ndarray) -> np.ndarray:
    """The mean color of a corner of a picture, where the hole bends little."""
    return picture[:4, :4, :3].mean(axis=(0, 1))


def write_sequence(folder: Path, exr: ModuleType, frames: tuple[int, ...]) -> Path:
    """Write even skies, frame f as bright as f / 5; the path of the first."""
    paths = [folder / f"sky_{frame:04d}.exr" for frame in frames]
    for path, frame in zip(paths, frames, strict=True):
        exr.write_exr(path, np.full((16, 32, 3), 0.2 * frame, np.float32))
    return paths[0]


def panorama(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """A new Environment Texture that shows the image "Panorama", as yet not linked."""
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.new(PANORAMA, 32, 16, float_buffer=True)
    return texture


def shows_panorama(scene: bpy.types.Scene) -> bool:
    """Whether the sky around the hole is still the World's own, or its image."""
    image = scene.umbra.environment_image
    return scene.umbra.environment_source == "WORLD" or (image is not None and image.name == PANORAMA)


def test_sky_image_follows_an_image_sequence(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    image = bpy.data.images.load(str(write_sequence(tmp_path, exr, (1, 2, 3))))
    image.source = "SEQUENCE"
    use_sky(scene, image)
    add_hole(scene, sky=False, mass_scale=0.1)
    scene.frame_set(3)
    picture = render(scene, tmp_path / "picture.exr", exr)
    np.testing.assert_allclose(corner(picture), 0.6, rtol=0.1)


def test_a_missing_frame_of_the_sky_is_no_black_sky(tmp_path: Path, exr: ModuleType) -> None:
    """The process ends with status 1 and one sentence, or the sky is magenta as in plain Blender."""
    first = write_sequence(tmp_path, exr, (1, 3))
    change = f"""
texture.image = bpy.data.images.load({str(first)!r})
texture.image.source = "SEQUENCE"
user = texture.image_user
user.frame_duration, user.frame_start, user.use_auto_refresh = 3, 1, True
scene.frame_set(2)
"""
    result = run_python(BEGIN.format(folder=str(tmp_path)) + change + END)
    if not refused(result):
        np.testing.assert_allclose(corner(read(tmp_path / "picture.exr", exr)), MAGENTA, atol=0.05)


def test_a_sky_that_blender_saved_as_multilayer(tmp_path: Path, exr: ModuleType) -> None:
    change = """
settings = scene.render.image_settings
if bpy.app.version >= (5, 0):
    settings.media_type = "MULTI_LAYER_IMAGE"
settings.file_format = "OPEN_EXR_MULTILAYER"
background.inputs["Color"].default_value = (0.2, 0.4, 0.6, 1.0)
bpy.data.objects.remove(bpy.data.objects["Cube"])
scene.render.filepath = str(folder / "panorama.exr")
bpy.ops.render.render(write_still=True)
if bpy.app.version >= (5, 0):
    settings.media_type = "IMAGE"
shrink(scene)
scene.render.filepath = str(folder / "picture.exr")
texture.image = bpy.data.images.load(str(folder / "panorama.exr"))
print("the panorama is there", flush=True)
"""
    result = run_python(BEGIN.format(folder=str(tmp_path)) + change + END)
    if "the panorama is there" not in result.stdout:
        pytest.fail(result.stderr)
    assert result.returncode == 0, result.stderr
    np.testing.assert_allclose(corner(read(tmp_path / "picture.exr", exr)), [0.2, 0.4, 0.6], rtol=0.1)


def test_the_lens_shows_the_stars_of_a_new_scene(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    """The compositor shows them: a few bright points in the dark, so that values differ by more than their mean."""
    add_hole(scene, sky=False, mass_scale=0.25)
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    picture = render(scene, tmp_path / "lens.exr", exr)[..., :3]
    lit = picture[picture.max(axis=-1) > 0.01]
    if len(lit) == 0:
        pytest.fail("The picture is black.")
    assert (lit.std(axis=0) > 0.5 * lit.mean(axis=0)).all()


def test_a_world_in_a_node_group_stays_the_sky(scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]) -> None:
    """Background and Environment Texture in a group, as in the Worlds that asset libraries give out."""
    group = bpy.data.node_groups.new("Sunset", "ShaderNodeTree")
    group.interface.new_socket("Background", in_out="OUTPUT", socket_type="NodeSocketShader")
    texture = panorama(group)
    background = group.nodes.new("ShaderNodeBackground")
    end = group.nodes.new("NodeGroupOutput")
    group.links.new(texture.outputs["Color"], background.inputs["Color"])
    group.links.new(background.outputs["Background"], end.inputs[0])
    tree = scene.world.node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    tree.links.new(node.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    environment_image(name=STAR_SKY)
    add_hole(scene, sky=False)
    assert shows_panorama(scene)
    assert "cannot be taken over" not in "".join(capfd.readouterr())


@pytest.mark.parametrize("between", ["ShaderNodeHueSaturation", "ShaderNodeGamma", None])
def test_a_world_is_not_put_away_without_a_word(
    scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str], between: str | None
) -> None:
    """A node between image and Background, or the coordinates Normal: the panorama stays, or a warning tells."""
    tree = scene.world.node_tree
    texture = panorama(tree)
    color = texture.outputs["Color"]
    if between is None:
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(coordinates.outputs["Normal"], texture.inputs["Vector"])
    else:
        node = tree.nodes.new(between)
        tree.links.new(color, node.inputs["Color"])
        color = node.outputs["Color"]
    tree.links.new(color, tree.nodes["Background"].inputs["Color"])
    environment_image(name=STAR_SKY)
    add_hole(scene, sky=False)
    said = "".join(capfd.readouterr())
    assert shows_panorama(scene) or ("Warning" in said and "World" in said)
