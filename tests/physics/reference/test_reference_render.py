# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference rendering against analytic skies, hand-made pixels and scalar formulas of another kind."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from physics.light.color import redshift_gain
from physics.numerics.sphere import euler_rotation, unit_vectors
from physics.reference.reference_render import render, resize, sample_environment

FloatArray = NDArray[np.float64]


@dataclass
class Map:
    theta: FloatArray
    phi: FloatArray
    one_plus_z: FloatArray
    visibility: FloatArray


def map_of(theta: FloatArray, phi: FloatArray, shift: float = 1.0, visibility: float = 1.0) -> Map:
    shape = np.shape(theta)
    return Map(np.asarray(theta), np.asarray(phi), np.full(shape, shift), np.full(shape, visibility))


def random_map(width: int, height: int) -> Map:
    rng = np.random.default_rng(5)
    theta = np.arccos(rng.uniform(-1.0, 1.0, (height, width)))
    phi = rng.uniform(0.0, 2.0 * np.pi, (height, width))
    return Map(theta, phi, np.exp(rng.normal(size=theta.shape)), rng.random(theta.shape))


def analytic_sky(directions: FloatArray) -> FloatArray:
    """Colors that are smooth on the sphere, poles and seam included."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([1.0 + x, 1.0 + y * z, 1.0 + 0.5 * (x - y + z)], axis=-1)


def analytic_environment(width: int, height: int) -> FloatArray:
    """That sky as a picture: column 0 is seen towards -x just past the seam, row 0 is the zenith."""
    u, v = (np.arange(width) + 0.5) / width, 1.0 - (np.arange(height) + 0.5) / height
    azimuth, elevation = np.meshgrid((0.5 - u) * 2.0 * np.pi, (v - 0.5) * np.pi)
    level = np.cos(elevation)
    return analytic_sky(np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1))


def test_smooth_sky_is_seen_where_it_is() -> None:
    width, height = 1024, 512
    warp_map = random_map(60, 40)
    warp_map.theta[0, :8] = [0.0, 1e-9, 1e-4, 3e-3, np.pi, np.pi - 1e-9, np.pi - 1e-4, np.pi - 3e-3]
    warp_map.phi[1, :4] = [0.0, np.pi - 1e-9, np.pi + 1e-9, 2.0 * np.pi - 1e-9]
    warp_map.one_plus_z[:] = warp_map.visibility[:] = 1.0
    picture = render(warp_map, analytic_environment(width, height))
    expected = analytic_sky(unit_vectors(warp_map.theta, warp_map.phi))
    # Linear interpolation is off by up to step^2 / 8 times the second derivative (below 2) in each direction; next
    # to a pole the extended row is off by half a step times the slope.
    interior = np.abs(np.cos(warp_map.theta)) < math.cos(np.pi / height)
    step = np.pi / height
    np.testing.assert_allclose(picture.sky[interior][:, :3], expected[interior], rtol=0.0, atol=step**2)
    np.testing.assert_allclose(picture.sky[..., :3], expected, rtol=0.0, atol=1.5 * step)


def test_texel_centers_give_texels_exactly() -> None:
    environment = np.random.default_rng(1).random((6, 10, 4))
    column, row = np.meshgrid(np.arange(10), np.arange(6))
    directions = unit_vectors((row + 0.5) / 6.0 * np.pi, (0.5 - (column + 0.5) / 10.0) * 2.0 * np.pi)
    np.testing.assert_allclose(sample_environment(environment, directions), environment, rtol=0.0, atol=1e-13)


def test_seam_is_the_mean_of_the_first_and_the_last_column() -> None:
    environment = np.random.default_rng(1).random((1, 8, 3))
    seen = sample_environment(environment, [(-1.0, 1e-16, 0.0), (-1.0, -1e-16, 0.0)])
    expected = 0.5 * (environment[0, 0] + environment[0, -1])
    np.testing.assert_allclose(seen, [expected, expected], rtol=1e-12)


def test_rows_are_extended_at_the_poles() -> None:
    environment = np.zeros((4, 8, 3))
    environment[0], environment[-1] = 2.0, 3.0
    seen = sample_environment(environment, [(0.0, 0.0, 1.0), (0.1, 0.0, 1.0), (0.0, 0.0, -1.0)])
    np.testing.assert_array_equal(seen, [[2.0] * 3, [2.0] * 3, [3.0] * 3])


def test_left_and_right_and_up_are_not_mirrored() -> None:
    # Columns from left to right: +y lies left of the middle, as in Cycles' World.
    environment = np.zeros((3, 4, 3))
    environment[1, 1] = (1.0, 0.0, 0.0)  # u = 3/8
    environment[0, :, 1] = 1.0
    assert sample_environment(environment, (1.0, 1.0, 0.0))[0] == pytest.approx(1.0)
    assert sample_environment(environment, (0.0, 0.0, 1.0))[1] == pytest.approx(1.0)


def rotated_by_axis_angle(vector: FloatArray, axis: FloatArray, angle: float) -> FloatArray:
    """Rodrigues' formula."""
    return (
        vector * math.cos(angle)
        + np.cross(axis, vector) * math.sin(angle)
        + axis * float(axis @ vector) * (1.0 - math.cos(angle))
    )


def test_euler_angles_are_applied_about_x_then_y_then_z() -> None:
    angles = (0.3, -1.2, 2.5)
    vector = np.array([0.2, -0.7, 0.4])
    expected = vector
    for axis, angle in zip(np.eye(3), angles, strict=True):
        expected = rotated_by_axis_angle(expected, axis, angle)
    np.testing.assert_allclose(euler_rotation(angles) @ vector, expected, rtol=1e-13)


def test_rotation_about_z_moves_the_sky_by_columns() -> None:
    environment = np.random.default_rng(1).random((16, 32, 3))
    warp_map = random_map(20, 10)
    turned = render(warp_map, environment, rotation=(0.0, 0.0, 2.0 * np.pi * 5 / 32))
    # A larger longitude is looked up: further left in the picture.
    moved = render(warp_map, np.roll(environment, 5, axis=1))
    np.testing.assert_allclose(turned.sky, moved.sky, rtol=1e-10)


def test_one_pixel_by_hand() -> None:
    environment = np.array([[[0.25, 0.5, 1.0]]])
    warp_map = map_of(np.array([[1.0]]), np.array([[2.0]]), shift=1.3, visibility=0.4)
    front = np.array([[[0.1, 0.2, 0.3, 0.6]]])
    picture = render(
        warp_map,
        environment,
        color_amount=0.7,
        brightness_amount=0.2,
        temperature=5000.0,
        exposure=2.0,
        strength=3.0,
        foreground=front,
    )
    sky = environment[0, 0] * 4.0 * 3.0 * 0.4 * redshift_gain(1.3, 0.7, 0.2, 5000.0)
    np.testing.assert_allclose(picture.sky[0, 0], [*sky, 1.0], rtol=1e-13)
    np.testing.assert_allclose(picture.image[0, 0], [*(front[0, 0, :3] + 0.4 * sky), 1.0], rtol=1e-13)
    assert picture.shadow[0, 0] == pytest.approx(0.6)
    assert picture.redshift[0, 0] == pytest.approx(1.3)


@pytest.mark.parametrize("supersampling", [2, 4, 8])
@pytest.mark.parametrize("size", [(6, 4), (5, 3)])
def test_supersampling_is_a_box_filter_of_the_picture(supersampling: int, size: tuple[int, int]) -> None:
    width, height = size
    environment = np.random.default_rng(1).random((16, 32, 3))
    warp_map = random_map(width * supersampling, height * supersampling)
    fine, coarse = render(warp_map, environment), render(warp_map, environment, output_size=size)
    blocks = (height, supersampling, width, supersampling)
    np.testing.assert_allclose(coarse.image, fine.image.reshape(*blocks, 4).mean(axis=(1, 3)), rtol=1e-12)
    np.testing.assert_allclose(coarse.shadow, fine.shadow.reshape(blocks).mean(axis=(1, 3)), rtol=1e-12)
    np.testing.assert_allclose(coarse.redshift, fine.redshift.reshape(blocks).mean(axis=(1, 3)), rtol=1e-12)


def test_resize_keeps_straight_lines_straight() -> None:
    column, row = np.meshgrid(np.arange(30) + 0.5, np.arange(20) + 0.5)
    ramp = np.stack([column / 30.0, row / 20.0], axis=-1)
    smaller = resize(ramp, (17, 13))
    column, row = np.meshgrid((np.arange(17) + 0.5) / 17.0, (np.arange(13) + 0.5) / 13.0)
    np.testing.assert_allclose(smaller, np.stack([column, row], axis=-1), rtol=1e-12)
    np.testing.assert_array_equal(resize(ramp, (30, 20)), ramp)


def test_light_without_alpha_is_added_to_the_sky() -> None:
    warp_map = map_of(np.array([[1.0, 1.0]]), np.array([[2.0, 2.0]]))
    front = np.array([[[2.0, 1.0, 0.0, 0.0], [0.1, 0.2, 0.3, 1.0]]])
    picture = render(warp_map, np.ones((1, 1, 3)), foreground=front)
    np.testing.assert_array_equal(picture.image[0, 0], [3.0, 2.0, 1.0, 1.0])
    np.testing.assert_array_equal(picture.image[0, 1], [0.1, 0.2, 0.3, 1.0])


@pytest.mark.parametrize(
    "broken",
    [
        (0.0, 0.0, 0.0, 0.0),
        (1.0, 1.0, -1.0, 1.0),
        (1.0, 1.0, 1.0, 1.5),
        (1.0, 1.0, 1.0, -0.5),
        (3.3, 1.0, 1.0, 1.0),
        (1.0, 7.0, 1.0, 1.0),
        (np.nan, 1.0, 1.0, 1.0),
        (1.0, 1.0, np.inf, 1.0),
    ],
)
def test_pixels_that_no_map_can_hold_are_magenta(broken: tuple[float, ...]) -> None:
    warp_map = map_of(np.ones((1, 2)), np.ones((1, 2)))
    for channel, value in zip(
        (warp_map.theta, warp_map.phi, warp_map.one_plus_z, warp_map.visibility), broken, strict=True
    ):
        channel[0, 0] = value
    front = np.ones((1, 2, 4))
    picture = render(warp_map, np.full((2, 4, 3), 0.5), exposure=-3.0, strength=0.0, foreground=front)
    np.testing.assert_array_equal(picture.image[0], [[1.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]])
    np.testing.assert_array_equal(picture.sky[0], [[1.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(picture.shadow, [[0.0, 0.0]])
    np.testing.assert_array_equal(picture.redshift, [[1.0, 1.0]])


def test_the_largest_angles_of_float32_are_valid() -> None:
    theta = np.array([[np.float32(np.pi)]])
    phi = np.array([[np.float32(2.0 * np.pi)]])
    picture = render(map_of(theta, phi), np.full((2, 4, 3), 0.5))
    np.testing.assert_allclose(picture.sky[0, 0], [0.5, 0.5, 0.5, 1.0])


def test_shapes_that_do_not_fit_are_named() -> None:
    warp_map = map_of(np.ones((3, 4)), np.ones((3, 4)))
    with pytest.raises(ValueError, match="environment has shape"):
        render(warp_map, np.ones((3, 4)))
    with pytest.raises(ValueError, match="foreground has shape"):
        render(warp_map, np.ones((2, 4, 3)), foreground=np.ones((3, 4, 3)))
    with pytest.raises(ValueError, match="foreground is 5x3 pixels, the picture 4x3"):
        render(warp_map, np.ones((2, 4, 3)), foreground=np.ones((3, 5, 4)), output_size=(4, 3))
    warp_map.theta = np.ones((2, 2))
    with pytest.raises(ValueError, match="share one shape"):
        render(warp_map, np.ones((2, 4, 3)))
