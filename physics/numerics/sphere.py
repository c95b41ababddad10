# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions on the sphere: angles, unit vectors and the triad at a point."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array


def cos_sin(angle: Array) -> tuple[Array, Array]:
    """Return cosine and sine, each to a few units of rounding, from the tangent of half the angle.

    numpy's tangent runs in vector instructions, its sine and cosine do not: one tangent costs a tenth of both.

    Parameters
    ----------
    angle : ndarray
        Radians.

    Returns
    -------
    cosine, sine : ndarray
        Of the same shape.
    """
    half = np.tan(0.5 * angle)
    square = half * half
    scale = 1.0 / (1.0 + square)
    cosine: Array = (1.0 - square) * scale
    half += half
    half *= scale
    return cosine, half


def by_component(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Array:
    """Return vectors that lie in memory component by component, which numpy processes faster.

    Parameters
    ----------
    x, y, z : array_like
        Shapes that broadcast.

    Returns
    -------
    ndarray, shape (..., 3)
    """
    return np.moveaxis(np.stack(np.broadcast_arrays(x, y, z)), 0, -1)


def unit_vectors(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Return (sin t cos p, sin t sin p, cos t) of polar and azimuthal angles.

    Parameters
    ----------
    theta, phi : array_like
        Radians; shapes that broadcast.

    Returns
    -------
    ndarray, shape (..., 3)
    """
    polar_cos, polar_sin = cos_sin(np.asarray(theta, dtype=np.float64))
    cosine, sine = cos_sin(np.asarray(phi, dtype=np.float64))
    return by_component(polar_sin * cosine, polar_sin * sine, polar_cos)


def celestial_coordinates(direction: Array) -> tuple[Array, Array]:
    """Return polar and azimuthal angle of directions.

    Parameters
    ----------
    direction : ndarray, shape (..., 3)
        Vectors of any length but 0.

    Returns
    -------
    theta : ndarray, shape (...)
        Radians, [0, pi]; NaN where a direction is NaN.
    phi : ndarray, shape (...)
        Radians, [0, 2 pi); NaN where a direction is NaN.
    """
    x, y, z = direction[..., 0], direction[..., 1], direction[..., 2]
    theta = np.arctan2(np.sqrt(x * x + y * y), z)
    phi = np.arctan2(y, x)
    phi = np.where(phi < 0.0, phi + 2.0 * math.pi, phi)
    # The sum of a tiny negative angle rounds up to 2 pi itself; the same comparison mends -0.
    return theta, np.where((phi >= 2.0 * math.pi) | (phi == 0.0), 0.0, phi)


def spherical_triad(theta: float, phi: float) -> Array:
    """Return the unit vectors r-hat, theta-hat and phi-hat at a place.

    Parameters
    ----------
    theta, phi : float
        Radians.

    Returns
    -------
    ndarray, shape (3, 3)
        Rows of Cartesian components.
    """
    sin_theta, cos_theta = math.sin(theta), math.cos(theta)
    sin_phi, cos_phi = math.sin(phi), math.cos(phi)
    return np.array(
        [
            [sin_theta * cos_phi, sin_theta * sin_phi, cos_theta],
            [cos_theta * cos_phi, cos_theta * sin_phi, -sin_theta],
            [-sin_phi, cos_phi, 0.0],
        ]
    )


def euler_rotation(euler: ArrayLike) -> Array:
    """Return the rotation of XYZ Euler angles, as of Blender's Mapping node (type Point).

    Parameters
    ----------
    euler : array_like, shape (3,)
        Angles about x, y and z in radians; applied in this order about fixed axes.

    Returns
    -------
    ndarray, shape (3, 3)
        Rz Ry Rx.
    """
    angle_x, angle_y, angle_z = (float(angle) for angle in np.asarray(euler, dtype=np.float64))
    cx, sx = math.cos(angle_x), math.sin(angle_x)
    cy, sy = math.cos(angle_y), math.sin(angle_y)
    cz, sz = math.cos(angle_z), math.sin(angle_z)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    rotation: Array = about_z @ about_y @ about_x
    return rotation
