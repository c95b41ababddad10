# SPDX-License-Identifier: GPL-3.0-or-later
"""File names: how long they may be, and which can be written as text."""

from __future__ import annotations

import os
from pathlib import Path

# Bytes of a file's name that all common file systems allow.
LONGEST_NAME = 255


def shortened(text: str, most: int) -> str:
    """Return the beginning of a text that takes at most so many bytes in a file's name, without half characters."""
    while len(os.fsencode(text)) > max(most, 0):
        text = text[:-1]
    return text


def brief(path: Path) -> str:
    """Return a path as a message shows it: one that is too long, by its end."""
    text = str(path)
    return text if len(text) <= LONGEST_NAME else f"...{text[-LONGEST_NAME:]}"


def is_text(path: str | os.PathLike[str]) -> bool:
    """Return whether a path can be encoded, which a name that is no UTF-8 cannot be."""
    try:
        os.fspath(path).encode()
    except UnicodeEncodeError:
        return False
    return True
