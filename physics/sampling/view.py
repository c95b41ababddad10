# SPDX-License-Identifier: GPL-3.0-or-later
"""One map's camera: from map pixels to rays, and what is known of the picture before any ray is traced."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..geodesics.crossings import Crossings, LightAtDisk
from ..geodesics.disk_tracer import disk_crossings
from ..kerr.critical_curve import all_around, around_hole, edge_angles, edge_function
from ..kerr.metric import metric_functions
from ..kerr.observer import Observer
from ..kerr.rays import Rays, camera_triad, light_in_fido_frame, rays_from_axes, redshift_vector
from ..kerr.shadow_outline import as_seen
from ..numerics.arrays import Array
from ..numerics.blocks import blocks
from ..numerics.sphere import spherical_triad
from ..shot.cameras import HolePanorama, PanoramaCamera
from ..shot.map_parameters import WarpMapParameters

# Points on the shadow's outline, for the square root of the picture's width and height in pixels. Chords between n
# points stray from it by (2 pi / n)^2 / 8 of its radius: 0.05 pixels where that is width and height together. What the
# outline of a larger one misses, the corners and samples of the tiles find.
OUTLINE_DENSITY = 10.0
# How well the angle of each is known, in pixels.
OUTLINE_ERROR = 0.02


class View:
    """The camera of one map as a function from map pixels to rays.

    Pixel coordinates are those of the map, supersampling included, from its top left corner.
    """

    def __init__(self, parameters: WarpMapParameters) -> None:
        self._spin = parameters.spin
        self._camera = parameters.camera
        self._per_pixel = 1.0 / parameters.supersampling
        self._pixel_angle = parameters.pixel_angle
        self._observer = parameters.observer()
        triad = spherical_triad(self._observer.theta, self._observer.phi)
        self._camera_to_triad = (triad @ np.array(parameters.camera_to_hole)).T
        self._camera_to_motion = self._camera_to_triad @ camera_triad(self._observer).T
        self.hole_to_world = np.array(parameters.hole_to_world)
        self.is_panorama = isinstance(parameters.camera, PanoramaCamera | HolePanorama)
        """Whether the picture is of all directions."""
        self.phi = self._observer.phi
        """The camera's azimuth about the spin axis, radians."""

    def rays(self, x: Array, y: Array) -> Rays:
        """Return the rays seen at map pixel coordinates x, y, shape (n,)."""
        seen = self._camera.directions(x * self._per_pixel, y * self._per_pixel)
        return rays_from_axes(self._spin, self._observer, seen, self._camera_to_triad)

    def light(self, x: Array, y: Array) -> Array:
        """Return where the light seen at map pixel coordinates x, y, shape (n,), runs in the FIDO's frame, (3, n)."""
        return self._light_and_doppler(x, y)[0]

    def light_and_momenta(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Return what `light` does, and the light's energy at infinity and angular momentum for a camera energy of 1,
        shape (n,): Eqs. 7, 8 and 13."""
        light, doppler = self._light_and_doppler(x, y)
        metric = metric_functions(self._spin, self._observer.r, self._observer.theta)
        momentum = doppler * light[2] * metric.varpi
        return light, metric.alpha * doppler + metric.omega * momentum, momentum

    def _light_and_doppler(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return what `light_in_fido_frame` does at map pixel coordinates."""
        seen = self._camera.directions(x * self._per_pixel, y * self._per_pixel)
        return light_in_fido_frame(self._observer, seen, self._camera_to_triad)

    def edge(self, x: Array, y: Array) -> Array:
        """Return the edge function at map pixel coordinates x, y, any one shape, block by block."""
        shape, x, y = x.shape, x.ravel(), y.ravel()
        values = np.empty(x.shape)
        for block in blocks(len(x)):
            values[block] = edge_function(self.rays(x[block], y[block]))
        return values.reshape(shape)

    def one_plus_z(self, x: Array, y: Array) -> Array:
        """Return 1 + z of the sky at map pixel coordinates, which may broadcast: Eq. 13 alone, without tracing."""
        constant, vector = redshift_vector(self._spin, self._observer)
        along = self._camera.component(x * self._per_pixel, y * self._per_pixel, self._camera_to_triad @ vector)
        return constant + along

    def carter(self, x: Array, y: Array) -> Array:
        """Return Carter's constant q of light of camera energy 1, at map pixel coordinates which may broadcast.

        By Eq. 8. Times the Doppler factor of Eq. 13, the light of Eq. 5 is an affine function of where the camera
        looks, and so are the momenta of Eq. 7.
        """
        metric = metric_functions(self._spin, self._observer.r, self._observer.theta)
        looking = np.concatenate([np.zeros((1, 3)), np.eye(3)])
        light, doppler = light_in_fido_frame(self._observer, looking, np.eye(3))
        light *= doppler
        cos = math.cos(self._observer.theta)
        polar, azimuthal, energy = (
            values[0]
            + self._camera.component(
                x * self._per_pixel, y * self._per_pixel, self._camera_to_triad @ (values[1:] - values[0])
            )
            for values in (
                metric.rho * light[1],
                metric.sigma / metric.rho * light[2],
                metric.alpha * doppler + metric.omega * metric.varpi * light[2],
            )
        )
        spinning = self._spin * energy
        found: Array = polar * polar + (cos * cos) * (azimuthal * azimuthal - spinning * spinning)
        return found

    def crossings(
        self,
        x: Array,
        y: Array,
        count: int,
        tolerance: float,
        method: str,
        wanted: NDArray[np.bool_] | None = None,
    ) -> tuple[Crossings, LightAtDisk]:
        """Return the crossings of the equatorial plane at map pixel coordinates x, y, shape (n,), and the rays' light.

        They go on smoothly beyond the rays' ends, see `crossings.Crossings`; for `wanted` see `disk_crossings`.
        """
        looking = self._camera.directions(x * self._per_pixel, y * self._per_pixel) @ self._camera_to_motion
        return disk_crossings(self._spin, self._observer, looking, count, tolerance, method, beyond=True, wanted=wanted)

    def places_in_plane(self, radii: Array, azimuths: Array) -> tuple[Array, Array]:
        """Return map pixel coordinates where places in the equatorial plane would be seen in flat space, shape (n,)."""
        r, theta, phi = self._observer.r, self._observer.theta, self._observer.phi
        places = np.stack([radii * np.cos(azimuths), radii * np.sin(azimuths), np.zeros(len(radii))], axis=-1)
        triad = spherical_triad(theta, phi)
        looking = (places - r * triad[0]) @ triad.T
        return self._pixels(looking / np.linalg.norm(looking, axis=-1, keepdims=True))

    def center(self) -> tuple[float, float] | None:
        """Return the map pixel coordinates where the camera sees light that comes from the hole's direction."""
        x, y = self._pixels(np.array([[-1.0, 0.0, 0.0]]))
        return None if np.isnan(x[0]) else (float(x[0]), float(y[0]))

    def outline(self) -> tuple[Array, Array]:
        """Return map pixel coordinates along the shadow's edge, in order, shape (n,); NaN where not in view."""
        return self._pixels(around_hole(self.edge_about, *all_around(len(self.edge_about))))

    @cached_property
    def edge_about(self) -> Array:
        """About how far the shadow's edge is from the hole's direction at equal steps of position angle, radians."""
        count = math.ceil(OUTLINE_DENSITY * math.sqrt((self._camera.width + self._camera.height) / self._per_pixel))
        fido = Observer.fido(self._observer.r, self._observer.theta, self._observer.phi)
        return edge_angles(self._spin, fido, *all_around(count), OUTLINE_ERROR * self._pixel_angle)

    def _pixels(self, looking: Array) -> tuple[Array, Array]:
        """Return the map pixels that see what the FIDO sees along `looking` (its triad), shape (n, 3): aberration."""
        x, y = self._camera.pixels(as_seen(self._observer, looking) @ self._camera_to_triad.T)
        return x / self._per_pixel, y / self._per_pixel
