# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender: build the end-to-end test's scene as an artist would, with the installed extension.

    blender -b --python-exit-code 1 --python end_to_end_scene.py -- SETTINGS.json

A rotated sky, a ball in front of the hole, a camera that moves, two frames. Its settings are end_to_end.py's.
"""

import json
import math
import sys

import bpy


def set_up_world(world: bpy.types.World, settings: dict) -> None:
    """The sky, turned and dimmed, as the World's background."""
    tree = world.node_tree
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(settings["sky"])
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = settings["rotation"]
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    background.inputs["Strength"].default_value = settings["strength"]


def add_ball(color: list[float]) -> None:
    """A ball that shines with one color, in the lower right corner of the picture."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.35, location=(1.5, -3.0, -0.75))
    material = bpy.data.materials.new("Ball")
    if material.node_tree is None:  # before Blender 5
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (*color, 1.0)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    bpy.context.object.data.materials.append(material)


def add_camera(scene: bpy.types.Scene) -> None:
    """A camera that looks along +y and drifts sideways."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.rotation_euler = (math.pi / 2.0, 0.0, 0.0)
    for frame, x in ((1, 0.0), (2, 0.2)):
        camera.location = (x, -8.0, 0.0)
        camera.keyframe_insert("location", frame=frame)
    scene.camera = camera


def main(settings: dict) -> None:
    """Build the scene and save it."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    scene = bpy.context.scene
    set_up_world(scene.world, settings)
    add_ball(settings["ball_color"])
    add_camera(scene)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 4
    scene.render.resolution_x, scene.render.resolution_y = settings["size"]
    scene.render.resolution_percentage = 100
    scene.frame_start, scene.frame_end = 1, 2
    scene.render.filepath = "//picture_"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    # Saved before the hole is added, so that its maps go beside the file from the beginning.
    bpy.ops.wm.save_as_mainfile(filepath=settings["scene"])
    for operator in (bpy.ops.umbra.add_black_hole, bpy.ops.umbra.setup_compositor):
        if operator() != {"FINISHED"}:
            sys.exit(f"{operator.idname()} did not finish.")
    bpy.ops.wm.save_mainfile()


if __name__ == "__main__":
    with open(sys.argv[-1], encoding="utf-8") as file:
        main(json.load(file))
