# SPDX-License-Identifier: GPL-3.0-or-later
"""Glare as numpy makes it: against the normal distribution's integral, and against what light must do."""

import math

import numpy as np
import pytest

from physics import GLARES, BlackHoleError, add_glare

KINDS = [kind for kind in GLARES if kind]


@pytest.mark.parametrize("kind", KINDS)
def test_a_point_becomes_the_sum_of_its_gaussians(kind: int) -> None:
    """Row and column sums through the point, by the error function; pixels average the Gaussian, hence 1e-2."""
    size = 601
    light = np.zeros((size, size, 1))
    light[size // 2, size // 2] = 1.0
    seen = add_glare(light, kind)[..., 0]
    assert seen.sum() == pytest.approx(1.0, abs=2e-4)  # the widest leaves the picture at six deviations
    along = np.abs(np.arange(size) - size // 2)
    for radius in (8, 30, 80):
        for axis, widths in ((1, [each.across for each in GLARES[kind]]), (0, [each.down for each in GLARES[kind]])):
            shares = [each.share for each in GLARES[kind]]
            beyond = sum(
                share * math.erfc((radius + 0.5) / (width * size) / math.sqrt(2.0))
                for share, width in zip(shares, widths, strict=True)
                if width
            )
            assert seen.sum(axis=1 - axis)[along > radius].sum() == pytest.approx(beyond, rel=1e-2, abs=1e-7)


@pytest.mark.parametrize("kind", GLARES)
def test_an_even_sky_stays_even_up_to_its_edges(kind: int) -> None:
    np.testing.assert_allclose(add_glare(np.full((90, 160, 3), 0.25), kind), 0.25, rtol=1e-12)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(BlackHoleError, match="glare is 7"):
        add_glare(np.zeros((4, 4, 3)), 7)
    with pytest.raises(BlackHoleError, match="shape"):
        add_glare(np.zeros((4, 4)), 1)
