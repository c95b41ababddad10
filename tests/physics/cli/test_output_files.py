# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that commands write: none costs the user another, and what cannot be written is refused before any work."""

import os
import sys

import numpy as np
import pytest
from commands import run

from physics import read_exr_header, read_warp_map, write_exr
from physics.cli import main
from physics.images.exr import replacing, target_of

SMALL = ("--width", "16", "--height", "9")


@pytest.fixture
def folder(tmp_path, capsys, small_patterns):
    """A map with a disk and its light, and a sky."""
    write_exr(tmp_path / "sky.exr", np.full((16, 32, 3), 0.25, np.float32))
    bake = ("bake", str(tmp_path / "map.exr"), *SMALL, "--radius", "30", "--disk", "--disk-crossings", "1", "--light")
    assert main(bake) == 0
    capsys.readouterr()
    return tmp_path


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(capsys, words, *arguments):
    """One sentence with its code, exit status 1, and no ray traced."""
    assert main([str(each) for each in arguments]) == 1
    said = capsys.readouterr()
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    assert words in said.err
    assert "tracing" not in said.err
    assert not said.out


@pytest.mark.parametrize("name", ["map.exr", "sky.exr", "map_disk1.exr", "map_light.exr"])
@pytest.mark.parametrize("spelling", ["itself", "dots", "symbolic link", "hard link", "linked folder"])
@pytest.mark.parametrize("options", [(), ("--light",)])
def test_render_never_writes_what_it_reads(folder, capsys, name, spelling, options):
    output = {
        "itself": folder / name,
        "dots": folder / "." / ".." / folder.name / name,
        "symbolic link": folder / "link.exr",
        "hard link": folder / "hard.exr",
        "linked folder": folder / "elsewhere" / name,
    }[spelling]
    if spelling == "symbolic link":
        output.symlink_to(folder / name)
    elif spelling == "hard link":
        os.link(folder / name, output)
    elif spelling == "linked folder":
        output.parent.symlink_to(folder, target_is_directory=True)
    before = contents(folder)
    refused(capsys, "would be lost", "render", folder / "map.exr", folder / "sky.exr", output, *options)
    assert contents(folder) == before


def test_render_replaces_a_picture_but_no_map(folder, capsys):
    other, picture = folder / "other.exr", folder / "picture.exr"
    (folder / "map.exr").rename(other)
    assert main(["bake", str(folder / "map.exr"), *SMALL]) == 0
    capsys.readouterr()
    refused(capsys, "is a warp map", "render", folder / "map.exr", folder / "sky.exr", other)
    for _ in range(2):
        assert main(["render", str(folder / "map.exr"), str(folder / "sky.exr"), str(picture)]) == 0


def test_bake_replaces_maps_alone(folder, capsys):
    before = contents(folder)
    refused(capsys, "would be lost", "bake", folder / "sky.exr", *SMALL)
    refused(capsys, "would be lost", "bake", folder / "map_disk1.exr", *SMALL)
    # a pass that would replace something else
    (folder / "new_disk2.exr").write_bytes(before["sky.exr"])
    refused(capsys, "would be lost", "bake", folder / "new.exr", *SMALL, "--disk")
    assert contents(folder) == {**before, "new_disk2.exr": before["sky.exr"]}
    assert main(["bake", str(folder / "map.exr"), *SMALL, "--spin", "0.1"]) == 0
    assert read_warp_map(folder / "map.exr").metadata["parameters"]["spin"] == 0.1


@pytest.mark.parametrize(
    "name", ["x" * 226 + ".exr", "x" * 251 + ".exr", "ü" * 125 + ".exr", "x" * 247 + "_disk1.e.exr"]
)
def test_long_names_work(tmp_path, capsys, name):
    """Up to the 255 bytes of common file systems, though the file's temporary name is longer."""
    assert main(["bake", str(tmp_path / name), *SMALL]) == (0 if len(os.fsencode(name)) <= 255 else 1)
    assert "Traceback" not in capsys.readouterr().err
    if len(os.fsencode(name)) <= 255:
        assert read_warp_map(tmp_path / name).theta.shape == (9, 16)
        assert len(list(tmp_path.iterdir())) == 1


def test_names_that_are_too_long_are_refused(folder, capsys):
    before = contents(folder)
    long = "x" * 252 + ".exr"
    deep = folder / "/".join(["y" * 200] * 25) / "map.exr"
    refused(capsys, "name too long", "bake", folder / long, *SMALL)
    refused(capsys, "name too long", "bake", deep, *SMALL)
    # the map's name fits, those of its disk's passes do not
    refused(capsys, "name too long", "bake", folder / ("x" * 250 + ".exr"), *SMALL, "--disk")
    refused(capsys, "name too long", "render", folder / "map.exr", folder / "sky.exr", folder / long)
    refused(capsys, "name too long", "render", folder / "map.exr", folder / long, folder / "picture.exr")
    refused(capsys, "name too long", "render", deep, folder / "sky.exr", folder / "picture.exr")
    for arguments in (("accuracy", deep), ("verify", deep), ("accuracy", long), ("verify", long)):
        assert main([str(each) for each in arguments]) == 1
        assert "Traceback" not in capsys.readouterr().err
    assert contents(folder) == before


def test_folders_that_cannot_be_made_are_found_before_any_work(folder, capsys):
    refused(capsys, "not a directory", "bake", folder / "sky.exr" / "map.exr", *SMALL)
    (folder / "a.exr").mkdir()
    refused(capsys, "is a folder", "bake", folder / "a.exr", *SMALL)
    refused(capsys, "is a directory", "render", folder / "map.exr", folder / "sky.exr", folder / "a.exr")
    assert not list((folder / "a.exr").iterdir())


def test_a_bake_that_fails_while_writing_leaves_the_former_files(folder, capsys, monkeypatch):
    """Map and passes take their places together."""
    before = contents(folder)

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("physics.cli.bake_command.write_warp_map", fail)
    arguments = ("--radius", "31", "--disk", "--disk-crossings", "1")
    refused_words = "no space left"
    assert main(["bake", str(folder / "map.exr"), *SMALL, *arguments]) == 1
    assert refused_words in capsys.readouterr().err
    assert contents(folder) == before


def test_temporary_names_hold_what_fits(tmp_path):
    name = "ö" * 122 + "_0001.exr"
    with replacing(tmp_path / name) as temporary:
        assert len(os.fsencode(temporary.name)) <= 255
        assert name.startswith(target_of(temporary.name).removesuffix(".exr"))
        write_exr(temporary, np.zeros((2, 2, 3), np.float32))
    assert read_exr_header(tmp_path / name)["size"] == (2, 2)


@pytest.mark.skipif(sys.platform != "linux", reason="names are Unicode elsewhere")
def test_names_that_are_no_utf8(folder):
    """Bytes of any encoding are names on Linux; maps, skies and pictures may have them."""
    odd = [os.fsdecode(os.fsencode(folder) + b"/m\xe4p_" + end) for end in (b"a.exr", b"b.exr", b"c.exr", b"d.png")]
    (folder / "sky.exr").rename(odd[1])
    bad = folder / os.fsdecode(b"b\xe4d.png")
    bad.write_bytes(b"no picture")
    for status, *arguments in (
        (0, "bake", odd[0], *SMALL),
        (0, "render", odd[0], odd[1], odd[2]),
        (0, "render", odd[0], odd[1], odd[3]),
        (0, "verify", odd[0]),
        (0, "verify", folder),
        (0, "accuracy", odd[0], "--samples", 20),
        (1, "render", odd[1], odd[0], odd[2]),
        (1, "render", odd[0], bad, odd[2]),
        (1, "bake", odd[3], *SMALL),
    ):
        result = run(*arguments)
        assert result.returncode == status, result.stderr
        assert "Traceback" not in result.stderr
    assert all(os.path.getsize(each) > 0 for each in odd)
