# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a render that shows a scene's World finds the images of that."""

import bpy

from ...nodes.world_nodes import MAP_ROLE
from ...scene.sky import sky_frames
from ...scene.sky.node_paths import reachable, world_output


def check(scene: bpy.types.Scene) -> None:
    """Refuse a frame for which an image of the World has no file, and images of UDIM tiles.

    Raises
    ------
    SceneError
        The first one of them, by name.
    """
    world = scene.world
    output = None if world is None else world_output(scene, world)
    if output is None:
        return
    for node in reachable(output.inputs["Surface"]):
        image = getattr(node, "image", None)
        if image is None or MAP_ROLE in node:
            continue
        if image.source == "TILED":
            raise sky_frames.tiled(image)
        sky_frames.check_frame(image, scene.frame_current, node.image_user)
