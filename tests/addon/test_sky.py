# SPDX-License-Identifier: GPL-3.0-or-later
"""The sky is what Blender's own World shows: whatever that is made of, and at every frame."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import (
    add_hole,
    compositor,
    environment_image,
    environment_pixels,
    links_of,
    read,
    refused,
    render,
    run_python,
    use_sky,
)

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


def unlinked_panorama(tree: bpy.types.NodeTree) -> bpy.types.Node:
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
    texture = unlinked_panorama(group)
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
    texture = unlinked_panorama(tree)
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


# --- Worlds that are no plain image ---------------------------------------------------------------

# A panorama of this width, in place of 4096, is quick to render.
WIDTH = 1024
# Between its pixels a panorama is interpolated: what a sky as smooth as these ones loses by that, and by half floats.
TOLERANCE = 4e-3
TINY = 1e-7  # of a hole that bends nothing


def textured(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """An Environment Texture of a smooth picture in a tree."""
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = environment_image(environment_pixels(64))
    return texture


def through(tree: bpy.types.NodeTree, kind: str, **values: object) -> None:
    """A picture, a color node, and the World's Background."""
    node = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in values.items():
        node.inputs[name].default_value = value
    tree.links.new(textured(tree).outputs["Color"], node.inputs["Color"])
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def by_coordinates(tree: bpy.types.NodeTree, name: str) -> None:
    """A picture that is looked up by another output of Texture Coordinate."""
    coordinates, texture = tree.nodes.new("ShaderNodeTexCoord"), textured(tree)
    tree.links.new(coordinates.outputs[name], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def procedural(tree: bpy.types.NodeTree, kind: str, output: str = "Color") -> None:
    """A texture that is no image."""
    node = tree.nodes.new(f"ShaderNodeTex{kind}")
    if kind == "Gradient":
        node.gradient_type = "RADIAL"
    tree.links.new(node.outputs[output], tree.nodes["Background"].inputs["Color"])


def sunless(tree: bpy.types.NodeTree) -> None:
    """A Sky Texture without the disk of the sun, whose edge is too sharp to compare."""
    node = tree.nodes.new("ShaderNodeTexSky")
    node.sun_disc = False
    tree.nodes["Background"].inputs["Strength"].default_value = 0.3
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def grouped(tree: bpy.types.NodeTree) -> None:
    """A group that is given its rotation and its strength from outside, in a group."""
    inner = bpy.data.node_groups.new("Sunset", "ShaderNodeTree")
    inner.interface.new_socket("Strength", in_out="INPUT", socket_type="NodeSocketFloat")
    inner.interface.new_socket("Turn", in_out="INPUT", socket_type="NodeSocketVector")
    inner.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    kinds = ("NodeGroupInput", "ShaderNodeTexCoord", "ShaderNodeMapping", "ShaderNodeBackground", "NodeGroupOutput")
    entry, coordinates, mapping, background, end = (inner.nodes.new(kind) for kind in kinds)
    texture = textured(inner)
    for one, other in (
        (coordinates.outputs["Generated"], mapping.inputs["Vector"]),
        (entry.outputs["Turn"], mapping.inputs["Rotation"]),
        (mapping.outputs["Vector"], texture.inputs["Vector"]),
        (texture.outputs["Color"], background.inputs["Color"]),
        (entry.outputs["Strength"], background.inputs["Strength"]),
        (background.outputs["Background"], end.inputs["Shader"]),
    ):
        inner.links.new(one, other)
    outer = bpy.data.node_groups.new("Library", "ShaderNodeTree")
    outer.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    within, last = outer.nodes.new("ShaderNodeGroup"), outer.nodes.new("NodeGroupOutput")
    within.node_tree = inner
    within.inputs["Strength"].default_value = 1.5
    within.inputs["Turn"].default_value = (0.3, -0.2, 1.1)
    outer.links.new(within.outputs["Shader"], last.inputs["Shader"])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = outer
    tree.links.new(node.outputs["Shader"], tree.nodes["World Output"].inputs["Surface"])


def for_the_camera(tree: bpy.types.NodeTree) -> None:
    """A sky that only the camera sees, and another one that gives the light."""
    path, mix, seen = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("LightPath", "MixShader", "Background"))
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs["Fac" if "Fac" in mix.inputs else "Factor"])
    tree.links.new(tree.nodes["Background"].outputs["Background"], mix.inputs[1])
    tree.links.new(textured(tree).outputs["Color"], seen.inputs["Color"])
    tree.links.new(seen.outputs["Background"], mix.inputs[2])
    tree.links.new(mix.outputs["Shader"], tree.nodes["World Output"].inputs["Surface"])


def emission(tree: bpy.types.NodeTree) -> None:
    """A picture that shines by Emission, without a Background."""
    tree.nodes.remove(tree.nodes["Background"])
    node = tree.nodes.new("ShaderNodeEmission")
    node.inputs["Strength"].default_value = 1.4
    tree.links.new(textured(tree).outputs["Color"], node.inputs["Color"])
    tree.links.new(node.outputs["Emission"], tree.nodes["World Output"].inputs["Surface"])


WORLDS: dict[str, Callable[[bpy.types.NodeTree], None]] = {
    "hue and saturation": lambda tree: through(tree, "HueSaturation", Saturation=1.6, Value=0.7),
    "gamma": lambda tree: through(tree, "Gamma", Gamma=1.8),
    "normal": lambda tree: by_coordinates(tree, "Normal"),
    "object": lambda tree: by_coordinates(tree, "Object"),
    "gradient": lambda tree: procedural(tree, "Gradient"),
    "noise": lambda tree: procedural(tree, "Noise"),
    "sky texture": sunless,
    "group": grouped,
    "for the camera": for_the_camera,
    "emission": emission,
}


def bare(scene: bpy.types.Scene, name: str) -> None:
    """The scene with nothing but a World of a kind."""
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    scene.world.cycles.sampling_method = "NONE"
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 1.0
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01  # through the pixels' centers, as the maps
    WORLDS[name](scene.world.node_tree)


@pytest.fixture
def panorama(addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    module = addon_module("scene.sky.panorama")
    monkeypatch.setattr(module, "PROCEDURAL_WIDTH", WIDTH)
    return module


@pytest.mark.parametrize("name", WORLDS)
@pytest.mark.parametrize("output", ["COMPOSITOR", "WORLD"])
def test_a_world_stays_as_blender_shows_it(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, panorama: ModuleType, name: str, output: str
) -> None:
    bare(scene, name)
    world, links = scene.world, links_of(scene.world.node_tree)
    groups = len(bpy.data.node_groups)
    own = render(scene, tmp_path / "own.exr", exr)[..., :3]
    add_hole(scene, sky=False, mass_scale=TINY)
    assert scene.umbra.environment_source == "WORLD"
    if output != "COMPOSITOR":
        assert bpy.ops.umbra.set_output(output=output) == {"FINISHED"}
    ours = render(scene, tmp_path / "ours.exr", exr)[..., :3]
    assert own.std() > 0.005
    np.testing.assert_allclose(ours, own, atol=TOLERANCE)
    if output != "COMPOSITOR":
        bpy.ops.umbra.set_output(output="COMPOSITOR")
        bpy.ops.umbra.remove_compositor()
        assert scene.world == world
        assert links_of(world.node_tree) == links
        assert len(bpy.data.node_groups) == groups


def test_output_world_bends_what_is_in_a_group(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, panorama: ModuleType
) -> None:
    """Compositor and World show the same bent sky."""
    bare(scene, "group")
    add_hole(scene, sky=False, mass_scale=0.3)
    scene.umbra.redshift_color = scene.umbra.redshift_brightness = 0.0
    group = next(node for node in compositor(scene).nodes if node.get("umbra_role") == "group")
    for name in ("Redshift Color", "Redshift Brightness"):
        group.inputs[name].default_value = 0.0
    pictures = []
    for output in ("COMPOSITOR", "WORLD"):
        bpy.ops.umbra.set_output(output=output)
        pictures.append(render(scene, tmp_path / f"{output}.exr", exr)[..., :3])
    assert (pictures[0].max(axis=-1) == 0.0).sum() > 20  # the shadow
    differing = np.abs(pictures[1] - pictures[0]).max(axis=-1) > 0.02
    assert differing.mean() < 0.05  # pixels at the shadow's edge, and what is crowded beside it


def test_a_panorama_is_kept_until_the_world_changes(
    scene: bpy.types.Scene, tmp_path: Path, panorama: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    error = addon_module("core.errors").SceneError
    environment = addon_module("scene.sky.environment")
    bare(scene, "gamma")
    add_hole(scene, sky=False)
    image = environment.read(scene).image
    assert image.packed_file is not None
    assert tuple(image.size) == (128, 64)  # as the texture
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    assert environment.read(scene).image == image
    assert [each.name for each in bpy.data.scenes] == [scene.name]
    scene.world.node_tree.nodes["Gamma"].inputs["Gamma"].default_value = 2.5
    with pytest.raises(error, match="no panorama"):
        environment.read(scene)
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    changed = environment.read(scene).image
    assert changed != image
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "file.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "file.blend"))
    assert environment.read(bpy.context.scene).image.name.startswith("World Panorama")


@pytest.mark.parametrize("by", ["keyframes", "driver"])
def test_a_panorama_is_turned_and_brightened_by_what_the_world_animates(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, panorama: ModuleType, by: str
) -> None:
    """A color node between, and keyframes or a driver of rotation and strength: one panorama serves all frames."""
    bare(scene, "gamma")
    tree = scene.world.node_tree
    mapping, coordinates = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    texture = next(node for node in tree.nodes if node.type == "TEX_ENVIRONMENT")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    turn, strength = mapping.inputs["Rotation"], tree.nodes["Background"].inputs["Strength"]
    for frame, angle in ((1, 0.4), (3, 1.8)):
        turn.default_value = (0.2, -0.3, angle)
        turn.keyframe_insert("default_value", frame=frame)
    if by == "keyframes":
        for frame, value in ((1, 0.5), (3, 1.5)):
            strength.default_value = value
            strength.keyframe_insert("default_value", frame=frame)
    else:
        strength.driver_add("default_value").driver.expression = "0.2 * frame"
    scene.frame_set(1)
    add_hole(scene, sky=False, mass_scale=TINY)
    assert scene.umbra.environment_source == "WORLD"
    images = set(bpy.data.images)
    seen = []
    for frame in (1, 3):
        scene.frame_set(frame)
        ours = render(scene, tmp_path / "ours.exr", exr)[..., :3]
        bpy.ops.umbra.remove_compositor()
        seen.append(render(scene, tmp_path / "own.exr", exr)[..., :3])
        np.testing.assert_allclose(ours, seen[-1], atol=2 * TOLERANCE)
        bpy.ops.umbra.setup_compositor()
    assert np.abs(seen[1] - seen[0]).max() > 0.05
    assert {each for each in bpy.data.images if each.name.startswith("World Panorama")} <= images


def test_what_only_turns_a_part_of_the_world_is_not_followed(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    bare(scene, "hue and saturation")
    tree, nodes = scene.world.node_tree, scene.world.node_tree.nodes
    followed = addon_module("scene.sky.followed")
    assert followed.of(scene.world, nodes["World Output"]).rotation is None  # nothing turns it
    mapping, coordinates = nodes.new("ShaderNodeMapping"), nodes.new("ShaderNodeTexCoord")
    texture = next(node for node in nodes if node.type == "TEX_ENVIRONMENT")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    found = followed.of(scene.world, nodes["World Output"])
    assert (found.rotation.socket, found.strength.socket) == (
        mapping.inputs["Rotation"],
        nodes["Background"].inputs["Strength"],
    )
    gradient, hue = nodes.new("ShaderNodeTexGradient"), next(node for node in nodes if node.type == "HUE_SAT")
    tree.links.new(gradient.outputs["Color"], hue.inputs["Value"])
    assert followed.of(scene.world, nodes["World Output"]).rotation is None
    tree.links.new(coordinates.outputs["Generated"], gradient.inputs["Vector"])
    assert followed.of(scene.world, nodes["World Output"]).rotation is None
    tree.links.new(mapping.outputs["Vector"], gradient.inputs["Vector"])
    assert followed.of(scene.world, nodes["World Output"]).rotation is not None
    mapping.inputs["Scale"].default_value = (1.0, 2.0, 1.0)
    assert followed.of(scene.world, nodes["World Output"]).rotation is None


@pytest.mark.parametrize("kind", ["animated", "camera", "tiles"])
def test_a_world_that_no_image_can_show_is_left_out_with_the_reason(
    scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str], addon_module: Callable[[str], ModuleType], kind: str
) -> None:
    """Output: World bends it all the same, unless it has tiles."""
    bare(scene, "gamma")
    tree, world = scene.world.node_tree, scene.world
    if kind == "animated":
        tree.nodes["Gamma"].inputs["Gamma"].keyframe_insert("default_value")
    elif kind == "camera":
        tree.nodes.remove(tree.nodes["Gamma"])
        by_coordinates(tree, "Camera")
    else:
        next(node for node in tree.nodes if node.type == "TEX_ENVIRONMENT").image.source = "TILED"
    environment_image(name=STAR_SKY)
    add_hole(scene, sky=False)
    said = "".join(capfd.readouterr())
    reason = {"animated": "is animated", "camera": "from each camera", "tiles": "UDIM tiles"}[kind]
    assert reason in said
    assert scene.umbra.environment_image.name == STAR_SKY
    assert reason in addon_module("scene.sky.environment").world_left_out(scene)
    if kind == "animated":
        bpy.ops.umbra.set_output(output="WORLD")
        assert scene.umbra.environment_source == "WORLD"
        assert scene.world.name == f"{world.name} (lensed)"
        assert "Gamma" in scene.world.node_tree.nodes
        bpy.ops.umbra.set_output(output="COMPOSITOR")
        assert scene.umbra.environment_source == "IMAGE"


# --- images ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("source", ["WORLD", "IMAGE"])
def test_alpha_is_as_in_blenders_world(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, panorama: ModuleType, source: str
) -> None:
    """Cycles multiplies alpha into the colors of 8-bit images before it decodes them."""
    made = bpy.data.images.new("Half", 16, 8, alpha=True)
    made.pixels.foreach_set(np.tile(np.array((0.8, 0.6, 0.4, 0.5), np.float32), 128))
    made.file_format, made.filepath_raw = "PNG", str(tmp_path / "half.png")
    made.save()
    tree = scene.world.node_tree
    texture = panorama_of(tree, bpy.data.images.load(str(tmp_path / "half.png")))
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    own = corner(render(scene, tmp_path / "own.exr", exr))
    if source == "IMAGE":
        use_sky(scene, texture.image)
        bpy.ops.umbra.setup_compositor()
    add_hole(scene, sky=False, mass_scale=TINY)
    np.testing.assert_allclose(corner(render(scene, tmp_path / "ours.exr", exr)), own, rtol=2e-3)
    assert own[0] == pytest.approx(0.133, abs=2e-3)


@pytest.mark.parametrize("alpha", [1.0, 0.5])
def test_alpha_in_a_sequence_is_said(
    scene: bpy.types.Scene,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    addon_module: Callable[[str], ModuleType],
    alpha: float,
) -> None:
    """By Add, and by the panel from then on; the file is not left among the images."""
    for frame in (1, 2):
        made = bpy.data.images.new("Half", 16, 8, alpha=True)
        made.pixels.foreach_set(np.tile(np.array((0.8, 0.6, 0.4, alpha), np.float32), 128))
        made.file_format, made.filepath_raw = "PNG", str(tmp_path / f"half_{frame:04d}.png")
        made.save()
        bpy.data.images.remove(made)
    image = bpy.data.images.load(str(tmp_path / "half_0001.png"))
    image.source = "SEQUENCE"
    use_sky(scene, image)
    add_hole(scene, sky=False)
    assert ("has alpha, which darkens a sequence less" in "".join(capfd.readouterr())) == (alpha < 1.0)
    lines = addon_module("ui.status").lines(bpy.context)
    assert ("has alpha" in " ".join(line.text for line in lines)) == (alpha < 1.0)
    assert sum(each.name.startswith("half") for each in bpy.data.images) == 1
    assert scene.umbra.environment_image == image


def panorama_of(tree: bpy.types.NodeTree, image: bpy.types.Image) -> bpy.types.Node:
    """An image as the World, as bright as it is."""
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.nodes["Background"].inputs["Strength"].default_value = 1.0
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    return texture


@pytest.mark.parametrize("output", ["WORLD", "CYCLES_LENS"])
@pytest.mark.parametrize("source", ["WORLD", "IMAGE"])
def test_a_missing_frame_is_refused_in_every_output(
    scene: bpy.types.Scene,
    tmp_path: Path,
    exr: ModuleType,
    addon_module: Callable[[str], ModuleType],
    output: str,
    source: str,
) -> None:
    image = bpy.data.images.load(str(write_sequence(tmp_path, exr, (1, 3))))
    image.source = "SEQUENCE"
    if source == "WORLD":
        texture = panorama_of(scene.world.node_tree, image)
        texture.image_user.frame_duration = 3
    else:
        use_sky(scene, image)
    add_hole(scene, sky=False)
    bpy.ops.umbra.set_output(output=output)
    check = addon_module("outputs.shared.world_files").check
    for frame in (1, 3):
        scene.frame_set(frame)
        check(scene)
    scene.frame_set(2)
    with pytest.raises(addon_module("core.errors").SceneError, match=r"sky_0002\.exr is missing") as caught:
        check(scene)
    assert caught.value.code == "sky.frame-missing"


@pytest.mark.parametrize("cyclic", [False, True])
def test_the_file_of_a_frame_is_the_one_that_blender_reads(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, addon_module: Callable[[str], ModuleType], cyclic: bool
) -> None:
    image = bpy.data.images.load(str(write_sequence(tmp_path, exr, (0, 4, 5, 6, 7))))
    image.source = "SEQUENCE"
    user = panorama_of(scene.world.node_tree, image).image_user
    user.frame_duration, user.frame_start, user.frame_offset, user.use_cyclic = 3, 2, 4, cyclic
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    sky_frames = addon_module("scene.sky.sky_frames")
    for frame in (0, 1, 2, 3, 4, 5, 6, 8):
        scene.frame_set(frame)
        shown = float(corner(render(scene, tmp_path / "own.exr", exr))[0]) / 0.2
        assert sky_frames.number_at(frame, user) == pytest.approx(shown, abs=0.01), frame


def test_the_lens_keeps_the_sky_that_was_chosen(scene: bpy.types.Scene) -> None:
    """Its place and brightness go along and come back, and so does the World."""
    world = scene.world
    use_sky(scene)
    add_hole(scene, sky=False)
    bpy.ops.umbra.set_output(output="COMPOSITOR")
    group = next(node for node in tree_of(scene).nodes if node.type == "GROUP")
    group.inputs["Exposure"].default_value = 1.5
    group.inputs["Environment Rotation"].default_value = (0.1, 0.2, 0.3)
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    assert scene.world != world
    texture = next(node for node in scene.world.node_tree.nodes if node.type == "TEX_ENVIRONMENT")
    assert texture.image == scene.umbra.environment_image
    other = environment_image(name="Other")
    scene.umbra.environment_image = other
    assert texture.image == other
    scene.umbra.environment_source = "WORLD"
    assert scene.world == world
    scene.umbra.environment_source = "IMAGE"
    assert scene.world != world
    bpy.ops.umbra.set_output(output="WORLD")
    bpy.ops.umbra.set_output(output="CYCLES_LENS")
    bpy.ops.umbra.set_output(output="COMPOSITOR")
    assert scene.world == world
    assert [each.name for each in bpy.data.worlds] == [world.name]


def tree_of(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """The scene's compositor."""
    return scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group


def test_the_plain_world_of_a_new_scene_is_said_to_be_one(
    scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]
) -> None:
    environment_image(name=STAR_SKY)
    add_hole(scene, sky=False)
    said = "".join(capfd.readouterr())
    assert said.count('World "World" is a plain color: the sky is the image "Umbra Star Sky"') == 1
    assert "Warning" not in said
