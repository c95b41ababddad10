# SPDX-License-Identifier: GPL-3.0-or-later
"""The sky around the hole: the World's, an image, or the built-in sky of real stars."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Euler

from ..core import color_spaces
from ..core.blender_version import NODES_ARE_OPTIONAL
from ..core.errors import SceneError
from ..core.physics_api import PACKAGE, physics

# On a scene whose World is replaced by a lensed copy: the World itself.
WORLD_BEFORE = "umbra_world_before"

STAR_SKY_NAME = "Umbra Star Sky"
STAR_SKY_HEIGHT = 2048
_STAR_SKY_FILE = f"star_sky_{STAR_SKY_HEIGHT}.exr"

_HELP = "connect Environment Texture > Background > World Output, or choose Sky: Image in the Umbra panel"


@dataclass(frozen=True)
class Sky:
    """An equirectangular environment and how it is placed."""

    image: bpy.types.Image
    texture: bpy.types.Node | None = None
    """The World's Environment Texture node, whose frame settings an animated image needs."""
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Euler XYZ, radians, as in a Mapping node of type Point."""
    strength: float = 1.0
    rotation_path: str | None = None
    """Data path, from the World, of the value to follow; None where it is fixed."""
    strength_path: str | None = None


def _source(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """The output that feeds an input, seen through reroutes."""
    while socket.is_linked:
        origin = socket.links[0].from_socket
        if origin.node.type != "REROUTE":
            return origin
        socket = origin.node.inputs[0]
    return None


def _input_path(node: bpy.types.Node, name: str) -> str:
    index = next(number for number, each in enumerate(node.inputs) if each.name == name)
    return f'node_tree.nodes["{bpy.utils.escape_identifier(node.name)}"].inputs[{index}].default_value'


def _angles(rotation: Iterable[float]) -> tuple[float, float, float]:
    x, y, z = rotation
    return x, y, z


def _mapping(texture: bpy.types.Node) -> tuple[tuple[float, float, float], str | None]:
    """Rotation of the sky before an Environment Texture, and the path to follow it by."""
    origin = _source(texture.inputs["Vector"])
    if origin is None:
        return (0.0, 0.0, 0.0), None
    mapping = None
    if origin.node.type == "MAPPING":
        mapping = origin.node
        origin = _source(mapping.inputs["Vector"])
    if origin is None or origin.node.type != "TEX_COORD" or origin.name != "Generated":
        raise SceneError(
            "The World's Environment Texture takes its coordinates from something else than Texture "
            f"Coordinate > Generated, with or without a Mapping node: {_HELP}.",
            code="sky.coordinates",
        )
    if mapping is None:
        return (0.0, 0.0, 0.0), None
    inputs = mapping.inputs
    if any(each.is_linked for each in inputs if each.name != "Vector"):
        raise SceneError(
            f"The World's Mapping node is driven by other nodes, which cannot be followed: {_HELP}.", code="sky.mapping"
        )
    has_location = mapping.vector_type in {"POINT", "TEXTURE"}
    moves = has_location and any(inputs["Location"].default_value)
    if moves or tuple(inputs["Scale"].default_value) != (1.0, 1.0, 1.0):
        raise SceneError(
            "The World's Mapping node moves or scales the sky: only its Rotation can be taken over; set "
            "Location to 0 and Scale to 1.",
            code="sky.mapping",
        )
    rotation = Euler(inputs["Rotation"].default_value, "XYZ")
    if mapping.vector_type == "TEXTURE":
        return _angles(rotation.to_matrix().inverted().to_euler("XYZ")), None
    return _angles(rotation), _input_path(mapping, "Rotation")


def read_world(scene: bpy.types.Scene) -> Sky:
    """The sky that a scene's World shows, or the one that its lensed World was made from, as that places it now.

    Raises
    ------
    SceneError
        The World is missing, or is not an Environment Texture feeding a Background.
    """
    world = scene.get(WORLD_BEFORE, scene.world)
    if world is None:
        raise SceneError(
            f'Scene "{scene.name}" has no World: add one, or choose Sky: Image in the Umbra panel.', code="sky.no-world"
        )
    uses_nodes = not NODES_ARE_OPTIONAL or world.use_nodes
    if not uses_nodes or world.node_tree is None:
        raise SceneError(
            f'World "{world.name}" is a plain color and has no environment: {_HELP}.', code="sky.plain-color"
        )
    engine = "CYCLES" if scene.render.engine == "CYCLES" else "EEVEE"
    output = world.node_tree.get_output_node(engine)
    surface = _source(output.inputs["Surface"]) if output is not None else None
    if surface is None or surface.node.type != "BACKGROUND":
        raise SceneError(
            f'World "{world.name}" is not a Background, so its sky cannot be taken over: {_HELP}.',
            code="sky.no-background",
        )
    background = surface.node
    color = _source(background.inputs["Color"])
    if color is None:
        raise SceneError(
            f'World "{world.name}" is a plain color and has no environment: {_HELP}.', code="sky.plain-color"
        )
    if color.node.type != "TEX_ENVIRONMENT":
        raise SceneError(
            f'World "{world.name}" makes its color with the node "{color.node.name}", which cannot be '
            f"taken over: {_HELP}.",
            code="sky.color-node",
        )
    if background.inputs["Strength"].is_linked:
        raise SceneError(
            f'The strength of World "{world.name}" is driven by other nodes, which cannot be followed: set '
            "it as a number.",
            code="sky.strength",
        )
    texture = color.node
    if texture.image is None:
        raise SceneError(
            f'The Environment Texture of World "{world.name}" has no image: choose one.', code="sky.no-image"
        )
    if texture.projection != "EQUIRECTANGULAR":
        raise SceneError(
            f'The Environment Texture of World "{world.name}" is a mirror ball: only Equirectangular images '
            "can be taken over.",
            code="sky.mirror-ball",
        )
    rotation, rotation_path = _mapping(texture)
    strength, strength_path = background.inputs["Strength"].default_value, _input_path(background, "Strength")
    if scene.world is not None and scene.world != world:
        rotation = _value_at(scene.world, rotation_path, rotation)
        strength = _value_at(scene.world, strength_path, strength)
    return Sky(
        image=texture.image,
        texture=texture,
        rotation=_angles(rotation),
        strength=strength,
        rotation_path=rotation_path,
        strength_path=strength_path,
    )


def _value_at(world: bpy.types.World, path: str | None, otherwise: Any) -> Any:
    """What a copy of a World has at a path of the World."""
    try:
        return otherwise if path is None else world.path_resolve(path)
    except ValueError:  # the artist has taken the node out
        return otherwise


def read(scene: bpy.types.Scene) -> Sky:
    """The sky that a scene's black hole is rendered with.

    Raises
    ------
    SceneError
        There is none, or it cannot be read.
    """
    settings = scene.umbra
    if settings.environment_source == "WORLD":
        return read_world(scene)
    if settings.environment_image is None:
        raise SceneError(
            "There is no environment: choose a sky image in the Umbra panel, or Sky: World.", code="sky.no-image"
        )
    return Sky(image=settings.environment_image)


def check_image(image: bpy.types.Image) -> None:
    """Refuse an image whose file is missing or unreadable.

    Raises
    ------
    SceneError
        It has no pixels.
    """
    if image.source == "GENERATED" or image.packed_file is not None:
        return
    if image.source == "FILE" and min(image.size) <= 0:
        path = bpy.path.abspath(image.filepath, library=image.library)
        raise SceneError(
            f'The sky image "{image.name}" cannot be loaded from {path}: choose a file that exists.',
            code="sky.image-missing",
        )


# --- the built-in sky -----------------------------------------------------------------------------


def _cache_folder() -> Path:
    """Where the built-in sky is kept between sessions."""
    try:
        return Path(bpy.utils.extension_path_user(PACKAGE, create=True))
    except ValueError:  # not installed as an extension
        return Path(bpy.app.tempdir)


# Stops by which the star sky is brightened when it is chosen. Its values are those of a photograph of a dark night,
# in which the stars would be dim points beside anything lit in the scene.
STAR_SKY_EXPOSURE = 2.5


def load_star_sky() -> bpy.types.Image:
    """The built-in sky of real stars, packed into the file so that the file needs nothing else.

    It is computed once and kept in the extension's own folder.

    Raises
    ------
    physics.BlackHoleError
        That folder cannot be written to.
    """
    image = bpy.data.images.get(STAR_SKY_NAME)
    if image is not None and image.packed_file is not None:
        return image
    path = _cache_folder() / _STAR_SKY_FILE
    if not path.is_file():
        pixels = physics.star_sky(STAR_SKY_HEIGHT)
        physics.write_exr(path, np.minimum(pixels, np.finfo(np.float16).max).astype(np.float16))
    image = bpy.data.images.load(str(path))
    image.name = STAR_SKY_NAME
    if not color_spaces.mark_as_linear_rec709(image):
        print("Umbra: the color configuration has no linear Rec.709, in which the stars are given", flush=True)
    image.pack()
    # no path of this computer in a file that may be passed on
    image.filepath_raw = f"//{_STAR_SKY_FILE}"
    for packed in image.packed_files:
        packed.filepath = image.filepath_raw
    return image
