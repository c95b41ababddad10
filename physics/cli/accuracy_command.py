# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m physics accuracy``: how exact a map on disk is."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from ..accuracy_check.accuracy import DEFAULT_ENVIRONMENT_WIDTH, DEFAULT_SAMPLES, check_accuracy
from ..files.disk_pass_file import find_pass
from ..files.warp_map_file import read_warp_map_metadata
from ..numerics.errors import WarpMapError
from .console import say
from .progress import ProgressPrinter

NAME = "accuracy"
HELP = "trace pixels of a map again by the reference method and say how far the map is from them"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("map", metavar="MAP.exr", type=Path, help="a warp map or an exit map")
    parser.add_argument("--samples", type=int, default=DEFAULT_SAMPLES, help="pixels to trace again")
    parser.add_argument(
        "--environment-width",
        type=int,
        default=DEFAULT_ENVIRONMENT_WIDTH,
        help="width of the sky's picture, in whose pixels errors are told too",
    )
    parser.add_argument("--seed", type=int, default=0, help="another seed chooses other pixels")
    parser.add_argument("--json", action="store_true", help="print the numbers as JSON, angles in radians")


def run(options: argparse.Namespace) -> None:
    """Judge the map and print the report.

    Raises
    ------
    BlackHoleError
        If the map or a pass cannot be read, or the options cannot be used.
    """
    report = check_accuracy(
        options.map,
        passes=_passes_beside(options.map),
        samples=options.samples,
        environment_width=options.environment_width,
        seed=options.seed,
        progress=ProgressPrinter(),
    )
    say(json.dumps(report.to_json(), indent=2) if options.json else report.text())


def _passes_beside(path: Path) -> list[Path]:
    """Return the passes of a map's disk."""
    try:
        disk = read_warp_map_metadata(path)["parameters"].get("disk")
    except WarpMapError:  # an exit map, which has no disk, or a file that is refused in a moment
        return []
    return [find_pass(path, crossing) for crossing in range(1, (disk["crossings"] if disk else 0) + 1)]
