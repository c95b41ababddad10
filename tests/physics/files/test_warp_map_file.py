# SPDX-License-Identifier: GPL-3.0-or-later
"""The file format: what is written is read back, and everything else is refused by name."""

import json
import os
import stat
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from shots import shot

from physics import (
    ImageFileError,
    WarpMapError,
    WarpMapParameters,
    bake,
    read_warp_map,
    read_warp_map_metadata,
    write_warp_map,
)
from physics.files import map_file
from physics.images.exr import read_exr, read_exr_header, write_exr

PLANES = ("theta", "phi", "one_plus_z", "visibility")


@pytest.fixture(scope="module")
def baked():
    return bake(shot())


@pytest.fixture
def written(baked, tmp_path):
    path = tmp_path / "map.exr"
    write_warp_map(path, baked)
    return path


def rewritten(path, change_pixels=lambda pixels: pixels, **attributes):
    """The same file with other pixels or header attributes, by the OpenEXR package alone."""
    with OpenEXR.File(str(path)) as file:
        pixels = change_pixels(file.channels()["RGBA"].pixels.copy())
        header = {key: value for key, value in file.header().items() if isinstance(value, str)}
    kept = {key: value for key, value in {**header, **attributes}.items() if value is not None}
    with OpenEXR.File(kept, {"RGBA": pixels}) as file:
        file.write(str(path))
    return path


def test_round_trip(baked, written):
    read = read_warp_map(written)
    for name in PLANES:
        assert np.array_equal(getattr(read, name), getattr(baked, name))
        assert getattr(read, name).dtype == np.float32
    assert read.metadata["hash"] == shot().hash
    assert WarpMapParameters.from_metadata(read.metadata["parameters"]) == shot()
    assert read.counts == baked.counts
    assert read_warp_map_metadata(written) == read.metadata


def test_any_exr_reader_finds_the_four_channels(baked, written):
    """Float32 R, G, B, A as documented, row 0 at the top, by the OpenEXR package alone."""
    with OpenEXR.File(str(written), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        header = dict(file.header())
    assert set(channels) == set("RGBA")
    for name, plane in zip("RGBA", PLANES, strict=True):
        assert channels[name].dtype == np.float32
        assert np.array_equal(channels[name], getattr(baked, plane))
    assert header["umbraFormat"] == "umbra warp map 1"
    assert json.loads(header["umbraParameters"])["spin"] == 0.999
    assert header["umbraHash"] == shot().hash
    assert (channels["B"] != 0.0).all()


def test_every_truncation_is_refused(written, tmp_path):
    data = written.read_bytes()
    cut = tmp_path / "cut.exr"
    # Every length through the header, then steps through the pixels, and the last bytes one by one.
    lengths = [*range(0, 1200, 7), *range(1200, len(data), 211), *range(len(data) - 8, len(data))]
    for length in lengths:
        cut.write_bytes(data[:length])
        with pytest.raises(WarpMapError, match=r"cut\.exr"):
            read_warp_map(cut)


def test_damaged_bytes_are_refused_or_harmless(baked, written, tmp_path):
    """A flipped byte is found by the format, by zlib or by the checksum; where it is not, it changed nothing."""
    data = bytearray(written.read_bytes())
    broken = tmp_path / "broken.exr"
    refused = 0
    for position in range(0, len(data), 97):
        damaged = data.copy()
        damaged[position] ^= 0x55
        broken.write_bytes(damaged)
        try:
            read = read_warp_map(broken)
        except WarpMapError:
            refused += 1
        else:
            assert all(np.array_equal(getattr(read, name), getattr(baked, name)) for name in PLANES)
    assert refused > 0.5 * len(range(0, len(data), 97))


def test_missing_file(tmp_path):
    for read in (read_warp_map, read_warp_map_metadata):
        with pytest.raises(WarpMapError, match=r"nowhere\.exr does not exist; bake it again\."):
            read(tmp_path / "nowhere.exr")
        with pytest.raises(WarpMapError, match="Cannot read"):
            read(tmp_path)


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "not an OpenEXR"), (b"\x89PNG\r\n\x1a\n" + b"0" * 100, "not an OpenEXR"), (b"v/1\x01" + b"\0" * 300, "")],
)
def test_files_that_are_no_exr(tmp_path, content, words):
    path = tmp_path / "foreign.exr"
    path.write_bytes(content)
    with pytest.raises(WarpMapError, match=rf"foreign\.exr.*{words}"):
        read_warp_map(path)


def test_a_picture_is_not_a_warp_map(tmp_path):
    path = tmp_path / "picture.exr"
    write_exr(path, np.ones((8, 8, 4), np.float32))
    for read in (read_warp_map, read_warp_map_metadata):
        with pytest.raises(WarpMapError, match=r"picture\.exr is not a warp map"):
            read(path)


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"umbraFormat": "umbra warp map 2"}, "another version"),
        ({"umbraFormat": None}, "not a warp map"),
        ({"umbraParameters": "{"}, "header"),
        ({"umbraParameters": None}, "header"),
        ({"umbraHash": None}, "header"),
        ({"umbraChecksum": "crc32 00000000"}, "pixels"),
        ({"umbraChecksum": None}, "pixels"),
    ],
)
def test_headers_that_do_not_fit(written, attributes, words):
    rewritten(written, **attributes)
    with pytest.raises(WarpMapError, match=rf"map\.exr.*{words}"):
        read_warp_map(written)


def test_a_map_of_another_size_than_it_says(written):
    rewritten(written, change_pixels=lambda pixels: np.ascontiguousarray(pixels[:, :-2]))
    with pytest.raises(WarpMapError, match="size"):
        read_warp_map(written)


@pytest.mark.parametrize(
    ("channel", "value"), [(0, -0.1), (0, 4.0), (1, 7.0), (2, 0.0), (2, np.nan), (2, np.inf), (3, 1.5), (3, np.nan)]
)
def test_values_that_no_map_has(written, channel, value):
    """Even with a right checksum, such as a faulty writer would make."""

    def change(pixels):
        pixels[3, 4, channel] = value
        return pixels

    with OpenEXR.File(str(written)) as file:
        changed = change(file.channels()["RGBA"].pixels.copy())
        checksum = map_file.checksum([changed[:, :, i] for i in range(4)])
    rewritten(written, change_pixels=change, umbraChecksum=checksum)
    with pytest.raises(WarpMapError, match="values that no warp map has"):
        read_warp_map(written)


def test_writing_replaces_whole_and_leaves_nothing_behind(baked, tmp_path, monkeypatch):
    path = tmp_path / "sub folder" / "kärte 1.exr"
    write_warp_map(path, baked)
    before = path.read_bytes()
    write_warp_map(path, baked)
    assert [item.name for item in path.parent.iterdir()] == [path.name]

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(ImageFileError, match=r"kärte 1\.exr.*no space left"):
        write_warp_map(path, baked)
    assert path.read_bytes() == before
    assert [item.name for item in path.parent.iterdir()] == [path.name]


def test_a_full_disk_is_said(baked):
    """/dev/full takes no byte: the writer's own failure, where the system has such a device."""
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    from physics.images import exr

    class Full:
        def __enter__(self):
            return Path("/dev/full")

        def __exit__(self, *_):
            return False

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exr, "replacing", lambda path: Full())
        with pytest.raises(OSError, match=r"EXR writer failed|no space"):
            write_exr("unused.exr", np.zeros((64, 64, 4), np.float32))


def test_a_folder_that_cannot_be_made_is_said(baked, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ImageFileError, match="choose another folder"):
        write_warp_map(tmp_path / "file" / "map.exr", baked)


def test_a_read_only_folder_is_said(baked, tmp_path):
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        if os.access(tmp_path, os.W_OK):
            pytest.skip("this user may write everywhere")
        with pytest.raises(ImageFileError, match="permission denied"):
            write_warp_map(tmp_path / "map.exr", baked)
    finally:
        tmp_path.chmod(stat.S_IRWXU)


def test_pictures_of_other_kinds(tmp_path):
    half = np.linspace(0.0, 1.0, 60, dtype=np.float16).reshape(4, 5, 3)
    write_exr(tmp_path / "half.exr", half)
    pixels, header = read_exr(tmp_path / "half.exr")
    assert np.array_equal(pixels, half.astype(np.float32))
    assert header["size"] == (5, 4)
    gray = np.ones((3, 2), np.float32)
    with OpenEXR.File({}, {"Y": gray}) as file:
        file.write(str(tmp_path / "gray.exr"))
    assert read_exr(tmp_path / "gray.exr")[0].shape == (3, 2, 3)
    with OpenEXR.File({}, {"depth": gray}) as file:
        file.write(str(tmp_path / "depth.exr"))
    with pytest.raises(ImageFileError, match=r"depth\.exr has no channels R, G and B"):
        read_exr(tmp_path / "depth.exr")
    assert read_exr_header(tmp_path / "half.exr")["size"] == (5, 4)
