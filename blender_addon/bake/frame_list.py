# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames as they are written on a command line: "1-250", "1,5,9-12", "1-250x2"."""

from __future__ import annotations

import re

from ..core.physics_api import physics

_PART = re.compile(r"(-?\d{1,18})(?:-(-?\d{1,18})(?:[x:](\d{1,18}))?)?")

MOST_FRAMES = 1_000_000


def parse_frames(text: str) -> list[int]:
    """Return the frames that a text names, in its order, each once.

    Parameters
    ----------
    text : str
        Frames and ranges with commas between them. "1-9x2" is every second frame from 1 to 9, and "1-9:2", as Open Job
        Description writes it, is the same. "-5--1" is -5 to -1.

    Raises
    ------
    BlackHoleError
        When the text cannot be read, or names more than a million frames.
    """
    frames: dict[int, None] = {}
    for part in text.split(","):
        match = _PART.fullmatch(part.strip())
        if match is None:
            raise physics.BlackHoleError(
                f'"{text}" is no list of frames: write them as in 1-250, or 1,5,9-12, or 1-250x2.',
                code="command.frames",
            )
        first = int(match[1])
        last = first if match[2] is None else int(match[2])
        step = 1 if match[3] is None else int(match[3])
        if last < first:
            raise physics.BlackHoleError(
                f'The frames "{part.strip()}" end before they begin: write {last}-{first}.', code="command.frames"
            )
        if step == 0:
            raise physics.BlackHoleError(
                f'The frames "{part.strip()}" have a step of 0: give 1 or more.', code="command.frames"
            )
        count = (last - first) // step + 1
        if len(frames) + count > MOST_FRAMES:
            raise physics.BlackHoleError(
                f'"{text}" names more than {MOST_FRAMES} frames: give fewer.', code="command.frames"
            )
        frames.update(dict.fromkeys(range(first, last + 1, step)))
    return list(frames)


def frames_text(frames: list[int]) -> str:
    """Return frames as a text that `parse_frames` reads, runs of neighbors as ranges: "1-4,9"."""
    runs: list[list[int]] = []
    for frame in frames:
        if runs and frame == runs[-1][1] + 1:
            runs[-1][1] = frame
        else:
            runs.append([frame, frame])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in runs)
