# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of frames as text: "1-250", "1,5,9-12", "1-250x2".

The farm script contains this module's source, so it imports nothing but the standard library.
"""

import re
from collections.abc import Iterable, Iterator

_PART = re.compile(r"(-?\d{1,18})(?:-(-?\d{1,18})(?:[x:](\d{1,18}))?)?")

MOST_FRAMES = 1_000_000


class FrameListError(ValueError):
    """A text that is not a list of frames: one sentence that says why, and its code in the manual."""

    def __init__(self, sentence: str) -> None:
        super().__init__(f"{sentence} [command.frames]")


def parse_frames(text: str) -> list[int]:
    """Return the frames that a text names, in its order, each once.

    Parameters
    ----------
    text : str
        Frames and ranges, separated by commas. "1-9x2" is every second frame from 1 to 9; "1-9:2", the notation of Open
        Job Description, is the same. "-5--1" is -5 to -1.

    Returns
    -------
    list of int
        At least one frame, and at most a million.

    Raises
    ------
    FrameListError
        If the text cannot be read, or names more frames.
    """
    frames: dict[int, None] = {}
    named = 0
    for part in text.split(","):
        match = _PART.fullmatch(part.strip())
        if match is None:
            raise FrameListError(f'"{text}" is not a list of frames: write them as in 1-250, or 1,5,9-12, or 1-250x2.')
        first = int(match[1])
        last = first if match[2] is None else int(match[2])
        step = 1 if match[3] is None else int(match[3])
        if last < first:
            raise FrameListError(f'The frames "{part.strip()}" end before they begin: write {last}-{first}.')
        if step == 0:
            raise FrameListError(f'The frames "{part.strip()}" have a step of 0: give 1 or more.')
        named += (last - first) // step + 1
        if named > MOST_FRAMES:
            raise FrameListError(f'"{text}" names more than {MOST_FRAMES} frames: give fewer.')
        frames.update(dict.fromkeys(range(first, last + 1, step)))
    return list(frames)


def frames_text(frames: Iterable[int]) -> str:
    """Return frames as a text that `parse_frames` reads, consecutive ones as ranges: "1-4,9"."""
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in ranges(frames))


def ranges(frames: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield first and last frame of each run of consecutive frames."""
    run: tuple[int, int] | None = None
    for frame in frames:
        if run is not None and frame == run[1] + 1:
            run = run[0], frame
            continue
        if run is not None:
            yield run
        run = frame, frame
    if run is not None:
        yield run
