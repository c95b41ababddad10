# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures tracing, maps, files, animations, the Cycles Lens and the filter of the sky; writes a table and two plots.

The scene of every number but the lens's and the filter's: spin 0.999, r = 10 on the circular orbit, 60 degrees high,
looking at the hole.
"""

# isort: off
import measuring  # before numpy
# isort: on

import argparse
from collections.abc import Iterable
from pathlib import Path

import animations
import disks
import lens
import maps
import matter
import plots
import skies
import stars
import tracing

# Pictures take seconds, so that a disturbance is a small part of them.
LENS_REPEATS = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("build/benchmark"), help="where table and plots go")
    parser.add_argument("--repeats", type=int, default=7, help="runs of which the fastest counts")
    parser.add_argument("--frames", type=int, default=16, help="of each camera move")
    parser.add_argument("--orbit-frames", type=int, default=250)
    parser.add_argument("--kgeo", type=Path, help="folder of a copy of kgeo, to measure it as well")
    parser.add_argument("--no-plots", action="store_true")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)

    table = Table(options.folder / "table.txt")
    table.add([measuring.describe_machine(), "one core, unless it says otherwise", "", measuring.Row.HEADINGS])
    table.add(tracing.rows(options.repeats, options.kgeo))
    table.add(maps.rows(options.repeats))
    table.add(["", *disks.lines(options.repeats), ""])
    table.add(["", *matter.lines(options.repeats), ""])
    table.add(animations.rows(options.frames, options.orbit_frames))
    table.add(lens.rows(min(options.repeats, LENS_REPEATS)))
    table.add(["", *skies.lines(min(options.repeats, LENS_REPEATS))])
    table.add(["", *stars.lines(min(options.repeats, LENS_REPEATS))])
    table.add(["", *maps.file_lines(options.repeats)])
    table.add(["", f"peak resident memory of the whole run: {measuring.process_memory():.0f} MB"])
    if not options.no_plots:
        machine = measuring.describe_machine()
        times, errors = options.folder / "time_against_pixels.png", options.folder / "error_against_tolerance.png"
        plots.plot_times(maps.time_against_pixels(options.repeats), machine, times)
        plots.plot_errors(tracing.error_against_tolerance(), machine, errors)
        print(f"\nplots: {times}, {errors}")


class Table:
    """Lines that are printed as they come and kept in a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._path.write_text("", encoding="utf-8")

    def add(self, lines: Iterable[object]) -> None:
        for line in lines:
            print(line, flush=True)
            with self._path.open("a", encoding="utf-8") as file:
                file.write(f"{line}\n")


if __name__ == "__main__":
    main()
