# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's cameras: from a pixel of the picture to a direction in the camera's own axes.

The axes are Blender's: x to the right, y up, looking along -z. Pixel coordinates count from the picture's top
left corner; the center of pixel (column i, row j) is (i + 0.5, j + 0.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..numerics.arrays import Array
from ..numerics.checks import number, shown, whole
from ..numerics.errors import BlackHoleError
from ..numerics.sphere import by_component, cos_sin

# Pictures beyond this are a mistake; refusing them beats running out of memory.
LARGEST_SIDE = 65536

# Lengths of lenses and sensors, millimeters, ratios of pixels, and shifts beyond which arithmetic would not hold.
SHORTEST, LONGEST = 1e-6, 1e6

SENSOR_FITS = ("AUTO", "HORIZONTAL", "VERTICAL")


def _check_size(width: int, height: int) -> None:
    width, height = whole(width, "the picture's width"), whole(height, "the picture's height")
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise BlackHoleError(
            f"The picture's size is {shown(width)} x {shown(height)}; each side must be between 1 and {LARGEST_SIDE} "
            "pixels.",
            code="camera.size",
        )


@dataclass(frozen=True)
class PerspectiveCamera:
    """Blender's perspective camera.

    Parameters
    ----------
    width, height : int
        Size of the picture in pixels.
    focal_length, sensor_width, sensor_height : float
        In millimeters, > 0.
    sensor_fit : {"AUTO", "HORIZONTAL", "VERTICAL"}
        Which side of the picture the sensor fits; AUTO takes the longer one, and the sensor's width for both.
    shift_x, shift_y : float
        Lens shift in units of the fitted side.
    pixel_aspect_x, pixel_aspect_y : float
        Width and height of a pixel, > 0.

    Raises
    ------
    BlackHoleError
        For a value outside these ranges.
    """

    width: int
    height: int
    focal_length: float
    sensor_width: float = 36.0
    sensor_height: float = 24.0
    sensor_fit: str = "AUTO"
    shift_x: float = 0.0
    shift_y: float = 0.0
    pixel_aspect_x: float = 1.0
    pixel_aspect_y: float = 1.0

    kind = "perspective"

    def __post_init__(self) -> None:
        _check_size(self.width, self.height)
        for name in ("focal_length", "sensor_width", "sensor_height", "pixel_aspect_x", "pixel_aspect_y"):
            length = number(getattr(self, name), f"the camera's {name.replace('_', ' ')}")
            if not SHORTEST <= length <= LONGEST:
                raise BlackHoleError(
                    "The camera's focal length, sensor and pixel aspect must be positive numbers, from "
                    f"{SHORTEST:g} to {LONGEST:g}.",
                    code="camera.lens",
                )
            object.__setattr__(self, name, length)
        for name in ("shift_x", "shift_y"):
            shift = number(getattr(self, name), "the camera's lens shift")
            if not abs(shift) <= LONGEST:
                raise BlackHoleError(
                    f"The camera's lens shift must be a finite number, up to {LONGEST:g}.", code="camera.lens"
                )
            object.__setattr__(self, name, shift)
        if self.sensor_fit not in SENSOR_FITS:
            raise BlackHoleError(
                f"The sensor fit is {shown(self.sensor_fit)}; choose one of {', '.join(SENSOR_FITS)}.",
                code="settings.choice",
            )

    @classmethod
    def from_field_of_view(cls, width: int, height: int, vertical: float) -> PerspectiveCamera:
        """Return the camera with square pixels whose picture is `vertical` radians high.

        Raises
        ------
        BlackHoleError
            Unless 0 < vertical < pi, or for a size out of range.
        """
        vertical = number(vertical, "the field of view")
        if not 0.0 < vertical < math.pi:
            raise BlackHoleError(
                f"The field of view is {math.degrees(vertical):g} degrees; it must be between 0 and 180 degrees.",
                code="camera.lens",
            )
        sensor = 24.0
        return cls(
            width,
            height,
            focal_length=0.5 * sensor / math.tan(0.5 * vertical),
            sensor_height=sensor,
            sensor_fit="VERTICAL",
        )

    def resized(self, width: int, height: int) -> PerspectiveCamera:
        """Return the camera that sees exactly the same in another number of pixels.

        Raises
        ------
        BlackHoleError
            For a size out of range.
        """
        return replace(
            self,
            width=width,
            height=height,
            pixel_aspect_x=self.pixel_aspect_x * self.width / width,
            pixel_aspect_y=self.pixel_aspect_y * self.height / height,
        )

    def cropped(self, column: int, row: int, width: int, height: int) -> PerspectiveCamera:
        """Return the camera whose picture is a part of this one's, `column` pixels from its left, `row` from its top.

        Raises
        ------
        BlackHoleError
            For a size out of range.
        """
        _check_size(width, height)
        per_pixel, fitted, tall = self._scale()
        right = column + 0.5 * (width - self.width) + self.shift_x * fitted
        up = (0.5 * (self.height - height) - row) * tall + self.shift_y * fitted
        return replace(
            self,
            width=width,
            height=height,
            sensor_width=per_pixel * self.focal_length * width,
            sensor_fit="HORIZONTAL",
            shift_x=right / width,
            shift_y=up / width,
        )

    def directions(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the unit vectors seen at pixel coordinates x, y of any one shape; shape (..., 3)."""
        x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        per_pixel, fitted, tall = self._scale()
        right = (x - 0.5 * self.width + self.shift_x * fitted) * per_pixel
        up = ((0.5 * self.height - y) * tall + self.shift_y * fitted) * per_pixel
        away = 1.0 / np.sqrt(right * right + up * up + 1.0)
        right *= away
        up *= away
        return by_component(right, up, -away)

    def component(self, x: ArrayLike, y: ArrayLike, vector: Array) -> Array:
        """Return the component along `vector`, shape (3,), of the unit vectors seen at x, y, which may broadcast."""
        per_pixel, fitted, tall = self._scale()
        right = (np.asarray(x, np.float64) - 0.5 * self.width + self.shift_x * fitted) * per_pixel
        up = ((0.5 * self.height - np.asarray(y, np.float64)) * tall + self.shift_y * fitted) * per_pixel
        along: Array = (vector[0] * right - vector[2]) + vector[1] * up
        along /= np.sqrt((right * right + 1.0) + up * up)
        return along

    def pixels(self, directions: Array) -> tuple[Array, Array]:
        """Return the pixel coordinates where directions, shape (n, 3), are seen, (n,) each; NaN behind the camera."""
        per_pixel, fitted, tall = self._scale()
        ahead = np.where(directions[:, 2] < 0.0, -directions[:, 2], np.nan)
        x = directions[:, 0] / ahead / per_pixel + 0.5 * self.width - self.shift_x * fitted
        y = 0.5 * self.height - (directions[:, 1] / ahead / per_pixel - self.shift_y * fitted) / tall
        return x, y

    def pixels_around(self, directions: Array) -> tuple[Array, Array]:
        """Return what `pixels` does: the plane of the picture goes on beyond its border."""
        return self.pixels(directions)

    def solid_angles(self) -> Array:
        """Return the solid angle of each pixel, steradians, shape (height, width)."""
        per_pixel, fitted, tall = self._scale()
        right = (np.arange(self.width) + 0.5 - 0.5 * self.width + self.shift_x * fitted) * per_pixel
        up = ((0.5 * self.height - np.arange(self.height) - 0.5) * tall + self.shift_y * fitted) * per_pixel
        square = (right * right + 1.0) + (up * up)[:, None]
        angles: Array = np.sqrt(square)
        angles *= square
        return np.divide(per_pixel * per_pixel * tall, angles, out=angles)

    def _scale(self) -> tuple[float, float, float]:
        """Return the tangent per pixel width, the fitted side in pixel widths, and a pixel's height in widths."""
        tall = self.pixel_aspect_y / self.pixel_aspect_x
        wider = self.pixel_aspect_x * self.width >= self.pixel_aspect_y * self.height
        horizontal = self.sensor_fit == "HORIZONTAL" or (self.sensor_fit == "AUTO" and wider)
        sensor = self.sensor_height if self.sensor_fit == "VERTICAL" else self.sensor_width
        fitted = self.width if horizontal else self.height * tall
        return sensor / (self.focal_length * fitted), fitted, tall


@dataclass(frozen=True)
class PanoramaCamera:
    """Cycles' equirectangular panorama camera.

    Parameters
    ----------
    width, height : int
        Size of the picture in pixels.
    latitude_min, latitude_max : float
        Range from the picture's bottom to its top, radians within [-pi/2, pi/2].
    longitude_min, longitude_max : float
        Range from the picture's left to its right, radians within [-pi, pi]; 0 is straight ahead.

    Raises
    ------
    BlackHoleError
        For a value outside these ranges.
    """

    width: int
    height: int
    latitude_min: float = -math.pi / 2
    latitude_max: float = math.pi / 2
    longitude_min: float = -math.pi
    longitude_max: float = math.pi

    kind = "panorama"

    def __post_init__(self) -> None:
        _check_size(self.width, self.height)
        for name, low, high, limit in (
            ("latitude", self.latitude_min, self.latitude_max, math.pi / 2),
            ("longitude", self.longitude_min, self.longitude_max, math.pi),
        ):
            low, high = (number(each, f"the panorama's {name}") for each in (low, high))
            object.__setattr__(self, f"{name}_min", low)
            object.__setattr__(self, f"{name}_max", high)
            # Blender keeps these as single-precision numbers, which may lie just beyond the float64 limit.
            if not -limit * (1 + 1e-6) <= low < high <= limit * (1 + 1e-6):
                raise BlackHoleError(
                    f"The panorama's {name} runs from {math.degrees(low):g} to {math.degrees(high):g} degrees; "
                    f"it must rise within -{math.degrees(limit):g} and {math.degrees(limit):g} degrees.",
                    code="camera.lens",
                )

    def resized(self, width: int, height: int) -> PanoramaCamera:
        """Return the camera that sees exactly the same in another number of pixels.

        Raises
        ------
        BlackHoleError
            For a size out of range.
        """
        return replace(self, width=width, height=height)

    def cropped(self, column: int, row: int, width: int, height: int) -> PanoramaCamera:
        """Return the camera whose picture is a part of this one's, `column` pixels from its left, `row` from its top.

        Raises
        ------
        BlackHoleError
            For a size or a part out of range.
        """
        longitudes, latitudes = self._angles(np.array([column, column + width]), np.array([row + height, row]))
        return PanoramaCamera(width, height, *latitudes.tolist(), *longitudes.tolist())

    def directions(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the unit vectors seen at pixel coordinates x, y of any one shape; shape (..., 3)."""
        x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        longitude, latitude = self._angles(x, y)
        (level, rise), (ahead, aside) = cos_sin(latitude), cos_sin(longitude)
        return by_component(level * aside, rise, -level * ahead)

    def component(self, x: ArrayLike, y: ArrayLike, vector: Array) -> Array:
        """Return the component along `vector`, shape (3,), of the unit vectors seen at x, y, which may broadcast."""
        longitude, latitude = self._angles(x, y)
        (level, rise), (ahead, aside) = cos_sin(latitude), cos_sin(longitude)
        along: Array = level * (vector[0] * aside - vector[2] * ahead) + vector[1] * rise
        return along

    def solid_angles(self) -> Array:
        """Return the solid angle of each pixel, steradians, shape (height, width)."""
        latitudes = np.linspace(self.latitude_max, self.latitude_min, self.height + 1)
        bands = np.sin(latitudes[:-1]) - np.sin(latitudes[1:])
        across = (self.longitude_max - self.longitude_min) / self.width
        return np.repeat((bands * across)[:, None], self.width, axis=1)

    def pixels_around(self, directions: Array) -> tuple[Array, Array]:
        """Return the pixel coordinates of directions, shape (n, 3), as if the picture went on beyond its border.

        Columns are counted from half of what is beside the picture on either side.
        """
        longitude = np.arctan2(directions[:, 0], -directions[:, 2])
        latitude = np.arctan2(directions[:, 1], np.hypot(directions[:, 0], directions[:, 2]))
        wide = self.longitude_max - self.longitude_min
        beside = 0.5 * (2.0 * math.pi - wide)
        x = ((longitude - self.longitude_min + beside) % (2.0 * math.pi) - beside) / wide * self.width
        y = (self.latitude_max - latitude) / (self.latitude_max - self.latitude_min) * self.height
        return x, y

    def pixels(self, directions: Array) -> tuple[Array, Array]:
        """Return the pixel coordinates where directions, shape (n, 3), are seen, (n,) each; NaN outside the range."""
        longitude = np.arctan2(directions[:, 0], -directions[:, 2])
        latitude = np.arctan2(directions[:, 1], np.hypot(directions[:, 0], directions[:, 2]))
        seen = (self.longitude_min <= longitude) & (longitude <= self.longitude_max)
        seen &= (self.latitude_min <= latitude) & (latitude <= self.latitude_max)
        x = (longitude - self.longitude_min) / (self.longitude_max - self.longitude_min) * self.width
        y = (self.latitude_max - latitude) / (self.latitude_max - self.latitude_min) * self.height
        return np.where(seen, x, np.nan), np.where(seen, y, np.nan)

    def _angles(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Return longitude and latitude at pixel coordinates, in radians."""
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
        longitude = self.longitude_min + (self.longitude_max - self.longitude_min) * x / self.width
        latitude = self.latitude_max - (self.latitude_max - self.latitude_min) * y / self.height
        return longitude, latitude


@dataclass(frozen=True)
class HolePanorama:
    """All directions, finer toward the camera's own: what is ahead is at the top, position angles run across.

    No camera of Blender's, but the one that a layer of light for all directions is made with. The angle alpha from
    straight ahead is FOCUS (e^(k v) - 1), v from 0 at the top to 1 at the bottom, where alpha is pi. The position angle
    runs from x, to the right, to y, up.

    Parameters
    ----------
    width, height : int
        Size of the picture in pixels.

    Raises
    ------
    BlackHoleError
        For a size out of range.
    """

    width: int
    height: int

    kind = "hole panorama"

    FOCUS = 0.06
    """Radians; nearer than this, rows are of nearly equal height."""
    RATE = math.log(1.0 + math.pi / FOCUS)
    """k."""

    def __post_init__(self) -> None:
        _check_size(self.width, self.height)

    def resized(self, width: int, height: int) -> HolePanorama:
        """Return the camera that sees exactly the same in another number of pixels.

        Raises
        ------
        BlackHoleError
            For a size out of range.
        """
        return replace(self, width=width, height=height)

    def cropped(self, column: int, row: int, width: int, height: int) -> HolePanorama:
        """Refuse: a part of it is not of all directions.

        Raises
        ------
        BlackHoleError
        """
        raise BlackHoleError("A panorama about the hole cannot be cropped.", code="camera.lens")

    def directions(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the unit vectors seen at pixel coordinates x, y of any one shape; shape (..., 3)."""
        x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        (ahead, aside), (right, up) = (cos_sin(each) for each in self._angles(x, y))
        return by_component(aside * right, aside * up, -ahead)

    def component(self, x: ArrayLike, y: ArrayLike, vector: Array) -> Array:
        """Return the component along `vector`, shape (3,), of the unit vectors seen at x, y, which may broadcast."""
        (ahead, aside), (right, up) = (cos_sin(each) for each in self._angles(x, y))
        along: Array = aside * (vector[0] * right + vector[1] * up) - vector[2] * ahead
        return along

    def pixels(self, directions: Array) -> tuple[Array, Array]:
        """Return the pixel coordinates where directions, shape (n, 3), are seen, (n,) each."""
        away = np.arctan2(np.hypot(directions[:, 0], directions[:, 1]), -directions[:, 2])
        around = np.arctan2(directions[:, 1], directions[:, 0]) % (2.0 * math.pi)
        return around / (2.0 * math.pi) * self.width, np.log1p(away / self.FOCUS) / self.RATE * self.height

    def pixels_around(self, directions: Array) -> tuple[Array, Array]:
        """Return what `pixels` does: nothing is beyond its border."""
        return self.pixels(directions)

    def solid_angles(self) -> Array:
        """Return the solid angle of each pixel, steradians, shape (height, width)."""
        away, _ = self._angles(np.zeros(self.height + 1), np.arange(self.height + 1.0))
        bands = np.cos(away[:-1]) - np.cos(away[1:])
        return np.repeat((bands * (2.0 * math.pi / self.width))[:, None], self.width, axis=1)

    def _angles(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Return the angle from straight ahead and the position angle at pixel coordinates, radians."""
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
        away: Array = self.FOCUS * np.expm1(y * (self.RATE / self.height))
        around: Array = x * (2.0 * math.pi / self.width)
        return away, around


# A new camera has its place in both.
Camera = PerspectiveCamera | PanoramaCamera | HolePanorama
CAMERAS: dict[str, type[Camera]] = {each.kind: each for each in (PerspectiveCamera, PanoramaCamera, HolePanorama)}
