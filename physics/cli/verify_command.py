# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m physics verify``: read maps and disk passes whole, without Blender, and say which hold."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from pathlib import Path

from ..files import warp_map_file
from ..files.map_check import Finding, State, check_map, stamp_kind
from ..files.map_file import ATTRIBUTE_FORMAT
from ..images.exr import read_exr_header, target_of
from ..numerics.errors import BlackHoleError, ImageFileError
from .console import say

NAME = "verify"
HELP = "read maps and disk passes completely, and say which are valid"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("paths", metavar="MAP.exr|FOLDER", type=Path, nargs="+")


def run(options: argparse.Namespace) -> None:
    """Check the files, print a line for each that does not hold, and the counts.

    Raises
    ------
    BlackHoleError
        When any file is damaged, stale, or missing, or was named and is no map.
    """
    counts: Counter[str] = Counter()
    for path in options.paths:
        folder = os.path.isdir(path)
        for file in _files_in(path) if folder else [path]:
            if folder and target_of(file.name) is not None:
                say(f"{file} was left half written, or is being written")
                continue
            if folder and (file.suffix.lower() != ".exr" or file.name.startswith(".")):
                continue
            found = check_file(file)
            if folder and found.state is State.FOREIGN:
                say(f"{found.fault}: left out")
                continue
            counts[found.state] += 1
            if found.fault:
                say(f"{found.state}: {found.fault}")
    say(", ".join(f"{count} {state}" for state, count in counts.items()) or "no maps")
    faulty = counts.total() - counts[State.VALID]
    if faulty:
        raise BlackHoleError(
            f"{faulty} of {counts.total()} files do not hold; bake them again.", code="command.faulty-maps"
        )


def _files_in(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise BlackHoleError(
            f"The folder {folder} cannot be read: {reason}; change its permissions.", code="folder.not-readable"
        ) from error


def check_file(path: Path) -> Finding:
    """Find out what a file is, of whatever kind of map it may be; any parameters will do."""
    try:
        kind = stamp_kind(read_exr_header(path).get(ATTRIBUTE_FORMAT))
    except ImageFileError:
        kind = None
    found = check_map(path, kind or warp_map_file.FORMAT)
    if kind is None and found.state is State.FOREIGN:
        return Finding(State.FOREIGN, f"{path} is not a map")
    return found
