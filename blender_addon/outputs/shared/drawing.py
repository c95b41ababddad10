# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of panels: sentences that are wrapped to the panel's width, and the inputs of nodes."""

import textwrap
from collections.abc import Iterable
from typing import Any

import bpy

# How many characters a line of a panel shows: its width less margins and icon, over a character's mean width, in
# pixels at an interface scale of 1.
MARGIN, CHARACTER_WIDTH = 50.0, 6.0
SHORTEST_LINE, ORDINARY_LINE = 20, 40


def _line_width() -> int:
    region = bpy.context.region
    if region is None:
        return ORDINARY_LINE
    scale = bpy.context.preferences.system.ui_scale
    return max(int((region.width / scale - MARGIN) / CHARACTER_WIDTH), SHORTEST_LINE)


def wrapped(text: str) -> list[str]:
    """Return a sentence as lines that fit the panel being drawn."""
    return textwrap.wrap(text, _line_width())


def draw_problem(layout: bpy.types.UILayout, text: str, icon: str = "ERROR") -> None:
    """Draw a sentence, the icon in front of its first line."""
    column = layout.column(align=True)
    for index, line in enumerate(wrapped(text)):
        column.label(text=line, icon=icon if index == 0 else "BLANK1")


def draw_sky_choice(layout: bpy.types.UILayout, settings: Any) -> None:
    """Draw where the sky comes from."""
    layout.row().prop(settings, "environment_source", expand=True)
    if settings.environment_source == "IMAGE":
        layout.template_ID(settings, "environment_image", open="image.open")


def draw_inputs(layout: bpy.types.UILayout, node: bpy.types.Node, names: Iterable[str]) -> None:
    """Draw those inputs of a node that are not linked."""
    for name in names:
        socket = node.inputs.get(name)
        if socket is not None and not socket.is_linked:
            layout.prop(socket, "default_value", text=name)
