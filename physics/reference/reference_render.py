# SPDX-License-Identifier: GPL-3.0-or-later
"""Numpy's own picture of a warp map over an equirectangular environment, in float64.

This is the statement of what a picture is, written as plainly as possible: the compositor's node group is
judged against it pixel by pixel, and the command line renders with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..light.color import DEFAULT_TEMPERATURE, redshift_gain
from ..light.environment_lookup import sample_environment
from ..light.sky_levels import sky_levels
from ..maps.footprint import footprint
from ..numerics.checks import finite, three
from ..numerics.errors import BlackHoleError
from ..numerics.sphere import euler_rotation, unit_vectors
from .filtered_sky import sample_filtered

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MAGENTA = (1.0, 0.0, 1.0)
"""Color of pixels that no valid warp map can hold."""

SMALLEST_ONE_PLUS_Z = 1e-6
LARGEST_ONE_PLUS_Z = 1e6
"""Frequency ratios outside these bounds are not trusted: no camera that can be placed sees them."""

ANGLE_SLACK = 1e-5
"""float32 cannot write pi and 2 pi exactly; angles out of range by more than this (radians) are foreign."""


MOST_STOPS = 1000.0
"""Exposures beyond this are no numbers of float64."""

HALVE_ABOVE = 3.0
"""Ratio of widths above which `resize` halves a picture before it interpolates."""


class WarpMapLike(Protocol):
    """Anything with the four channels of a warp map, each of shape (height, width), row 0 at the top."""

    @property
    def theta(self) -> NDArray[np.float32]:
        """Polar angle (radians) the light comes from."""

    @property
    def phi(self) -> NDArray[np.float32]:
        """Azimuth (radians) the light comes from."""

    @property
    def one_plus_z(self) -> NDArray[np.float32]:
        """Frequency ratio source / camera."""

    @property
    def visibility(self) -> NDArray[np.float32]:
        """Share of the pixel that sees the sky, 0..1."""


@dataclass(frozen=True)
class ReferencePicture:
    """The four results of a reference rendering, row 0 at the top.

    Attributes
    ----------
    image : ndarray, shape (height, width, 4)
        Foreground over sky, alpha 1.
    sky : ndarray, shape (height, width, 4)
        The sky alone with the hole in it, alpha 1.
    shadow : ndarray, shape (height, width)
        Share of each pixel that the hole hides, 0..1; 0 where the map is invalid.
    redshift : ndarray, shape (height, width)
        1 + z averaged over the pixel; 1 where the map is invalid.
    """

    image: FloatArray
    sky: FloatArray
    shadow: FloatArray
    redshift: FloatArray


def invalid_pixels(warp_map: WarpMapLike) -> BoolArray:
    """Return which pixels no valid warp map can have.

    Parameters
    ----------
    warp_map : WarpMapLike

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    theta, phi, one_plus_z, visibility = _channels(warp_map)
    # Written as "not inside", so that NaN, which compares false with everything, counts as invalid.
    inside = (
        _within(theta, 0.0, np.pi)
        & _within(phi, 0.0, 2.0 * np.pi)
        & _within(visibility, 0.0, 1.0)
        & (one_plus_z > SMALLEST_ONE_PLUS_Z)
        & (one_plus_z < LARGEST_ONE_PLUS_Z)
    )
    invalid: BoolArray = np.logical_not(inside)
    return invalid


def resize(image: ArrayLike, output_size: tuple[int, int]) -> FloatArray:
    """Bring a supersampled picture to its final size: halve what is far too large, then interpolate.

    Parameters
    ----------
    image : array_like, shape (rows, columns, channels)
    output_size : (int, int)
        Width and height of the result.

    Returns
    -------
    ndarray, shape (height, width, channels)
        For factors 1, 2, 4, 8 this is exactly the mean over each s x s block. Other factors end with one
        bilinear interpolation, edges extended.
    """
    picture: FloatArray = np.asarray(image, dtype=np.float64)
    width, height = output_size
    while picture.shape[1] > HALVE_ABOVE * width:
        picture = _bilinear_resize(picture, (picture.shape[1] + 1) // 2, (picture.shape[0] + 1) // 2)
    return _bilinear_resize(picture, width, height)


def over_sky(sky: ArrayLike, light: ArrayLike, transmittance: ArrayLike) -> FloatArray:
    """Lay a layer of light over a picture, at the picture's size.

    Parameters
    ----------
    sky : array_like, shape (height, width, 3 or 4)
        The lensed sky, the shadow in it; or, premultiplied with an alpha, what a camera of bent rays sees.
    light, transmittance : array_like, shape (map height, map width, 3) and (map height, map width)
        Of a `LightLayer`; larger than the picture if its map is supersampled.

    Returns
    -------
    ndarray, shape (height, width, 4)
        light + transmittance x sky, for alpha as well: a layer covers 1 - transmittance.
    """
    behind: FloatArray = np.asarray(sky, dtype=np.float64)
    if behind.shape[2] == 3:
        behind = _opaque(behind)
    light, passes = np.asarray(light), np.asarray(transmittance)[..., None]
    height, width = behind.shape[:2]
    layer = resize(np.concatenate([light, 1.0 - passes, passes], axis=-1), (width, height))
    return layer[..., :4] + layer[..., 4:] * behind


def render(
    warp_map: WarpMapLike,
    environment: ArrayLike,
    *,
    rotation: ArrayLike = (0.0, 0.0, 0.0),
    color_amount: float = 1.0,
    brightness_amount: float = 1.0,
    temperature: float = DEFAULT_TEMPERATURE,
    exposure: float = 0.0,
    strength: float = 1.0,
    foreground: ArrayLike | None = None,
    output_size: tuple[int, int] | None = None,
    looks: int = 0,
) -> ReferencePicture:
    """Picture of a sky seen through a warp map, with an optional foreground in front of it.

    Parameters
    ----------
    warp_map : WarpMapLike
        Four channels of one shape, row 0 at the top; see `WarpMapLike`.
    environment : array_like, shape (rows, columns, 3 or 4)
        Equirectangular picture of the sky in scene-linear values, row 0 at the top. Alpha is ignored.
    rotation : array_like, shape (3,)
        XYZ Euler angles (radians) of the environment, as in a Mapping node (type Point) of a World's nodes.
    color_amount, brightness_amount : float
        0 (off) to 1 (physical); see `color.redshift_gain`.
    temperature : float
        Black-body temperature in kelvin, > 0, of what in the sky is not colored as a black body is.
    exposure : float
        Stops by which the sky is brightened.
    strength : float
        Factor on the sky, the World's own strength.
    foreground : array_like, shape (height, width, 4), optional
        Premultiplied RGBA of the final size, row 0 at the top. Pixels of alpha 0 may carry light (flames).
    output_size : (int, int), optional
        Width and height of the picture. Default: the foreground's, or else the map's.
    looks : int
        Places at which each pixel looks at the sky along the ellipse that it covers there; see
        `filtered_sky.sample_filtered` and `SKY_FILTERS`. 0: one look at the sky itself, unfiltered.

    Returns
    -------
    ReferencePicture

    Raises
    ------
    BlackHoleError
        If shapes do not fit together, or for a setting that cannot be.

    Notes
    -----
    sky = environment(R d) 2^exposure strength gain(1 + z) visibility for each pixel of the map, then the box
    filter, then image = foreground + (1 - alpha) sky. Invalid pixels of the map are magenta in image and sky.
    """
    rotation = [finite(angle, "the rotation of the sky") for angle in three(rotation, "the rotation of the sky")]
    strength, stops = finite(strength, "the strength of the sky"), finite(exposure, "the exposure")
    if not abs(stops) <= MOST_STOPS:
        raise BlackHoleError(
            f"The exposure is {stops:g} stops; give -{MOST_STOPS:g} to {MOST_STOPS:g}.", code="settings.range"
        )
    theta, phi, one_plus_z, visibility = _channels(warp_map)
    sky_picture: FloatArray = np.asarray(environment, dtype=np.float64)
    if sky_picture.ndim != 3 or sky_picture.shape[2] not in (3, 4):
        raise BlackHoleError(
            f"The environment has shape {sky_picture.shape}, expected (rows, columns, 3 or 4).",
            code="settings.array",
        )
    front = None if foreground is None else np.asarray(foreground, dtype=np.float64)
    if front is not None and (front.ndim != 3 or front.shape[2] != 4):
        raise BlackHoleError(
            f"The foreground has shape {front.shape}, expected (height, width, 4).", code="settings.array"
        )
    if output_size is None:
        rows, columns = theta.shape if front is None else front.shape[:2]
        output_size = (columns, rows)
    if front is not None and front.shape[:2] != output_size[::-1]:
        rows, columns = front.shape[:2]
        raise BlackHoleError(
            f"The foreground is {columns}x{rows} pixels, the picture {output_size[0]}x{output_size[1]}.",
            code="settings.array",
        )

    invalid = invalid_pixels(warp_map)
    shift = np.where(invalid, 1.0, one_plus_z)
    seen = np.where(invalid, 1.0, visibility)
    directions = unit_vectors(np.where(invalid, 0.0, theta), np.where(invalid, 0.0, phi))
    turn = euler_rotation(rotation)
    if looks:
        covered = footprint(warp_map).astype(np.float64)
        covered[..., :3] = covered[..., :3] @ turn.T
        covered[invalid] = 0.0
        levels = sky_levels(sky_picture[..., :3])
        colors = sample_filtered(sky_picture[..., :3], levels, directions @ turn.T, covered, looks)
    else:
        colors = sample_environment(sky_picture[..., :3], directions @ turn.T)
    colors *= redshift_gain(shift, color_amount, brightness_amount, temperature, colors)
    colors *= (2.0**stops * strength * seen)[..., np.newaxis]
    colors[invalid] = MAGENTA

    data = np.stack([seen, shift, invalid.astype(np.float64)], axis=-1)
    sky = resize(colors, output_size)
    seen, shift, broken = np.moveaxis(resize(data, output_size), -1, 0)
    image = sky if front is None else front[..., :3] + (1.0 - front[..., 3:]) * sky
    # A broken map must not hide behind an opaque foreground.
    image = image + broken[..., np.newaxis] * (np.asarray(MAGENTA) - image)
    return ReferencePicture(image=_opaque(image), sky=_opaque(sky), shadow=1.0 - seen, redshift=shift)


def _channels(warp_map: WarpMapLike) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    theta: FloatArray = np.asarray(warp_map.theta, dtype=np.float64)
    phi: FloatArray = np.asarray(warp_map.phi, dtype=np.float64)
    one_plus_z: FloatArray = np.asarray(warp_map.one_plus_z, dtype=np.float64)
    visibility: FloatArray = np.asarray(warp_map.visibility, dtype=np.float64)
    shapes = {theta.shape, phi.shape, one_plus_z.shape, visibility.shape}
    if len(shapes) != 1 or theta.ndim != 2:
        raise BlackHoleError(
            "The warp map's four channels must share one shape (height, width).", code="settings.array"
        )
    return theta, phi, one_plus_z, visibility


def _within(values: FloatArray, low: float, high: float) -> BoolArray:
    inside: BoolArray = (values > low - ANGLE_SLACK) & (values < high + ANGLE_SLACK)
    return inside


def _bilinear_resize(picture: FloatArray, width: int, height: int) -> FloatArray:
    """Bilinear samples at the new pixels' centers, edges extended; half the size averages 2 x 2 pixels."""
    rows, row_share = _interpolation(picture.shape[0], height)
    columns, column_share = _interpolation(picture.shape[1], width)
    below = np.minimum(rows + 1, picture.shape[0] - 1)
    right = np.minimum(columns + 1, picture.shape[1] - 1)
    by_rows = picture[rows] * (1.0 - row_share)[:, None, None] + picture[below] * row_share[:, None, None]
    first, second = by_rows[:, columns], by_rows[:, right]
    resized: FloatArray = first * (1.0 - column_share)[None, :, None] + second * column_share[None, :, None]
    return resized


def _interpolation(old_count: int, new_count: int) -> tuple[NDArray[np.int64], FloatArray]:
    """For each new pixel, the old pixel before its center and the next one's weight."""
    centers = (np.arange(new_count) + 0.5) * old_count / new_count - 0.5
    centers = np.clip(centers, 0.0, old_count - 1.0)
    before = np.floor(centers).astype(np.int64)
    return before, centers - before


def _opaque(colors: FloatArray) -> FloatArray:
    return np.concatenate([colors, np.ones_like(colors[..., :1])], axis=-1)
