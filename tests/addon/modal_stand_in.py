# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators that run beside the interface need of Blender's window, for tests without one."""

from types import SimpleNamespace

import bpy

TIMER = SimpleNamespace(type="TIMER", value="NOTHING")
ESCAPE = SimpleNamespace(type="ESC", value="PRESS")
MOUSE = SimpleNamespace(type="MOUSEMOVE", value="NOTHING")


class Window:
    """What the modal operator needs of Blender's window, for a test without one."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.scene = scene
        self.view_layer = scene.view_layers[0]
        self.window = object()
        self.workspace = SimpleNamespace(status_text_set=lambda text: setattr(self, "status", text))
        self.status = ""
        self.removed = 0
        self.window_manager = SimpleNamespace(
            windows=[],
            progress_begin=lambda *_: None,
            progress_update=lambda _: None,
            progress_end=lambda: None,
            event_timer_add=lambda *_, **__: "timer",
            event_timer_remove=lambda _: setattr(self, "removed", self.removed + 1),
            modal_handler_add=lambda _: None,
        )
