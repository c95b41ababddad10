# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions on the sphere: angles, unit vectors and the triad at a point."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def unit_vectors(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Return (sin t cos p, sin t sin p, cos t), shape (..., 3), of polar and azimuthal angles in radians."""
    polar, azimuth = np.asarray(theta, dtype=np.float64), np.asarray(phi, dtype=np.float64)
    sine = np.sin(polar)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)], axis=-1)


def celestial_coordinates(direction: Array) -> tuple[Array, Array]:
    """Return theta in [0, pi] and phi in [0, 2 pi) of vectors of shape (..., 3); NaN where they are NaN."""
    x, y, z = direction[..., 0], direction[..., 1], direction[..., 2]
    theta = np.arctan2(np.hypot(x, y), z)
    phi = np.arctan2(y, x) % (2.0 * math.pi)
    # The remainder of a tiny negative angle rounds up to 2 pi itself.
    return theta, np.where(phi >= 2.0 * math.pi, 0.0, phi)


def spherical_triad(theta: float, phi: float) -> Array:
    """Return r-hat, theta-hat and phi-hat at a place as rows of Cartesian components, shape (3, 3)."""
    sin_theta, cos_theta = math.sin(theta), math.cos(theta)
    sin_phi, cos_phi = math.sin(phi), math.cos(phi)
    return np.array([
        [sin_theta * cos_phi, sin_theta * sin_phi, cos_theta],
        [cos_theta * cos_phi, cos_theta * sin_phi, -sin_theta],
        [-sin_phi, cos_phi, 0.0],
    ])
