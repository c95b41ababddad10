# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames as they are written on a command line."""

import pytest

from blender_addon.bake.frame_list import frames_text, parse_frames
from physics import BlackHoleError


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("7", [7]),
        ("1-4", [1, 2, 3, 4]),
        ("1,5,9-12", [1, 5, 9, 10, 11, 12]),
        ("1-10x3", [1, 4, 7, 10]),
        ("1-9:4", [1, 5, 9]),
        ("-5--3", [-5, -4, -3]),
        ("-1-1, 3", [-1, 0, 1, 3]),
        ("3,1-4,3", [3, 1, 2, 4]),
    ],
)
def test_reading(text: str, frames: list[int]) -> None:
    assert parse_frames(text) == frames


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "no list of frames"),
        ("1-", "no list of frames"),
        ("1..4", "no list of frames"),
        ("1,,2", "no list of frames"),
        ("5x2", "no list of frames"),
        ("9-1", "write 1-9"),
        ("1-9x0", "step of 0"),
        ("1-99999999999", "more than 1000000 frames"),
    ],
)
def test_what_cannot_be_read(text: str, sentence: str) -> None:
    with pytest.raises(BlackHoleError, match=sentence):
        parse_frames(text)


def test_writing() -> None:
    frames = [1, 2, 3, 5, 9, 10, -4]
    assert frames_text(frames) == "1-3,5,9-10,-4"
    assert parse_frames(frames_text(frames)) == frames
