# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels say fits the sidebar as Blender first shows it, and the buttons that they offer help."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType, SimpleNamespace
from typing import Any

import bpy
import pytest
from small_scene import add_hole

# Pixels in a window of scale 1, measured on screenshots of Blender 5.2: a line beside an icon, a name beside its field,
# that of a switch behind its box, a name in front of a value within a field.
LINE, BESIDE, SWITCH, WITHIN = 210, 78, 100, 150

OUTPUTS = ["COMPOSITOR", "CYCLES_LENS", "WORLD"]


@dataclass
class Layout:
    """Stands in for Blender's layout, and remembers all texts and how much room each has."""

    texts: list[tuple[str, float]] = field(default_factory=list)
    buttons: list[str] = field(default_factory=list)
    use_property_split: bool = False

    def row(self, **_options: object) -> Layout:
        return Layout(self.texts, self.buttons, self.use_property_split)

    column = split = box = row

    def label(self, text: str = "", **_options: object) -> None:
        self.texts.append((text, LINE))

    def prop(self, owner: Any, name: str, text: str | None = None, **options: object) -> None:
        setting = owner.bl_rna.properties[name]
        label = setting.name if text is None else text
        beside = SWITCH if setting.type == "BOOLEAN" else BESIDE
        if not options.get("expand"):
            self.texts.append((label, beside if self.use_property_split else WITHIN))

    def operator(self, name: str, text: str | None = None, **_options: object) -> SimpleNamespace:
        self.buttons.append(name)
        category, function = name.split(".")
        label = getattr(getattr(bpy.ops, category), function).get_rna_type().name if text is None else text
        self.texts.append((label, WITHIN))
        return SimpleNamespace()

    def operator_menu_enum(self, *_arguments: object, **_options: object) -> None:
        pass

    template_ID = template_icon = separator = progress = operator_menu_enum


@pytest.fixture
def panels(addon: ModuleType) -> Callable[[], Layout]:
    """A function that draws all panels of the sidebar."""

    def draw() -> Layout:
        layout = Layout()
        found = [each for each in bpy.types.Panel.__subclasses__() if each.__module__.startswith(f"{addon.__name__}.")]
        names = {getattr(each, "bl_idname", None) or each.__name__: each for each in found}
        for panel in [each for each in found if getattr(each, "bl_category", "") == "Umbra"]:
            parent = names.get(getattr(panel, "bl_parent_id", None))
            polls = [each.poll for each in (parent, panel) if hasattr(each, "poll")]
            if all(poll(bpy.context) for poll in polls):
                panel.draw(SimpleNamespace(layout=layout), bpy.context)
                layout.use_property_split = False
        return layout

    return draw


@pytest.mark.parametrize("output", OUTPUTS)
def test_all_texts_fit_the_sidebar(
    scene: bpy.types.Scene, panels: Callable[[], Layout], addon_module: Callable[[str], ModuleType], output: str
) -> None:
    hole = add_hole(scene)
    hole.umbra.disk.texture = scene.umbra.environment_image
    hole.umbra.disk.enabled = hole.umbra.disk.light = True
    hole.umbra.motion = "CAMERA_ANIMATION"
    scene.umbra.quality = "CUSTOM"
    bpy.ops.umbra.set_output(output=output)
    width_of = addon_module("outputs.shared.drawing").width_of
    layout = panels()
    assert len(layout.texts) > 40
    assert [(text, width_of(text)) for text, room in layout.texts if width_of(text) > room] == []


def test_long_sentences_are_broken_between_words(addon_module: Callable[[str], ModuleType]) -> None:
    drawing = addon_module("outputs.shared.drawing")
    assert drawing.fill("one two three", 7, len) == ["one two", "three"]
    assert drawing.fill("one incomprehensible word", 8, len) == ["one", "incompre", "hensible", "word"]
    sentence = "WWWW mmmm " * 12 + "or take the compositor set-up out with Remove from Compositor."
    lines = drawing.wrapped(sentence)
    assert " ".join(lines) == " ".join(sentence.split())
    assert max(map(drawing.width_of, lines)) <= LINE


def test_a_choice_is_offered_where_none_of_several_is_rendered(
    scene: bpy.types.Scene, panels: Callable[[], Layout]
) -> None:
    hole = add_hole(scene)
    scene.collection.objects.link(hole.copy())
    scene.umbra.active_hole = None
    layout = panels()
    assert "umbra.add_black_hole" not in layout.buttons
    assert "Black Hole" in [text for text, _room in layout.texts]


def test_the_lens_offers_its_engine(scene: bpy.types.Scene, panels: Callable[[], Layout]) -> None:
    """Chosen in another engine it is refused, unless the switch is wanted as well; the panel has a button for it."""
    eevee = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
    add_hole(scene)
    scene.render.engine = eevee
    with pytest.raises(RuntimeError, match="needs the render engine Cycles"):
        bpy.ops.umbra.set_output(output="CYCLES_LENS")
    assert (scene.render.engine, scene.umbra.output) == (eevee, "COMPOSITOR")
    assert bpy.ops.umbra.set_output(output="CYCLES_LENS", switch_engine=True) == {"FINISHED"}
    assert (scene.render.engine, scene.umbra.output) == ("CYCLES", "CYCLES_LENS")
    assert "umbra.use_cycles" not in panels().buttons
    scene.render.engine = eevee
    assert "umbra.use_cycles" in panels().buttons
    assert bpy.ops.umbra.use_cycles() == {"FINISHED"}
    assert scene.render.engine == "CYCLES"


def test_an_engine_stays_where_the_output_fails(scene: bpy.types.Scene) -> None:
    add_hole(scene)
    before = scene.render.engine = "BLENDER_WORKBENCH"
    scene.camera = None
    with pytest.raises(RuntimeError, match="has no camera"):
        bpy.ops.umbra.set_output(output="CYCLES_LENS", switch_engine=True)
    assert (scene.render.engine, scene.umbra.output) == (before, "COMPOSITOR")
