# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels of a sky: their light, by integrals over the sphere, and their places in the atlas."""

from __future__ import annotations

import math

import numpy as np
import pytest

from physics.light.sky_levels import FEWEST_ROWS, MARGIN, MOST_ROWS, LevelLayout, layout_for, sky_levels
from physics.numerics.errors import BlackHoleError


def centers(rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y, z of the texels' centers."""
    longitude, polar = np.meshgrid(
        (0.5 - (np.arange(2 * rows) + 0.5) / (2 * rows)) * 2.0 * np.pi, (np.arange(rows) + 0.5) / rows * np.pi
    )
    return np.sin(polar) * np.cos(longitude), np.sin(polar) * np.sin(longitude), np.cos(polar)


def mean_light(level: np.ndarray) -> np.ndarray:
    """Mean over the sphere, each row by its solid angle."""
    edges = np.cos(np.linspace(0.0, np.pi, level.shape[0] + 1))
    weights = (edges[:-1] - edges[1:])[:, np.newaxis, np.newaxis]
    return (level * weights).sum(axis=(0, 1)) / (weights.sum() * level.shape[1])


@pytest.mark.parametrize("shape", [(256, 512), (100, 200), (90, 250), (33, 65), (3, 5), (1, 1)])
def test_each_level_has_the_light_of_the_sky(shape: tuple[int, int]) -> None:
    """Single precision sums to 1e-6; a sky that is resampled first has its own mean, which the levels keep."""
    picture = np.random.default_rng(5).gamma(0.3, 3.0, (*shape, 3))
    levels = sky_levels(picture).levels
    for level in levels:
        np.testing.assert_allclose(mean_light(level), mean_light(levels[0]), rtol=1e-5)
    assert levels[-1].shape[0] >= FEWEST_ROWS
    assert all(level.shape[1] == 2 * level.shape[0] for level in levels)


def test_a_sky_of_the_right_size_is_level_zero() -> None:
    picture = np.random.default_rng(6).random((64, 128, 3)).astype(np.float32)
    np.testing.assert_array_equal(sky_levels(picture).levels[0], picture)


def test_a_linear_sky_stays_linear_where_rows_are_alike() -> None:
    """z = cos(theta) averaged by solid angle over a row between two angles is the mean of their cosines."""
    for level in sky_levels(np.repeat(centers(512)[2][..., np.newaxis], 3, axis=2)).levels[1:]:
        edges = np.cos(np.linspace(0.0, np.pi, level.shape[0] + 1))
        expected = 0.5 * (edges[:-1] + edges[1:])
        # level 0 holds centers and not means, which differ by (pi / 512)^2 / 8
        np.testing.assert_allclose(level[:, 0, 0], expected, atol=5e-6)


def test_texels_beside_the_poles_are_as_wide_as_high() -> None:
    """A harmonic cos(m phi) is damped by sin(w) / w, w = m pi / (columns sin(theta)), as a box of that width does."""
    rows, order = 256, 3
    longitude = (0.5 - (np.arange(2 * rows) + 0.5) / (2 * rows)) * 2.0 * np.pi
    picture = np.repeat(np.tile(np.cos(order * longitude), (rows, 1))[..., np.newaxis], 3, axis=2)
    level = sky_levels(picture).levels[1]
    theta = (np.arange(rows // 2) + 0.5) * np.pi / (rows // 2)
    half_width = order * np.pi / rows / np.sin(theta)
    pair = np.cos(order * np.pi / (2 * rows))  # the mean of two neighbors
    phase = np.cos(order * (longitude[0::2] + longitude[1::2]) / 2.0)
    expected = pair * (np.sin(half_width) / half_width)[:, np.newaxis] * phase
    np.testing.assert_allclose(level[3:-3, :, 0], expected[3:-3], atol=2e-3)


@pytest.mark.parametrize("columns", [16, 1000, 1024, 4096, 8192, 16384])
def test_layout_follows_from_the_height(columns: int) -> None:
    layout = layout_for(columns // 2, columns)
    height = layout.size[1]
    assert layout.rows == (height - 4 * MARGIN) * 2 // 3
    assert min(columns // 2, MOST_ROWS) <= layout.rows <= max(1.13 * columns // 2, 2 * FEWEST_ROWS)
    assert layout.rows / 2 ** (layout.count - 1) in range(FEWEST_ROWS, 2 * FEWEST_ROWS)


def test_levels_do_not_overlap_in_the_atlas() -> None:
    levels = sky_levels(np.full((128, 256, 1), 1.0))
    width, height = levels.atlas_layout.size
    atlas = levels.atlas()
    assert atlas.shape == (height, width, 1)
    area = sum((level.shape[0] + 2 * MARGIN) * (level.shape[1] + 2 * MARGIN) for level in levels.levels[1:])
    assert atlas.sum() == area


def test_margins_go_on_around_the_sky() -> None:
    picture = np.random.default_rng(8).random((64, 128, 3)).astype(np.float32)
    levels = sky_levels(picture)
    atlas = levels.atlas()
    for number, level in enumerate(levels.levels[1:]):
        column, row = LevelLayout(32).corner(number)
        rows, columns = level.shape[:2]
        top = atlas.shape[0] - row - rows
        np.testing.assert_array_equal(atlas[top : top + rows, column : column + columns], level)
        np.testing.assert_array_equal(atlas[top : top + rows, column - 1], level[:, -1])
        np.testing.assert_array_equal(atlas[top : top + rows, column + columns], level[:, 0])
        np.testing.assert_array_equal(atlas[top - 1, column : column + columns], level[0])


def test_values_that_are_no_numbers_do_not_spread() -> None:
    picture = np.full((32, 64, 3), 0.5)
    picture[5, 5] = (math.nan, math.inf, -math.inf)
    levels = sky_levels(picture).levels
    assert all(np.isfinite(level).all() for level in levels)
    assert levels[1][10, 10, 0] == 0.5


@pytest.mark.parametrize("shape", [(4, 8), (0, 4, 3), (4, 0, 3)])
def test_what_is_no_picture_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(BlackHoleError, match="expected"):
        sky_levels(np.zeros(shape))
