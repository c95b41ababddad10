# SPDX-License-Identifier: GPL-3.0-or-later
"""The layer of stars of one frame: images brought into the camera's picture and drawn as points of fixed width.

The light of an image, in the camera, is F |mu| RGB(g T) / Y(T): F the star's flux, T its temperature from B-V,
g = 1 / (1 + z), mu the magnification in the camera's own sky, RGB and Y the light and the luminance of a black body
(`light.black_body`). Lensing alone changes no surface brightness; the shift turns a black body of T into one of g T
(Liouville's theorem, see `light.color`). A moving camera sees solid angles smaller by (f_camera / f_FIDO)^2.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kerr.critical_curve import around_hole
from ..kerr.rays import redshift_vector
from ..kerr.shadow_outline import as_seen
from ..light import black_body
from ..light.star_color import temperature_from_color_index
from ..light.star_sky import ZERO_MAGNITUDE, Stars, load_stars
from ..numerics.arrays import Array
from ..numerics.sphere import cos_sin, euler_rotation, spherical_triad, unit_vectors
from ..numerics.work import drain
from ..shot.map_parameters import WarpMapParameters
from .catalog_file import read_star_catalog
from .drawing import REACH, draw
from .folds import with_pairs
from .refinement import Images, refine
from .search import Mesh, find_images, mesh_for
from .star_settings import StarParameters, StarSettings, star_view


@dataclass(frozen=True)
class StarLayer:
    """The light of stars in one frame."""

    image: NDArray[np.float32]
    """Linear Rec. 709 radiance, shape (height, width, 3), row 0 at the top; the picture's size, without supersampling.

    To be added to the sky: stars hide nothing.
    """
    metadata: dict[str, Any]
    """``hash``, ``counts`` and ``parameters``, as of a map of its view, and ``stars``: the settings."""

    @property
    def counts(self) -> dict[str, int]:
        """``stars`` searched, ``images`` found in all directions and ``drawn`` in the picture.

        And ``vanished``: images of the mesh that exact places do not confirm, beside caustics; ``unresolved``: cells of
        the sky that were refused because they are too large, whose images are missing.
        """
        counts: dict[str, int] = self.metadata["counts"]
        return counts


@dataclass(frozen=True)
class Points:
    """Images of stars in a picture; arrays of shape (images,) or (images, 3)."""

    star: NDArray[np.intp]
    x: Array
    """Pixels from the left of the picture, and from its top."""
    y: Array
    magnification: Array
    """Solid angle in the camera's sky over that on the celestial sphere."""
    one_plus_z: Array
    light: Array
    """Linear Rec. 709 radiance times steradian."""


class StarBaker:
    """Makes the layers of a shot one after another, and searches once what they have in common.

    Frames of one place share everything but the projection, frames of one orbit the table of the sky.
    """

    def __init__(self) -> None:
        self._mesh_key: object = None
        self._mesh: Mesh | None = None
        self._images_key: object = None
        self._images: tuple[Images, int] | None = None
        self._table: tuple[str, Stars] | None = None

    def bake(
        self, parameters: WarpMapParameters, stars: Stars | None = None, settings: StarSettings | None = None
    ) -> StarLayer:
        """Return the stars of a frame.

        Parameters
        ----------
        parameters : WarpMapParameters
            The warp map's. Samples, accuracy and disk do not matter.
        stars : Stars, optional
            The built-in catalog by default.
        settings : StarSettings, optional

        Returns
        -------
        StarLayer

        Raises
        ------
        BlackHoleError
            If no map can be made from these parameters.
        """
        settings = StarSettings() if settings is None else settings
        return drain(self._steps(star_view(parameters), load_stars() if stars is None else stars, settings))

    def steps(self, parameters: StarParameters) -> Generator[float, None, StarLayer]:
        """Make the stars of a frame step by step.

        Parameters
        ----------
        parameters : StarParameters

        Yields
        ------
        float
            The fraction done, 0 to 1.

        Raises
        ------
        BlackHoleError
            If no map can be made from these parameters, or the catalog cannot be read.
        """
        parameters.view.validate()
        return (yield from self._steps(parameters.view, self._catalog(parameters), parameters.settings))

    def _catalog(self, parameters: StarParameters) -> Stars:
        digest = "" if parameters.table is None else parameters.settings.catalog_digest
        if self._table is None or self._table[0] != digest:
            stars = load_stars() if parameters.table is None else read_star_catalog(parameters.table)
            self._table = digest, stars
        return self._table[1]

    def _steps(
        self, view: WarpMapParameters, stars: Stars, settings: StarSettings
    ) -> Generator[float, None, StarLayer]:
        view.validate()
        yield 0.0
        chosen = bright_stars(stars, settings.magnitude_limit)
        points, vanished = self.points(view, chosen, settings)
        yield 0.8
        image, drawn = draw(view.camera, points.x, points.y, points.light)
        mesh = self._mesh
        assert mesh is not None
        counts = {
            "stars": len(chosen.magnitude),
            "images": len(points.star),
            "drawn": drawn,
            "vanished": vanished,
            "unresolved": mesh.refused,
        }
        metadata = {
            "hash": view.hash,
            "counts": counts,
            "parameters": view.to_metadata(),
            "stars": settings.to_metadata(),
        }
        return StarLayer(image, metadata)

    def points(self, parameters: WarpMapParameters, stars: Stars, settings: StarSettings) -> tuple[Points, int]:
        """Return the images of stars in a picture, also those beside it, and how many of the mesh's there are not.

        Parameters
        ----------
        parameters : WarpMapParameters
            Valid ones.
        stars : Stars
        settings : StarSettings

        Returns
        -------
        points : Points
        vanished : int
        """
        observer = parameters.observer()
        pixel = smallest_pixel(parameters)
        key: tuple[object, ...] = (parameters.spin, round(observer.r, 9), round(observer.theta, 12))
        if self._mesh is None or key != self._mesh_key or not self._mesh.sky.is_for(pixel):
            self._mesh = mesh_for(parameters.spin, observer.r, observer.theta, pixel)
            self._mesh_key, self._images_key = key, None
        toward = self._toward(parameters, stars, settings)
        key = (*key, toward.tobytes())
        if self._images is None or key != self._images_key:
            images, vanished = refine(self._mesh.sky, find_images(self._mesh, toward), toward)
            self._images = with_pairs(self._mesh.sky, images, toward), vanished
            self._images_key = key
        images, vanished = self._images
        return self._project(parameters, images, stars, settings), vanished

    @staticmethod
    def _toward(parameters: WarpMapParameters, stars: Stars, settings: StarSettings) -> Array:
        """Return the directions toward stars in the frame of the table, in which the camera's azimuth is 0."""
        turn = euler_rotation((0.0, 0.0, parameters.observer().phi))
        to_stars = euler_rotation(settings.rotation) @ np.array(parameters.hole_to_world) @ turn
        directions: Array = unit_vectors(0.5 * math.pi - stars.declination, stars.right_ascension) @ to_stars
        return directions

    def _project(self, parameters: WarpMapParameters, images: Images, stars: Stars, settings: StarSettings) -> Points:
        assert self._mesh is not None
        observer = parameters.observer()
        psi, away, _area = self._mesh.sky.angles(images.x, images.y)
        looking = around_hole(away, *cos_sin(psi))
        seen = as_seen(observer, looking)
        doppler = math.sqrt(1.0 - observer.beta**2) / (1.0 + observer.beta * (looking @ np.array(observer.direction)))
        triad = spherical_triad(observer.theta, observer.phi)
        x, y = parameters.camera.pixels_around(seen @ (triad @ np.array(parameters.camera_to_hole)))
        inside = (x > -REACH - 1.0) & (x < parameters.camera.width + REACH + 1.0)
        inside &= (y > -REACH - 1.0) & (y < parameters.camera.height + REACH + 1.0)
        some = np.flatnonzero(inside)
        constant, vector = redshift_vector(parameters.spin, observer)
        one_plus_z = constant + seen[some] @ vector
        magnification = images.magnification[some] * doppler[some] ** 2
        star = images.star[some]
        temperature = temperature_from_color_index(stars.color_index)[star]
        g = 1.0 / one_plus_z
        color = black_body.rgb(temperature * g**settings.color_amount)
        color *= (g ** (4.0 * (settings.brightness_amount - settings.color_amount)))[:, None]
        color *= (ZERO_MAGNITUDE * stars.flux[star] * magnification / black_body.luminance(temperature))[:, None]
        return Points(star, x[some], y[some], magnification, one_plus_z, color)


def smallest_pixel(parameters: WarpMapParameters) -> float:
    """Return about the smallest angle in the FIDO's sky between two pixels of the picture, radians.

    Pixels of a flat picture are smallest in its corners; ahead of a moving camera they show more than they are wide,
    behind it less.
    """
    camera, beta = parameters.camera, parameters.observer().beta
    width, height = float(camera.width), float(camera.height)
    one = camera.directions([0.0, width, 0.0, width], [0.0, 0.0, height, height])
    other = camera.directions([1.0, width - 1.0, 1.0, width - 1.0], [1.0, 1.0, height - 1.0, height - 1.0])
    across = float(np.linalg.norm(one - other, axis=-1).min()) * math.sqrt(0.5)
    return min(across, parameters.pixel_angle) * math.sqrt((1.0 - beta) / (1.0 + beta))


def bright_stars(stars: Stars, limit: float) -> Stars:
    """Return the stars down to a magnitude."""
    bright = stars.magnitude <= limit
    return Stars(
        stars.right_ascension[bright],
        stars.declination[bright],
        stars.magnitude[bright],
        stars.color_index[bright],
    )
