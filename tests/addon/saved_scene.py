# SPDX-License-Identifier: GPL-3.0-or-later
"""A small scene that each release saves, for the releases after it to open; and the script that saves one.

    python tests/addon/saved_scene.py CHECKOUT OUT.blend [--disk] [--animated]
    python tests/addon/saved_scene.py CHECKOUT OUT.blend --world

builds the scene with the add-on as it stands in CHECKOUT, a folder with any commit of this repository, and saves it.
Use the Python that has Blender 4.5, the oldest supported one, whose files all others open. Blender 5 keeps values
elsewhere, so there is a file of its own for that. Only what every version has is used here.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

SIZE = (64, 36)
ARTISTS_NODE = "Artist's Exposure"

# What the artist has set, to be found again: of the hole, of the scene, and of the group's node.
HOLE = {"spin": 0.75, "mass_scale": 0.5, "motion": "STATIC"}
SCENE = {"environment_source": "IMAGE", "quality": "DRAFT", "supersampling": "2"}
GROUP = {
    "Exposure": 0.5,
    "Redshift Color": 0.75,
    "Redshift Brightness": 0.5,
    "Sky Temperature": 5000.0,
    "Environment Strength": 1.5,
}
ROTATION = (0.1, 0.2, 0.3)
PLAIN_COLOR, PLAIN_STRENGTH = (0.6, 0.35, 0.15, 1.0), 0.5


# Frames and values of the keyframes of an animated scene.
KEYFRAMES = {1: 0.25, 3: 0.75}
WORLD_SCENE, LENS_SCENE = "With the Output World", "With the Output Cycles Lens"
IN_STRIPS, FOLLOWER, UNUSED = "Hole in Strips", "Follower", "Unused Action"


def property_of(settings: bpy.types.bpy_struct, name: str) -> str:
    """A property's name in the version of the add-on that is enabled."""
    return name if name in settings.bl_rna.properties else name.replace("color", "colour")


def input_of(node: bpy.types.Node, name: str) -> bpy.types.NodeSocket:
    """A node's input by the name that the version of the add-on that is enabled has for it."""
    return node.inputs.get(name) or node.inputs[name.replace("Color", "Colour")]


def sky_pixels() -> np.ndarray:
    """A smooth sky that differs in every direction, row 0 at the top, shape (16, 32, 3)."""
    row, column = np.mgrid[0:16, 0:32].astype(np.float32)
    across, down = column / 32.0, row / 16.0
    wave = np.sin(4.0 * math.pi * across) * np.sin(math.pi * down)
    return np.stack([0.5 + 0.4 * np.cos(2.0 * math.pi * across), 0.2 + 0.7 * down, 0.5 + 0.3 * wave], axis=-1)


def _sky() -> bpy.types.Image:
    image = bpy.data.images.new("Saved Sky", 32, 16, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.ones((16, 32, 4), np.float32)
    pixels[..., :3] = sky_pixels()
    image.pixels.foreach_set(pixels[::-1].ravel())
    image.pack()
    return image


def compositor_of(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """The scene's compositor tree, wherever this Blender keeps it."""
    return scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group


def _empty_scene() -> bpy.types.Scene:
    """A camera that looks past the origin, without anything else."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.render.filepath = "//picture"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.image_settings.color_depth = "32"
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -10.0, 1.5), (math.radians(82.0), 0.0, 0.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


def build(*, disk: bool, animated: bool = False) -> bpy.types.Scene:
    """Make the scene with whatever version of the add-on is enabled."""
    scene = _empty_scene()
    scene.umbra.environment_image = _sky()
    for name, value in SCENE.items():
        setattr(scene.umbra, name, value)
    assert bpy.ops.umbra.add_black_hole() == {"FINISHED"}
    hole = scene.umbra.active_hole
    for name, value in HOLE.items():
        setattr(hole.umbra, name, value)
    if disk:
        hole.umbra.disk.texture = scene.umbra.environment_image  # the built-in one would make the file large
        hole.umbra.disk.enabled = True
        hole.umbra.disk.temperature = 7000.0
        if "streaks" in hole.umbra.disk.bl_rna.properties:  # up to version 0.1
            hole.umbra.disk.streaks = 0.25
    _finish_compositor(scene)
    if animated:
        _animate(scene)
        _add_outputs(scene)
    return scene


def _finish_compositor(scene: bpy.types.Scene) -> None:
    """Set the group's values, and put a node of the artist's own behind it."""
    tree = compositor_of(scene)
    group = next(node for node in tree.nodes if node.get("umbra_role") == "group")
    for name, value in GROUP.items():
        input_of(group, name).default_value = value
    group.inputs["Environment Rotation"].default_value = ROTATION
    targets = [link.to_socket for link in group.outputs["Image"].links]
    own = tree.nodes.new("CompositorNodeExposure")
    own.name = ARTISTS_NODE
    tree.links.new(group.outputs["Image"], own.inputs["Image"])
    for target in targets:
        tree.links.new(own.outputs["Image"], target)


def _insert_keyframes(owner: bpy.types.ID, settings: bpy.types.bpy_struct, name: str) -> None:
    for frame, value in KEYFRAMES.items():
        setattr(settings, name, value)
        assert settings.keyframe_insert(name, frame=frame)
    assert owner.animation_data.action_slot is not None


def _drive(owner: bpy.types.bpy_struct, name: str, source: bpy.types.ID, path: str, index: int = -1) -> None:
    driver = owner.driver_add(name, index).driver
    driver.type = "SUM"
    target = driver.variables.new().targets[0]
    target.id_type = source.id_type
    target.id, target.data_path = source, path


def _animate(scene: bpy.types.Scene) -> None:
    """Give keyframes, strips and drivers to everything that has another name today."""
    hole = scene.umbra.active_hole
    disk = hole.umbra.disk
    disk.texture_use = disk.bl_rna.properties["texture_use"].enum_items[1].identifier
    scene.frame_start, scene.frame_end = min(KEYFRAMES), max(KEYFRAMES)
    redshift = property_of(scene.umbra, "redshift_color")
    doppler, variation = property_of(disk, "doppler_color"), property_of(disk, "color_variation")
    _insert_keyframes(scene, scene.umbra, redshift)
    _insert_keyframes(hole, disk, doppler)
    _drive(disk, variation, scene, f"umbra.{redshift}")
    (group,) = [node for node in compositor_of(scene).nodes if node.get("umbra_role") == "group"]
    _drive(input_of(group, "Redshift Color"), "default_value", scene, f"umbra.{redshift}")

    unused = hole.animation_data.action.copy()
    unused.name, unused.use_fake_user = UNUSED, True
    other = bpy.data.objects.new(IN_STRIPS, None)
    scene.collection.objects.link(other)
    _insert_keyframes(other, other.umbra.disk, doppler)
    animation = other.animation_data
    strip = animation.nla_tracks.new().strips.new("Strip", 1, animation.action)
    strip.action_slot = animation.action_slot
    animation.action = None


def _add_outputs(scene: bpy.types.Scene) -> None:
    """Scenes with the other outputs, and an object that follows the World's group by name and by index."""
    hole = scene.umbra.active_hole
    disk = hole.umbra.disk
    for name, output in ((WORLD_SCENE, "WORLD"), (LENS_SCENE, "CYCLES_LENS")):
        other = scene.copy()
        other.name, other.use_fake_user = name, True
        other.animation_data_clear()
        if bpy.app.version >= (5, 0):
            other.compositing_node_group = scene.compositing_node_group.copy()
        camera = scene.camera.copy()
        camera.data = scene.camera.data.copy()
        other.collection.objects.link(camera)
        other.camera = camera
        other.umbra.output = output
        assert other.umbra.output == output
    tree = bpy.data.scenes[WORLD_SCENE].world.node_tree
    (node,) = [each for each in tree.nodes if "Lensed Light" in each.inputs]
    socket = input_of(node, "Redshift Color")
    for frame, value in KEYFRAMES.items():
        socket.default_value = value
        assert socket.keyframe_insert("default_value", frame=frame)
    follower = bpy.data.objects.new(FOLLOWER, None)
    bpy.data.scenes[WORLD_SCENE].collection.objects.link(follower)
    by_name = f'node_tree.nodes["{node.name}"].inputs["{socket.name}"].default_value'
    world = bpy.data.scenes[WORLD_SCENE].world
    _drive(follower, "location", hole, f"umbra.disk.{property_of(disk, 'doppler_color')}", 0)
    _drive(follower, "location", world, by_name, 1)
    _drive(follower, "location", world, f"node_tree.{socket.path_from_id('default_value')}", 2)


def build_world() -> bpy.types.Scene:
    """Make a scene with Output: World, whose World has an Environment Texture inside a group, and a plain color."""
    scene = _empty_scene()
    scene.cycles.filter_width, scene.cycles.use_denoising = 0.01, False
    scene.world = bpy.data.worlds.new("Saved World")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = True
    inner = bpy.data.node_groups.new("Artist's Sky", "ShaderNodeTree")
    inner.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketShader")
    texture, background, end = map(
        inner.nodes.new, ("ShaderNodeTexEnvironment", "ShaderNodeBackground", "NodeGroupOutput")
    )
    texture.image = _sky()
    inner.links.new(texture.outputs["Color"], background.inputs["Color"])
    inner.links.new(background.outputs[0], end.inputs[0])
    tree = scene.world.node_tree
    tree.nodes.clear()
    group, plain, both, output = map(
        tree.nodes.new,
        ("ShaderNodeGroup", "ShaderNodeBackground", "ShaderNodeAddShader", "ShaderNodeOutputWorld"),
    )
    group.node_tree = inner
    plain.inputs["Color"].default_value, plain.inputs["Strength"].default_value = PLAIN_COLOR, PLAIN_STRENGTH
    tree.links.new(group.outputs[0], both.inputs[0])
    tree.links.new(plain.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], output.inputs["Surface"])
    hole = bpy.data.objects.new("Hole", None)
    scene.collection.objects.link(hole)
    hole.umbra.is_black_hole = True
    for name, value in HOLE.items():
        setattr(hole.umbra, name, value)
    scene.umbra.active_hole = hole
    scene.umbra.environment_source = "WORLD"
    assert bpy.ops.umbra.set_output(output="WORLD") == {"FINISHED"}
    (node,) = [each for each in scene.world.node_tree.nodes if "Lensed Light" in each.inputs]
    for name, value in GROUP.items():
        if name in node.inputs:
            node.inputs[name].default_value = value
    return scene


def main() -> None:
    """Build and save the scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--disk", action="store_true")
    parser.add_argument("--animated", action="store_true")
    parser.add_argument("--world", action="store_true")
    options = parser.parse_args()
    sys.path.insert(0, str(options.checkout.resolve()))
    import blender_addon

    blender_addon.register()
    if options.world:
        build_world()
    else:
        build(disk=options.disk, animated=options.animated)
    bpy.context.preferences.filepaths.save_version = 0
    with tempfile.TemporaryDirectory() as folder:  # a file keeps the path that it is saved to
        path = Path(folder) / options.output.name
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, relative_remap=False)
        options.output.write_bytes(path.read_bytes())
    print(f"{options.output}: {options.output.stat().st_size / 1e3:.0f} kB")
    blender_addon.unregister()


if __name__ == "__main__":
    main()
