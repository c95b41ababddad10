# SPDX-License-Identifier: GPL-3.0-or-later
"""The parser of the command line, made from the list of commands."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any, Protocol

from ..images.exr_library import exr_library
from ..numerics import interrupts
from ..numerics.errors import BlackHoleError
from . import accuracy_command, bake_command, console, render_command, verify_command


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
    try:
        interrupts.raise_again()
        console.allow_any_name()
        options = make_parser().parse_args(arguments)
        check_numbers(options)
        exr_library()  # before minutes of work
        options.run(options)
    except BlackHoleError as error:
        return _failed(error)
    except MemoryError:
        return _failed(BlackHoleError("There is not enough memory; make the picture smaller.", code="command.memory"))
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        reason = (error.strerror or str(error)).lower()
        return _failed(BlackHoleError(f"The system refuses: {place}{reason}.", code="command.system"))
    except KeyboardInterrupt:
        console.note(f"\n{interrupts.SENTENCE}")
        return interrupts.STATUS
    return 0


def check_numbers(options: argparse.Namespace) -> None:
    """Check that all numbers among the options are finite.

    Raises
    ------
    BlackHoleError
        If one is not.
    """
    for name, value in vars(options).items():
        for number in value if isinstance(value, list | tuple) else (value,):
            if isinstance(number, float) and not math.isfinite(number):
                raise BlackHoleError(
                    f"--{name.replace('_', '-')} is {number:g}; give a finite number.", code="settings.range"
                )


def _failed(error: BlackHoleError) -> int:
    console.note(f"error: {' '.join(error.for_user().splitlines())}")
    return 1


class Parser(argparse.ArgumentParser):
    """A parser that says so where its help cannot be printed."""

    def print_help(self, file: Any = None) -> None:
        """Print the help, by default on standard output."""
        if file is None:
            console.say(self.format_help().rstrip("\n"))
        else:
            super().print_help(file)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser, with a subparser for each of `COMMANDS`."""
    parser = Parser(prog="python -m physics", description="Warp maps of a spinning black hole, without Blender.")
    commands = parser.add_subparsers(required=True, metavar="command")
    for command in COMMANDS:
        subparser = commands.add_parser(
            command.NAME, help=command.HELP, formatter_class=argparse.ArgumentDefaultsHelpFormatter
        )
        subparser.set_defaults(run=command.run)
        command.add_options(subparser)
    return parser
