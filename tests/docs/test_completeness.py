# SPDX-License-Identifier: GPL-3.0-or-later
"""What there is to set and to call has a place in the manual."""

import argparse
import ast

from pages import DOCS, ROOT

import physics
from physics.cli import make_parser

ADDON = sorted((ROOT / "blender_addon").rglob("*.py"))
MANUAL = "\n".join(page.read_text(encoding="utf-8") for page in sorted(DOCS.glob("*.md")))


def command_line_options():
    (commands,) = [each for each in make_parser()._actions if isinstance(each, argparse._SubParsersAction)]
    for command, parser in commands.choices.items():
        yield command, f"python -m physics {command}"
        for action in parser._actions:
            if action.option_strings and action.dest != "help" and action.help != argparse.SUPPRESS:
                yield command, f"`{action.option_strings[-1]}"


def test_command_line_options_are_described():
    assert not [(command, wanted) for command, wanted in command_line_options() if wanted not in MANUAL]


# Settings that no panel shows: what the add-on keeps for itself.
UNSEEN = {"foreground_scene", "look_version", "map_names"}


def properties():
    """Labels of the add-on's settings, as its panels show them."""
    for file in ADDON:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.AnnAssign) and isinstance(node.annotation, ast.Call):
                if any(keyword.arg == "get" for keyword in node.annotation.keywords):
                    continue  # computed, for drivers
                named = [keyword.value for keyword in node.annotation.keywords if keyword.arg == "name"]
                for label in (named or node.annotation.args)[:1]:
                    if isinstance(label, ast.Constant) and node.target.id not in UNSEEN:
                        yield f"{file.stem}.{node.target.id}", label.value
    for name, setting in (physics.MATTER_SETTINGS | physics.SKY_SETTINGS).items():
        yield f"tables.{name}", setting.label


def test_settings_are_described():
    assert not [(where, label) for where, label in properties() if label not in MANUAL]


def operators():
    """Names of the add-on's operators that are not its own affair."""
    for file in ADDON:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and node.name.startswith("UMBRA_OT_"):
                values = {
                    each.targets[0].id: each.value for each in node.body
                    if isinstance(each, ast.Assign) and isinstance(each.targets[0], ast.Name)
                }  # fmt: skip
                if "INTERNAL" not in ast.dump(values.get("bl_options", ast.Constant(""))):
                    yield values["bl_idname"].value, values["bl_label"].value


def test_operators_are_described():
    assert not [(name, label) for name, label in operators() if label not in MANUAL and name not in MANUAL]


def test_what_is_looked_for_is_found():
    assert ("bake", "`--spin") in list(command_line_options())
    assert ("hole_properties.spin", "Spin") in list(properties())
    assert ("tables.depth", "Optical Depth") in list(properties())
    assert ("umbra.bake_frame", "Bake This Frame") in list(operators())
