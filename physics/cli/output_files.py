# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of the files that a command writes, before any work: none of them may cost the user another file."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..files.map_check import State, check_map, stamp_kind
from ..files.map_file import ATTRIBUTE_FORMAT, MapFormat
from ..images.exr import check_target, read_exr_header
from ..numerics.errors import BlackHoleError, ImageFileError


def check_maps(outputs: Mapping[Path, MapFormat]) -> None:
    """Check that maps can be written, over nothing but former maps.

    Parameters
    ----------
    outputs : mapping
        The kind of map that each file will be.

    Raises
    ------
    BlackHoleError
        If a file there is anything but a map of the same kind.
    ImageFileError
        If a file cannot be written.
    """
    for path, kind in outputs.items():
        check_target(path)
        found = check_map(path, kind, thorough=False)
        if found.state is State.FOREIGN:
            raise BlackHoleError(
                f"{found.fault}, and would be lost; choose another name, or remove it.", code="command.overwrites"
            )


def check_picture(output: Path, inputs: Iterable[Path]) -> None:
    """Check that a picture can be written, over no file that it is made from and over no map.

    Parameters
    ----------
    output : path
    inputs : iterable of path
        They are compared as files, so that links and other spellings of a path count as the file itself.

    Raises
    ------
    BlackHoleError
        If the output is one of the inputs, or a map.
    ImageFileError
        If it cannot be written.
    """
    check_target(output)
    if not os.path.exists(output):
        return
    for path in inputs:
        if os.path.exists(path) and os.path.samefile(path, output):
            raise BlackHoleError(
                f"{output} is what the picture is made from, and would be lost; choose another name.",
                code="command.overwrites",
            )
    try:
        kind = stamp_kind(read_exr_header(output).get(ATTRIBUTE_FORMAT))
    except ImageFileError:
        return
    if kind is not None:
        raise BlackHoleError(
            f"{output} is {kind.noun}, and would be lost; choose another name, or remove it.",
            code="command.overwrites",
        )
