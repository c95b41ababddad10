# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of the commands that the pages tell people to type."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from pages import ROOT

from physics.cli import main

# Blender's options with the number of values each takes, from `blender --help` of 4.5 and 5.2.
BLENDER_OPTIONS = {
    **dict.fromkeys(("-b", "--background", "-a", "--render-anim", "--factory-startup", "--offline-mode"), 0),
    **dict.fromkeys(("-f", "--render-frame", "-s", "--frame-start", "-e", "--frame-end", "-S", "--scene"), 1),
    **dict.fromkeys(("-o", "--render-output", "-E", "--engine", "-F", "--render-format", "-j", "--frame-jump"), 1),
    **dict.fromkeys(("-P", "--python", "--python-expr", "--python-exit-code", "--addons", "-t", "--threads"), 1),
}
# `blender --command extension install-file`, from its --help.
EXTENSION_OPTIONS = {"-r": 1, "--repo": 1, "-e": 0, "--enable": 0, "-s": 0, "--sync": 0, "--no-prefs": 0}
# What `openjd` takes, from its --help.
OPENJD_COMMANDS = {"check", "summary", "run"}
OPENJD_OPTIONS = {"-p": 1, "--job-param": 1, "--step": 1, "--tasks": 1, "--run-dependencies": 0, "--maximum-tasks": 1}
SMALL = ("--width", "32", "--height", "18")
_ASSIGNMENT = re.compile(r"\w+=\S*")


def commands(code: str) -> list[list[str]]:
    """The commands of a block, each as its words, without comments and what is assigned before."""
    joined = code.replace("\\\n", " ")
    found = []
    for line in joined.splitlines():
        for words in _split(shlex.split(line.removeprefix("$ "), comments=True)):
            while words and _ASSIGNMENT.fullmatch(words[0]):
                words = words[1:]
            if words:
                found.append(words)
    return found


def _split(words: list[str]) -> list[list[str]]:
    parts: list[list[str]] = [[]]
    for word in words:
        if word in ("&&", "&", ";", "|", "||"):
            parts.append([])
        else:
            parts[-1].append(word)
    return parts


class Blender(Protocol):
    """What a line that calls Blender is tried with."""

    def run(self, code: str) -> None:
        """Run Python that is given on the line, in a small scene with a hole."""

    def parse(self, words: list[str]) -> None:
        """Have the add-on's own command parse its words; SystemExit where they are wrong."""


def check(words: list[str], blender: Blender) -> None:
    """Run a command where that is possible in this folder, and else compare it with what it calls."""
    program = os.path.basename(words[0])
    if re.fullmatch(r"python(3(\.\d+)?)?", program):
        _check_python(words[1:])
    elif program == "ssh":
        check(words[2:], blender)  # after the machine's name
    elif program in CHECKS:
        CHECKS[program](words[1:], blender)
    else:
        raise AssertionError(f"nothing knows how to check the command {words[0]}")


def _check_python(words: list[str]) -> None:
    if words[:2] == ["-m", "physics"]:
        arguments = words[2:] + (list(SMALL) if words[2] == "bake" else [])
        assert main(arguments) == 0, words
        return
    script = ROOT / words[0]
    source = script.read_text(encoding="utf-8")
    for word in words[1:]:
        if word.startswith("--"):
            assert f'"{word.split("=")[0]}"' in source, f"{script} has no option {word}"


def _check_make(words: list[str], _blender: Blender) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for word in words:
        if not _ASSIGNMENT.fullmatch(word):
            assert re.search(rf"^{re.escape(word)}:", makefile, re.MULTILINE), f"make has no target {word}"


def _check_blender(words: list[str], blender: Blender) -> None:
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if word in ("-c", "--command"):
            _check_blender_command(rest, blender)
            return
        if word == "--":
            return
        if not word.startswith("-"):
            assert word == "FILE" or Path(word).suffix == ".blend", f"{word} is neither an option nor a file"
            continue
        rest.insert(0, word)
        option, values, rest = _option(rest, BLENDER_OPTIONS, "Blender")
        if option == "--python-expr":
            blender.run(values[0])


def _check_blender_command(words: list[str], blender: Blender) -> None:
    if words[0] == "umbra":
        try:
            blender.parse(words[1:])
        except SystemExit as end:
            if end.code:
                raise AssertionError(f"-c {' '.join(words)} is wrong usage") from end
        return
    assert words[:2] == ["extension", "install-file"], f"nothing knows how to check --command {words[0]}"
    _check_options(words[2:], EXTENSION_OPTIONS, "extension install-file")


def _check_openjd(words: list[str], _blender: Blender) -> None:
    assert words[0] in OPENJD_COMMANDS, f"openjd has no command {words[0]}"
    _check_options(words[1:], OPENJD_OPTIONS, "openjd")


def _check_options(words: list[str], known: dict[str, int], program: str) -> None:
    rest = list(words)
    while rest:
        if rest[0].startswith("-"):
            _name, _values, rest = _option(rest, known, program)
        else:
            rest = rest[1:]


def _option(words: list[str], known: dict[str, int], program: str) -> tuple[str, list[str], list[str]]:
    """The option that the words begin with, its values and the words after it."""
    name = words[0]
    assert name in known, f"{program} has no option {name}"
    values, rest = words[1 : 1 + known[name]], words[1 + known[name] :]
    assert len(values) == known[name], f"{name} takes a value"
    return name, values, rest


CHECKS: dict[str, Callable[[list[str], Blender], None]] = {
    "make": _check_make,
    "blender": _check_blender,
    "openjd": _check_openjd,
}
