# SPDX-License-Identifier: GPL-3.0-or-later
"""Skies of all common formats, as linear Rec. 709: against values worked out by hand and by published matrices."""

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from exr_files import written

from physics import ImageFileError, write_exr
from physics.cli import main
from physics.images import picture
from physics.images.chromaticities import REC709, to_rec709
from physics.images.exr import read_exr
from physics.images.picture import image_io, read_picture

ROOT = Path(__file__).parents[3]

# ACES 2065-1 (SMPTE ST 2065-1) and what turns linear Rec. 709 into it, rounded, from the ACES documents; P3 with the
# white of D65, and its matrix from SMPTE EG 432-1.
ACES_AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
TO_ACES_AP0 = np.array([[0.4397, 0.3830, 0.1773], [0.0898, 0.8134, 0.0968], [0.0175, 0.1115, 0.8710]])
P3_D65 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290)
P3_TO_XYZ = np.array([[0.4866, 0.2657, 0.1982], [0.2290, 0.6917, 0.0793], [0.0000, 0.0451, 1.0439]])
REC709_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])

needs_image_io = pytest.mark.skipif(image_io() is None, reason="there is no OpenImageIO")


def png(path, rows, color_type, depth=8):
    """A PNG without filters of rows of numbers: color type 0 gray, 2 RGB, 4 gray and alpha, 6 RGBA."""
    samples = {0: 1, 2: 3, 4: 2, 6: 4}[color_type]
    data = np.asarray(rows, ">u2" if depth == 16 else "u1").reshape(len(rows), -1)
    lines = b"".join(b"\0" + line.tobytes() for line in data)

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    head = struct.pack(">IIBBBBB", data.shape[1] // samples, len(rows), depth, color_type, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)
    return path


def radiance(path, pixels):
    """A Radiance picture, not compressed, of (red, green, blue, exponent) bytes."""
    data = np.asarray(pixels, np.uint8)
    height, width = data.shape[:2]
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode() + data.tobytes())
    return path


def exr(path, color, **header):
    planes = {name: np.full((8, 16), value, np.float32) for name, value in zip("RGB", color, strict=True)}
    written(path, planes, compression=OpenEXR.ZIP_COMPRESSION, **header)
    return path


@needs_image_io
def test_png_is_srgb(tmp_path):
    """Of 8 and 16 bits, gray and in color. 188 of 255 is 0.5029 in linear light, 10 is 10 / 255 / 12.92."""
    values = {0: 0.0, 10: 10 / 255 / 12.92, 188: 0.502886, 255: 1.0}
    color = read_picture(png(tmp_path / "a.png", [[0, 10, 188, 255, 188, 10]] * 2, 2))
    assert color.shape == (2, 2, 3)
    assert color[1] == pytest.approx(
        np.array([[values[0], values[10], values[188]], [1.0, values[188], values[10]]]), abs=1e-5
    )
    gray = read_picture(png(tmp_path / "b.png", [[188, 10]], 0))
    assert gray[0] == pytest.approx(np.array([[values[188]] * 3, [values[10]] * 3]), abs=1e-5)
    deep = read_picture(png(tmp_path / "c.png", [[188 * 257, 0, 65535]], 2, depth=16))
    assert deep[0, 0] == pytest.approx(np.array([values[188], 0.0, 1.0]), abs=1e-5)


@needs_image_io
def test_colors_are_not_multiplied_by_alpha(tmp_path):
    found = read_picture(png(tmp_path / "a.png", [[255, 188, 0, 128]], 6))
    assert found[0, 0] == pytest.approx(np.array([1.0, 0.502886, 0.0, 128 / 255]), abs=1e-5)
    found = read_picture(png(tmp_path / "b.png", [[188, 128]], 4))
    assert found[0, 0, :3] == pytest.approx(np.full(3, 0.502886), abs=1e-5)


@needs_image_io
def test_radiance_is_linear(tmp_path):
    """(m / 256) 2^(e - 128), Ward 1991; a mantissa may stand for the middle of its step."""
    found = read_picture(radiance(tmp_path / "sky.hdr", [[(128, 64, 32, 129), (255, 0, 128, 140)]]))
    assert found[0] == pytest.approx(np.array([[1.0, 0.5, 0.25], [255 * 16.0, 0.0, 128 * 16.0]]), rel=0.02, abs=1e-2)


@needs_image_io
def test_jpeg_is_srgb(tmp_path):
    library = image_io()
    target = library.ImageOutput.create(str(tmp_path / "sky.jpg"))
    target.open(str(tmp_path / "sky.jpg"), library.ImageSpec(16, 8, 3, "uint8"))
    target.write_image(np.full((8, 16, 3), 188, np.uint8))
    target.close()
    # one level of 8 bits, which the compression may change, is 0.006 here
    assert read_picture(tmp_path / "sky.jpg") == pytest.approx(np.full((8, 16, 3), 0.502886), abs=0.01)


@needs_image_io
@pytest.mark.parametrize("ending", ["png", "hdr"])
def test_a_map_is_rendered_over_any_sky(tmp_path, ending, capsys):
    """An even sky without redshift is seen in its own color."""
    if ending == "png":
        sky = png(tmp_path / "sky.png", np.full((8, 48), 188), 2)
    else:
        sky = radiance(tmp_path / "sky.hdr", np.full((8, 16, 4), 128))
    assert main(["bake", str(tmp_path / "m.exr"), "--width", "8", "--height", "4", "--radius", "1e4"]) == 0
    plain = ("--redshift-color", "0", "--redshift-brightness", "0")
    assert main(["render", str(tmp_path / "m.exr"), str(sky), str(tmp_path / "p.exr"), *plain]) == 0
    found, _ = read_exr(tmp_path / "p.exr")
    assert found[0, 0, :3] == pytest.approx(np.full(3, 0.502886 if ending == "png" else 0.5), rel=0.01)
    # and the sky is not overwritten
    png_sky = tmp_path / "sky.png"
    if png_sky.exists():
        capsys.readouterr()
        assert main(["render", str(tmp_path / "m.exr"), str(sky), str(sky)]) == 1
        assert "would be lost" in capsys.readouterr().err


@needs_image_io
def test_spoiled_pictures_are_refused_in_one_sentence(tmp_path):
    good = png(tmp_path / "good.png", np.full((64, 192), 7), 2).read_bytes()
    spoiled = {
        "text.png": b"a text",
        "empty.hdr": b"",
        "cut.png": good[:40],
        "huge.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 1000000\n" + bytes(100),
        "cut.hdr": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100 +X 100\n" + bytes(100),
        "text.exr": b"a text",
    }
    for name, data in spoiled.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ImageFileError, match=name) as caught:
            read_picture(tmp_path / name)
        assert "\n" not in str(caught.value)
        assert str(caught.value).endswith(".")
    with pytest.raises(ImageFileError, match="does not exist"):
        read_picture(tmp_path / "none.png")


def test_without_openimageio_the_sentence_names_it(tmp_path, monkeypatch):
    monkeypatch.setattr(picture, "image_io", lambda: None)
    with pytest.raises(ImageFileError, match="install OpenImageIO") as caught:
        read_picture(png(tmp_path / "a.png", [[1, 2, 3]], 2))
    assert caught.value.code == "file.no-reader"
    write_exr(tmp_path / "sky.exr", np.ones((2, 4, 3), np.float32))
    assert (read_picture(tmp_path / "sky.exr") == 1.0).all()


@needs_image_io
def test_blender_is_not_started_to_read_a_picture(tmp_path):
    png(tmp_path / "a.png", [[1, 2, 3]], 2)
    script = (
        "import sys; from physics.images.picture import read_picture; "
        f"assert read_picture({str(tmp_path / 'a.png')!r}).shape == (1, 1, 3); assert 'bpy' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# --- chromaticities ---------------------------------------------------------------------------------


def test_aces_is_read_as_rec709(tmp_path):
    """The published matrix has four digits, and its white is adapted by another formula: 0.2 %."""
    color = np.array([0.8, 0.1, 0.05])
    found = read_picture(exr(tmp_path / "ap0.exr", TO_ACES_AP0 @ color, chromaticities=ACES_AP0))
    assert found[3, 5] == pytest.approx(color, abs=0.002)


def test_a_sky_with_other_primaries_shows_the_same_color(tmp_path):
    """A color is the same in Rec.709 and in ACES AP0, if the file says which of them it has."""
    color = np.array([0.8, 0.1, 0.05])
    skies = {
        "rec709": exr(tmp_path / "rec709.exr", color),
        "ap0": exr(tmp_path / "ap0.exr", TO_ACES_AP0 @ color, chromaticities=ACES_AP0),
    }
    assert main(["bake", str(tmp_path / "m.exr"), "--width", "32", "--height", "16", "--radius", "1e5"]) == 0
    corners = {}
    for name, sky in skies.items():
        shown = tmp_path / f"{name}_picture.exr"
        assert main(["render", str(tmp_path / "m.exr"), str(sky), str(shown)]) == 0
        corners[name] = read_exr(shown)[0][2, 2, :3]
    np.testing.assert_allclose(corners["ap0"], corners["rec709"], atol=0.01)


def test_p3_is_read_as_rec709(tmp_path):
    """Of the same white, so by way of XYZ alone; the published matrices have four digits."""
    color = np.array([0.3, 0.6, 0.2])
    in_p3 = np.linalg.solve(P3_TO_XYZ, REC709_TO_XYZ @ color)
    found = read_picture(exr(tmp_path / "p3.exr", in_p3, chromaticities=P3_D65))
    assert found[0, 0] == pytest.approx(color, abs=1e-3)


def test_rec709_is_left_as_it_is(tmp_path):
    color = np.array([0.8, 0.1, 0.05], np.float32)
    for header in ({}, {"chromaticities": REC709}):
        assert (read_picture(exr(tmp_path / "a.exr", color, **header))[1, 1] == color).all()


@pytest.mark.parametrize(
    "primaries", [ACES_AP0, P3_D65, (0.7347, 0.2653, 0.2738, 0.7174, 0.1666, 0.0089, 0.3457, 0.3585)]
)
def test_white_stays_white(primaries):
    assert to_rec709(primaries) @ np.ones(3) == pytest.approx(np.ones(3), abs=1e-12)


@pytest.mark.parametrize(
    "primaries",
    [
        (0.0,) * 8,
        (0.3, 0.3) * 4,
        (np.nan,) * 8,
        (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.9, 0.05),
        (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3, 0.0),
    ],
)
def test_primaries_that_are_none_are_refused(tmp_path, primaries):
    path = exr(tmp_path / "odd.exr", (0.1, 0.2, 0.3), chromaticities=primaries)
    with pytest.raises(ImageFileError, match="chromaticities"):
        read_picture(path)


def test_a_cube_map_is_refused_by_name(tmp_path, capsys):
    cube = exr(tmp_path / "cube.exr", (0.1, 0.2, 0.3), envmap=OpenEXR.ENVMAP_CUBE)
    with pytest.raises(ImageFileError, match=r"cube\.exr is a cube map") as caught:
        read_picture(cube)
    assert caught.value.code == "file.cube-map"
    panorama = exr(tmp_path / "panorama.exr", (0.1, 0.2, 0.3), envmap=OpenEXR.ENVMAP_LATLONG)
    assert read_picture(panorama).shape == (8, 16, 3)
    assert main(["bake", str(tmp_path / "m.exr"), "--width", "8", "--height", "4"]) == 0
    capsys.readouterr()
    assert main(["render", str(tmp_path / "m.exr"), str(cube), str(tmp_path / "p.png")]) == 1
    assert "is a cube map" in capsys.readouterr().err
    assert not (tmp_path / "p.png").exists()
