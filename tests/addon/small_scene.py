# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes and small renders for the tests of the add-on."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SIZE = (64, 36)
PROCESS_TIMEOUT = 300  # seconds
EXTENSION = "bl_ext.user_default.umbra_black_hole"


def shrink(scene: bpy.types.Scene, size: tuple[int, int] = SIZE) -> None:
    """Make renders of a scene quick, and exact in float32."""
    render = scene.render
    render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGBA"
    render.image_settings.color_depth = "32"
    scene.umbra.sky_filter = "OFF"  # its files and nodes have tests of their own
    scene.umbra.glare = "OFF"  # and so has this


def environment_pixels(height: int = 16) -> np.ndarray:
    """A smooth sky, different in every direction, row 0 at the top."""
    width = 2 * height
    row, column = np.mgrid[0:height, 0:width].astype(np.float32)
    across, down = column / width, row / height
    return np.stack(
        [
            0.5 + 0.4 * np.cos(2 * math.pi * across),
            0.2 + 0.7 * down,
            0.5 + 0.3 * np.sin(4 * math.pi * across) * np.sin(math.pi * down),
        ],
        axis=-1,
    ).astype(np.float32)


def environment_image(pixels: np.ndarray | None = None, name: str = "Test Sky") -> bpy.types.Image:
    """An image datablock with these pixels (scene-linear)."""
    pixels = environment_pixels() if pixels is None else pixels
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = pixels
    image.pixels.foreach_set(full[::-1].ravel())
    image.pack()
    return image


def use_sky(scene: bpy.types.Scene, image: bpy.types.Image | None = None) -> None:
    """Choose an image as the sky around the hole."""
    scene.umbra.environment_image = image or environment_image()
    scene.umbra.environment_source = "IMAGE"


def world_sky(scene: bpy.types.Scene, image: bpy.types.Image) -> dict[str, bpy.types.Node]:
    """Give the scene's World an Environment Texture, turned by a Mapping node."""
    tree = scene.world.node_tree
    tree.nodes.clear()
    nodes = {
        "coordinates": tree.nodes.new("ShaderNodeTexCoord"),
        "mapping": tree.nodes.new("ShaderNodeMapping"),
        "texture": tree.nodes.new("ShaderNodeTexEnvironment"),
        "background": tree.nodes.new("ShaderNodeBackground"),
        "output": tree.nodes.new("ShaderNodeOutputWorld"),
    }
    nodes["texture"].image = image
    links = tree.links
    links.new(nodes["coordinates"].outputs["Generated"], nodes["mapping"].inputs["Vector"])
    links.new(nodes["mapping"].outputs["Vector"], nodes["texture"].inputs["Vector"])
    links.new(nodes["texture"].outputs["Color"], nodes["background"].inputs["Color"])
    links.new(nodes["background"].outputs["Background"], nodes["output"].inputs["Surface"])
    return nodes


def add_hole(scene: bpy.types.Scene, *, sky: bool = True, **settings: object) -> bpy.types.Object:
    """Add a black hole as the menu does; without the default cube, which would hide it."""
    cube = bpy.data.objects.get("Cube")
    if cube is not None:
        bpy.data.objects.remove(cube)
    if sky:
        use_sky(scene)
    assert bpy.ops.umbra.add_black_hole() == {"FINISHED"}
    hole = scene.umbra.active_hole
    for name, value in settings.items():
        setattr(hole.umbra, name, value)
    return hole


def render(scene: bpy.types.Scene, path: Path, exr: ModuleType) -> np.ndarray:
    """Render the current frame to an EXR; its pixels, row 0 at the top.

    Cycles makes no table of the World's light by itself, which would take longer than the render.
    """
    if scene.world is not None and scene.world.cycles.sampling_method == "AUTOMATIC":
        scene.world.cycles.sampling_method = "NONE"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read(path, exr)


def read(path: Path, exr: ModuleType) -> np.ndarray:
    """Pixels of an EXR, shape (height, width, channels), row 0 at the top."""
    pixels, _attributes = exr.read_exr(path)
    return pixels


def plain_name(path: Path | str) -> str:
    """The name of a map file without what tells its .blend file and its shot."""
    return re.sub(r".*?(Scene_Black_Hole)_[0-9a-f]{8}(?=_)", r"\1", Path(path).name)


def find_map(folder: Path, name: str) -> Path:
    """The one map file in a folder that has this plain name."""
    (path,) = (each for each in folder.glob("*.exr") if plain_name(each) == name)
    return path


def compositor(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """The scene's compositor tree, made if it has none."""
    if bpy.app.version < (5, 0):
        scene.use_nodes = True
        return scene.node_tree
    if scene.compositing_node_group is None:
        tree = bpy.data.node_groups.new("Artist's Compositor", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        layer = tree.nodes.new("CompositorNodeRLayers")
        output = tree.nodes.new("NodeGroupOutput")
        tree.links.new(layer.outputs["Image"], output.inputs[0])
    return scene.compositing_node_group


def links_of(tree: bpy.types.NodeTree) -> set[tuple[str, str, str, str]]:
    """The links of a tree in a form that can be compared."""
    return {
        (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
        for link in tree.links
    }


def run_python(
    code: str, *, resources: Path | None = None, timeout: float = PROCESS_TIMEOUT
) -> subprocess.CompletedProcess[str]:
    """Run a script in a process of its own, with the extension that these tests installed.

    With a folder for `resources`, Blender keeps to that one instead, in which nothing is installed.
    """
    environment = dict(os.environ)
    if resources is not None:
        resources.mkdir(exist_ok=True)
        environment["BLENDER_USER_RESOURCES"] = str(resources)
    return subprocess.run(
        _script(code, enable=resources is None),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
        env=environment,
    )


def refused(result: subprocess.CompletedProcess[str]) -> bool:
    """Whether a script ended as it does for a frame that cannot be right.

    Raises
    ------
    CalledProcessError
        It failed in any other way.
    """
    if result.returncode == 1 and "Error: Umbra Black Hole: " in result.stderr:
        return True
    if result.returncode:
        sys.stderr.write(result.stderr)
        result.check_returncode()
    return False


def start_python(code: str) -> subprocess.Popen[str]:
    """Start a script as `run_python` does, without waiting for it."""
    return subprocess.Popen(_script(code), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _script(code: str, *, enable: bool = True) -> list[str]:
    """The command that runs a script with the tools of these tests, and with the extension unless told otherwise."""
    begin = f"import bpy\nimport sys\nsys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    if enable:
        begin += f"""
import importlib
import ready_groups
bpy.ops.preferences.addon_enable(module={EXTENSION!r})
ready_groups.install(lambda name: importlib.import_module(f"{EXTENSION}.{{name}}"))
"""
    return [sys.executable, "-c", begin + code]
