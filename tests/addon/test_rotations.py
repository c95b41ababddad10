# SPDX-License-Identifier: GPL-3.0-or-later
"""Arithmetic of rotations against numpy's linear algebra."""

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest


@pytest.fixture
def rotations(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("scene.rotations")


def test_the_nearest_rotation(rotations: ModuleType) -> None:
    """The orthogonal factor of the singular value decomposition, for axes as skew as a scene may have them."""
    rng = np.random.default_rng(4)
    for _ in range(200):
        exact, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        exact *= np.sign(np.linalg.det(exact))
        noisy = exact + rng.uniform(-1e-4, 1e-4, (3, 3))
        left, _, right = np.linalg.svd(noisy)
        np.testing.assert_allclose(rotations.nearest_rotation(noisy), left @ right, rtol=0, atol=1e-14)


def test_products_and_lengths(rotations: ModuleType) -> None:
    rng = np.random.default_rng(5)
    one, other = rng.standard_normal((2, 3, 3))
    np.testing.assert_allclose(rotations.times(one, other), one @ other, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotations.times(one, other[0]), one @ other[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotations.length(one), np.linalg.norm(one, axis=0), rtol=1e-15)
    assert rotations.determinant(one) == pytest.approx(np.linalg.det(one), rel=1e-12)
