# SPDX-License-Identifier: GPL-3.0-or-later
"""The lensed sky of one place as a picture that a World shader can look up, whichever way the camera is turned.

Across runs the position angle psi about the hole's direction; up runs s = ln(delta) + delta, where delta is the
distance from the shadow's edge. Around the edge the sky winds up without end, by equal angles for equal factors in
delta; s is the logarithm next to the edge and plain far from it, so that directions turn at nearly one rate everywhere.
So a small picture is fine where the sky is crowded, the shadow's edge is a function and not a row of pixels, and the
map has no poles and no seam: psi is a circle, and directions are kept as vectors. The bottom row is a header with the
numbers that lead from a direction to a place in the map. All of this is in the axes of the scene's world.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..geodesics.tracer import Fate, trace_block
from ..kerr.critical_curve import around_hole, edge_angles
from ..kerr.observer import Observer
from ..kerr.rays import rays_from_triad, redshift_vector
from ..numerics.arrays import Array, Image
from ..numerics.blocks import blocks
from ..numerics.sphere import cos_sin, spherical_triad
from ..shot.cameras import PanoramaCamera
from ..shot.map_parameters import IDENTITY, WarpMapParameters

# Sizes of the grid: position angles, and places between the edge and the opposite point of the sky.
FINAL = (512, 431)
PREVIEW = (192, 95)

# The first place beside the edge, as a share of the edge's largest distance from the hole's direction. What lies closer
# is given the same direction: a fifth of a pixel in common pictures.
CLOSEST = 1e-3
# How well the edge's place is found, radians: single precision has no more of it.
EDGE_ERROR = 1e-9

# Newton's method doubles its correct digits in each round: this many rounds serve any start.
NEWTON_ROUNDS = 6

# The header's parts, each an eighth of its width, so that reading one needs no width.
HEADER_PARTS = 8
STAMP = 1.0

# Shorter vectors than this are not directions: rays that could not be resolved, whose vectors are 0. Between places
# whose light comes from opposite directions, beside the flat side of a fast hole, interpolation shortens vectors too.
SHORTEST = 1e-3


@dataclass(frozen=True)
class WorldMap:
    """A world map in memory."""

    texture: Image
    """Shape (rows + 1, columns, 4), from the bottom up as Blender keeps pixels.

    Row 0 is the header. In the others, red, green and blue are the unit vector towards the light's origin (world axes;
    0 where a ray was not resolved) and alpha is the angle, radians, from the hole's direction to the shadow's edge.
    """
    metadata: dict[str, Any]
    """``hash``, ``counts`` and ``parameters``; in a file also ``format``."""

    @property
    def counts(self) -> dict[str, int]:
        """``rays`` traced, and ``unresolved`` ones among them."""
        counts: dict[str, int] = self.metadata["counts"]
        return counts

    def look_up(self, directions: ArrayLike) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Do in float64 what the World shader does: where light seen along world directions comes from.

        Parameters
        ----------
        directions : array_like, shape (n, 3)
            Unit vectors along which the camera looks, on the scene's world axes.

        Returns
        -------
        origin : ndarray, shape (n, 3)
            Unit vectors towards the origin of the light, world axes; NaN where unresolved.
        one_plus_z : ndarray, shape (n,)
            f_source / f_camera.
        visible : ndarray of bool, shape (n,)
            False in the shadow.
        """
        looking = np.asarray(directions, dtype=np.float64)
        rows, columns = self.texture.shape[:2]
        header = self.texture[0, :: columns // HEADER_PARTS].astype(np.float64)
        outward, polar, motion, shift = header[:4, :3]
        offset, slope, beta, constant = header[:4, 3]
        # Eq. 5: what the camera sees along N, the FIDO sees along this, but for its length
        contraction = math.sqrt((1.0 - beta) * (1.0 + beta))
        along = looking @ motion
        seen = contraction * looking + ((1.0 - contraction) * along - beta)[:, None] * motion
        aside, up = seen @ polar, seen @ np.cross(outward, polar)
        away = np.arctan2(np.hypot(aside, up), -(seen @ outward))
        across = np.arctan2(up, aside) / (2.0 * math.pi)
        edge = self._sample(across, np.full(len(across), 0.5))[:, 3]
        delta = away - edge
        visible: NDArray[np.bool_] = delta > 0.0
        positive = np.where(visible, delta, 1.0)
        height = np.clip(offset + slope * (np.log(positive) + positive), header[4, 0], 1.0 - 0.5 / rows)
        origin = self._sample(across, height)[:, :3]
        length = np.linalg.norm(origin, axis=-1, keepdims=True)
        origin = np.where(length > SHORTEST, origin / np.maximum(length, SHORTEST), np.nan)
        return origin, constant + looking @ shift, visible

    def _sample(self, across: Array, height: Array) -> Array:
        """Return the texture's values, interpolated bilinearly, round and round across; shape (n, 4)."""
        rows, columns = self.texture.shape[:2]
        x, y = across * columns - 0.5, height * rows - 0.5
        left, below = np.floor(x), np.floor(y)
        share_x, share_y = (x - left)[:, None], (y - below)[:, None]
        left_index = left.astype(np.intp) % columns
        right_index = (left_index + 1) % columns
        below_index = np.clip(below.astype(np.intp), 0, rows - 1)
        above_index = np.minimum(below_index + 1, rows - 1)
        texels = self.texture.astype(np.float64)
        lower = texels[below_index, left_index] * (1.0 - share_x) + texels[below_index, right_index] * share_x
        upper = texels[above_index, left_index] * (1.0 - share_x) + texels[above_index, right_index] * share_x
        values: Array = lower * (1.0 - share_y) + upper * share_y
        return values


def world_parameters(parameters: WarpMapParameters, grid: tuple[int, int] = FINAL) -> WarpMapParameters:
    """Return what a world map is made from: the place and its motion, whatever the camera's orientation.

    Parameters
    ----------
    parameters : WarpMapParameters
        A frame's. Camera, orientation, interpolation and disk do not matter.
    grid : (int, int)
        Position angles, and places between the edge and the opposite point of the sky.

    Returns
    -------
    WarpMapParameters
        With a panorama camera that stands for the size of the map's texture.
    """
    columns, rows = grid
    return replace(
        parameters,
        camera=PanoramaCamera(columns, rows + 1),
        camera_to_hole=IDENTITY,
        supersampling=1,
        interpolation=0.0,
        disk=None,
    )


def world_map_steps(parameters: WarpMapParameters) -> Generator[float, None, WorldMap]:
    """Trace a world map step by step.

    Parameters
    ----------
    parameters : WarpMapParameters
        From `world_parameters`.

    Yields
    ------
    float
        The fraction done, 0 to 1, after each block of rays.

    Returns
    -------
    WorldMap

    Raises
    ------
    BlackHoleError
        Before the first step, if no map can be made from these parameters.
    """
    parameters.validate()
    observer, columns, rows = parameters.observer(), parameters.camera.width, parameters.camera.height - 1
    fido = Observer.fido(observer.r, observer.theta, observer.phi)
    aside, up = cos_sin((np.arange(columns, dtype=np.float64) + 0.5) * (2.0 * math.pi / columns))
    edge = edge_angles(parameters.spin, fido, aside, up, EDGE_ERROR)
    closest = CLOSEST * float(edge.max())
    heights = np.linspace(math.log(closest) + closest, math.log(math.pi) + math.pi, rows)
    # Beyond the opposite point, where the angle passes pi, the great circle goes on down the other side.
    looking = around_hole(edge + distances(heights)[:, None], aside, up).reshape(-1, 3)
    found = np.empty((len(looking), 3))
    fate = np.empty(len(looking), np.uint8)
    for block in blocks(len(looking)):
        rays = rays_from_triad(parameters.spin, fido, looking[block])
        fate[block], found[block] = trace_block(rays, parameters.tolerance, parameters.method)
        yield block.stop / len(looking)
    to_world = np.array(parameters.hole_to_world)
    texture = np.empty((rows + 1, columns, 4), np.float32)
    texture[0] = _header(parameters, observer, heights)
    texture[1:, :, :3] = np.where((fate == Fate.SKY)[:, None], found @ to_world.T, 0.0).reshape(rows, columns, 3)
    texture[1:, :, 3] = edge
    _extend(texture[1:, :, :3], (fate == Fate.SHADOW).reshape(rows, columns))
    counts = {"rays": len(looking), "unresolved": int(np.count_nonzero(fate == Fate.UNRESOLVED))}
    metadata = {"hash": parameters.hash, "counts": counts, "parameters": parameters.to_metadata()}
    return WorldMap(texture, metadata)


def distances(s: Array) -> Array:
    """Return the distances from the shadow's edge at given values of the map's second coordinate.

    Solves ln(delta) + delta = s by Newton's method in ln(delta), which comes down from above.

    Parameters
    ----------
    s : ndarray

    Returns
    -------
    ndarray
        delta, radians, > 0; the shape of `s`.
    """
    # Above the solution in every case: delta is at most s for s >= 1, and at most 1 and exp(s) below.
    logarithm: Array = np.where(s > 1.0, np.log(np.maximum(s, 1.0)), np.minimum(s, 0.0))
    for _ in range(NEWTON_ROUNDS):
        delta = np.exp(logarithm)
        logarithm -= (logarithm + delta - s) / (1.0 + delta)
    found: Array = np.exp(logarithm)
    return found


def _header(parameters: WarpMapParameters, observer: Observer, heights: Array) -> Image:
    """Return the header's row, shape (columns, 4).

    Its parts: r-hat and the map's height where s = 0; theta-hat and its rise for each unit of s; the camera's direction
    of motion and its speed; c and c_0 of 1 + z = c_0 + c . N; the height of the lowest place, a stamp, width and height
    of the texture.
    """
    columns, rows = parameters.camera.width, len(heights)
    to_world = np.array(parameters.hole_to_world) @ spherical_triad(observer.theta, observer.phi).T
    constant, along = redshift_vector(parameters.spin, observer)
    slope = (rows - 1) / (heights[-1] - heights[0]) / (rows + 1)
    lowest = 1.5 / (rows + 1)
    parts = np.zeros((HEADER_PARTS, 4))
    parts[0] = *to_world[:, 0], lowest - slope * heights[0]
    parts[1] = *to_world[:, 1], slope
    parts[2] = *(to_world @ np.array(observer.direction)), observer.beta
    parts[3] = *(to_world @ along), constant
    parts[4] = lowest, STAMP, columns, rows + 1
    header: Image = np.repeat(parts, columns // HEADER_PARTS, axis=0).astype(np.float32)
    return header


def _extend(directions: Image, beyond: NDArray[np.bool_]) -> None:
    """Give places that lie in the shadow, beyond the opposite point, the direction below them: none is looked up."""
    for row in np.flatnonzero(beyond.any(axis=1)):
        if row > 0:
            directions[row, beyond[row]] = directions[row - 1, beyond[row]]
