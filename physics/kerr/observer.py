# SPDX-License-Identifier: GPL-3.0-or-later
"""Observers: where the camera is and how it moves, as the local FIDO (ZAMO) measures it.

Equation numbers are those of Verbraeck & Eisemann, "Raytracing Equations" (see `metric`).
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

from ..numerics.checks import finite, vector
from ..numerics.errors import BlackHoleError, UnstableOrbitWarning
from ..numerics.sphere import spherical_triad
from .metric import (
    LARGEST_RADIUS,
    check_spin,
    ergosphere_radius,
    isco_radius,
    metric_functions,
    photon_orbit_radius,
)

Direction = tuple[float, float, float]
Vector = tuple[float, float, float]

# A direction of motion is normalised for the caller when it is this near to a unit vector; anything further
# off is more likely to be a mistake than a rounding error.
UNIT_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Observer:
    """A camera's position and motion.

    Parameters
    ----------
    r : float
        Boyer-Lindquist radius, units of M, > 0 and up to 1e12 (outside the horizon: checked where the spin is known).
    theta, phi : float
        Boyer-Lindquist angles in radians; theta in [0, pi], 0 along the spin axis.
    beta : float
        Speed measured by the local FIDO, in units of c, in [0, 1). 0 is the FIDO itself, which the hole
        drags along: it is not at rest against the stars.
    direction : tuple of float, shape (3,)
        Unit vector B of the motion, components along (r-hat, theta-hat, phi-hat) of the FIDO.

    Raises
    ------
    BlackHoleError
        For a value outside these ranges.
    """

    r: float
    theta: float
    phi: float
    beta: float = 0.0
    direction: Direction = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for name, what in (("r", "radius"), ("theta", "theta"), ("phi", "phi"), ("beta", "speed")):
            object.__setattr__(self, name, finite(getattr(self, name), f"the observer's {what}"))
        object.__setattr__(self, "direction", vector(self.direction, "the direction of motion"))
        if not all(math.isfinite(component) for component in self.direction):
            raise BlackHoleError("The direction of motion must be three finite numbers.", code="camera.position")
        if not 0.0 < self.r <= LARGEST_RADIUS:
            raise BlackHoleError(
                f"The observer's radius is {self.r:g}; it must be positive and at most {LARGEST_RADIUS:g} M.",
                code="camera.position",
            )
        if not 0.0 <= self.theta <= math.pi:
            raise BlackHoleError(
                f"The observer's theta is {self.theta:g}; it must lie between 0 and pi.", code="camera.position"
            )
        if not 0.0 <= self.beta < 1.0:
            raise BlackHoleError(
                f"The observer's speed is {self.beta:g} times the speed of light; it must be below 1.",
                code="camera.too-fast",
            )
        norm = math.sqrt(sum(component * component for component in self.direction))
        if abs(norm - 1.0) > UNIT_TOLERANCE:
            raise BlackHoleError(
                f"The direction of motion {tuple(self.direction)} is not a unit vector.", code="camera.position"
            )
        unit = tuple(float(component) / norm for component in self.direction)
        object.__setattr__(self, "direction", unit)

    @classmethod
    def fido(cls, r: float, theta: float, phi: float) -> Observer:
        """Return the fiducial observer (FIDO, ZAMO): no angular momentum, dragged along by the spin.

        Parameters
        ----------
        r : float
            Radius, units of M.
        theta, phi : float
            Radians, theta in [0, pi].

        Raises
        ------
        BlackHoleError
            For values out of range. The horizon is checked where the spin is known: when rays are made.
        """
        return cls(r, theta, phi)

    @classmethod
    def static(cls, spin: float, r: float, theta: float, phi: float) -> Observer:
        """Return the observer at rest against the stars.

        Its angular velocity is 0, hence beta = varpi omega / alpha against the dragging (Eq. 14 with
        Omega = 0).

        Parameters
        ----------
        spin : float
            Kerr parameter, -1 < a < 1.
        r : float
            Radius, units of M, outside the horizon.
        theta, phi : float
            Radians, theta in [0, pi].

        Raises
        ------
        BlackHoleError
            Inside the ergosphere, where nothing can resist the dragging, or inside the horizon.
        """
        check_spin(spin)
        metric = metric_functions(spin, r, theta)
        limit = ergosphere_radius(spin, theta)
        if not r > limit:
            raise BlackHoleError(
                f"Nothing can be at rest against the stars inside the ergosphere: here it reaches to "
                f"{limit:.4g} M and the camera is at {r:.4g} M; move the camera out or let it move as a FIDO.",
                code="camera.ergosphere",
            )
        return cls._rotating(r, theta, phi, -metric.varpi * metric.omega / metric.alpha)

    @classmethod
    def circular_orbit(cls, spin: float, r: float, phi: float = 0.0, prograde: bool = True) -> Observer:
        """Return the observer on the circular geodesic orbit in the equatorial plane (Eq. 14).

        Parameters
        ----------
        spin : float
            Kerr parameter, -1 < a < 1.
        r : float
            Radius, units of M, outside the photon orbit.
        phi : float
            Azimuth, radians; theta is pi / 2.
        prograde : bool
            Whether it turns with the hole's spin (towards +phi when the spin is 0) or against it.

        Raises
        ------
        BlackHoleError
            At or inside the photon orbit, where a circular orbit would need the speed of light.

        Warns
        -----
        UnstableOrbitWarning
            Between the photon orbit and the ISCO: the orbit exists but is unstable.
        """
        spin = check_spin(spin)
        limit = photon_orbit_radius(spin, prograde)
        if not r > limit:
            raise BlackHoleError(
                f"There is no circular orbit at {r:.4g} M: the {_sense(prograde)} photon orbit, where it would "
                f"take the speed of light, lies at {limit:.4g} M; move the camera out.",
                code="camera.no-orbit",
            )
        isco = isco_radius(spin, prograde)
        if r < isco:
            warnings.warn(
                f"The circular orbit at {r:.4g} M is unstable: the innermost stable one, {_sense(prograde)}, "
                f"lies at {isco:.4g} M.",
                UnstableOrbitWarning,
                stacklevel=2,
            )
        return cls.keplerian(spin, r, math.pi / 2, phi, prograde)

    @classmethod
    def keplerian(cls, spin: float, r: float, theta: float, phi: float, prograde: bool = True) -> Observer:
        """Return an observer that turns about the axis with the angular velocity Omega of Eq. 14.

        In the equatorial plane this is the circular geodesic orbit; off it there is no such geodesic, and
        the observer is a powered flight that keeps abreast of the orbit below.

        Parameters
        ----------
        spin : float
            Kerr parameter, -1 < a < 1.
        r : float
            Radius, units of M, outside the horizon.
        theta, phi : float
            Radians, theta in [0, pi].
        prograde : bool
            As for `circular_orbit`.

        Raises
        ------
        BlackHoleError
            Where that angular velocity would need the speed of light or more.
        """
        spin = check_spin(spin)
        metric = metric_functions(spin, r, theta)
        turn = math.copysign(1.0, spin) if spin else 1.0
        # BPT Eq. 2.16 with the sign of the spin: Omega = +-1 / (r^(3/2) +- |a|).
        if prograde:
            angular_velocity = turn / (r**1.5 + abs(spin))
        else:
            angular_velocity = -turn / (r**1.5 - abs(spin))
        speed = metric.varpi / metric.alpha * (angular_velocity - metric.omega)
        if not abs(speed) < 1.0:
            raise BlackHoleError(
                f"An orbit at {r:.4g} M would need {abs(speed):.3g} times the speed of light "
                f"(the {_sense(prograde)} photon orbit lies at {photon_orbit_radius(spin, prograde):.4g} M); "
                f"move the camera out.",
                code="camera.no-orbit",
            )
        return cls._rotating(r, theta, phi, speed)

    @classmethod
    def free_fall(cls, spin: float, r: float, theta: float, phi: float) -> Observer:
        """Return the observer falling from rest at infinity with E = 1, L = 0.

        Energy conservation gives the FIDO's measure gamma = 1 / alpha, hence beta = sqrt(1 - alpha^2),
        along -r-hat.

        Parameters
        ----------
        spin : float
            Kerr parameter, -1 < a < 1.
        r : float
            Radius, units of M, outside the horizon.
        theta, phi : float
            Radians, theta in [0, pi].

        Raises
        ------
        BlackHoleError
            At or inside the horizon.
        """
        check_spin(spin)
        alpha = metric_functions(spin, r, theta).alpha
        return cls(r, theta, phi, math.sqrt((1.0 - alpha) * (1.0 + alpha)), (-1.0, 0.0, 0.0))

    @classmethod
    def _rotating(cls, r: float, theta: float, phi: float, speed: float) -> Observer:
        """Return the observer moving along +phi-hat with `speed`, which may be negative."""
        return cls(r, theta, phi, abs(speed), (0.0, 0.0, math.copysign(1.0, speed) if speed else 1.0))


def local_velocity(spin: float, position: Vector, velocity: Vector) -> Vector:
    """Return what the local FIDO measures of a velocity that is given by coordinate time.

    The FIDO's clocks run slower and its rulers are shorter than the coordinates', and it is carried round itself. With
    dots for d/dt, beta_r = rho r' / (alpha sqrt(Delta)), beta_theta = rho theta' / alpha and
    beta_phi = varpi (phi' - omega) / alpha: the orthonormal basis of the FIDO, BPT Eq. 3.2, in the functions of Eq. 1.
    For phi' alone it is Eq. 14. Nothing at rest (velocity 0) is at rest for the FIDO: it is the static observer.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    position : sequence of float, shape (3,)
        Cartesian, in the hole's frame (z along the spin axis), units of M, outside the horizon. Its spherical
        coordinates are taken as Boyer-Lindquist ones.
    velocity : sequence of float, shape (3,)
        The position's derivative by the coordinate time t, Cartesian in the same frame, units of c. Against the stars,
        so that a frame that turns with something does not count.

    Returns
    -------
    tuple of float, shape (3,)
        Units of c; Cartesian components along r-hat, theta-hat and phi-hat, laid out as those of the position: the
        `velocity` of `WarpMapParameters`. Its length is 1 or more where no observer can move like that.

    Raises
    ------
    BlackHoleError
        At or inside the horizon, or for numbers that are not finite.
    """
    spin = check_spin(spin)
    x, y, z = vector(position, "the camera's position")
    moving = vector(velocity, "the camera's velocity")
    if not all(math.isfinite(value) for value in (x, y, z, *moving)):
        raise BlackHoleError("The camera's place and velocity must be finite numbers.", code="camera.position")
    r, theta, phi = math.hypot(x, y, z), math.atan2(math.hypot(x, y), z), math.atan2(y, x)
    metric = metric_functions(spin, r, theta)
    triad: list[list[float]] = spherical_triad(theta, phi).tolist()
    # r', r theta' and r sin(theta) phi', so that nothing is divided by the sine
    along = [row[0] * moving[0] + row[1] * moving[1] + row[2] * moving[2] for row in triad]
    beta = (
        metric.sigma / metric.delta * along[0],
        metric.rho / (metric.alpha * r) * along[1],
        (metric.sigma / (metric.rho * r) * along[2] - metric.varpi * metric.omega) / metric.alpha,
    )
    u, v, w = (sum(beta[axis] * triad[axis][i] for axis in range(3)) for i in range(3))
    return u, v, w


def _sense(prograde: bool) -> str:
    return "prograde" if prograde else "retrograde"
