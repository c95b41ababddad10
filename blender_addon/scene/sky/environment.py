# SPDX-License-Identifier: GPL-3.0-or-later
"""The sky around the hole: the World's, an image, or the built-in sky of real stars."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import bpy
from mathutils import Euler

from ...core.blender_version import NODES_ARE_OPTIONAL
from ...core.errors import SceneError
from . import followed, panorama, sky_alpha, sky_frames, world_digest
from .node_paths import SHINING, Place, source, world_output

# On a scene whose World is replaced, by a lensed copy or by one that shows the sky's image: the World itself.
WORLD_BEFORE = "umbra_world_before"

STAR_SKY_NAME = "Umbra Star Sky"

# Codes of Worlds that show no picture of a sky.
NO_SKY = frozenset({"sky.plain-color", "sky.no-world"})

_HELP = "connect Environment Texture > Background > World Output, or choose Sky: Image in the Umbra panel"

# The engine whose Worlds have an image's alpha multiplied in before its colors are decoded.
_CYCLES = "CYCLES"


@dataclass(frozen=True)
class Sky:
    """An equirectangular environment and how it is placed."""

    image: bpy.types.Image
    texture: bpy.types.Node | None = None
    """The World's Environment Texture node, whose frame settings an animated image needs."""
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Euler XYZ, radians, as in a Mapping node of type Point."""
    strength: float = 1.0
    rotation_at: Place | None = None
    """Where the World holds the rotation, to be followed; None where it is fixed."""
    strength_at: Place | None = None


class _NoPlainImageError(SceneError):
    """A World is more than an image with rotation and strength."""


def _angles(rotation: Iterable[float]) -> tuple[float, float, float]:
    x, y, z = rotation
    return x, y, z


def _no_plain_image(world: bpy.types.World, node: bpy.types.Node) -> _NoPlainImageError:
    return _NoPlainImageError(
        f'World "{world.name}" makes its sky with the node "{node.name}", which is no plain image: {_HELP}.',
        code="sky.panorama",
    )


def _rotation(world: bpy.types.World, texture: Place) -> tuple[tuple[float, float, float], Place | None]:
    """Rotation of the sky before an Environment Texture, and where to follow it."""
    origin = texture.input("Vector")
    mapping = None
    if origin.is_output and origin.node.type == "MAPPING":
        mapping = origin
        origin = mapping.input("Vector")
    if origin.is_output and (origin.node.type != "TEX_COORD" or origin.socket.name != "Generated"):
        raise _no_plain_image(world, origin.node)
    if mapping is None:
        if origin.node != texture.node:  # a vector that is the same everywhere
            raise _no_plain_image(world, origin.node)
        return (0.0, 0.0, 0.0), None
    node = mapping.node
    if not origin.is_output:
        raise _no_plain_image(world, node)
    values = {name: mapping.input(name) for name in ("Location", "Rotation", "Scale")}
    has_location = node.vector_type in {"POINT", "TEXTURE"}
    moves = has_location and (values["Location"].is_output or any(values["Location"].value))
    if moves or values["Rotation"].is_output or values["Scale"].is_output or tuple(values["Scale"].value) != (1, 1, 1):
        raise _no_plain_image(world, node)
    rotation = Euler(values["Rotation"].value, "XYZ")
    if node.vector_type == "TEXTURE":
        return _angles(rotation.to_matrix().inverted().to_euler("XYZ")), None
    return _angles(rotation), values["Rotation"]


def _world_of(scene: bpy.types.Scene) -> bpy.types.World:
    world: bpy.types.World | None = scene.get(WORLD_BEFORE, scene.world)
    if world is None:
        raise SceneError(
            f'Scene "{scene.name}" has no World: add one, or choose Sky: Image in the Umbra panel.', code="sky.no-world"
        )
    return world


def _output_of(scene: bpy.types.Scene, world: bpy.types.World) -> bpy.types.Node:
    """The output of a World whose surface is made by nodes."""
    if world.node_tree is None or (NODES_ARE_OPTIONAL and not world.use_nodes):
        raise _plain_color(world)
    output: bpy.types.Node | None = world_output(scene, world)
    if output is None or not output.inputs["Surface"].is_linked:
        raise SceneError(
            f'World "{world.name}" is not a Background, so its sky cannot be taken over: {_HELP}.',
            code="sky.no-background",
        )
    return output


def _plain_color(world: bpy.types.World) -> SceneError:
    return SceneError(f'World "{world.name}" is a plain color and has no environment: {_HELP}.', code="sky.plain-color")


def _plain_image(world: bpy.types.World, output: bpy.types.Node) -> Sky:
    """The sky of a World that is an image with rotation and strength."""
    background = source(Place(output.inputs["Surface"]))
    if not background.is_output or background.node.type not in SHINING:
        raise _no_plain_image(world, background.node)
    texture, strength = background.input("Color"), background.input("Strength")
    if not texture.is_output:
        raise _plain_color(world)
    if texture.node.type != "TEX_ENVIRONMENT" or texture.node.projection != "EQUIRECTANGULAR":
        raise _no_plain_image(world, texture.node)
    image = texture.node.image
    if image is None:
        raise SceneError(
            f'The Environment Texture of World "{world.name}" has no image: choose one.', code="sky.no-image"
        )
    if image.source == "TILED":
        raise sky_frames.tiled(image)
    if strength.is_output:
        raise _no_plain_image(world, strength.node)
    rotation, rotation_at = _rotation(world, texture)
    return Sky(image, texture.node, rotation, strength.value, rotation_at, strength)


def _image_as_shown(scene: bpy.types.Scene, image: bpy.types.Image, *, may_render: bool) -> bpy.types.Image:
    """The image as a World shows it: Cycles multiplies the alpha of 8-bit images into colors as they are encoded."""
    if scene.render.engine != _CYCLES or not sky_alpha.counts(image):
        return image
    if may_render:
        return panorama.of_image(image)
    return panorama.find(world_digest.of_image(image)) or _missing_panorama(f'the sky image "{image.name}"')


def _panorama_of(world: bpy.types.World, output: bpy.types.Node, *, may_render: bool) -> Sky:
    """The sky of any other World."""
    parts = followed.of(world, output)
    refusal = panorama.problem(world, output, parts)
    if refusal is not None:
        raise refusal from None
    if may_render:
        image = panorama.of_world(world, output, parts)
    else:
        image = panorama.find(world_digest.of_world(output, parts)) or _missing_panorama(f'World "{world.name}"')
    sky = Sky(image, rotation_at=parts.rotation, strength_at=parts.strength)
    if parts.rotation is not None:
        sky = replace(sky, rotation=_angles(parts.rotation.value))
    return sky if parts.strength is None else replace(sky, strength=parts.strength.value)


def _missing_panorama(what: str) -> bpy.types.Image:
    raise SceneError(
        f"There is no panorama of {what} as it is now, and a render cannot make one: press Update Compositor in the "
        "Umbra panel.",
        code="sky.panorama",
    )


def alpha_note(scene: bpy.types.Scene, *, may_load: bool) -> str | None:
    """Return a warning where the compositor shows an image sequence brighter than Cycles shows it as a World, if so.

    Parameters
    ----------
    scene : Scene
        The scene.
    may_load : bool
        Whether a file of the sequence is read for this. Otherwise what is known of it counts.
    """
    if scene.render.engine != _CYCLES:
        return None
    try:
        return sky_alpha.note(read(scene).image, may_load=may_load)
    except SceneError:
        return None


def read_world(scene: bpy.types.Scene, *, may_render: bool = False) -> Sky:
    """The sky that a scene's World shows, or the one that its lensed World was made from, as that places it now.

    Parameters
    ----------
    scene : Scene
        The scene.
    may_render : bool
        Whether a panorama of a World that is no plain image is rendered where there is none. Not inside a render.

    Raises
    ------
    SceneError
        The World is missing, is a plain color, or cannot be shown by an image.
    """
    world = _world_of(scene)
    output = _output_of(scene, world)
    try:
        sky = _plain_image(world, output)
    except _NoPlainImageError:
        sky = _panorama_of(world, output, may_render=may_render)
    image = _image_as_shown(scene, sky.image, may_render=may_render)
    rotation, strength = sky.rotation, sky.strength
    if scene.world is not None and scene.world != world:
        rotation = _value_at(scene.world, world, sky.rotation_at, rotation)
        strength = _value_at(scene.world, world, sky.strength_at, strength)
    return replace(sky, image=image, rotation=_angles(rotation), strength=strength)


def _value_at(copy: bpy.types.World, world: bpy.types.World, place: Place | None, otherwise: Any) -> Any:
    """What a copy of a World has at a place of the World."""
    if place is None or place.owner != world.node_tree:
        return otherwise
    try:
        return copy.node_tree.path_resolve(place.path)
    except ValueError:  # the artist has taken the node out
        return otherwise


def is_star_sky(image: bpy.types.Image | None) -> bool:
    """Return whether an image is the built-in sky with its stars."""
    return image is not None and is_named(image, STAR_SKY_NAME)


def is_named(image: bpy.types.Image, name: str) -> bool:
    """Return whether an image has a name, or the name with the number that Blender gives what is appended."""
    return re.fullmatch(rf"{re.escape(name)}(\.\d+)?", image.name) is not None


def shows_stars(scene: bpy.types.Scene) -> bool:
    """Return whether the built-in stars are the scene's sky."""
    settings = scene.umbra
    image = settings.environment_image
    return settings.environment_source == "IMAGE" and is_star_sky(image)


def world_left_out(scene: bpy.types.Scene) -> str | None:
    """Return why a World that is more than a color is not the sky, where the stars are shown instead of it."""
    if not shows_stars(scene):
        return None
    try:
        world = _world_of(scene)
        output = _output_of(scene, world)
        _plain_image(world, output)
    except _NoPlainImageError:
        refusal = panorama.problem(world, output, followed.of(world, output))
    except SceneError as error:
        refusal = error
    else:
        return None
    if refusal is None or refusal.code in NO_SKY:
        return None
    return f"The stars are shown and not the World. {refusal.for_user()}"


# On the scene: the stars are its sky because the World, which is more than a color, cannot be shown by an image.
_LEFT_OUT = "umbra_world_left_out"


def leave_world(scene: bpy.types.Scene, image: bpy.types.Image | None) -> None:
    """Choose an image as the sky, in place of a World that no image can show."""
    settings = scene.umbra
    scene[_LEFT_OUT] = True
    settings.environment_image = image
    settings.environment_source = "IMAGE"


def take_world(scene: bpy.types.Scene) -> bool:
    """Choose the World again where only an image could not show it; return whether that was so."""
    settings = scene.umbra
    was_left_out = scene.get(_LEFT_OUT) is not None and settings.environment_source == "IMAGE"
    if _LEFT_OUT in scene:
        del scene[_LEFT_OUT]
    image = settings.environment_image
    if not was_left_out or not is_star_sky(image):
        return False
    settings.environment_source = "WORLD"
    return True


def prepare(scene: bpy.types.Scene) -> None:
    """Render the panorama that a scene's sky needs, if it needs one and it is not there.

    Raises
    ------
    SceneError
        There is no sky, or it cannot be read.
    """
    settings = scene.umbra
    if settings.environment_source == "WORLD":
        read_world(scene, may_render=True)
    elif settings.environment_image is not None and settings.environment_image.source != "TILED":
        _image_as_shown(scene, settings.environment_image, may_render=True)


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
    return Sky(_image_as_shown(scene, chosen_image(scene), may_render=False))


def chosen_image(scene: bpy.types.Scene) -> bpy.types.Image:
    """The image chosen as the sky.

    Raises
    ------
    SceneError
        There is none, or it has several tiles.
    """
    image = scene.umbra.environment_image
    if image is None:
        raise SceneError(
            "There is no environment: choose a sky image in the Umbra panel, or Sky: World.", code="sky.no-image"
        )
    if image.source == "TILED":
        raise sky_frames.tiled(image)
    return image


def check_image(image: bpy.types.Image) -> None:
    """Refuse an image whose file is missing or unreadable.

    Raises
    ------
    SceneError
        It has no pixels.
    """
    if sky_frames.is_packed(image) or image.source != "FILE" or min(image.size) > 0:
        return
    # an OpenEXR file of several layers is no image, but a render result: it has no size of its own
    if image.type != "MULTILAYER" or not sky_frames.path_of(image).is_file():
        raise sky_frames.image_missing(image)


# --- the built-in sky, which `bake.star_sky` makes --------------------------------------------------

# Stops by which the star sky is brightened when it is chosen. Its values are those of a photograph of a dark night,
# in which the stars would be dim points beside anything lit in the scene.
STAR_SKY_EXPOSURE = 2.5
