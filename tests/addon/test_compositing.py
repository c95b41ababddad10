# SPDX-License-Identifier: GPL-3.0-or-later
"""The set-up in the compositor: it goes in without breaking the artist's tree, and comes out without a trace."""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from small_scene import add_hole, compositor, environment_image, links_of, shrink, use_sky, world_sky


@pytest.fixture
def tree_module(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("outputs.shared.compositor_tree")


@pytest.fixture
def environment(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("scene.sky.environment")


@pytest.fixture
def scene() -> bpy.types.Scene:
    scene = bpy.context.scene
    shrink(scene)
    return scene


def nodes_of(tree: bpy.types.NodeTree, kind: str) -> list[bpy.types.Node]:
    return [node for node in tree.nodes if node.type == kind]


def output_of(tree: bpy.types.NodeTree) -> bpy.types.Node:
    return next(node for node in tree.nodes if node.type in {"COMPOSITE", "GROUP_OUTPUT"})


def origin(socket: bpy.types.NodeSocket) -> tuple[bpy.types.Node, str]:
    (link,) = socket.links
    return link.from_node, link.from_socket.name


def test_a_scene_without_a_tree(scene: bpy.types.Scene, tree_module: ModuleType) -> None:
    add_hole(scene)
    setup = tree_module.find_setup(scene)
    output = output_of(setup.tree)
    assert origin(output.inputs[0]) == (setup.group, "Image")
    layer, name = origin(setup.group.inputs["Render"])
    assert (layer.type, name) == ("R_LAYERS", "Image")
    assert origin(setup.group.inputs["Warp Map"])[0] == setup.map
    assert origin(setup.group.inputs["Environment"])[0] == setup.sky
    assert setup.sky.image == scene.umbra.environment_image
    image = setup.map.image
    assert (image.source, image.colorspace_settings.name, image.alpha_mode) == (
        "SEQUENCE",
        "Non-Color",
        "CHANNEL_PACKED",
    )
    assert scene.render.film_transparent
    assert scene.render.compositor_precision == "FULL"
    assert tree_module.is_in_use(scene)


def artists_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """Render Layers > Blur > output, and beside it Render Layers > Viewer, and its alpha to an Invert."""
    tree = compositor(scene)
    (layer,) = nodes_of(tree, "R_LAYERS")
    output = output_of(tree)
    blur = tree.nodes.new("CompositorNodeBlur")
    viewer = tree.nodes.new("CompositorNodeViewer")
    invert = tree.nodes.new("CompositorNodeInvert")
    for node, name in ((blur, "My Blur"), (viewer, "My Viewer"), (invert, "My Invert")):
        node.name = name
    tree.links.new(layer.outputs["Image"], blur.inputs["Image"])
    tree.links.new(blur.outputs["Image"], output.inputs[0])
    tree.links.new(layer.outputs["Image"], viewer.inputs["Image"])
    tree.links.new(layer.outputs["Alpha"], invert.inputs["Color"])
    return tree


def test_insertion_into_an_artists_tree_and_removal(scene: bpy.types.Scene, tree_module: ModuleType) -> None:
    tree = artists_tree(scene)
    scene.render.film_transparent = False
    before = links_of(tree)
    names = {node.name for node in tree.nodes}
    settings = ("film_transparent", "compositor_precision", "use_compositing", "use_lock_interface")
    values = [getattr(scene.render, name) for name in settings]

    add_hole(scene)
    setup = tree_module.find_setup(scene)
    assert setup.tree == tree
    blur, viewer, invert = (tree.nodes[name] for name in ("My Blur", "My Viewer", "My Invert"))
    assert origin(blur.inputs["Image"]) == (setup.group, "Image")
    assert origin(viewer.inputs["Image"]) == (setup.group, "Image")
    assert origin(invert.inputs["Color"])[1] == "Alpha"
    assert names < {node.name for node in tree.nodes}

    assert bpy.ops.umbra.remove_compositor() == {"FINISHED"}
    assert links_of(tree) == before
    assert {node.name for node in tree.nodes} == names
    assert [getattr(scene.render, name) for name in settings] == values
    assert not any(key.startswith("umbra_") for key in scene.keys())  # noqa: SIM118  not a dict
    assert "Umbra Black Hole" not in bpy.data.node_groups
    assert not [image for image in bpy.data.images if image.source == "SEQUENCE"]


def test_running_it_again_changes_nothing(scene: bpy.types.Scene, tree_module: ModuleType) -> None:
    tree = artists_tree(scene)
    scene.render.film_transparent = False
    before = links_of(tree)
    add_hole(scene)
    links = links_of(tree)
    group = tree_module.find_setup(scene).group
    group.inputs["Exposure"].default_value = 1.5
    for _ in range(2):
        assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    assert links_of(tree) == links
    assert len(nodes_of(tree, "GROUP")) == 1
    assert tree_module.find_setup(scene).group.inputs["Exposure"].default_value == 1.5
    bpy.ops.umbra.remove_compositor()
    assert links_of(tree) == before
    assert not scene.render.film_transparent


def test_what_the_artist_adds_later_survives_removal(scene: bpy.types.Scene, tree_module: ModuleType) -> None:
    add_hole(scene)
    setup = tree_module.find_setup(scene)
    tree, output = setup.tree, output_of(setup.tree)
    glare = tree.nodes.new("CompositorNodeGlare")
    tree.links.new(setup.group.outputs["Image"], glare.inputs["Image"])
    tree.links.new(glare.outputs["Image"], output.inputs[0])
    bpy.ops.umbra.setup_compositor()
    assert origin(output.inputs[0])[0] == glare
    bpy.ops.umbra.remove_compositor()
    tree = tree_module.find_tree(scene)
    (glare,) = nodes_of(tree, "GLARE")
    assert origin(glare.inputs["Image"])[0].type == "R_LAYERS"
    assert origin(output_of(tree).inputs[0])[0] == glare


def test_removal_from_a_scene_that_had_no_tree(scene: bpy.types.Scene, tree_module: ModuleType) -> None:
    add_hole(scene)
    bpy.ops.umbra.remove_compositor()
    assert tree_module.find_setup(scene) is None
    assert not tree_module.is_in_use(scene)
    if bpy.app.version < (5, 0):
        assert not scene.use_nodes
        assert {node.type for node in scene.node_tree.nodes} == {"R_LAYERS", "COMPOSITE"}
    else:
        assert scene.compositing_node_group is None
        assert len(bpy.data.node_groups) == 0
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.umbra.remove_compositor()
    bpy.ops.umbra.setup_compositor()  # and in again
    assert tree_module.is_in_use(scene)


def test_the_sky_goes_behind_the_layer_farthest_back(scene: bpy.types.Scene, tree_module: ModuleType) -> None:
    tree = compositor(scene)
    (back,) = nodes_of(tree, "R_LAYERS")
    front = tree.nodes.new("CompositorNodeRLayers")
    over = tree.nodes.new("CompositorNodeAlphaOver")
    pictures = [socket for socket in over.inputs if socket.type == "RGBA"]
    behind = over.inputs.get("Background") or pictures[0]
    before = over.inputs.get("Foreground") or pictures[1]
    tree.links.new(front.outputs["Image"], before)
    tree.links.new(back.outputs["Image"], behind)
    tree.links.new(over.outputs["Image"], output_of(tree).inputs[0])
    add_hole(scene)
    setup = tree_module.find_setup(scene)
    assert origin(setup.group.inputs["Render"])[0] == back
    assert origin(behind) == (setup.group, "Image")
    assert origin(before)[0] == front


def test_an_output_that_does_not_use_the_render_is_left_alone(
    scene: bpy.types.Scene, tree_module: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    tree = compositor(scene)
    tree.nodes.remove(nodes_of(tree, "R_LAYERS")[0])
    color = tree.nodes.new("CompositorNodeRGB")
    output = output_of(tree)
    tree.links.new(color.outputs[0], output.inputs[0])
    before, names = links_of(tree), {node.name for node in tree.nodes}
    use_sky(scene)
    notes = addon_module("outputs.compositor.compositing").set_up(scene)
    assert any("does not use the render" in note for note in notes)
    assert origin(output.inputs[0])[0] == color
    assert not tree_module.is_in_use(scene)
    addon_module("outputs.compositor.compositing").remove(scene)
    assert links_of(tree) == before
    assert {node.name for node in tree.nodes} == names


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="before 5.0 the tree is part of the scene")
def test_a_tree_shared_with_another_scene_is_not_touched(scene: bpy.types.Scene) -> None:
    tree = compositor(scene)
    bpy.data.scenes.new("Other").compositing_node_group = tree
    before = links_of(tree)
    with pytest.raises(RuntimeError, match='also belongs to scene "Other"'):
        bpy.ops.umbra.setup_compositor()
    assert links_of(tree) == before


# --- sky ------------------------------------------------------------------------------------------


def test_the_worlds_sky_is_taken_over_and_followed(scene: bpy.types.Scene, tree_module: ModuleType) -> None:
    image = environment_image()
    nodes = world_sky(scene, image)
    nodes["mapping"].inputs["Rotation"].default_value = (0.1, 0.2, 0.3)
    strength = nodes["background"].inputs["Strength"]
    for frame, value in ((1, 0.5), (11, 2.5)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    add_hole(scene, sky=False)
    assert scene.umbra.environment_source == "WORLD"
    setup = tree_module.find_setup(scene)
    assert setup.sky.image == image
    for frame, expected in ((1, 0.5), (11, 2.5)):
        scene.frame_set(frame)
        assert tuple(setup.group.inputs["Environment Rotation"].default_value) == pytest.approx((0.1, 0.2, 0.3))
        assert setup.group.inputs["Environment Strength"].default_value == pytest.approx(expected)

    # a sky of one's own is not the World's any more
    scene.umbra.environment_image = environment_image(name="Other Sky")
    scene.umbra.environment_source = "IMAGE"
    assert setup.sky.image.name == "Other Sky"
    names = ("Environment Rotation", "Environment Strength")
    paths = {setup.group.inputs[name].path_from_id("default_value") for name in names}
    assert not any(each.data_path in paths for each in setup.tree.animation_data.drivers)
    assert setup.group.inputs["Environment Strength"].default_value == 1.0
    scene.umbra.environment_source = "WORLD"
    assert setup.sky.image == image
    assert len([each for each in setup.tree.animation_data.drivers if each.data_path in paths]) == 4
    bpy.ops.umbra.remove_compositor()
    tree = tree_module.find_tree(scene)
    assert tree is None or tree.animation_data is None or not tree.animation_data.drivers


def test_a_texture_mapping_node_is_the_inverse_rotation(scene: bpy.types.Scene, environment: ModuleType) -> None:
    nodes = world_sky(scene, environment_image())
    nodes["mapping"].vector_type = "TEXTURE"
    nodes["mapping"].inputs["Rotation"].default_value = (0.0, 0.0, 0.7)
    sky = environment.read_world(scene)
    assert sky.rotation == pytest.approx((0.0, 0.0, -0.7), abs=1e-6)
    assert sky.rotation_at is None


def test_worlds_that_cannot_be_taken_over_say_why(
    scene: bpy.types.Scene, environment: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    scene_error = addon_module("core.errors").SceneError

    def refused(pattern: str) -> None:
        with pytest.raises(scene_error, match=pattern):
            environment.read_world(scene)

    refused("plain color and has no environment")
    nodes = world_sky(scene, environment_image())
    environment.read_world(scene)
    links = scene.world.node_tree.links

    nodes["mapping"].inputs["Scale"].default_value = (1.0, 1.0, 2.0)
    refused("no panorama")
    nodes["mapping"].inputs["Scale"].default_value = (1.0, 1.0, 1.0)
    links.new(nodes["coordinates"].outputs["Camera"], nodes["mapping"].inputs["Vector"])
    refused("Generated")
    links.new(nodes["coordinates"].outputs["Generated"], nodes["mapping"].inputs["Vector"])
    nodes["texture"].projection = "MIRROR_BALL"
    refused("no panorama")
    nodes["texture"].projection = "EQUIRECTANGULAR"
    nodes["texture"].image = None
    refused("no image")
    nodes["texture"].image = environment_image()
    gamma = scene.world.node_tree.nodes.new("ShaderNodeGamma")
    links.new(nodes["texture"].outputs["Color"], gamma.inputs["Color"])
    links.new(gamma.outputs["Color"], nodes["background"].inputs["Color"])
    refused("no panorama")
    gamma.inputs["Gamma"].keyframe_insert("default_value")
    refused("is animated")
    scene.world = None
    refused("no World")
    scene.umbra.environment_source = "IMAGE"
    with pytest.raises(scene_error, match="no environment"):
        environment.read(scene)


def test_the_default_world_brings_the_real_stars(
    scene: bpy.types.Scene, tree_module: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene, sky=False)
    exposure = tree_module.find_setup(scene).group.inputs["Exposure"]
    assert exposure.default_value == addon_module("scene.sky.environment").STAR_SKY_EXPOSURE
    bpy.ops.umbra.remove_compositor()  # and with the group its exposure
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    exposure = tree_module.find_setup(scene).group.inputs["Exposure"]
    assert exposure.default_value == addon_module("scene.sky.environment").STAR_SKY_EXPOSURE
    exposure.default_value = 1.0  # the artist's own stays
    assert bpy.ops.umbra.use_star_sky() == {"FINISHED"}
    assert exposure.default_value == 1.0
    image = scene.umbra.environment_image
    assert scene.umbra.environment_source == "IMAGE"
    assert tuple(image.size) == (4096, 2048)
    assert image.packed_file is None
    assert Path(image.filepath).parent == Path(bpy.app.tempdir, "umbra_maps")  # beside maps of a file not saved yet
    assert math.isclose(image.pixels[3], 1.0)


def test_a_sky_of_the_artists_own_nodes_stays(
    scene: bpy.types.Scene, tree_module: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene)
    setup = tree_module.find_setup(scene)
    color = setup.tree.nodes.new("CompositorNodeRGB")
    setup.tree.links.new(color.outputs[0], setup.group.inputs["Environment"])
    bpy.ops.umbra.setup_compositor()
    assert origin(setup.group.inputs["Environment"])[0] == color
    scene.umbra.environment_image = None
    addon_module("outputs.compositor.compositor_sync").sync_sky(scene)  # nothing is missing
    assert addon_module("outputs.registry").of(scene).sky_problem(scene) is None


def panel(addon_module: Callable[[str], ModuleType]) -> str:
    """What the panel says of the scene."""
    return " ".join(line.text for line in addon_module("ui.status").lines(bpy.context))


def test_a_camera_that_another_scene_bends_is_refused(
    scene: bpy.types.Scene, tree_module: ModuleType, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene)
    other = bpy.data.scenes.new("Other")
    for each in scene.objects:
        other.collection.objects.link(each)
    other.camera, other.world, other.render.engine = scene.camera, scene.world, "CYCLES"
    other.umbra.environment_image, other.umbra.environment_source = scene.umbra.environment_image, "IMAGE"
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        assert bpy.ops.umbra.set_output(output="CYCLES_LENS") == {"FINISHED"}
    refusal = addon_module("core.errors").SceneError
    for output in ("COMPOSITOR", "WORLD"):
        assert bpy.ops.umbra.set_output(output=output) == {"FINISHED"}
        with pytest.raises(refusal, match="a camera of its own"):
            addon_module("outputs.registry").of(scene).take_away(scene)
        assert "a camera of its own" in panel(addon_module)
        shared = scene.camera.data
        scene.camera.data = bpy.data.cameras.new("Own")
        addon_module("outputs.registry").of(scene).take_away(scene)
        assert "a camera of its own" not in panel(addon_module)
        scene.camera.data = shared


def test_strips_that_are_not_rendered_do_not_matter(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    """Blender renders the scene where all strips are muted, one by one or by channel, or the sequencer is off."""
    check, refusal = addon_module("outputs.shared.sequencer").check, addon_module("core.errors").SceneError
    editor = scene.sequence_editor_create()
    end = {"length": 10} if bpy.app.version >= (5, 0) else {"frame_end": 10}
    strip = editor.strips.new_effect("Title", "COLOR", 2, 1, **end)
    with pytest.raises(refusal, match='"Title"'):
        check(scene)
    add_hole(scene)
    assert 'has the strip "Title"' in panel(addon_module)  # before a render is refused
    strip.mute = True
    check(scene)
    assert "Title" not in panel(addon_module)
    strip.mute = False
    editor.channels[2].mute = True
    check(scene)
    editor.channels[2].mute = False
    scene.render.use_sequencer = False
    check(scene)
