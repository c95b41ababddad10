# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m physics accuracy``: how exact a map on disk is."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ..accuracy_check.accuracy import DEFAULT_ENVIRONMENT_WIDTH, DEFAULT_SAMPLES, check_accuracy
from ..files.warp_map_file import read_warp_map_metadata
from ..numerics.errors import WarpMapError
from ..numerics.work import Progress
from .disk_command import pass_path


def add_command(commands: Any, progress: type) -> None:
    """Add the command to the parser's; `progress` makes what shows the fraction done."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "accuracy",
        help="trace pixels of a map again by the reference method and say how far the map is from them",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.set_defaults(run=lambda options: _run(options, progress()))
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


def _run(options: argparse.Namespace, progress: Progress) -> None:
    report = check_accuracy(
        options.map,
        passes=_passes_beside(options.map),
        samples=options.samples,
        environment_width=options.environment_width,
        seed=options.seed,
        progress=progress,
    )
    print(json.dumps(report.to_json(), indent=2) if options.json else report.text())


def _passes_beside(path: Path) -> list[Path]:
    """Return the passes of a map's disk, as this command line names them or as the add-on does."""
    try:
        disk = read_warp_map_metadata(path)["parameters"].get("disk")
    except WarpMapError:  # an exit map, which has no disk, or a file that is refused in a moment
        return []
    paths = []
    for crossing in range(1, (disk["crossings"] if disk else 0) + 1):
        beginning, _, frame = path.name.rpartition("_")
        other = path.with_name(f"{beginning}_disk{crossing}_{frame}")
        paths.append(other if other.is_file() else pass_path(path, crossing))
    return paths
