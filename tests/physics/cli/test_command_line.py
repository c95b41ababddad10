# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line as a user meets it: a process of its own, its exit status and its words."""

import json
import zlib

import numpy as np
import pytest
from commands import run

from physics import read_warp_map
from physics.files.disk_pass_file import pass_path
from physics.images.exr import read_exr, write_exr
from physics.images.png import srgb_from_linear


def read_png(path):
    """The pixels of an 8-bit RGB PNG without filters: signature, IHDR, one IDAT."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = (int.from_bytes(data[i : i + 4], "big") for i in (16, 20))
    start = data.index(b"IDAT")
    length = int.from_bytes(data[start - 4 : start], "big")
    rows = np.frombuffer(zlib.decompress(data[start + 4 : start + 4 + length]), np.uint8).reshape(height, -1)
    assert (rows[:, 0] == 0).all()
    return rows[:, 1:].reshape(height, width, 3)


@pytest.fixture(scope="module")
def sky(tmp_path_factory):
    path = tmp_path_factory.mktemp("sky") / "sky.exr"
    write_exr(path, np.full((16, 32, 3), 0.25, np.float32))
    return path


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    path = tmp_path_factory.mktemp("maps") / "orbit.exr"
    result = run("bake", path, "--spin", 0.999, "--radius", 10, "--inclination", 80, "--orbit", "circular",
                 "--width", 64, "--height", 36, "--fov", 60, "--supersampling", 2)  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "100 %" in result.stderr
    assert f"wrote {path}" in result.stdout
    return path


def test_bake_writes_a_map_of_what_was_asked(baked):
    warp_map = read_warp_map(baked)
    assert warp_map.theta.shape == (72, 128)
    parameters = warp_map.metadata["parameters"]
    assert parameters["spin"] == 0.999
    assert parameters["motion"] == "circular"
    assert np.linalg.norm(parameters["camera_position"]) == pytest.approx(10.0)
    assert warp_map.counts["shadow"] > 1000


@pytest.mark.parametrize("ending", ["png", "exr"])
def test_render_over_an_even_sky(baked, sky, tmp_path, ending):
    """A sky of one color without redshift shows the sky's color, and the shadow as black."""
    output = tmp_path / f"picture.{ending}"
    result = run("render", baked, sky, output, "--redshift-color", 0, "--redshift-brightness", 0)
    assert result.returncode == 0, result.stderr
    visibility = read_warp_map(baked).visibility.reshape(36, 2, 64, 2).mean(axis=(1, 3))
    if ending == "png":
        expected = np.repeat(srgb_from_linear(0.25 * visibility)[..., None], 3, axis=2)
        assert np.abs(read_png(output).astype(int) - expected).max() <= 1
    else:
        picture, _ = read_exr(output)
        assert picture[..., :3] == pytest.approx(0.25 * visibility[..., None].repeat(3, axis=2), abs=1e-6)


def test_panorama(tmp_path):
    path = tmp_path / "whole sky.exr"
    result = run("bake", path, "--panorama", "--width", 64, "--height", 32, "--orbit", "free-fall", "--radius", 6)
    assert result.returncode == 0, result.stderr
    assert read_warp_map(path).metadata["parameters"]["camera"]["kind"] == "panorama"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--radius", 1.1), "inside the black hole"),
        (("--radius", -3), "positive"),
        (("--spin", 1), "spin"),
        (("--inclination", 200), "0 to 180"),
        (("--orbit", "static", "--radius", 1.9, "--inclination", 90), "ergosphere"),
        (("--orbit", "circular-retrograde", "--radius", 3), "photon orbit"),
        (("--fov", 180), "field of view"),
        (("--width", 0), "size"),
        (("--tolerance", 0), "tolerance"),
    ],
)
def test_impossible_shots_end_with_one_sentence(tmp_path, arguments, words):
    result = run("bake", tmp_path / "map.exr", "--width", 8, "--height", 8, *arguments)
    assert result.returncode == 1
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    assert words in result.stderr
    assert not list(tmp_path.iterdir())


def test_wrong_files_end_with_one_sentence(baked, sky, tmp_path):
    cases = [
        (("bake", tmp_path / "map.png"), "does not end in .exr"),
        (("render", sky, sky, tmp_path / "a.png"), "not a warp map"),
        (("render", tmp_path / "no.exr", sky, tmp_path / "a.png"), "does not exist"),
        (("render", baked, tmp_path / "no.exr", tmp_path / "a.png"), "does not exist"),
        (("render", baked, sky, tmp_path / "a.jpg"), "must end in .png or .exr"),
    ]
    for arguments, words in cases:
        result = run(*arguments)
        assert result.returncode == 1
        assert words in result.stderr
        assert "Traceback" not in result.stderr
    assert not list(tmp_path.iterdir())


def test_wrong_usage_is_explained():
    result = run("bake")
    assert result.returncode == 2
    assert "usage" in result.stderr
    assert run("--help").returncode == 0


def test_unstable_orbit_and_odd_sky_are_noted(baked, tmp_path):
    result = run("bake", tmp_path / "map.exr", "--width", 8, "--height", 8, "--spin", 0, "--radius", 5, "--orbit",
                 "circular", "--inclination", 90)  # fmt: skip
    assert result.returncode == 0
    assert "unstable" in result.stderr
    square = tmp_path / "square.exr"
    write_exr(square, np.zeros((8, 8, 3), np.float32))
    assert "panorama?" in run("render", baked, square, tmp_path / "a.png").stderr


def test_a_disk_is_baked_beside_the_map_and_drawn(tmp_path, sky):
    path, picture = tmp_path / "map.exr", tmp_path / "picture.exr"
    small = ("--width", 64, "--height", 36, "--radius", 40, "--fov", 40)
    disk = ("--disk", "--disk-crossings", 2, "--disk-outer", 15)
    result = run("bake", path, *small, *disk, "--light", "--light-look", "gargantua", "--light-time", 10)
    assert result.returncode == 0, result.stderr
    for name in ("map_disk2.exr", "map_light.exr"):
        assert f"wrote {tmp_path / name}" in result.stdout
    result = run("render", path, sky, picture, "--light")
    assert result.returncode == 0, result.stderr
    plain = tmp_path / "plain.exr"
    assert run("render", path, sky, plain).returncode == 0
    assert not np.array_equal(read_exr(picture)[0], read_exr(plain)[0])
    # A layer of a map without that disk is refused, and so is one that is missing.
    assert run("bake", path, *small, "--disk", "--disk-crossings", 2).returncode == 0
    result = run("render", path, sky, picture, "--light")
    assert (result.returncode, "does not belong to" in result.stderr) == (1, True)
    (tmp_path / "map_light.exr").unlink()
    result = run("render", path, sky, picture, "--light")
    assert (result.returncode, "map_light.exr does not exist" in result.stderr) == (1, True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--disk-outer", 9), "add --disk"),
        (("--disk", "--disk-outer", 1), "outer radius"),
        (("--disk", "--disk-inner", 0.1), "inner radius"),
        (("--disk", "--disk-crossings", 99), "crossings"),
        (("--disk", "--method", "cash-karp-printed"), "knows no disk"),
    ],
)
def test_impossible_disks_are_refused_in_one_sentence(tmp_path, arguments, words):
    result = run("bake", tmp_path / "map.exr", *arguments)
    assert result.returncode == 1
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("map_path", "expected"),
    [
        ("map.exr", "map_disk2.exr"),
        ("Scene_Black_Hole_48x27_0001.exr", "Scene_Black_Hole_48x27_disk2_0001.exr"),
        ("//umbra_maps/Scene_Black_Hole_48x27_999995.exr", "//umbra_maps/Scene_Black_Hole_48x27_disk2_999995.exr"),
        ("shot_1/map.exr", "shot_1/map_disk2.exr"),
        ("spin_0.9.exr", "spin_0.9_disk2.exr"),
        ("a_1_b.exr", "a_1_b_disk2.exr"),
    ],
)
def test_passes_are_named_by_one_rule(map_path, expected):
    assert pass_path(map_path, 2) == expected


@pytest.mark.parametrize("names", ["{stem}_disk{crossing}_{frame}.exr", "{stem}_{frame}_disk{crossing}.exr"])
def test_passes_are_found_however_they_are_named(tmp_path, names):
    """The passes of a numbered map, as the add-on names them, and as this command line once did."""
    path = tmp_path / "shot_0007.exr"
    small = ("--width", 64, "--height", 36, "--radius", 40, "--fov", 40)
    assert run("bake", path, *small, "--disk", "--disk-crossings", 2).returncode == 0
    for crossing in (1, 2):
        name = names.format(stem="shot", frame="0007", crossing=crossing)
        (tmp_path / f"shot_disk{crossing}_0007.exr").replace(tmp_path / name)
    result = run("accuracy", path, "--samples", 100, "--json")
    assert result.returncode == 0, result.stderr
    assert len(json.loads(result.stdout)["disk"]) == 2


def test_the_british_spelling_of_an_option_is_accepted(baked, sky, tmp_path):
    pictures = [tmp_path / "american.exr", tmp_path / "british.exr"]
    for picture, option in zip(pictures, ("--redshift-color", "--redshift-colour"), strict=True):
        result = run("render", baked, sky, picture, option, 0.25)
        assert result.returncode == 0, result.stderr
    assert np.array_equal(read_exr(pictures[0])[0], read_exr(pictures[1])[0])
    assert "colour" not in run("render", "--help").stdout
