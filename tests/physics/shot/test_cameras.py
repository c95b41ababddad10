# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels to directions: Blender's definitions of its lenses, checked by hand-made geometry."""

import math

import numpy as np
import pytest

from physics import BlackHoleError, PanoramaCamera, PerspectiveCamera


def tangents(camera, x, y):
    right, up, back = camera.directions(x, y)
    assert back < 0.0
    return right / -back, up / -back


def test_the_middle_looks_straight_ahead():
    assert PerspectiveCamera(640, 480, 50.0).directions(320.0, 240.0) == pytest.approx([0.0, 0.0, -1.0])


@pytest.mark.parametrize(
    ("fit", "width", "height", "half_width"),
    [
        ("AUTO", 400, 200, 36 / 100),
        ("AUTO", 200, 400, 36 / 100 * 0.5),  # the sensor's width goes to the longer side, the height
        ("HORIZONTAL", 200, 400, 36 / 100),
        ("VERTICAL", 400, 200, 24 / 100 * 2.0),
    ],
)
def test_sensor_fit(fit, width, height, half_width):
    camera = PerspectiveCamera(width, height, 50.0, sensor_fit=fit)
    right, up = tangents(camera, width, 0.0)
    assert right == pytest.approx(half_width)
    assert up == pytest.approx(half_width * height / width)


def test_shift_is_in_units_of_the_fitted_side_and_moves_the_frame():
    camera = PerspectiveCamera(400, 200, 50.0, shift_x=0.25, shift_y=-0.1)
    right, up = tangents(camera, 200.0, 100.0)
    assert right == pytest.approx(0.25 * 0.72)
    assert up == pytest.approx(-0.1 * 0.72)


def test_pixel_aspect():
    camera = PerspectiveCamera(400, 400, 50.0, pixel_aspect_x=2.0)
    right, up = tangents(camera, 400.0, 0.0)
    assert right == pytest.approx(0.36)
    assert up == pytest.approx(0.18)


def test_field_of_view():
    camera = PerspectiveCamera.from_field_of_view(1920, 1080, math.radians(60.0))
    assert tangents(camera, 960.0, 0.0)[1] == pytest.approx(math.tan(math.radians(30.0)))
    for wrong in (0.0, math.pi, -1.0, math.nan):
        with pytest.raises(BlackHoleError, match="field of view"):
            PerspectiveCamera.from_field_of_view(10, 10, wrong)


@pytest.mark.parametrize(
    "camera",
    [
        PerspectiveCamera(1920, 1079, 50.0, shift_x=0.2, shift_y=-0.1, pixel_aspect_y=1.5),
        PerspectiveCamera(300, 700, 35.0, sensor_fit="VERTICAL"),
        PerspectiveCamera(999, 1000, 35.0, shift_x=0.3),  # AUTO: with fewer pixels both sides may count as many
        PanoramaCamera(600, 200, latitude_min=-0.5, longitude_max=2.0),
    ],
)
def test_a_camera_with_fewer_pixels_sees_the_same(camera):
    small = camera.resized(48, 27)
    assert (small.width, small.height) == (48, 27)
    across, down = np.random.default_rng(3).random((2, 100))
    seen = small.directions(across * 48, down * 27)
    np.testing.assert_allclose(seen, camera.directions(across * camera.width, down * camera.height), atol=1e-12)


def test_panorama_covers_the_whole_sky_without_gap():
    camera = PanoramaCamera(360, 180)
    # Longitude 0 is straight ahead, the right side of the picture is to the right.
    assert camera.directions(180.0, 90.0) == pytest.approx([0.0, 0.0, -1.0], abs=1e-15)
    assert camera.directions(270.0, 90.0) == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert camera.directions(5.0, 0.0) == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    assert camera.directions(0.0, 90.0) == pytest.approx(camera.directions(360.0, 90.0), abs=1e-15)


def test_partial_panorama():
    camera = PanoramaCamera(100, 50, latitude_min=0.0, latitude_max=0.5, longitude_min=-0.2, longitude_max=0.3)
    assert math.asin(camera.directions(0.0, 50.0)[1]) == pytest.approx(0.0, abs=1e-15)
    assert math.asin(camera.directions(0.0, 0.0)[1]) == pytest.approx(0.5)
    seen = camera.directions(100.0, 50.0)
    assert math.atan2(seen[0], -seen[2]) == pytest.approx(0.3)


@pytest.mark.parametrize(
    "camera",
    [
        PerspectiveCamera(300, 200, 35.0, shift_x=0.1, shift_y=0.2, pixel_aspect_y=1.5),
        PerspectiveCamera(200, 300, 80.0, sensor_fit="VERTICAL"),
        PanoramaCamera(300, 100, latitude_max=1.0),
    ],
)
def test_pixels_are_the_inverse_of_directions(camera):
    random = np.random.default_rng(0)
    x, y = random.uniform((0.0, 0.0), (camera.width, camera.height), (20, 2)).T
    seen_x, seen_y = camera.pixels(camera.directions(x, y))
    assert seen_x == pytest.approx(x, abs=1e-9)
    assert seen_y == pytest.approx(y, abs=1e-9)
    vector = np.array([0.3, -0.5, 0.8])
    assert camera.component(x, y, vector) == pytest.approx(camera.directions(x, y) @ vector, abs=1e-14)


def test_directions_are_unit_vectors_of_the_pixels_shape():
    y, x = np.mgrid[0:7, 0:9] + 0.5
    for camera in (PerspectiveCamera(9, 7, 20.0), PanoramaCamera(9, 7)):
        vectors = camera.directions(x, y)
        assert vectors.shape == (7, 9, 3)
        assert np.linalg.norm(vectors, axis=-1) == pytest.approx(np.ones((7, 9)), abs=1e-15)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PerspectiveCamera(0, 10, 50.0), "size"),
        (lambda: PerspectiveCamera(10, 70000, 50.0), "size"),
        (lambda: PerspectiveCamera(10, 10, 0.0), "positive"),
        (lambda: PerspectiveCamera(10, 10, math.inf), "positive"),
        (lambda: PerspectiveCamera(10, 10, 50.0, shift_x=math.nan), "shift"),
        (lambda: PerspectiveCamera(10, 10, 50.0, sensor_fit="DIAGONAL"), "sensor fit"),
        (lambda: PanoramaCamera(10, 10, latitude_min=1.0, latitude_max=0.5), "latitude"),
        (lambda: PanoramaCamera(10, 10, longitude_max=7.0), "longitude"),
    ],
)
def test_impossible_cameras_are_refused_in_words(make, words):
    with pytest.raises(BlackHoleError, match=words):
        make()


@pytest.mark.parametrize(
    "camera",
    [
        PerspectiveCamera(96, 54, 35.0, shift_x=0.2, shift_y=-0.1),
        PerspectiveCamera(54, 96, 35.0, shift_x=0.2, shift_y=-0.1),
        PerspectiveCamera(96, 54, 35.0, sensor_fit="VERTICAL", sensor_height=20.0, pixel_aspect_x=2.0, shift_y=0.3),
        PanoramaCamera(96, 54),
        PanoramaCamera(96, 54, -0.4, 1.2, -2.0, 0.5),
    ],
)
def test_a_part_of_the_picture_sees_the_same_as_the_whole(camera):
    column, row = 17, 9
    part = camera.cropped(column, row, 41, 30)
    x, y = np.meshgrid(np.arange(41) + 0.5, np.arange(30) + 0.5)
    np.testing.assert_allclose(part.directions(x, y), camera.directions(x + column, y + row), atol=1e-13)
    assert (part.width, part.height) == (41, 30)
