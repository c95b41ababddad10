# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether Blender renders the strips of a scene's sequencer in place of the scene."""

import bpy

from ...core.errors import SceneError


def check(scene: bpy.types.Scene) -> None:
    """Refuse to render a scene whose sequencer is rendered in its place.

    Raises
    ------
    SceneError
        If it has a strip of pictures that is not muted, and Sequencer is switched on.
    """
    editor = scene.sequence_editor
    if editor is None or not scene.render.use_sequencer:
        return
    strips = editor.strips
    shown = [each for each in strips if not (each.type == "SOUND" or each.mute or editor.channels[each.channel].mute)]
    if shown:
        raise SceneError(
            f'The sequencer of scene "{scene.name}" has the strip "{shown[0].name}", and Blender renders the strips '
            "instead of the scene: switch Sequencer off in Output Properties > Post Processing, or edit in a scene of "
            "its own.",
            code="render.sequencer",
        )
