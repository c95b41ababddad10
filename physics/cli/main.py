# SPDX-License-Identifier: GPL-3.0-or-later
"""The parser of the command line, made from the list of commands."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Protocol

from ..images.exr_library import exr_library
from ..numerics.errors import BlackHoleError
from . import accuracy_command, bake_command, render_command, verify_command


class Command(Protocol):
    """What the module of a command has."""

    NAME: str
    HELP: str

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        """Add the command's options."""

    def run(self, options: argparse.Namespace) -> None:
        """Do the work, or raise BlackHoleError with a sentence for the user."""


COMMANDS: tuple[Command, ...] = (bake_command, render_command, verify_command, accuracy_command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after ``python -m physics``; by default those of the process.

    Returns
    -------
    int
        The exit status: 0 done; 1 failed, with a sentence on standard error; 130 stopped by Ctrl-C. Wrong usage ends
        the process with 2.
    """
    options = make_parser().parse_args(arguments)
    try:
        exr_library()  # before minutes of work
        options.run(options)
    except BlackHoleError as error:
        print(f"error: {error.for_user()}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ncanceled: nothing was written", file=sys.stderr)
        return 130
    return 0


def make_parser() -> argparse.ArgumentParser:
    """Return the parser, with a subparser for each of `COMMANDS`."""
    parser = argparse.ArgumentParser(
        prog="python -m physics", description="Warp maps of a spinning black hole, without Blender."
    )
    commands = parser.add_subparsers(required=True, metavar="command")
    for command in COMMANDS:
        subparser = commands.add_parser(
            command.NAME, help=command.HELP, formatter_class=argparse.ArgumentDefaultsHelpFormatter
        )
        subparser.set_defaults(run=command.run)
        command.add_options(subparser)
    return parser
