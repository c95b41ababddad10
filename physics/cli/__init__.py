# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line `python -m physics`, one module per command; `main.COMMANDS` lists them.

Imports every room below. Hands on `main`.
"""

from .main import main, make_parser

__all__ = ["main", "make_parser"]
