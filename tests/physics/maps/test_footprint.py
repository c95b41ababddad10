# SPDX-License-Identifier: GPL-3.0-or-later
"""Footprints against closed forms of the camera in empty space, and against derivatives of traced rays."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

import physics
from physics.maps.footprint import NOTHING_SEEN, footprint

HALF = 2.0**-10
"""Half precision rounds by 2^-11."""


@dataclass
class Arrays:
    theta: np.ndarray
    phi: np.ndarray
    visibility: np.ndarray


def of_directions(x: np.ndarray, y: np.ndarray, z: np.ndarray, seen: np.ndarray | None = None) -> np.ndarray:
    length = np.sqrt(x * x + y * y + z * z)
    arrays = Arrays(
        np.arccos(z / length).astype(np.float32),
        np.mod(np.arctan2(y, x), 2.0 * math.pi).astype(np.float32),
        np.ones(x.shape, np.float32) if seen is None else seen,
    )
    return footprint(arrays).astype(np.float64)


def test_a_flat_camera_sees_ellipses_of_known_axes() -> None:
    """At the angle e off the axis of a pinhole a pixel of width d spans d cos^2(e) along the radius, d cos(e) across.

    Central differences are off by the square of a pixel's width: 1e-4.
    """
    d = 0.01
    columns, rows = np.meshgrid((np.arange(101) - 50) * d, (np.arange(81) - 40) * d)
    found = of_directions(columns, rows, np.ones_like(columns))
    off = np.arctan(np.hypot(columns, rows))
    inner = np.s_[1:-1, 1:-1]
    major = np.linalg.norm(found[..., :3], axis=-1)
    np.testing.assert_allclose(major[inner], (d * np.cos(off))[inner], rtol=2.0 * HALF + 2e-4)
    np.testing.assert_allclose(2.0 ** found[..., 3][inner], (d * np.cos(off) ** 2)[inner], rtol=3e-3)
    # the major axis is perpendicular to the radius
    radial = np.stack([columns, rows, np.zeros_like(columns)], axis=-1)
    cosine = np.abs((found[..., :3] * radial).sum(axis=-1)) / np.maximum(major * np.linalg.norm(radial, axis=-1), 1e-9)
    far = off > 0.2
    far[[0, -1]], far[:, [0, -1]] = False, False
    assert cosine[far].max() < 0.03


def test_seam_and_poles_are_like_any_other_place() -> None:
    """The same camera turned so that seam or pole lies in its picture: only the frame of the vectors changes."""
    d = 0.004
    columns, rows = np.meshgrid((np.arange(61) - 30) * d, (np.arange(61) - 30) * d)
    ahead = np.ones_like(columns)
    expected = of_directions(ahead, columns, rows)
    for turned in (of_directions(-ahead, columns, rows), of_directions(columns, rows, ahead)):
        major, wanted = (np.linalg.norm(each[..., :3], axis=-1) for each in (turned, expected))
        np.testing.assert_allclose(major, wanted, rtol=2e-3)
        np.testing.assert_allclose(turned[..., 3], expected[..., 3], atol=2.0**-7)  # half precision's steps near -8


def test_pixels_beside_hidden_ones_take_the_other_side() -> None:
    d = 0.01
    columns, rows = np.meshgrid(np.arange(20) * d, np.arange(10) * d)
    seen = np.ones(columns.shape, np.float32)
    seen[:, 10:] = 0.0
    found = of_directions(columns, rows, np.ones_like(columns), seen)
    whole = of_directions(columns, rows, np.ones_like(columns))
    np.testing.assert_array_equal(found[:, 10:], np.broadcast_to(np.asarray(NOTHING_SEEN), (10, 10, 4)))
    lengths, wanted = (np.linalg.norm(each[:, 9, :3], axis=-1) for each in (found, whole))
    np.testing.assert_allclose(lengths, wanted, rtol=0.02)
    np.testing.assert_allclose(found[:, 9, 3], whole[:, 9, 3], atol=0.03)


def test_a_pixel_alone_has_no_extent() -> None:
    found = of_directions(np.ones((1, 1)), np.zeros((1, 1)), np.zeros((1, 1)))
    np.testing.assert_array_equal(found[0, 0, :3], 0.0)


@pytest.mark.parametrize("spin", [0.0, 0.9])
def test_axes_are_those_of_traced_ray_bundles(spin: float) -> None:
    """Singular values of the derivative of rays traced a hundredth of a pixel apart, where a pixel is a small step.

    Between pixels the sky is compressed by a factor that changes by the pixel's distance from the shadow, so
    central differences agree to a few percent from 10 pixels off.
    """
    place = (25.0, 0.0, 2.0)
    look = physics.looking_at_hole(place)

    def camera(scale: int, left: int, top: int) -> physics.PerspectiveCamera:
        whole = physics.PerspectiveCamera.from_field_of_view(160 * scale, 90 * scale, math.radians(40.0))
        return whole.cropped(left, top, 3, 3)

    def axes(parameters: physics.WarpMapParameters, pixel_widths: float) -> tuple[float, float]:
        middle = physics.footprint(physics.bake(parameters))[1, 1].astype(np.float64)
        return float(np.linalg.norm(middle[:3])) / pixel_widths, float(2.0 ** middle[3]) / pixel_widths

    def parameters(scale: int, column: float, row: float) -> physics.WarpMapParameters:
        left, top = round((column + 0.5) * scale - 1.5), round((row + 0.5) * scale - 1.5)
        return physics.WarpMapParameters(
            spin=spin, camera=camera(scale, left, top), camera_position=place, camera_to_hole=look, motion="fido"
        )

    for column, row in ((20, 20), (120, 20), (100, 70), (40, 45)):
        coarse, fine = axes(parameters(1, column, row), 1.0), axes(parameters(9, column, row), 1.0 / 9.0)
        assert coarse[0] == pytest.approx(fine[0], rel=0.05)
        assert coarse[1] == pytest.approx(fine[1], rel=0.05)
