# SPDX-License-Identifier: GPL-3.0-or-later
"""From a direction in the camera's sky to a light ray: momenta, constants of motion, redshift.

Equations 3 to 8 and 13 of Verbraeck & Eisemann, "Raytracing Equations" (after James et al. 2015), with Eq. 6
corrected (its first line must end in B_r B_theta / kappa to be orthonormal) and with everything written so
that it stays regular on the spin axis, where Eq. 8 is 0 times infinity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..numerics.arrays import Array, Indices
from ..numerics.sphere import unit_vectors
from .metric import MetricFunctions, axis_safe_sin, check_spin, metric_functions
from .observer import Observer

# Energy at infinity, per energy in the FIDO's frame, that stands for none: its constants of motion stay finite.
LEAST_ENERGY = 1e-12


@dataclass(frozen=True)
class Rays:
    """Light rays arriving at one camera; arrays of shape (n,).

    The momenta are those of the *light* (Eq. 7), scaled to unit energy at infinity, p_t = -1: a ray traced
    backwards runs along their negatives.
    """

    spin: float
    observer: Observer
    b: Array
    """Constant of motion p_phi, units of M (Eq. 8)."""
    q_plus_b2: Array
    """q + b^2 of Eq. 8, units of M^2: unlike q it is regular on the axis."""
    radial: Array
    """Delta p_r (Eq. 7) in units of M^2: its square is R(r_cam) of Eq. 3; > 0 for outgoing light."""
    polar: Array
    """p_theta (Eq. 7), units of M."""
    azimuthal: Array
    """b / sin(theta_cam), units of M, regular on the axis."""
    escapes: NDArray[np.bool_]
    """Whether the energy at infinity is positive; the rest can come only from the horizon."""
    one_plus_z: Array
    """Eq. 13, f_source / f_camera for a source at rest at infinity; NaN where `escapes` is false."""

    @property
    def q(self) -> Array:
        """Carter's constant q of Eq. 8, units of M^2."""
        return self.q_plus_b2 - self.b * self.b

    def __len__(self) -> int:
        return len(self.b)

    def select(self, chosen: NDArray[np.bool_] | Indices) -> Rays:
        """Return the chosen rays alone."""
        return Rays(
            self.spin,
            self.observer,
            self.b[chosen],
            self.q_plus_b2[chosen],
            self.radial[chosen],
            self.polar[chosen],
            self.azimuthal[chosen],
            self.escapes[chosen],
            self.one_plus_z[chosen],
        )


def camera_directions(theta_rd: ArrayLike, phi_rd: ArrayLike) -> Array:
    """Return the unit vectors N of Eq. 4 along which a camera looks.

    Parameters
    ----------
    theta_rd, phi_rd : array_like, shape (n,)
        Viewing angles in the camera's frame, radians.

    Returns
    -------
    ndarray, shape (n, 3)
        On (e_x, e_y, e_z), e_y along the camera's motion.
    """
    return unit_vectors(theta_rd, phi_rd)


def camera_triad(observer: Observer) -> Array:
    """Return the camera's axes on the FIDO's triad: the inverse of Eq. 6, corrected.

    Parameters
    ----------
    observer : Observer

    Returns
    -------
    ndarray, shape (3, 3)
        Rows e_x, e_y and e_z along (r, theta, phi)-hat. Where the motion B is along +-theta-hat, kappa = 0, and e_x is
        r-hat and e_z = e_x x e_y.
    """
    b_r, b_theta, b_phi = observer.direction
    kappa = math.hypot(b_r, b_phi)
    x_r, x_phi = (1.0, 0.0) if kappa == 0.0 else (b_phi / kappa, -b_r / kappa)
    return np.array(
        [
            [x_r, 0.0, x_phi],
            [b_r, b_theta, b_phi],
            [-x_phi * b_theta, x_phi * b_r - x_r * b_phi, x_r * b_theta],
        ]
    )


def rays_from_camera(spin: float, observer: Observer, directions: Array) -> Rays:
    """Return the rays that a camera sees along `directions`.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    observer : Observer
        The camera, outside the horizon.
    directions : ndarray, shape (n, 3)
        Unit vectors N in the camera frame (Eq. 4): where the camera looks. Light travels along -N.

    Raises
    ------
    BlackHoleError
        For a spin out of range or a camera inside the horizon.
    """
    return rays_from_axes(spin, observer, directions, camera_triad(observer))


def rays_from_triad(spin: float, observer: Observer, looking: Array) -> Rays:
    """Return the rays that a camera sees along directions on the axes (r-hat, theta-hat, phi-hat).

    These axes are the FIDO's triad, carried along by the boost to the camera.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    observer : Observer
        The camera, outside the horizon.
    looking : ndarray, shape (n, 3)
        Unit vectors along which the camera looks. Light runs the other way.

    Returns
    -------
    Rays

    Raises
    ------
    BlackHoleError
        If the spin is out of range or the camera is inside the horizon.
    """
    return rays_from_axes(spin, observer, looking, np.eye(3))


def rays_from_axes(spin: float, observer: Observer, directions: Array, axes: Array) -> Rays:
    """Return the rays that a camera sees along directions on any axes of its own.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    observer : Observer
        The camera, outside the horizon.
    directions : ndarray, shape (n, 3)
        Unit vectors along which the camera looks. Light runs the other way.
    axes : ndarray, shape (3, 3)
        Each row is one axis of the camera's frame on (r, theta, phi)-hat, the FIDO's triad carried along by the boost.

    Returns
    -------
    Rays

    Raises
    ------
    BlackHoleError
        If the spin is out of range or the camera is inside the horizon.
    """
    spin = check_spin(spin)
    metric = metric_functions(spin, observer.r, observer.theta)
    light, doppler = light_in_fido_frame(observer, directions, axes)
    return _rays_from_fido(spin, observer, metric, light, doppler)


def light_in_fido_frame(observer: Observer, directions: Array, axes: Array) -> tuple[Array, Array]:
    """Return where light runs in the FIDO's frame, and how much redder it is there, by Eqs. 5 and 13.

    Parameters
    ----------
    observer : Observer
    directions : ndarray, shape (n, 3)
        Unit vectors N, where the camera looks.
    axes : ndarray, shape (3, 3)
        As for `rays_from_axes`.

    Returns
    -------
    light : ndarray, shape (3, n)
        Unit vectors on (r-hat, theta-hat, phi-hat): the FIDO looks along their negatives to see the same light.
    doppler : ndarray, shape (n,)
        f_FIDO / f_camera.
    """
    beta, motion = observer.beta, np.array(observer.direction)
    gamma_inverse = math.sqrt((1.0 - beta) * (1.0 + beta))
    ahead = 1.0 - beta * (directions @ (axes @ motion))
    # Light runs along -N, contracted across the motion, and beta is added along it.
    boost = gamma_inverse * np.eye(3) + (1.0 - gamma_inverse) * np.outer(motion, motion)
    light = -(axes @ boost).T @ directions.T
    light += (beta * motion)[:, None]
    light /= ahead
    ahead /= gamma_inverse
    return light, ahead


def negative_energy_rays(spin: float, observer: Observer, directions: Array) -> Rays:
    """Return the rays that carry negative energy at infinity, as ordinary rays of a mirrored hole.

    Reversing the energy and the spin together leaves r and theta of Eq. 2 as they are and reverses d phi / d zeta: such
    a ray, traced backwards, runs as one of unit energy and the same b / |E| does about the hole of spin -a.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    observer : Observer
        The camera, outside the horizon.
    directions : ndarray, shape (n, 3)
        Unit vectors N in the camera frame (Eq. 4): where the camera looks.

    Returns
    -------
    Rays
        Of spin -a and scaled to p_t = +1; `escapes` says which directions these are, and `one_plus_z` is
        -E / E_camera. Rays of no energy count as having the least.

    Raises
    ------
    BlackHoleError
        If the spin is out of range or the camera is inside the horizon.
    """
    spin = check_spin(spin)
    metric = metric_functions(spin, observer.r, observer.theta)
    light, doppler = light_in_fido_frame(observer, directions, camera_triad(observer))
    return _rays_from_fido(spin, observer, metric, light, doppler, -1.0)


def redshift_vector(spin: float, observer: Observer) -> tuple[float, Array]:
    """Return the constants with which 1 + z of the sky is a linear function of the direction.

    Eqs. 5, 7 and 13 put together: the Doppler factor times alpha + omega varpi n_phi, in which the denominator of
    Eq. 5 cancels.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    observer : Observer
        The camera, outside the horizon.

    Returns
    -------
    constant : float
        c_0.
    vector : ndarray, shape (3,)
        c, with 1 + z = c_0 + c . N for every ray of the camera, N on (r, theta, phi)-hat.

    Raises
    ------
    BlackHoleError
        If the spin is out of range or the camera is inside the horizon.
    """
    metric = metric_functions(spin, observer.r, observer.theta)
    e_x, e_y, e_z = camera_triad(observer)
    beta = observer.beta
    gamma = 1.0 / math.sqrt((1.0 - beta) * (1.0 + beta))
    dragging = metric.omega * metric.varpi
    constant = gamma * (metric.alpha + dragging * e_y[2] * beta)
    on_x, on_y, on_z = -dragging * e_x[2], -gamma * (metric.alpha * beta + dragging * e_y[2]), -dragging * e_z[2]
    return constant, on_x * e_x + on_y * e_y + on_z * e_z


def _rays_from_fido(
    spin: float,
    observer: Observer,
    metric: MetricFunctions,
    light: Array,
    doppler: Array,
    sign: float = 1.0,
) -> Rays:
    """Return the rays of light that runs along `light`, on the FIDO's triad, shape (3, n); `doppler` is Eq. 13's.

    Those whose energy at infinity has this `sign`, with p_t = -sign and the spin times it.
    """
    n_r, n_theta, n_phi = light
    # Energy at infinity for unit energy in the FIDO's frame, 1/E_f of Eq. 7; inside the ergosphere it can
    # be zero or negative. It is also alpha / (1 - b omega), the second factor of Eq. 13.
    energy = sign * (metric.alpha + metric.omega * metric.varpi * n_phi)
    if sign < 0.0:
        energy = np.where(energy >= 0.0, np.maximum(energy, LEAST_ENERGY), energy)
    escapes = energy > 0.0
    fido_energy = 1.0 / np.where(escapes, energy, np.nan)
    # varpi / sin(theta) = Sigma / rho is finite on the axis, where varpi and b vanish together (Eq. 8).
    azimuthal = fido_energy * (metric.sigma / metric.rho) * n_phi
    polar = fido_energy * metric.rho * n_theta
    a_cos = spin * math.cos(observer.theta)
    return Rays(
        spin=sign * spin,
        observer=observer,
        b=azimuthal * axis_safe_sin(observer.theta),
        q_plus_b2=polar * polar + azimuthal * azimuthal - a_cos * a_cos,
        radial=fido_energy * metric.rho * math.sqrt(metric.delta) * n_r,
        polar=polar,
        azimuthal=azimuthal,
        escapes=escapes,
        one_plus_z=np.where(escapes, doppler * energy, np.nan),
    )
