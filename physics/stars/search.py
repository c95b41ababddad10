# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the images of stars: which cells of a local sky hold a star.

Each cell of the table is two triangles on the celestial sphere. The map that is linear on each triangle is continuous,
so the images that it has come and go in pairs, and none is lost or counted twice where triangles meet: the side of a
shared edge that a star is on, the sign of a triple product, is worked out from the same numbers for both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..numerics.arrays import Array, Index, Mask
from .local_sky import LocalSky, local_sky

WIDEST = 0.25
"""Cells with longer sides (chord) are refused: their triangles may not be what lies between their corners."""

# Tables are made with more columns until no more than this share of the sky's light is in cells that are refused.
COLUMNS = (256, 512, 1024)
MOST_REFUSED = 1e-4

# Stars are sorted into this many zones of equal area between the poles.
ZONES = 256
# Pairs of star and cell that are looked at together, which bounds the memory.
PAIRS_AT_ONCE = 1 << 16


@dataclass(frozen=True)
class Bounds:
    """What of the celestial sphere cells may cover; arrays of shape (cells,)."""

    low: Array
    """Smallest and largest z, and azimuth in turns."""
    high: Array
    first: Array
    last: Array
    """In turns, from `first` on; `last` - `first` is at most 1."""


@dataclass(frozen=True)
class Mesh:
    """The cells of a local sky, ready to be searched; arrays of shape (cells,) unless said otherwise."""

    sky: LocalSky
    row: Index
    column: Index
    bounds: Bounds
    corners: Array
    """Shape (4, 3, cells): the corners 00, 01 (next column), 10 (next row), 11."""
    sides: Array
    """Shape (5, 3, cells): cross products 00 x 01, 01 x 10, 10 x 00, 11 x 10, 01 x 11."""
    refused: int
    """Cells with a corner that is not known or sides that are too long."""
    refused_light: float
    """Share of the light of an even sky that comes through them."""


class Found(NamedTuple):
    """Images as the mesh has them, in no order; arrays of shape (images,)."""

    star: Index
    x: Array
    """Column in the table, and row."""
    y: Array


def mesh_for(spin: float, r: float, theta: float, smallest: float) -> Mesh:
    """Return the cells of a place's sky, fine enough for nearly all of it.

    Parameters
    ----------
    spin, r, theta, smallest
        As for `local_sky`.

    Returns
    -------
    Mesh

    Raises
    ------
    BlackHoleError
        If the place is inside the horizon or the spin out of range.
    """
    for columns in COLUMNS:
        mesh = mesh_of(local_sky(spin, r, theta, smallest, columns))
        if mesh.refused_light <= MOST_REFUSED:
            break
    return mesh


def mesh_of(sky: LocalSky) -> Mesh:
    """Return the cells of a table, ready to be searched."""
    nodes = np.moveaxis(sky.nodes, -1, 0)
    c00, c01, c10, c11 = nodes[:, :-1, :-1], nodes[:, :-1, 1:], nodes[:, 1:, :-1], nodes[:, 1:, 1:]
    known = np.isfinite(nodes[0])
    good = known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:]
    with np.errstate(invalid="ignore"):
        longest = np.maximum.reduce(
            [((one - other) ** 2).sum(axis=0) for one, other in ((c00, c11), (c01, c10), (c00, c01), (c10, c11))]
            + [((one - other) ** 2).sum(axis=0) for one, other in ((c00, c10), (c01, c11))]
        )
        good &= longest < WIDEST**2
    row, column = np.nonzero(good)
    chord = longest[row, column]
    corners = np.stack([each[:, row, column] for each in (c00, c01, c10, c11)])
    a, b, c, d = corners
    sides = np.stack([_cross(a, b), _cross(b, c), _cross(c, a), _cross(d, c), _cross(b, d)])

    azimuth = np.arctan2(nodes[1], nodes[0]) / (2.0 * math.pi)
    start = azimuth[row, column]
    turns = [azimuth[row + i, column + j] - start for i, j in ((0, 1), (1, 0), (1, 1))]
    turns = [each - np.round(each) for each in turns]
    first = start + np.minimum.reduce([np.zeros_like(start), *turns])
    last = start + np.maximum.reduce([np.zeros_like(start), *turns])
    low, high = corners[:, 2].min(axis=0), corners[:, 2].max(axis=0)
    # Great circles rise above their ends by no more than chord^2 / 8 of the radius.
    low, high = low - chord / 8.0, high + chord / 8.0
    # A cell that holds a pole, or nearly, has all azimuths.
    polar = (last - first > 0.4) | (np.maximum(np.abs(low), np.abs(high)) > 1.0 - 2.0 * chord)
    # The sides of others bulge in azimuth as well, the more the nearer to a pole.
    bulge = chord / (16.0 * math.pi) / np.sqrt(np.maximum(1.0 - np.maximum(low * low, high * high), chord))
    first, last = np.where(polar, 0.0, first - bulge), np.where(polar, 1.0, last + bulge)
    lost_row, lost_column = np.nonzero(~good)
    lost_area = sky.angles(lost_column + 0.5, lost_row + 0.5)[2]
    lost_light = float(lost_area.sum()) / (4.0 * math.pi)
    bounds = Bounds(low, high, first, last)
    return Mesh(sky, row, column, bounds, corners, sides, len(lost_row), lost_light)


def _cross(a: Array, b: Array) -> Array:
    product: Array = np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
    )
    return product


def find_images(mesh: Mesh, stars: Array) -> Found:
    """Return the images of stars, by the triangles that hold them.

    Parameters
    ----------
    mesh : Mesh
    stars : ndarray, shape (n, 3)
        Unit vectors toward the stars, in the frame of the mesh.

    Returns
    -------
    Found
        Places are as good as linear interpolation in a cell: some 0.01 cells, worse next to caustics.
    """
    order, key = sort_stars(stars)
    sorted_stars = np.ascontiguousarray(stars[order].T)
    cell, begin, count = spans(mesh.bounds, key)
    parts = []
    ends = np.cumsum(count)
    start = 0
    while start < len(cell):
        done = ends[start - 1] if start else 0
        stop = max(int(np.searchsorted(ends, done + PAIRS_AT_ONCE)), start + 1)
        some = slice(start, stop)
        owner = np.repeat(cell[some], count[some])
        member = np.arange(len(owner)) + np.repeat(begin[some] - (ends[some] - count[some] - done), count[some])
        parts.append(_inside(mesh, owner, member, sorted_stars))
        start = stop
    if not parts:
        return Found(np.empty(0, np.intp), np.empty(0), np.empty(0))
    star, x, y = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Found(order[star], x, y)


def sort_stars(stars: Array) -> tuple[Index, Array]:
    """Return the order of stars by zone and azimuth, and the keys that `spans` looks up, in that order."""
    zone = np.minimum(((stars[:, 2] + 1.0) * (0.5 * ZONES)).astype(np.intp), ZONES - 1)
    turn = np.arctan2(stars[:, 1], stars[:, 0]) / (2.0 * math.pi)
    turn -= np.floor(turn)
    key = zone + np.minimum(turn, 1.0 - 1e-12)
    order = np.argsort(key)
    return order, key[order]


def spans(bounds: Bounds, key: Array) -> tuple[Index, Index, Index]:
    """Return the stretches of sorted stars that cells may hold: the cell, the first star, and how many."""
    lowest = np.clip(((bounds.low + 1.0) * (0.5 * ZONES)).astype(np.intp), 0, ZONES - 1)
    highest = np.clip(((bounds.high + 1.0) * (0.5 * ZONES)).astype(np.intp), 0, ZONES - 1)
    zones = highest - lowest + 1
    cell = np.repeat(np.arange(len(zones)), zones)
    zone = lowest[cell] + np.arange(len(cell)) - np.repeat(np.cumsum(zones) - zones, zones)
    base = np.floor(bounds.first)
    first, last = (bounds.first - base)[cell], (bounds.last - base)[cell]
    begin = np.searchsorted(key, zone + first)
    end = np.searchsorted(key, zone + np.minimum(last, 1.0))
    over = np.flatnonzero(last > 1.0)
    begin_again = np.searchsorted(key, zone[over].astype(np.float64))
    end_again = np.searchsorted(key, zone[over] + np.minimum(last[over] - 1.0, first[over]))
    cell = np.concatenate([cell, cell[over]])
    begin, end = np.concatenate([begin, begin_again]), np.concatenate([end, end_again])
    held = np.flatnonzero(end > begin)
    return cell[held], begin[held], (end - begin)[held]


def _inside(mesh: Mesh, cell: Index, member: Index, stars: Array) -> tuple[Index, Array, Array]:
    """Return which stars their cells hold, and where, in columns and rows."""
    sx, sy, sz = stars[:, member]

    def side(number: int) -> Array:
        nx, ny, nz = mesh.sides[number]
        product: Array = nx[cell] * sx + ny[cell] * sy + nz[cell] * sz
        return product

    ab, bc, ca = side(0), side(1), side(2)
    first = _same_side(ab, bc, ca)
    dc, bd = side(3), side(4)
    second = _same_side(dc, -bc, bd)  # the triangle 11, 10, 01
    results = []
    for held, upper in ((np.flatnonzero(first), False), (np.flatnonzero(second), True)):
        ahead = (mesh.corners[1, :, cell[held]].T * stars[:, member[held]]).sum(axis=0) > 0.0
        held = held[ahead]
        if upper:
            total = bd[held] + dc[held] - bc[held]
            u, v = 1.0 - bd[held] / total, 1.0 - dc[held] / total
        else:
            total = ab[held] + bc[held] + ca[held]
            u, v = ca[held] / total, ab[held] / total
        results.append((member[held], mesh.column[cell[held]] + u, mesh.row[cell[held]] + v))
    star, x, y = (np.concatenate(each) for each in zip(*results, strict=True))
    return star, x, y


def _same_side(a: Array, b: Array, c: Array) -> Mask:
    """Return where triple products have one sign, and are not all next to nothing."""
    same: Mask = ((a >= 0.0) & (b >= 0.0) & (c >= 0.0)) | ((a <= 0.0) & (b <= 0.0) & (c <= 0.0))
    same &= np.abs(a + b + c) > 1e-15
    return same
