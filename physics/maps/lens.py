# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers that a camera shader needs to bend its rays: those of a warp map's parameters, plainly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kerr.rays import redshift_vector
from ..numerics.arrays import Array
from ..numerics.errors import BlackHoleError
from ..numerics.sphere import spherical_triad
from ..shot.cameras import Camera, PanoramaCamera, PerspectiveCamera
from ..shot.map_parameters import Vector, WarpMapParameters

# The sphere around the hole that backward rays leave along their asymptotes, units of M.
DEFAULT_SPHERE_RADIUS = 15.0


@dataclass(frozen=True)
class LensNumbers:
    """What `umbra_lens.osl` takes; vectors are in the hole's frame."""

    panorama: int
    plane_corner: Vector
    """Lower left corner of the picture: tangents to the right and up, or longitude and latitude in radians; and 0."""
    plane_size: Vector
    """Width and height of the picture in the same measure; and 0."""
    spin: float
    place: Vector
    """The camera, units of M."""
    right: Vector
    up: Vector
    forward: Vector
    beta: float
    motion: Vector
    """Unit vector of the camera's motion on (r, theta, phi)-hat of the FIDO."""
    redshift_constant: float
    redshift_vector: Vector
    """c_0 and c with 1 + z = c_0 + c . N for every ray of the camera."""

    @classmethod
    def of(cls, parameters: WarpMapParameters) -> LensNumbers:
        """Return the numbers of a frame.

        Raises
        ------
        BlackHoleError
            For a negative spin, which the shader does not know, or when the motion is impossible.
        """
        if parameters.spin < 0.0:
            raise BlackHoleError("The lens camera takes spins from 0: turn the hole over instead.", code="hole.spin")
        observer = parameters.observer()
        axes = np.array(parameters.camera_to_hole)
        corner, size = _plane(parameters.camera)
        constant, along = redshift_vector(parameters.spin, observer)
        return cls(
            panorama=int(isinstance(parameters.camera, PanoramaCamera)),
            plane_corner=corner,
            plane_size=size,
            spin=parameters.spin,
            place=parameters.camera_position,
            right=_vector(axes[:, 0]),
            up=_vector(axes[:, 1]),
            forward=_vector(-axes[:, 2]),
            beta=observer.beta,
            motion=observer.direction,
            redshift_constant=constant,
            redshift_vector=_vector(spherical_triad(observer.theta, observer.phi).T @ along),
        )


def _plane(camera: Camera) -> tuple[Vector, Vector]:
    if isinstance(camera, PanoramaCamera):
        corner = (camera.longitude_min, camera.latitude_min, 0.0)
        far = (camera.longitude_max, camera.latitude_max)
    elif isinstance(camera, PerspectiveCamera):
        low, high = camera.directions([0.0, camera.width], [camera.height, 0.0])
        corner = (-low[0] / low[2], -low[1] / low[2], 0.0)
        far = (-high[0] / high[2], -high[1] / high[2])
    else:
        raise BlackHoleError(
            f"The lens has no formula for a {camera.kind} camera; give it a perspective or panorama camera.",
            code="camera.type",
        )
    corner = _vector(np.array(corner))
    return corner, _vector(np.array([far[0] - corner[0], far[1] - corner[1], 0.0]))


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
