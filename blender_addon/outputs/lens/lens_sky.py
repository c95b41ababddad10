# SPDX-License-Identifier: GPL-3.0-or-later
"""The sky's image behind the lens: a World that shows it, for as long as the output is the lens.

With Sky: World the scene's own World is the sky. A World that is chosen by hand meanwhile is shown, and stays.
"""

from typing import Any

import bpy

from ...scene.sky import environment, image_world
from ..protocol import Look
from ..shared.look import EXPOSURE, PLACEMENT

# On the scene: which sky was last put behind the lens. Files of before this version lack it, and stay as they are.
CHOICE = "umbra_lens_sky"
# On our World.
OURS = "umbra_sky_image"

_EXPOSURE_NODE = "Umbra Exposure"


def world_of_image(scene: bpy.types.Scene) -> bpy.types.World | None:
    """Return the scene's World if it is one of ours."""
    world = scene.world
    return world if world is not None and OURS in world else None


def install(scene: bpy.types.Scene, look: Look) -> None:
    """Put the sky of the settings behind the lens."""
    settings = scene.umbra
    scene[CHOICE] = settings.environment_source
    if settings.environment_source != "IMAGE" or settings.environment_image is None:
        return
    world = world_of_image(scene)
    if world is None:
        world = _make(environment.chosen_image(scene))
        if scene.world is not None:
            scene[environment.WORLD_BEFORE] = scene.world
        scene.world = world
        for name, socket in _controls(world).items():
            if name in look:
                socket.default_value = look[name]
    image_world.show(world, environment.chosen_image(scene))


def refresh(scene: bpy.types.Scene) -> None:
    """Follow a change of the settings."""
    settings = scene.umbra
    if CHOICE not in scene or scene.library is not None:
        return
    if scene[CHOICE] != settings.environment_source:
        if settings.environment_source == "WORLD":
            remove(scene)
            scene[CHOICE] = settings.environment_source
        else:
            install(scene, {})
        return
    world = world_of_image(scene)
    if world is not None and settings.environment_image is not None:
        image_world.show(world, environment.chosen_image(scene))


def remove(scene: bpy.types.Scene) -> None:
    """Put back the World that was there; one that was chosen by hand since then stays."""
    ours = world_of_image(scene)
    if ours is not None:
        scene.world = scene.get(environment.WORLD_BEFORE)
        if ours.users == 0:
            bpy.data.worlds.remove(ours)
    if CHOICE in scene:
        del scene[CHOICE]
        if environment.WORLD_BEFORE in scene:
            del scene[environment.WORLD_BEFORE]


def look(scene: bpy.types.Scene) -> Look:
    """Return how the image is placed and how bright it is."""
    world = world_of_image(scene)
    if world is None:
        return {}
    values = {name: socket.default_value for name, socket in _controls(world).items()}
    return {name: value if isinstance(value, float) else tuple(value) for name, value in values.items()}


def controls(scene: bpy.types.Scene) -> dict[str, Any]:
    """Return the sockets that hold these values, for the panel."""
    world = world_of_image(scene)
    return {} if world is None else _controls(world)


def hidden_by(scene: bpy.types.Scene) -> bpy.types.World | None:
    """Return the World that was chosen by hand and is shown in place of the image, if so."""
    is_image = scene.get(CHOICE) == "IMAGE" and scene.umbra.environment_source == "IMAGE"
    if not is_image or scene.umbra.environment_image is None or world_of_image(scene) is not None:
        return None
    return scene.world


def brighten_stars(scene: bpy.types.Scene) -> None:
    """Brighten the star sky, unless the artist has set an exposure."""
    exposure = controls(scene).get(EXPOSURE)
    if exposure is not None and exposure.default_value == 0.0:
        exposure.default_value = environment.STAR_SKY_EXPOSURE


def _make(image: bpy.types.Image) -> bpy.types.World:
    """A World of the image, whose colors are multiplied by two to the power of an exposure."""
    world = image_world.make(f"{image.name} (sky)", image)
    world[OURS] = True
    tree = world.node_tree
    texture = image_world.texture(world)
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    power, scaled = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeVectorMath")
    power.operation, scaled.operation = "POWER", "SCALE"
    power.name = power.label = _EXPOSURE_NODE
    power.inputs[0].default_value, power.inputs[1].default_value = 2.0, 0.0
    power.location, scaled.location = (texture.location.x, -280.0), (texture.location.x + 220.0, -280.0)
    tree.links.new(texture.outputs["Color"], scaled.inputs[0])
    tree.links.new(power.outputs[0], scaled.inputs["Scale"])
    tree.links.new(scaled.outputs[0], background.inputs["Color"])
    return world


def _controls(world: bpy.types.World) -> dict[str, Any]:
    """The values of such a World, by the names of the compositor's sockets that say the same."""
    found = {PLACEMENT[name]: socket for name, socket in image_world.placement(world).items()}
    power = world.node_tree.nodes.get(_EXPOSURE_NODE)
    return found if power is None else found | {EXPOSURE: power.inputs[1]}
