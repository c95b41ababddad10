# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of a thick disk: the transfer of light through a layer of gas, front to back.

With the optical depths of `thick_nodes`, I += T (1 - exp(-d tau)) S, T *= exp(-d tau) (Chandrasekhar 1960, Radiative
Transfer, ch. I). The profile is flat inside and steep at its surface, exp(-(z / (1.2 H))^6), and higher where the gas
is denser: surfaces of clouds hide each other.

What rays meet is a smooth function of the pixel, unlike the turbulence there. So rays are traced at the corners of
cells of pixels, and the places along them interpolated; cells in which that is not good enough, as beside the shadow,
are traced pixel by pixel.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..numerics.arrays import Image, Index
from ..sampling.view import View
from ..shot.disk import Disk
from .surface import FieldLevels, Surface
from .thick_cells import Cells
from .thick_nodes import NODES, Nodes, extents, passes_of, profile

BLOCK = 1 << 13
"""Rays worked through at a time."""

DENSITY_SHARE = 0.4
"""Power of the turbulence by which the gas is denser; by the rest of it, it is higher."""

SHEAR = 1.5, 3.0
"""How far the pattern leans in ln r and azimuth per z / r, so that it is no curtain."""

GROUP = 4
"""Nodes shaded at a time, so that those behind what hides them need not be."""
HIDDEN, LEAST_DEPTH, HIGHEST_CLOUD = 2e-3, 2e-4, 2.0
"""Share of the light that passes, below which nothing is seen; optical depth of a node that is too small to see; and by
how much clouds may be higher than the smooth layer."""

_TURN = np.float32(2.0 * np.pi)

COARSE_CELL, FINE_CELL = 8, 4
"""Pixels along the sides of cells, for pictures of at least as many columns as follow."""
COARSE_COLUMNS, FINE_COLUMNS = 1000, 200


def thick_layer_steps(
    surface: Surface,
    view: View,
    size: tuple[int, int],
    disk: Disk,
    spin: float,
    time: float,
    nodes: int = NODES,
    side: int | None = None,
) -> Generator[float, None, tuple[Image, int]]:
    """Return premultiplied light and what passes through, shape (height, width, 4), and how many rays are unresolved.

    Yields the fraction done, 0 to 1, after each block of rays.

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
    side : int, optional
        Pixels along the sides of cells; 1 traces all rays.
    """
    columns, rows = size
    if side is None:
        side = COARSE_CELL if columns >= COARSE_COLUMNS else FINE_CELL if columns >= FINE_COLUMNS else 1
    layer = np.zeros((rows * columns, 4), dtype=np.float32)
    layer[:, 3] = 1.0
    unresolved, left = 0, np.arange(rows * columns)
    if side > 1:
        cells = Cells(side, size)
        for done in cells.trace(view, surface, disk, spin, nodes):
            yield 0.4 * done
        for pixels, parts in cells.parts():
            for part, radial, azimuthal in parts:
                _add(layer, pixels, *_transfer(surface, part, radial, azimuthal, time))
            yield 0.4
        left = cells.left()
        unresolved = cells.unresolved
    width = max(1, BLOCK // columns) * columns if side == 1 else BLOCK
    for start in range(0, len(left), width):
        pixels = left[start : start + width]
        row, column = np.divmod(pixels, columns)
        rays = view.rays(column + 0.5, row + 0.5)
        unresolved += int(np.count_nonzero(~rays.escapes))
        for each in passes_of(surface, rays, disk, spin, nodes):
            here = pixels[each.ray]
            radial, azimuthal = extents(each.nodes, here - here[0] // columns * columns, columns)
            _add(layer, here, *_transfer(surface, each.nodes, radial, azimuthal, time))
        yield min(1.0, (start + width) / len(left))
    return layer.reshape(rows, columns, 4), unresolved


def _add(layer: Image, pixels: Index, light: Image, through: Image) -> None:
    """Lay what pixels show behind what they have already."""
    before = layer[pixels]
    light *= before[:, 3:]
    before[:, :3] += light
    before[:, 3] *= through
    layer[pixels] = before


def _transfer(surface: Surface, part: Nodes, radial: Image, azimuthal: Image, time: float) -> tuple[Image, Image]:
    """Return light, shape (n, 3), and what passes, (n,), of a pass with the extents of its nodes."""
    count, rays = part.depth.shape
    light, passing = np.zeros((rays, 4), dtype=np.float32), np.ones(rays, dtype=np.float32)
    possible = part.depth * profile(part.zeta * np.float32(1.0 / HIGHEST_CLOUD)) > np.float32(LEAST_DEPTH)
    for start in range(0, count, GROUP):
        group = slice(start, start + GROUP)
        size = min(GROUP, count - start)
        # What is hidden is not looked at.
        some = np.flatnonzero(possible[group] & (passing > np.float32(HIDDEN)))
        if not len(some):
            continue
        here = [each[group].ravel().take(some) for each in (part.log_radius, part.phi, part.log_g, part.zeta)]
        late = part.delay[group].ravel().take(some) if part.delay.size else None
        levels = surface.levels(*(each[group].ravel().take(some) for each in (radial, azimuthal)))
        colors, dense = _gas(surface, (here[0], here[1], here[2], here[3]), levels, time, late)
        steps = np.zeros(size * rays, dtype=np.float32)
        steps[some] = part.depth[group].ravel().take(some) * dense
        steps = steps.reshape(size, rays)
        shown = np.zeros((size * rays, 4), dtype=np.float32)
        after = np.exp(-np.cumsum(steps, axis=0))
        after *= passing
        seen = np.concatenate([passing[None], after[:-1]]) - after
        colors *= seen.ravel().take(some)[:, None]
        shown[some] = colors
        light += shown.reshape(size, rays, 4).sum(axis=0)
        passing = after[-1]
    return light[:, :3], passing


def _gas(
    surface: Surface, here: tuple[Image, Image, Image, Image], levels: FieldLevels, time: float, late: Image | None
) -> tuple[Image, Image]:
    """Return the light of opaque gas, shape (n, 4), and by how much the depth of nodes is multiplied, (n,), at places
    of ln r, azimuth, ln g and z / H."""
    log_radius, phi, log_g, zeta = here
    above = zeta * np.float32(surface.look.thickness)
    phi += np.float32(SHEAR[1]) * above
    phi -= _TURN * np.floor(phi * (np.float32(1.0) / _TURN))
    if late is not None:
        late *= np.float32(surface.look.light_travel)
    log_radius += np.float32(SHEAR[0]) * above
    np.clip(log_radius, surface.log_inner, surface.log_outer, out=log_radius)
    light, dense, _ = surface.emission(log_radius, phi, log_g, time, late, levels)
    with np.errstate(divide="ignore", invalid="ignore"):
        excess = np.log(dense / surface.radial(surface.depth, log_radius))
    excess[~np.isfinite(excess)] = 0.0
    zeta *= np.exp(np.float32(-surface.look.puff) * excess)
    excess *= np.float32(DENSITY_SHARE)
    return light, np.exp(excess) * profile(zeta)
