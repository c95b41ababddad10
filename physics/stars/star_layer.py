# SPDX-License-Identifier: GPL-3.0-or-later
"""The layer of stars of one frame: images brought into the camera's picture and drawn as points of fixed width.

The light of an image, in the camera, is F |mu| RGB(g T) / Y(T): F the star's flux, T its temperature from B-V,
g = 1 / (1 + z), mu the magnification in the camera's own sky, RGB and Y the light and the luminance of a black body
(`light.black_body`). Lensing alone changes no surface brightness; the shift turns a black body of T into one of g T
(Liouville's theorem, see `light.color`). A moving camera sees solid angles smaller by (f_camera / f_FIDO)^2.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
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
from ..numerics.checks import finite, number, vector
from ..numerics.errors import BlackHoleError
from ..numerics.sphere import cos_sin, euler_rotation, spherical_triad, unit_vectors
from ..shot.cameras import Camera, PanoramaCamera
from ..shot.map_parameters import WarpMapParameters
from .refinement import Images, refine
from .search import Mesh, find_images, mesh_for

POINTS_AT_ONCE = 8192
# A panorama wider than this, radians, joins at its sides, give or take single precision.
FULL_CIRCLE = 6.2831

WIDTH = 0.55
"""Standard deviation of a star's Gaussian in pixels."""
REACH = 2
"""Pixels on each side that it is drawn in."""


@dataclass(frozen=True)
class StarSettings:
    """How stars are drawn.

    Parameters
    ----------
    rotation : tuple of float, shape (3,)
        XYZ Euler angles (radians) of the sky, as in a Mapping node (type Point) of a World's nodes.
    magnitude_limit : float
        The faintest visual magnitude that is drawn; infinity for no limit.
    color_amount, brightness_amount : float
        0 (off) to 1 (physical): how much the redshift changes color and brightness.
    catalog : str
        The name of the catalog, for the file's header.
    """

    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    magnitude_limit: float = math.inf
    color_amount: float = 1.0
    brightness_amount: float = 1.0
    catalog: str = "XHIP"

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", vector(self.rotation, "the rotation of the sky"))
        if not all(math.isfinite(angle) for angle in self.rotation):
            raise BlackHoleError("The rotation of the sky must be three finite numbers.", code="settings.range")
        if math.isnan(number(self.magnitude_limit, "the magnitude limit")):
            raise BlackHoleError("The magnitude limit is not a number; give one such as 6.5.", code="settings.range")
        for name in ("color_amount", "brightness_amount"):
            if not 0.0 <= finite(getattr(self, name), "an amount of redshift") <= 1.0:
                raise BlackHoleError(
                    f"An amount of redshift is {getattr(self, name):g}; give it a value from 0 to 1.",
                    code="settings.range",
                )

    def to_metadata(self) -> dict[str, Any]:
        """Return all settings as plain JSON values; None stands for no limit of magnitude."""
        values = {**asdict(self), "rotation": list(self.rotation)}
        if math.isinf(self.magnitude_limit):
            values["magnitude_limit"] = None
        return values


@dataclass(frozen=True)
class StarLayer:
    """The light of stars in one frame."""

    image: NDArray[np.float32]
    """Linear Rec. 709 radiance, shape (height, width, 3), row 0 at the top; the picture's size, without supersampling.

    To be added to the sky: stars hide nothing.
    """
    metadata: dict[str, Any]
    """``hash``, ``counts`` and ``parameters`` of the map that the layer lies beside, and ``stars``: the settings."""

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

    def bake(
        self, parameters: WarpMapParameters, stars: Stars | None = None, settings: StarSettings | None = None
    ) -> StarLayer:
        """Return the stars of a frame.

        Parameters
        ----------
        parameters : WarpMapParameters
            The warp map's. Supersampling and disk do not matter.
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
        plain = replace(parameters, supersampling=1)
        plain.validate()
        chosen = bright_stars(load_stars() if stars is None else stars, settings.magnitude_limit)
        points, vanished = self.points(plain, chosen, settings)
        camera = plain.camera
        image, drawn = draw(camera, points.x, points.y, points.light)
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
            "hash": plain.hash,
            "counts": counts,
            "parameters": plain.to_metadata(),
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
            self._images = refine(self._mesh.sky, find_images(self._mesh, toward), toward)
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


def draw(camera: Camera, x: Array, y: Array, light: Array) -> tuple[NDArray[np.float32], int]:
    """Draw points of light into a picture.

    Parameters
    ----------
    camera : Camera
    x, y : ndarray, shape (n,)
        Pixels from the picture's left and top.
    light : ndarray, shape (n, 3)
        Radiance times steradian.

    Returns
    -------
    image : ndarray of float32, shape (height, width, 3)
        Radiance. Times the pixels' solid angles it adds up to the light of the points, but for what lies beyond the
        picture's border. A panorama of the full circle goes on at the other side, and beyond its poles.
    drawn : int
        How many points reach into the picture.

    Notes
    -----
    Each is a Gaussian of standard deviation `WIDTH`, taken at the pixels' centers, with weights that sum to 1.
    """
    width, height = camera.width, camera.height
    taps = np.arange(-REACH, REACH + 1)
    column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    weights = []
    for place, pixel in ((x, column), (y, row)):
        weight = np.exp(-0.5 * ((taps + 0.5) - (place - pixel)[:, None]) ** 2 / WIDTH**2)
        weights.append(weight / weight.sum(axis=1, keepdims=True))
    rows, columns = row[:, None] + taps, column[:, None] + taps
    is_round = isinstance(camera, PanoramaCamera) and camera.longitude_max - camera.longitude_min > FULL_CIRCLE
    whole = (rows[:, 0] >= 0) & (rows[:, -1] < height) & (columns[:, 0] >= 0) & (columns[:, -1] < width)
    partly = (rows[:, -1] >= 0) & (rows[:, 0] < height)
    if not is_round:
        partly &= (columns[:, -1] >= 0) & (columns[:, 0] < width)
    flux = np.zeros((3, height * width))
    for members, is_whole in ((np.flatnonzero(whole), True), (np.flatnonzero(partly & ~whole), False)):
        for start in range(0, len(members), POINTS_AT_ONCE):
            some = members[start : start + POINTS_AT_ONCE]
            share = weights[1][some][:, :, None] * weights[0][some][:, None, :]
            down, right = rows[some][:, :, None], columns[some][:, None, :]
            if not is_whole:
                down, right = np.broadcast_arrays(down, right)
                if is_round:
                    beyond = (down < 0) | (down >= height)
                    right = np.where(beyond, right + width // 2, right) % width
                    down = np.where(down < 0, -1 - down, np.where(down >= height, 2 * height - 1 - down, down))
                seen = (down >= 0) & (down < height) & (right >= 0) & (right < width)
                share, down, right = share * seen, np.where(seen, down, 0), np.where(seen, right, 0)
            pixel = (down * width + right).ravel()
            for channel in range(3):
                np.add.at(flux[channel], pixel, (share * light[some, channel][:, None, None]).ravel())
    image = np.moveaxis(flux.reshape(3, height, width), 0, -1) / camera.solid_angles()[..., None]
    return image.astype(np.float32), int(np.count_nonzero(partly))
