# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing points of light; their files, catalogs and commands."""

from __future__ import annotations

import math

import numpy as np
import pytest
from commands import run
from shots import shot

import physics
from physics.stars.drawing import draw

CAMERAS = [
    physics.PerspectiveCamera(40, 30, 20.0, shift_x=0.3, pixel_aspect_y=1.5),
    physics.PanoramaCamera(40, 20),
    physics.PanoramaCamera(40, 20, 0.1, 0.9, -1.0, 2.0),
]


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_point_has_the_same_light_at_32_places_in_a_pixel(camera: object) -> None:
    areas = camera.solid_angles()
    for step in range(32):
        x, y = 12.0 + step / 32.0, 9.0 + (5 * step % 32) / 32.0
        image, drawn = draw(camera, np.array([x]), np.array([y]), np.array([[1.0, 2.0, 0.5]]))
        light = image * areas[..., None]
        assert drawn == 1
        np.testing.assert_allclose(light.sum(axis=(0, 1)), [1.0, 2.0, 0.5], rtol=1e-5)
        row, column = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
        assert (light[..., 0] * column).sum() == pytest.approx(x, abs=0.01)
        assert (light[..., 0] * row).sum() == pytest.approx(y, abs=0.01)


@pytest.mark.parametrize("camera", CAMERAS)
def test_solid_angles_are_those_between_the_corners_of_pixels(camera: object) -> None:
    y, x = np.mgrid[0 : camera.height + 1, 0 : camera.width + 1].astype(float)
    corner = camera.directions(x, y)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    expected = 0.5 * np.linalg.norm(np.cross(d - a, c - b), axis=-1)
    np.testing.assert_allclose(camera.solid_angles(), expected, rtol=0.02)


def test_a_panorama_goes_on_at_its_sides_and_beyond_its_poles() -> None:
    camera = CAMERAS[1]
    for x, y in ((0.1, 10.0), (39.9, 10.0), (7.0, 0.2), (31.0, 19.9)):
        image, _drawn = draw(camera, np.array([x]), np.array([y]), np.ones((1, 3)))
        assert (image[..., 0] * camera.solid_angles()).sum() == pytest.approx(1.0, rel=1e-5)
    image, _drawn = draw(camera, np.array([0.0]), np.array([10.0]), np.ones((1, 3)))
    np.testing.assert_allclose(image[:, 0], image[:, -1], rtol=1e-6)


def test_crops_join() -> None:
    """Parts of a picture, as in border renders and tiles, are what the whole has there."""
    whole = shot(160, 90, spin=0.9, radius=22.0)
    layer = physics.StarBaker().bake(whole)
    part = shot(spin=0.9, radius=22.0, camera=whole.camera.cropped(60, 20, 50, 40))
    found = physics.StarBaker().bake(part)
    np.testing.assert_allclose(found.image, layer.image[20:60, 60:110], rtol=1e-3, atol=1e-5 * layer.image.max())
    assert layer.counts["stars"] == 41411


def test_files_and_commands(tmp_path: object) -> None:
    table = tmp_path / "stars.csv"
    table.write_text("ra,dec,mag,b-v\n# none\n180.5,10,1.5,0.6\n10,-80,3,\n170,12,2\n")
    stars = physics.read_star_catalog(table)
    np.testing.assert_allclose(np.degrees(stars.right_ascension), [180.5, 10.0, 170.0])
    assert math.isnan(stars.color_index[1])
    where = str(tmp_path / "map.exr")
    size = ("--width", "96", "--height", "48", "--panorama")
    assert run("bake", where, *size, "--stars", "--star-catalog", str(table)).returncode == 0
    layer = physics.read_stars(physics.stars_path(where))
    assert layer.metadata["stars"]["catalog"] == "stars.csv"
    assert layer.counts["stars"] == 3
    assert layer.counts["images"] >= 9
    assert layer.image.max() > 0.0
    sky = tmp_path / "sky.exr"
    physics.write_exr(sky, np.zeros((4, 8, 3), np.float32))
    picture = tmp_path / "picture.exr"
    assert run("render", where, str(sky), str(picture), "--stars", "--exposure", "1").returncode == 0
    np.testing.assert_allclose(physics.read_exr(picture)[0][..., :3], 2.0 * layer.image, rtol=1e-5)
    turned = run("render", where, str(sky), str(picture), "--stars", "--rotation", "0", "0", "5")
    assert turned.returncode == 1
    assert "star-rotation" in turned.stderr
    assert run("bake", where, *size, "--star-limit", "3").returncode == 1
    assert run("verify", physics.stars_path(where)).returncode == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1,2,3,0.5\n1,95,3,0.5\n", "line 2: the declination is 95"),
        ("1,2,x,0.5\n", "line 1: the magnitude 'x' is not a number"),
        ("1,2\n", "line 1: 2 columns"),
        ("ra,dec,mag\n", "holds no stars"),
        ("1,2,3,-3\n", "the B-V is -3"),
    ],
)
def test_a_table_that_is_none_is_refused_by_its_line(tmp_path: object, text: str, said: str) -> None:
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(physics.BlackHoleError, match=said) as caught:
        physics.read_star_catalog(tmp_path / "table.csv")
    assert caught.value.code == "file.bad-catalog"
