# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of a thick disk: the transfer of light through a layer of gas, front to back.

Along the backward ray (Chandrasekhar 1960, Radiative Transfer, ch. I; the invariants of Lindquist 1966, Ann. Phys. 37,
487), with u the matter's four-velocity, n its density and rho^2 = r^2 + a^2 cos^2 theta,

    d tau = kappa n (-p . u) rho^2 d lambda,   I += T (1 - exp(-d tau)) S,   T *= exp(-d tau).

kappa n is such that the vertical depth is that of the thin disk: tau(r) profile(z / H) / H with the profile's integral
1, z = r cot theta and H = thickness r. The profile is flat inside and steep at its surface, exp(-(z / (1.2 H))^6), and
higher where the gas is denser: surfaces of clouds hide each other. Matter above the plane moves as that below it does.
"""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np

from ..kerr.orbiting_matter import redshift_factor
from ..numerics.arrays import Array, Image, Index
from ..sampling.view import View
from ..shot.disk import Disk
from .slow_paths import SlowPaths
from .surface import Surface
from .thick_paths import LayerPaths, Samples

ROWS = 16
"""Rows of pixels worked through at a time."""

NODES, COARSE_NODES = 16, 12
KEPT = 0.2
"""Share of the nodes that is spread evenly over a pass; the others go where light comes from."""

PROFILE_HEIGHT, PROFILE_POWER, PROFILE_AREA = 1.2, 6, 2.0 * 1.2 * 0.9277
HIGHEST = 2.6
"""Of the layer, in units of H."""

DENSITY_SHARE = 0.4
"""Power of the turbulence by which the gas is denser; by the rest of it, it is higher."""

SHEAR = 0.15, 0.5
"""How far the pattern leans in ln r and azimuth per z / r, so that it is no curtain."""

LARGEST_STEP = 3.0
_TURN = 2.0 * math.pi


def thick_layer_steps(
    surface: Surface, view: View, size: tuple[int, int], disk: Disk, spin: float, time: float, nodes: int = NODES
) -> Generator[float, None, tuple[Image, int]]:
    """Return premultiplied light and what passes through, shape (height, width, 4), and how many rays are unresolved.

    Yields the fraction done, 0 to 1, after each few rows of pixels.

    Parameters
    ----------
    surface : Surface
        Of a look whose thickness is above 0.
    view : View
    size : (int, int)
        Columns and rows of the picture.
    disk : Disk
    spin : float
        Kerr parameter, -1 < a < 1.
    time : float
        Units of M.
    nodes : int
        Places along each pass of a ray.
    """
    columns, rows = size
    layer = np.zeros((rows * columns, 4), dtype=np.float32)
    layer[:, 3] = 1.0
    unresolved = 0
    for start in range(0, rows, ROWS):
        pixels = np.arange(start * columns, min(start + ROWS, rows) * columns)
        row, column = np.divmod(pixels, columns)
        cosine = math.sin(math.atan(HIGHEST * _height(surface, disk.radii(spin), None)))
        rays = view.rays(column + 0.5, row + 0.5)
        swinging = LayerPaths(rays, cosine)
        unresolved += int(np.count_nonzero(~rays.escapes))
        part = layer[pixels[0] : pixels[-1] + 1]
        for paths in (swinging, SlowPaths(rays, cosine, ~swinging.usable)):
            for order in paths.orders(disk.crossings):
                chosen, low, high = paths.passes(order, disk.crossings, *disk.radii(spin))
                if len(chosen):
                    _add_pass(surface, paths, (chosen, low, high), part, columns, disk, spin, time, nodes)
        yield min(1.0, (start + ROWS) / rows)
    return layer.reshape(rows, columns, 4), unresolved


def _height(surface: Surface, radii: tuple[float, float], radius: Array | None) -> Array | float:
    """Return H / r at radii, or the largest of the disk."""
    look, (inner, outer) = surface.look, radii
    if radius is None:
        return look.thickness * float(max(1.0, (outer / inner) ** look.flare))
    height: Array = look.thickness * (radius / inner) ** look.flare
    return height


def _add_pass(
    surface: Surface,
    paths: LayerPaths | SlowPaths,
    met: tuple[Index, Array, Array],
    layer: Image,
    columns: int,
    disk: Disk,
    spin: float,
    time: float,
    nodes: int,
) -> None:
    """Add one pass of rays behind what `layer`, shape (n, 4), has of them already."""
    chosen, low, high = met
    edges = _edges(surface, paths, met, disk, spin, nodes)
    samples = paths.samples(chosen, low, high, edges, surface.look.light_travel > 0.0)
    pixel = paths.live[chosen]
    with np.errstate(invalid="ignore", divide="ignore"):
        log_radius = -np.log(samples.u)
    inside = (log_radius > surface.log_inner) & (log_radius < surface.log_outer) & np.isfinite(samples.phi)
    node, ray = np.nonzero(inside)
    if not len(node):
        return
    radial, azimuthal = _footprints(log_radius, samples.phi, pixel, len(layer), columns)
    levels = surface.levels(radial[node, ray].astype(np.float32), azimuthal[node, ray].astype(np.float32))
    depth, zeta, log_g = _depths(surface, paths, chosen, samples, disk, spin, (node, ray))
    above = samples.height[node, ray]
    places = log_radius[node, ray] + SHEAR[0] * above, samples.phi[node, ray] + SHEAR[1] * above
    late = None
    if surface.look.light_travel > 0.0:
        late = (surface.look.light_travel * samples.delay[node, ray]).astype(np.float32)
    phi = np.mod(places[1], _TURN).astype(np.float32)
    light, dense, _ = surface.emission(
        np.clip(places[0], surface.log_inner, surface.log_outer).astype(np.float32), phi, log_g, time, late, levels
    )
    smooth = surface.radial(surface.depth, places[0].astype(np.float32))
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = np.where(smooth > 0.0, np.log(dense / smooth), 0.0)
    depth *= np.exp(DENSITY_SHARE * excess) * profile(zeta * np.exp(-surface.look.puff * excess))
    steps = np.zeros(samples.u.shape)
    steps[node, ray] = depth
    total = np.cumsum(steps, axis=0)
    seen = np.exp(steps - total) - np.exp(-total)
    light *= seen[node, ray].astype(np.float32)[:, None]
    through = layer[pixel, 3].copy()
    for channel in range(3):
        layer[pixel, channel] += through * np.bincount(ray, light[:, channel], len(chosen)).astype(np.float32)
    layer[pixel, 3] = through * np.exp(-total[-1]).astype(np.float32)


def profile(zeta: Array) -> Array:
    """Return the density across the layer by z / H: its integral is 1."""
    density: Array = np.exp(-((zeta / PROFILE_HEIGHT) ** PROFILE_POWER)) / PROFILE_AREA
    return density


def _depths(
    surface: Surface,
    paths: LayerPaths | SlowPaths,
    chosen: Index,
    samples: Samples,
    disk: Disk,
    spin: float,
    inside: tuple[Index, Index],
) -> tuple[Array, Array, Image]:
    """Return optical depths of samples without the profile, z / H there, and ln g."""
    node, ray = inside
    u, height = samples.u[node, ray], samples.height[node, ray]
    radius, rays = 1.0 / u, paths.rays.select(chosen)
    light = redshift_factor(spin, radius, rays.b[ray], 1.0, samples.u_slope[node, ray] / (u * u), disk.retrograde)
    tall = _height(surface, disk.radii(spin), radius)
    zeta = height / np.sqrt(1.0 - height * height) / tall
    rho = radius * radius + (spin * height) ** 2
    depth = surface.radial(surface.depth, np.log(radius).astype(np.float32)).astype(np.float64)
    depth *= rho / light * samples.mino_step[node, ray] / (radius * tall)
    return depth, zeta, np.log(light / rays.one_plus_z[ray]).astype(np.float32)


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
    with np.errstate(invalid="ignore", divide="ignore"):
        log_radius = -np.log(samples.u)
    margin = 0.08
    inside = (log_radius > surface.log_inner - margin) & (log_radius < surface.log_outer + margin)
    node, ray = np.nonzero(inside)
    steps = np.zeros(samples.u.shape)
    if len(node):
        depth, zeta, _ = _depths(surface, paths, chosen, samples, disk, spin, (node, ray))
        steps[node, ray] = depth * profile(zeta / 1.15)
    total = np.cumsum(steps, axis=0)
    seen = np.exp(steps - total) - np.exp(-total)
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


def _footprints(log_radius: Array, phi: Array, pixel: Index, count: int, columns: int) -> tuple[Array, Array]:
    """Return the extents of samples in ln r and azimuth: to the pixels beside, and to the next node, so that nodes are
    no sheets of their own."""
    place = np.full(count + columns, -1)
    place[pixel] = np.arange(len(pixel))
    radial, azimuthal = (np.nan_to_num(each) ** 2 for each in (_to_next(log_radius), _wrapped(_to_next(phi))))
    column = pixel % columns
    for step in (1, columns):
        after, before = place[pixel + step], place[np.maximum(pixel - step, 0)]
        if step == 1:
            after, before = np.where(column < columns - 1, after, -1), np.where(column > 0, before, -1)
        other = np.where(after >= 0, after, np.where(before >= 0, before, np.arange(len(pixel))))
        away = np.clip(np.nan_to_num(log_radius[:, other] - log_radius), -LARGEST_STEP, LARGEST_STEP)
        turned = np.nan_to_num(_wrapped(phi[:, other] - phi))
        radial += away * away
        azimuthal += turned * turned
    return np.sqrt(radial), np.sqrt(azimuthal)


def _to_next(values: Array) -> Array:
    change: Array = np.gradient(values, axis=0)
    return change


def _wrapped(angle: Array) -> Array:
    wrapped: Array = angle - _TURN * np.rint(angle * (1.0 / _TURN))
    return wrapped
