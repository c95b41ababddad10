# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of the commands that the pages tell people to type."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable
from pathlib import Path

from pages import ROOT

from physics.__main__ import main

# Blender's options with the number of values each takes, from `blender --help` of 4.5 and 5.2.
BLENDER_OPTIONS = {
    **dict.fromkeys(("-b", "--background", "-a", "--render-anim", "--factory-startup", "--offline-mode"), 0),
    **dict.fromkeys(("-f", "--render-frame", "-s", "--frame-start", "-e", "--frame-end", "-S", "--scene"), 1),
    **dict.fromkeys(("-o", "--render-output", "-E", "--engine", "-F", "--render-format", "-j", "--frame-jump"), 1),
    **dict.fromkeys(("-P", "--python", "--python-expr", "--python-exit-code", "--addons", "-t", "--threads"), 1),
}
# `blender --command extension install-file`, from its --help.
EXTENSION_OPTIONS = {"-r": 1, "--repo": 1, "-e": 0, "--enable": 0, "-s": 0, "--sync": 0, "--no-prefs": 0}
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
        if word in ("&&", ";", "|", "||"):
            parts.append([])
        else:
            parts[-1].append(word)
    return parts


def check(words: list[str], run_in_blender: Callable[[str], None]) -> None:
    """Run a command where that is possible in this folder, and else compare it with what it calls.

    Python that Blender is given is handed to `run_in_blender`.
    """
    program = os.path.basename(words[0])
    if re.fullmatch(r"python(3(\.\d+)?)?", program):
        _check_python(words[1:])
    elif program in CHECKS:
        CHECKS[program](words[1:], run_in_blender)
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


def _check_make(words: list[str], _run: Callable[[str], None]) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for word in words:
        if not _ASSIGNMENT.fullmatch(word):
            assert re.search(rf"^{re.escape(word)}:", makefile, re.MULTILINE), f"make has no target {word}"


def _check_blender(words: list[str], run: Callable[[str], None]) -> None:
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if word in ("-c", "--command"):
            _check_blender_command(rest)
            return
        if word == "--":
            return
        if not word.startswith("-"):
            assert word == "FILE" or Path(word).suffix == ".blend", f"{word} is neither an option nor a file"
            continue
        assert word in BLENDER_OPTIONS, f"Blender has no option {word}"
        values, rest = rest[: BLENDER_OPTIONS[word]], rest[BLENDER_OPTIONS[word] :]
        assert len(values) == BLENDER_OPTIONS[word], f"{word} takes a value"
        if word == "--python-expr":
            run(values[0])


def _check_blender_command(words: list[str]) -> None:
    assert words[:2] == ["extension", "install-file"], f"nothing knows how to check --command {words[0]}"
    rest = words[2:]
    while rest:
        word = rest.pop(0)
        if word.startswith("-"):
            assert word in EXTENSION_OPTIONS, f"extension install-file has no option {word}"
            del rest[: EXTENSION_OPTIONS[word]]


CHECKS: dict[str, Callable[[list[str], Callable[[str], None]], None]] = {
    "make": _check_make,
    "blender": _check_blender,
}
