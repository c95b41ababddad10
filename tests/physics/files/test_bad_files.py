# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are cut, spoiled, foreign or hostile: each is refused in one sentence that names it, or reads the same."""

import os
import random
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from exr_files import (
    COMPRESSIONS,
    LINES,
    SIZE,
    attributes,
    chunks,
    compression,
    deep,
    every_kind,
    multipart,
    planes,
    spoiled,
    with_value,
    with_window,
    written,
)
from shots import shot

from physics import (
    BlackHoleError,
    Disk,
    ImageFileError,
    WarpMapError,
    bake,
    read_disk_pass,
    read_warp_map,
    write_disk_pass,
    write_warp_map,
)
from physics.files import map_file
from physics.files.exit_map_file import read_exit_map, write_exit_map
from physics.images import exr
from physics.images.exr import read_exr, read_exr_header
from physics.maps.exit_map import bake_exit_map

HERE = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """(reader, path) of a small file of each kind of map."""
    folder = tmp_path_factory.mktemp("maps")
    parameters = shot(24, 14, radius=30.0, disk=Disk(crossings=1))
    baked = bake(parameters)
    write_warp_map(folder / "warp.exr", baked)
    write_disk_pass(folder / "disk.exr", baked.disk_passes[0])
    write_exit_map(folder / "exit.exr", bake_exit_map(shot(24, 14, radius=30.0)))
    return {
        "warp": (read_warp_map, folder / "warp.exr"),
        "disk": (read_disk_pass, folder / "disk.exr"),
        "exit": (read_exit_map, folder / "exit.exr"),
    }


def assert_refused(path, read=read_exr):
    """One sentence that names the file; from maps the advice to bake again."""
    with pytest.raises(BlackHoleError) as caught:
        read(path)
    text = str(caught.value)
    assert path.name in text
    assert text.endswith(".")
    assert "\n" not in text
    if read is not read_exr:
        assert isinstance(caught.value, WarpMapError)
        assert text.endswith("; bake it again.")
    return text


def boundaries(data, lines, height):
    """Every length at which a piece of the file ends or begins, and one byte to each side."""
    table, places = chunks(data, lines, height)
    found = {0, 4, 8, table, len(data)}
    for _, begin, value, end in attributes(data):
        found |= {begin, value, value - 4, end}
    found |= {table + 8 * i for i in range(len(places) + 1)}
    for place in places:
        found |= {place, place + 4, place + 8}
    return sorted({each + step for each in found for step in (-1, 0, 1) if 0 <= each + step < len(data)})


# --- cut short --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["warp", "disk", "exit"])
def test_maps_cut_at_every_boundary(maps, tmp_path, kind):
    read, path = maps[kind]
    data, cut = path.read_bytes(), tmp_path / "cut.exr"
    for length in boundaries(data, LINES["ZIP"], 28 if kind == "exit" else 14):
        cut.write_bytes(data[:length])
        text = assert_refused(cut, read)
        assert "cut short" in text or "not an OpenEXR" in text


@pytest.mark.parametrize("name", COMPRESSIONS)
def test_pictures_cut_at_every_boundary(tmp_path, name):
    """A picture has no checksum: what is missing must be found all the same, and said before the library looks."""
    cut = tmp_path / "cut.exr"
    data = written(cut, planes(), compression=compression(name))
    assert read_exr(cut)[0].shape == (*SIZE[::-1], 4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(OpenEXR, "File", None)
        for length in boundaries(data, LINES[name], SIZE[1]):
            cut.write_bytes(data[:length])
            text = assert_refused(cut)
            assert "cut short" in text or "not an OpenEXR" in text


def test_a_header_alone_is_enough_for_what_reads_the_header(tmp_path):
    path = tmp_path / "picture.exr"
    data = written(path, planes())
    table, _ = chunks(data, 1)
    path.write_bytes(data[:table])
    assert_refused(path)


# --- spoiled ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["warp", "disk", "exit"])
def test_spoiled_maps_are_refused_or_the_same(maps, tmp_path, kind):
    read, path = maps[kind]
    data, broken = path.read_bytes(), tmp_path / "broken.exr"
    good, source, refused = read(path), random.Random(1), 0
    for _ in range(250):
        broken.write_bytes(spoiled(data, source))
        try:
            found = read(broken)
        except WarpMapError:
            refused += 1
            continue
        for name, value in vars(good).items():
            if isinstance(value, np.ndarray):
                assert np.array_equal(getattr(found, name), value)
    assert refused > 100


SPOIL = """
import random, sys
from pathlib import Path
from exr_files import every_kind, spoiled
from physics import BlackHoleError
from physics.images.exr import read_exr, read_exr_header

folder = Path(sys.argv[1])
kinds = list(every_kind(folder).values())
source, path, refused = random.Random(2), folder / "spoiled.exr", 0
for number in range(1500):
    path.write_bytes(spoiled(source.choice(kinds), source))
    for read in (read_exr, read_exr_header):
        try:
            read(path)
        except BlackHoleError as error:
            assert path.name in str(error) and "\\n" not in str(error), error
            refused += 1
print("refused", refused)
"""


def test_spoiled_pictures_end_no_process(tmp_path):
    """In a process of its own, which a fault in the library's own code would end."""
    result = subprocess.run(
        [sys.executable, "-c", SPOIL, str(tmp_path)],
        cwd=HERE, env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (HERE, HERE.parents[1])))},
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr[-2000:]
    assert int(result.stdout.split("refused")[-1]) > 800


# --- sizes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("box", "words"),
    [
        ((0, 0, 99_999, 99_999), "100000 x 100000 pixels"),
        ((0, 0, 2**31 - 1, 2**31 - 1), "pixels large"),
        ((-(2**31), -(2**31), 2**31 - 1, 2**31 - 1), "pixels large"),
        ((0, 0, 2**17, 0), "pixels large"),
        ((0, 0, 32_767, 16_384), "pixels large"),
        ((0, 0, -1, 39), "size"),
        ((5, 5, 4, 4), "size"),
        ((0, 0, 8191, 4095), "cannot hold 8192 x 4096"),
    ],
)
def test_sizes_are_refused_before_anything_is_allocated(tmp_path, monkeypatch, box, words):
    path = tmp_path / "huge.exr"
    path.write_bytes(with_window(written(path, planes(), compression=OpenEXR.ZIP_COMPRESSION), *box))
    monkeypatch.setattr(OpenEXR, "File", None)  # the library never sees it
    text = assert_refused(path)
    assert words in text
    if "cannot hold" not in words:
        with pytest.raises(ImageFileError, match=words):
            read_exr_header(path)


@pytest.mark.parametrize("name", COMPRESSIONS)
def test_what_compresses_best_is_not_taken_for_cut_short(tmp_path, name):
    """An even picture, as small as files get."""
    path = tmp_path / "even.exr"
    pixels = {each: np.zeros((1024, 2048), np.float16) for each in "RGB"}
    data = written(path, pixels, compression=compression(name))
    assert read_exr(path)[0].shape == (1024, 2048, 3)
    assert name == "NO" or len(data) < 1024 * 2048 * 6 / 2


def test_windows_that_begin_elsewhere(tmp_path):
    path = tmp_path / "moved.exr"
    path.write_bytes(with_window(written(path, planes(), compression=OpenEXR.NO_COMPRESSION), -7, 0, 16, 39))
    pixels, header = read_exr(path)
    assert np.array_equal(pixels[..., 0], planes()["R"])
    assert header["size"] == SIZE


# --- other kinds ------------------------------------------------------------------------------------


def test_kinds_of_files(tmp_path):
    path = tmp_path / "kind.exr"
    multipart(path, 2)
    assert "several parts" in assert_refused(path)
    multipart(path, 1)
    assert np.array_equal(read_exr(path)[0][..., 2], planes()["B"])
    deep(path)
    assert "deep data" in assert_refused(path)
    written(path, planes(), type=OpenEXR.tiledimage, tiles=OpenEXR.TileDescription())
    assert np.array_equal(read_exr(path)[0][..., 1], planes()["G"])
    data = written(path, planes())
    path.write_bytes(with_value(data, "dataWindow", struct.pack("<4i", 0, 0, 23, 30)))
    assert "crop" in assert_refused(path)
    path.write_bytes(data[:4] + b"\x03" + data[5:])
    assert "version" in assert_refused(path)
    path.write_bytes(with_value(data, "compression", b"\x63"))
    assert "compressed in a way" in assert_refused(path)
    path.write_bytes(b"")
    assert "not an OpenEXR" in assert_refused(path)


def test_channels_that_are_not_those_of_a_picture(tmp_path):
    path = tmp_path / "channels.exr"
    written(path, planes("XYZ"))
    assert read_exr(path)[0].shape[2] == 3  # luminance alone is gray
    written(path, planes("RG"))
    assert "no channels R, G and B" in assert_refused(path)
    data = written(path, planes("RGB"))
    begin = next(value for name, _, value, _ in attributes(data) if name == "channels")
    sampling = begin + 2 + 8  # after "B", its end, its type and flags
    path.write_bytes(data[:sampling] + struct.pack("<2i", 2, 2) + data[sampling + 8 :])
    assert "lower resolution" in assert_refused(path)
    path.write_bytes(data[: begin + 2] + struct.pack("<i", 7) + data[begin + 6 :])
    assert "channels cannot be read" in assert_refused(path)


@pytest.mark.parametrize("kind", ["warp", "disk", "exit"])
def test_maps_with_channels_of_other_types_names_and_values(maps, tmp_path, kind):
    """Written by the package itself with a right checksum, as a faulty program might."""
    read, path = maps[kind]
    channels, header = exr.read_channels(path)
    texts = {key: value for key, value in header.items() if isinstance(value, str)}
    broken = tmp_path / "broken.exr"

    def write(changed):
        order = [changed[name] for name in "RGBA" if name in changed]
        exr.write_channels(broken, changed, {**texts, "umbraChecksum": map_file.checksum(order)})

    write(channels)
    read(broken)
    write({name: channels[name] for name in "RGB"})
    assert "damaged" in assert_refused(broken, read)
    write({**{name: channels[name] for name in "RGB"}, "Z": channels["A"]})
    assert "damaged" in assert_refused(broken, read)
    for value in (np.nan, np.inf, -np.inf):
        for name in "RGBA":
            plane = channels[name].copy()
            plane[3, 4] = value
            write({**channels, name: plane})
            assert "damaged" in assert_refused(broken, read)
    # Half precision is another map: it must not pass for the one that was baked.
    half = {name: plane.astype(np.float16) for name, plane in channels.items()}
    exr.write_channels(broken, half, texts)
    assert_refused(broken, read)


@pytest.mark.parametrize(
    "parameters",
    ["[]", "3", "null", "{}", "NaN", '{"camera": 3}', '{"camera": {"width": "24"}, "supersampling": 1}'],
)
@pytest.mark.parametrize("kind", ["warp", "disk", "exit"])
def test_headers_of_nonsense(maps, tmp_path, kind, parameters):
    read, path = maps[kind]
    channels, header = exr.read_channels(path)
    texts = {key: value for key, value in header.items() if isinstance(value, str)}
    for changed in ({"umbraParameters": parameters}, {"umbraCounts": parameters}):
        exr.write_channels(tmp_path / "odd.exr", channels, {**texts, **changed})
        assert "damaged" in assert_refused(tmp_path / "odd.exr", read)


def test_skies_of_no_finite_numbers_are_noted(maps, tmp_path):
    sky = np.full((16, 32, 3), 0.5, np.float32)
    sky[3, 4], sky[5, 6] = np.nan, np.inf
    exr.write_exr(tmp_path / "sky.exr", sky)
    result = subprocess.run(
        [sys.executable, "-m", "physics", "render", maps["warp"][1], tmp_path / "sky.exr", tmp_path / "picture.exr"],
        cwd=HERE.parents[1], capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "note: 2 pixels of the sky are no finite numbers" in result.stderr
    assert np.isfinite(read_exr(tmp_path / "picture.exr")[0]).all()


def test_every_kind_is_what_it_says(tmp_path):
    assert set(every_kind(tmp_path)) > {"tiled", "multipart", "deep", "ZIP float32"}
