# SPDX-License-Identifier: GPL-3.0-or-later
"""What rays meet of a thick layer, at a few places along each pass: where light comes from, and how dense it is there.

Along the backward ray (Chandrasekhar 1960, Radiative Transfer, ch. I; the invariants of Lindquist 1966, Ann. Phys. 37,
487), with u the matter's four-velocity, n its density and rho^2 = r^2 + a^2 cos^2 theta,

    d tau = kappa n (-p . u) rho^2 d lambda.

kappa n is such that the vertical depth is that of the thin disk: tau(r) profile(z / H) / H with the profile's integral
1, z = r cot theta and H = thickness r. Matter above the plane moves as that below it does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ..kerr.orbiting_matter import redshift_factor
from ..kerr.rays import Rays
from ..numerics.arrays import Array, Image, Index
from ..shot.disk import Disk
from .slow_paths import SlowPaths
from .surface import Surface
from .thick_paths import LayerPaths

NODES, COARSE_NODES = 12, 20
KEPT = 0.35
"""Share of the nodes that is spread evenly over a pass; the others go where light comes from."""

PROFILE_HEIGHT, PROFILE_AREA = 1.2, 2.0 * 1.2 * 0.9277
HIGHEST = 2.6
"""Of the layer, in units of H."""

RIM_MARGIN = 0.08
"""In ln r, by which places off the disk count as near to it."""


Numbers = TypeVar("Numbers", Array, Image)

LARGEST_STEP = 3.0
_TURN = np.float32(2.0 * math.pi)


@dataclass(frozen=True)
class Nodes:
    """Places along a pass of rays, front to back; arrays of float32, shape (nodes, n), finite everywhere."""

    log_radius: Image
    phi: Image
    """Azimuth, radians, continuous along a ray."""
    log_g: Image
    zeta: Image
    """z / H."""
    depth: Image
    """Optical depth of the node for a profile of 1 and without turbulence; 0 off the disk."""
    delay: Image
    """How much earlier light left there, units of M; 0 if not asked for."""


@dataclass(frozen=True)
class Pass:
    """One pass of some rays."""

    is_slow: bool
    """Whether its rays are those of `SlowPaths`."""
    order: int
    ray: Index
    """Numbers of the rays, shape (n,)."""
    nodes: Nodes


def profile(zeta: Numbers) -> Numbers:
    """Return the density across the layer by z / H: its integral is 1."""
    square = zeta * (1.0 / PROFILE_HEIGHT)
    square *= square
    density: Numbers = np.exp(-square * square * square)
    density *= 1.0 / PROFILE_AREA
    return density


def shares_seen(steps: Numbers) -> Numbers:
    """Return the share of the light behind everything that each node takes away, from optical depths front to back."""
    total = np.cumsum(steps, axis=0)
    seen: Numbers = np.exp(steps - total) - np.exp(-total)
    return seen


def height_over_radius(surface: Surface, radii: tuple[float, float], radius: Array | None) -> Array | float:
    """Return H / r at radii, or the largest of the disk."""
    look, (inner, outer) = surface.look, radii
    if radius is None:
        return look.thickness * float(max(1.0, (outer / inner) ** look.flare))
    height: Array = look.thickness * (radius / inner) ** look.flare
    return height


def passes_of(surface: Surface, rays: Rays, disk: Disk, spin: float, nodes: int = NODES) -> Iterator[Pass]:
    """Yield the passes of rays through a layer, front to back for each ray.

    Parameters
    ----------
    surface : Surface
        Of a look whose thickness is above 0.
    rays : Rays
    disk : Disk
    spin : float
        Kerr parameter, -1 < a < 1.
    nodes : int
        Places along each pass of a ray.
    """
    radii = disk.radii(spin)
    cosine = math.sin(math.atan(HIGHEST * height_over_radius(surface, radii, None)))
    swinging = LayerPaths(rays, cosine)
    for paths in (swinging, SlowPaths(rays, cosine, ~swinging.usable)):
        for order in paths.orders(disk.crossings):
            met = paths.passes(order, disk.crossings, *radii)
            if len(met[0]):
                found = _nodes(surface, paths, met, disk, spin, nodes)
                yield Pass(isinstance(paths, SlowPaths), order, paths.live[met[0]], found)


def _nodes(
    surface: Surface,
    paths: LayerPaths | SlowPaths,
    met: tuple[Index, Array, Array],
    disk: Disk,
    spin: float,
    nodes: int,
) -> Nodes:
    chosen, low, high = met
    edges = _edges(surface, paths, met, disk, spin, nodes)
    timed = surface.look.light_travel > 0.0
    samples = paths.samples(chosen, low, high, edges, timed)
    rays = paths.rays.select(chosen)
    height = _ahead(samples.height)
    fields = samples.u, samples.u_slope, height, samples.mino_step
    log_radius, log_g, zeta, depth = _matter(surface, rays, *fields, disk, spin)
    known = np.isfinite(samples.phi) & np.isfinite(log_g)
    depth = np.where(known & (log_radius > surface.log_inner) & (log_radius < surface.log_outer), depth, 0.0)
    delay = np.nan_to_num(samples.delay) if timed else np.zeros(0)
    plain = (each.astype(np.float32) for each in (log_radius, _ahead(samples.phi), _ahead(log_g), zeta, depth, delay))
    return Nodes(*plain)


def _matter(
    surface: Surface, rays: Rays, u: Array, slope: Array, height: Array, step: Array, disk: Disk, spin: float
) -> tuple[Array, Array, Array, Array]:
    """Return ln r, ln g, z / H and the optical depth for a profile of 1, shape (nodes, n); of places that are unknown
    that of the one before."""
    u, slope = _ahead(u), _ahead(slope)
    with np.errstate(all="ignore"):
        radius = 1.0 / u
        light = redshift_factor(spin, radius, rays.b, 1.0, slope * radius * radius, disk.retrograde)
        tall = height_over_radius(surface, disk.radii(spin), radius)
        zeta = height / np.sqrt(1.0 - height * height) / tall
        log_radius = np.log(radius)
        depth = surface.radial(surface.depth, np.nan_to_num(log_radius).astype(np.float32)).astype(np.float64)
        depth *= (radius * radius + (spin * height) ** 2) / light * step / (radius * tall)
        log_g = np.log(light / rays.one_plus_z)
    return log_radius, log_g, np.nan_to_num(zeta, nan=1e3, posinf=1e3, neginf=-1e3), np.nan_to_num(depth)


def _ahead(values: Array) -> Array:
    """Return values of shape (nodes, n) with those of the node before where they are unknown."""
    bad = ~np.isfinite(values)
    if not bad.any():
        return values
    values = values.copy()
    values[0][bad[0]] = 1.0
    for number in range(1, len(values)):
        np.copyto(values[number], values[number - 1], where=bad[number])
    return values


def _edges(
    surface: Surface,
    paths: LayerPaths | SlowPaths,
    met: tuple[Index, Array, Array],
    disk: Disk,
    spin: float,
    nodes: int,
) -> Array:
    """Return where parts of passes begin and end, shape (nodes + 1, n): of equal shares of what is seen of a smooth
    layer, `KEPT` of them by the angle alone."""
    chosen, low, high = met
    even = np.linspace(0.0, 1.0, COARSE_NODES + 1)[:, None]
    samples, _ = paths.heights(chosen, low, high, even)
    rays = paths.rays.select(chosen)
    fields = samples.u, samples.u_slope, samples.height, samples.mino_step
    log_radius, _, zeta, depth = _matter(surface, rays, *fields, disk, spin)
    inside = np.isfinite(samples.u) & (log_radius > surface.log_inner - RIM_MARGIN)
    inside &= log_radius < surface.log_outer + RIM_MARGIN
    steps = np.where(inside, depth * profile(zeta / 1.15), 0.0)
    seen = shares_seen(steps)
    seen /= np.maximum(seen.sum(axis=0), 1e-6)
    seen[1:-1] = 0.25 * seen[:-2] + 0.5 * seen[1:-1] + 0.25 * seen[2:]
    near = inside.astype(np.float64)
    near[1:-1] = np.maximum(near[1:-1], 0.5 * np.maximum(near[:-2], near[2:]))
    near += 1e-3
    weight = (1.0 - KEPT) * seen / np.maximum(seen.sum(axis=0), 1e-6) + KEPT * near / near.sum(axis=0)
    weight /= weight.sum(axis=0)
    sums = np.concatenate([np.zeros((1, weight.shape[1])), np.cumsum(weight, axis=0)])
    shares = np.linspace(0.0, 1.0, nodes + 1)[:, None]
    edges = np.zeros((nodes + 1, weight.shape[1]))
    for number in range(COARSE_NODES):
        edges += np.clip((shares - sums[number]) / weight[number], 0.0, 1.0)
    edges /= COARSE_NODES
    return edges


def extents(nodes: Nodes, pixel: Index, columns: int, side: int = 1) -> tuple[Image, Image]:
    """Return the extents of nodes in ln r and azimuth: to the pixels beside, and to the next node, so that nodes are no
    sheets of their own.

    `pixel`: numbers of the rays, in rising order, in a picture of so many columns, of every `side`-th pixel.
    """
    share = np.float32(1.0 / side)
    log_radius, phi = nodes.log_radius, nodes.phi
    place = np.full(int(pixel.max()) + columns + 2, -1)
    place[pixel] = np.arange(len(pixel))
    radial, azimuthal = (np.square(np.gradient(each, axis=0)).astype(np.float32) for each in (log_radius, phi))
    column = pixel % columns
    for step in (1, columns):
        after, before = place[pixel + step], place[np.maximum(pixel - step, 0)]
        if step == 1:
            after, before = np.where(column < columns - 1, after, -1), np.where(column > 0, before, -1)
        other = np.where(after >= 0, after, np.where(before >= 0, before, np.arange(len(pixel))))
        away = share * np.clip(log_radius[:, other] - log_radius, -LARGEST_STEP, LARGEST_STEP)
        turned = share * wrapped(phi[:, other] - phi)
        radial += away * away
        azimuthal += turned * turned
    return np.sqrt(radial), np.sqrt(azimuthal)


def wrapped(angle: Image) -> Image:
    """Return angles within half a turn of 0."""
    turns: Image = np.rint(angle * (np.float32(1.0) / _TURN))
    return angle - _TURN * turns
