# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of panels: sentences that are wrapped to the panel's width, and the inputs of nodes."""

from collections.abc import Callable, Iterable
from typing import Any

import blf
import bpy

# Pixels at an interface scale of 1: the sidebar as Blender first shows it, what of that a line of text does not have
# (tabs, margins and icon), and the narrowest line.
SIDEBAR, MARGIN, NARROWEST = 292.0, 82.0, 120.0


def wrapped(text: str) -> list[str]:
    """Return a sentence as lines that fit the panel being drawn."""
    region, scale = bpy.context.region, _scale()
    width = SIDEBAR * scale if region is None else region.width
    return fill(text, max(width - MARGIN * scale, NARROWEST * scale), width_of)


def _scale() -> float:
    return bpy.context.preferences.system.ui_scale or 1.0  # 0 before a window was drawn


def width_of(text: str) -> float:
    """Return the width of a text in the interface's font, pixels."""
    blf.size(0, bpy.context.preferences.ui_styles[0].widget.points * _scale())
    width: float = blf.dimensions(0, text)[0]
    return width


def fill(text: str, width: float, measure: Callable[[str], float]) -> list[str]:
    """Return a text as lines no wider than a width, broken between words, and within those that are wider alone."""
    lines = [""]
    for word in text.split():
        joined = f"{lines[-1]} {word}".lstrip()
        if measure(joined) <= width:
            lines[-1] = joined
            continue
        if lines[-1]:
            lines.append("")
        for character in word:
            if lines[-1] and measure(lines[-1] + character) > width:
                lines.append("")
            lines[-1] += character
    return lines


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
