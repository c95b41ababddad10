# SPDX-License-Identifier: GPL-3.0-or-later
"""A small scene that each release saves, for the releases after it to open; and the script that saves one.

    python tests/addon/saved_scene.py CHECKOUT OUT.blend [--disk]

with the Python that has Blender 4.5 (the oldest supported one, whose files all others open) builds the scene with the
add-on as it stands in CHECKOUT, a folder with any commit of this repository, and saves it. Only what every version has
is used here, by the names it was saved under.
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
    "Redshift Colour": 0.75,
    "Redshift Brightness": 0.5,
    "Sky Temperature": 5000.0,
    "Environment Strength": 1.5,
}
ROTATION = (0.1, 0.2, 0.3)


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


def build(*, disk: bool) -> bpy.types.Scene:
    """Make the scene with whatever version of the add-on is enabled."""
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
        hole.umbra.disk.streaks = 0.25
    _finish_compositor(scene)
    return scene


def _finish_compositor(scene: bpy.types.Scene) -> None:
    """Set the group's values, and put a node of the artist's own behind it."""
    tree = compositor_of(scene)
    group = next(node for node in tree.nodes if node.get("umbra_role") == "group")
    for name, value in GROUP.items():
        group.inputs[name].default_value = value
    group.inputs["Environment Rotation"].default_value = ROTATION
    targets = [link.to_socket for link in group.outputs["Image"].links]
    own = tree.nodes.new("CompositorNodeExposure")
    own.name = ARTISTS_NODE
    tree.links.new(group.outputs["Image"], own.inputs["Image"])
    for target in targets:
        tree.links.new(own.outputs["Image"], target)


def main() -> None:
    """Build and save the scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--disk", action="store_true")
    options = parser.parse_args()
    if bpy.app.version >= (5, 0):
        sys.exit("Save it with Blender 4.5: newer versions write files that it cannot open.")
    sys.path.insert(0, str(options.checkout.resolve()))
    import blender_addon

    blender_addon.register()
    build(disk=options.disk)
    bpy.context.preferences.filepaths.save_version = 0
    with tempfile.TemporaryDirectory() as folder:  # a file keeps the path that it is saved to
        path = Path(folder) / options.output.name
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, relative_remap=False)
        options.output.write_bytes(path.read_bytes())
    print(f"{options.output}: {options.output.stat().st_size / 1e3:.0f} kB")
    blender_addon.unregister()


if __name__ == "__main__":
    main()
