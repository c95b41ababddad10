# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything one warp map depends on: the hole, the camera, and how they stand in the scene."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..geodesics.tracer import DEFAULT_METHOD, DEFAULT_TOLERANCE, check_settings
from ..images.exr_header import LARGEST_SIDE, MOST_PIXELS, fits
from ..kerr.metric import check_spin, isco_radius, metric_functions
from ..kerr.observer import Observer
from ..numerics.checks import number, shown, three, vector, whole
from ..numerics.errors import BlackHoleError
from ..numerics.sphere import spherical_triad
from .cameras import CAMERAS, Camera
from .disk import Disk
from .identity import agree, hash_of

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

MOTIONS = ("fido", "static", "circular", "circular_retrograde", "free_fall", "velocity")
SUPERSAMPLING = (1, 2, 4)

# Error of direction allowed to interpolation, radians: a texel of a sky 8192 pixels wide has 8e-4.
DEFAULT_INTERPOLATION = 5e-6
LARGEST_INTERPOLATION = 1e-2

# Rotations that come from single-precision matrices are orthonormal to about this.
ROTATION_TOLERANCE = 1e-4


@dataclass(frozen=True)
class WarpMapParameters:
    """What a warp map is made from.

    Parameters
    ----------
    spin : float
        Kerr parameter, -1 < a < 1.
    camera : PerspectiveCamera or PanoramaCamera
        Its width and height are the picture's, before supersampling.
    camera_position : tuple of float, shape (3,)
        Cartesian, in the hole's frame (z along the spin axis), units of M. Its spherical coordinates are
        taken as Boyer-Lindquist ones.
    camera_to_hole, hole_to_world : nested tuple of float, shape (3, 3)
        Rotations: camera axes to the hole's frame, and the hole's frame to the scene's world axes.
    motion : str
        One of `MOTIONS`: the observer's. "circular" is abreast of the circular orbit of the same radius.
    velocity : tuple of float, shape (3,)
        For motion "velocity": as the local FIDO measures it, Cartesian in the hole's frame, units of c.
    supersampling : {1, 2, 4}
        Map pixels along each side of a picture's pixel.
    tolerance, method
        As for `trace_rays`.
    interpolation : float
        Error of direction allowed where neighboring rays are interpolated, radians; 0 traces every pixel.
    disk : Disk or None
        A disk whose passes are baked along with the map.
    """

    spin: float
    camera: Camera
    camera_position: Vector
    camera_to_hole: Matrix = IDENTITY
    hole_to_world: Matrix = IDENTITY
    motion: str = "fido"
    velocity: Vector = (0.0, 0.0, 0.0)
    supersampling: int = 1
    tolerance: float = DEFAULT_TOLERANCE
    method: str = DEFAULT_METHOD
    interpolation: float = DEFAULT_INTERPOLATION
    disk: Disk | None = None

    def __post_init__(self) -> None:
        for name in ("spin", "tolerance", "interpolation"):
            object.__setattr__(self, name, number(getattr(self, name), f"the {name}"))
        for name in ("camera_position", "velocity"):
            object.__setattr__(self, name, vector(getattr(self, name), f"the {name.replace('_', ' ')}"))
        for name in ("camera_to_hole", "hole_to_world"):
            rows = tuple(vector(row, f"the matrix {name}") for row in three(getattr(self, name), f"the matrix {name}"))
            object.__setattr__(self, name, rows)
        object.__setattr__(self, "supersampling", whole(self.supersampling, "the supersampling"))
        if not isinstance(self.camera, Camera):
            raise BlackHoleError(
                f"The camera is {shown(self.camera)}; give a PerspectiveCamera or a PanoramaCamera.",
                code="settings.type",
            )
        if not (self.disk is None or isinstance(self.disk, Disk)):
            raise BlackHoleError(
                f"The disk is {shown(self.disk)}; give a Disk, or None for none.", code="settings.type"
            )

    def validate(self) -> None:
        """Raise BlackHoleError, with a sentence for the user, when no map can be made from these parameters."""
        check_spin(self.spin)
        check_settings(self.tolerance, self.method)
        if not 0.0 <= self.interpolation <= LARGEST_INTERPOLATION:
            raise BlackHoleError(
                f"The interpolation error is {self.interpolation:g}; give it a value between 0 (every pixel is traced) "
                f"and {LARGEST_INTERPOLATION:g} radians.",
                code="settings.range",
            )
        if self.supersampling not in SUPERSAMPLING:
            raise BlackHoleError(f"The supersampling is {self.supersampling}; choose 1, 2 or 4.", code="settings.range")
        self.check_size()
        if not all(math.isfinite(value) for value in (*self.camera_position, *self.velocity)):
            raise BlackHoleError("The camera's place and velocity must be finite numbers.", code="camera.position")
        for name in ("camera_to_hole", "hole_to_world"):
            matrix = np.array(getattr(self, name))
            proper = bool((np.abs(matrix) < 2.0).all()) and np.linalg.det(matrix) > 0.0
            if not proper or np.abs(matrix @ matrix.T - np.eye(3)).max() > ROTATION_TOLERANCE:
                raise BlackHoleError(f"The matrix {name} is not a rotation.", code="settings.array")
        metric_functions(self.spin, self.radius, 0.5)  # inside the horizon is the first thing to say
        self.observer()
        if self.disk is not None:
            self.disk.validate(self.spin, self.method)

    def check_size(self, pictures: int = 1) -> None:
        """Raise BlackHoleError when a map of so many pictures, one below the other, is too large for a file."""
        width, height = self.map_size
        if not fits(width, pictures * height):
            raise BlackHoleError(
                f"The map is {width} x {pictures * height} pixels large; it can have up to {MOST_PIXELS} pixels, and "
                f"{LARGEST_SIDE} along a side. Lower the resolution or the supersampling.",
                code="camera.size",
            )

    @property
    def radius(self) -> float:
        """Distance of the camera from the hole, units of M."""
        return math.hypot(*self.camera_position)

    @property
    def map_size(self) -> tuple[int, int]:
        """Width and height of the map in pixels."""
        return self.camera.width * self.supersampling, self.camera.height * self.supersampling

    @property
    def pixel_angle(self) -> float:
        """Angle between two neighboring pixels of the map in the middle of the picture, radians."""
        x = 0.5 * self.camera.width + np.array([0.0, 1.0 / self.supersampling])
        one, other = self.camera.directions(x, np.full(2, 0.5 * self.camera.height))
        return float(np.linalg.norm(other - one))

    def observer(self) -> Observer:
        """Return the observer that the camera is.

        Raises
        ------
        BlackHoleError
            Where this motion is impossible: static inside the ergosphere, faster than light, inside the horizon.
        """
        if not isinstance(self.motion, str):
            raise BlackHoleError(
                f"There is no motion {shown(self.motion)}; choose one of {', '.join(MOTIONS)}.", code="settings.choice"
            )
        x, y, z = self.camera_position
        r, theta, phi = self.radius, math.atan2(math.hypot(x, y), z), math.atan2(y, x)
        match self.motion:
            case "fido":
                return Observer.fido(r, theta, phi)
            case "static":
                return Observer.static(self.spin, r, theta, phi)
            case "circular" | "circular_retrograde":
                return Observer.keplerian(self.spin, r, theta, phi, prograde=self.motion == "circular")
            case "free_fall":
                return Observer.free_fall(self.spin, r, theta, phi)
            case "velocity":
                return self._moving_observer(r, theta, phi)
        raise BlackHoleError(
            f"There is no motion {shown(self.motion)}; choose one of {', '.join(MOTIONS)}.", code="settings.choice"
        )

    def _moving_observer(self, r: float, theta: float, phi: float) -> Observer:
        local = spherical_triad(theta, phi) @ np.array(self.velocity)
        speed = float(np.linalg.norm(local))
        if not speed < 1.0:
            raise BlackHoleError(
                f"The camera moves at {speed:.3g} times the speed of light; slow it down or raise the speed of light.",
                code="camera.too-fast",
            )
        if speed == 0.0:
            return Observer.fido(r, theta, phi)
        b_r, b_theta, b_phi = (local / speed).tolist()
        return Observer(r, theta, phi, speed, (b_r, b_theta, b_phi))

    @cached_property
    def hash(self) -> str:
        """SHA-256, in hexadecimal, of the rounded parameters and of the version of what is made from them."""
        return hash_of(self.to_metadata())

    def agrees_with(self, made: dict[str, Any]) -> bool:
        """Return whether a map that was made from other parameters is the one that these would give.

        Parameters
        ----------
        made : dict
            The ``parameters`` of the map's metadata.

        Returns
        -------
        bool
            Whether they differ by the noise of single-precision arithmetic at most; see `identity.agree`.
        """
        return agree(made, self.to_metadata())

    def to_metadata(self) -> dict[str, Any]:
        """Return every parameter as plain JSON values."""
        values = asdict(self)
        values["camera"] = {"kind": self.camera.kind, **asdict(self.camera)}
        if self.disk is None:
            del values["disk"]  # maps without a disk keep the hash they had before there were disks
        plain: dict[str, Any] = json.loads(json.dumps(values))
        return plain

    @classmethod
    def from_metadata(cls, values: dict[str, Any]) -> WarpMapParameters:
        """Return the parameters that `to_metadata` was made from."""
        camera = dict(values["camera"])
        kind = CAMERAS[camera.pop("kind")]
        disk = Disk(**values["disk"]) if values.get("disk") else None
        return cls(**{**values, "camera": kind(**camera), "disk": disk})


def looking_at_hole(position: Vector) -> Matrix:
    """Return the orientation of a camera that looks at the hole, with the spin axis upright in the picture.

    Parameters
    ----------
    position : tuple of float, shape (3,)
        The camera, in the hole's frame, any unit; not at the origin.

    Returns
    -------
    nested tuple of float, shape (3, 3)
        `camera_to_hole` of `WarpMapParameters`. On the spin axis itself, where upright has no meaning, the picture's
        up is the direction of phi = 0 (x).

    Raises
    ------
    BlackHoleError
        If the position is that of the hole, or infinitely far away.
    """
    distance = math.hypot(*position)
    if not 0.0 < distance < math.inf:
        raise BlackHoleError(
            f"The camera is {distance:g} M from the hole; it must have a place outside of it.", code="camera.position"
        )
    back = np.array(position) / distance
    right = np.cross([0.0, 0.0, 1.0], back)
    if np.linalg.norm(right) < 1e-12:
        right = np.cross([1.0, 0.0, 0.0], back)
    right /= np.linalg.norm(right)
    rows = np.stack([right, np.cross(back, right), back], axis=1).tolist()
    return tuple(tuple(row) for row in rows)  # type: ignore[return-value]


def unstable_orbit_warning(parameters: WarpMapParameters) -> str | None:
    """Return a warning if the camera is on a circular orbit inside the ISCO.

    Parameters
    ----------
    parameters : WarpMapParameters

    Returns
    -------
    str or None
        A sentence for the user, or None if there is nothing to warn of.
    """
    if parameters.motion not in ("circular", "circular_retrograde"):
        return None
    isco = isco_radius(parameters.spin, prograde=parameters.motion == "circular")
    if parameters.radius >= isco:
        return None
    return (
        f"The circular orbit at {parameters.radius:.4g} M is unstable: the innermost stable one lies at {isco:.4g} M."
    )
