# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid twice as fine, against the function that the coarse one was made of."""

import math

import numpy as np
import pytest

from physics.disk_passes.ring_grid import between, continuous

ANGLES, COLUMNS = 128, 21


def image(angles, columns, turns, sides):
    """u, azimuth and du / dlambda of a made-up image: the azimuth turns by `turns` once round, winds up along the
    columns by more than half a turn at each, and is counted the other way beyond pi. `sides`: to which half the rows at
    0 and at pi belong."""
    psi = np.arange(angles)[:, None] * (2.0 * math.pi / angles)
    s = np.linspace(-3.0, 3.0, columns)
    u = 1.0 / (1.0 + np.exp(s + 0.3 * np.cos(psi)))
    azimuth = turns * psi + 0.4 * np.sin(psi + 0.2) - 12.0 * s
    other = psi > math.pi
    other[0], other[angles // 2] = sides
    counted = azimuth - 2.0 * math.pi * 3.0 * other
    if sides[0]:  # that half ends there: it is the last of the round before
        counted[0] += 2.0 * math.pi * turns
    return np.stack([u, counted, u * (1.0 - u)]), azimuth


@pytest.mark.parametrize("sides", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("turns", [0, 1, -2])
def test_the_azimuth_is_continuous_round_the_hole(turns, sides):
    values, azimuth = image(ANGLES, COLUMNS, turns, sides)
    found, beyond, once_round = continuous(values[1])
    assert beyond == pytest.approx(6.0 * math.pi)
    assert once_round == pytest.approx(2.0 * math.pi * turns)
    np.testing.assert_allclose(found, azimuth, atol=1e-12)


@pytest.mark.parametrize("sides", [(False, False), (True, True)])
def test_half_way_between_nodes_is_what_cubics_say(sides):
    """Cubics leave out 3/128 of the fourth difference, at the ends 5/128: of e^s in steps of 0.3, 2e-4 of it."""
    coarse, _ = image(ANGLES, COLUMNS, 1, sides)
    fine, azimuth = image(2 * ANGLES, 2 * COLUMNS - 1, 1, sides)
    found = between(coarse)
    np.testing.assert_array_equal(found[[0, 2], ::2, ::2], coarse[[0, 2]])
    np.testing.assert_allclose(found[[0, 2]], fine[[0, 2]], atol=1e-4)
    again, *_ = continuous(found[1])
    np.testing.assert_allclose(again, azimuth, atol=1e-5)


def test_what_is_not_known_spreads_no_farther_than_its_neighbors():
    coarse, _ = image(ANGLES, COLUMNS, 1, (False, False))
    coarse[:, 40, 10] = np.nan
    rows, columns = np.nonzero(np.isnan(between(coarse)).any(axis=0))
    assert np.abs(rows - 80).max() <= 3
    assert np.abs(columns - 20).max() <= 3
