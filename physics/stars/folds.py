# SPDX-License-Identifier: GPL-3.0-or-later
"""Images beside caustics, where the sky folds over within a cell and triangles do not see it.

Two images of opposite parity appear where a star crosses a caustic (Schneider, Ehlers & Falco 1992, "Gravitational
Lenses", section 6.2). While they are less than about a cell apart, the mesh may have neither. So each star near a cell
in which the determinant of the lens map changes its sign is tried from both sides of that line.
"""

from __future__ import annotations

import math

import numpy as np

from ..numerics.arrays import Array, Index, Mask
from .local_sky import MARGIN, LocalSky
from .refinement import Images, interpolate, refine
from .search import WIDEST, Bounds, Found, sort_stars, spans

STARTS = np.linspace(0.0, 1.0, 4)
"""Where Newton's method begins, across and along a cell."""

SAG = 0.125
"""How far the sky between two points of a cell may bulge, in their distance."""

REACH = 1.25
"""How far from a cell's middle its pairs are, in cells."""
SAME = 0.01
"""Images of one star and one parity that are nearer than this, in cells, are one."""
MOST_CELLS = 1 << 12
"""Cells that are looked at together, which bounds the memory."""


def with_pairs(sky: LocalSky, images: Images, stars: Array) -> Images:
    """Return images, and beside caustics those that a mesh does not have.

    Parameters
    ----------
    sky : LocalSky
    images : Images
        Those of the mesh, from `refine`.
    stars : ndarray, shape (n, 3)
        Unit vectors toward the stars, in the frame of the table.
    """
    row, column = folded_cells(sky)
    found = [images]
    for start in range(0, len(row), MOST_CELLS):
        some = slice(start, start + MOST_CELLS)
        found.append(_pairs(sky, row[some], column[some], stars))
    return _distinct(sky, found)


def folded_cells(sky: LocalSky) -> tuple[Index, Index]:
    """Return rows and columns of the cells in which the lens map's determinant changes its sign."""
    nodes = sky.directions
    inner = slice(MARGIN, -MARGIN)
    along_x = 0.5 * (nodes[inner, 2:-1] - nodes[inner, :-3])
    along_y = 0.5 * (nodes[2:, 1:-2] - nodes[:-2, 1:-2])
    sign = np.einsum("ijk,ijk->ij", nodes[inner, 1:-2], np.cross(along_x, along_y))
    sign = np.concatenate([sign, sign[:, :1]], axis=1)
    corners = np.stack([sign[:-1, :-1], sign[:-1, 1:], sign[1:, :-1], sign[1:, 1:]])
    with np.errstate(invalid="ignore"):
        changes = np.isfinite(corners).all(axis=0) & (corners.min(axis=0) < 0.0) & (corners.max(axis=0) > 0.0)
    row, column = np.nonzero(changes)
    return row, column


def _pairs(sky: LocalSky, row: Index, column: Index, stars: Array) -> Images:
    """Return the images of stars in and beside some cells."""
    right, down = (each.ravel() for each in np.meshgrid(STARTS, STARTS))
    x, y = column[:, None] + right, np.clip(row[:, None] + down, 0.0, sky.rows - 1.0)
    here, along_x, along_y = interpolate(sky, x.ravel(), y.ravel())
    shape = (3, len(row), len(right))
    parity = np.sign((here * np.cross(along_x, along_y, axis=0)).sum(axis=0)).reshape(shape[1:])
    here = here.reshape(shape)
    known = np.isfinite(here).all(axis=(0, 2))
    known &= (np.ptp(here, axis=2) ** 2).sum(axis=0) < WIDEST**2
    order, key = sort_stars(stars)
    cell, begin, count = spans(_bounds(here[:, known]), key)
    cell = np.repeat(np.flatnonzero(known)[cell], count)
    star = order[np.arange(len(cell)) + np.repeat(begin - (np.cumsum(count) - count), count)]
    near = np.einsum("kpj,pk->pj", here[:, cell], stars[star])
    parts = []
    for side in (1.0, -1.0):
        first = np.where(parity[cell] == side, near, -np.inf).argmax(axis=1)
        parts.append(Found(star, x[cell, first], y[cell, first]))
    started = Found(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    middle = np.tile(np.stack([column[cell], row[cell]]) + 0.5, 2)
    return refine(sky, started, stars, lambda x, y: _is_beside(sky, x, y, middle))[0]


def _is_beside(sky: LocalSky, x: Array, y: Array, middle: Array) -> Mask:
    across = np.abs((x - middle[0] + 0.5 * len(sky.edge)) % len(sky.edge) - 0.5 * len(sky.edge))
    beside: Mask = (across < REACH) & (np.abs(y - middle[1]) < REACH)
    return beside


def _bounds(points: Array) -> Bounds:
    """Return what of the sky cells cover, from points of theirs, shape (3, cells, points)."""
    # What lies between the points bulges by less than they are apart.
    apart = np.linalg.norm(points[:, :, 1:] - points[:, :, :-1], axis=0).max(axis=1)
    apart *= SAG
    low, high = points[2].min(axis=1) - apart, points[2].max(axis=1) + apart
    azimuth = np.arctan2(points[1], points[0]) / (2.0 * math.pi)
    turns = azimuth - azimuth[:, :1]
    turns -= np.round(turns)
    slack = apart / (2.0 * math.pi) / np.sqrt(np.maximum(1.0 - np.maximum(low * low, high * high), 1e-12))
    first, last = azimuth[:, 0] + turns.min(axis=1) - slack, azimuth[:, 0] + turns.max(axis=1) + slack
    polar = last - first > 0.4
    return Bounds(low, high, np.where(polar, 0.0, first), np.where(polar, 1.0, last))


def _distinct(sky: LocalSky, found: list[Images]) -> Images:
    """Return images without those that are there before: of the same star, place and parity."""
    star, x, y, magnification, parity = (
        np.concatenate([getattr(each, name) for each in found])
        for name in ("star", "x", "y", "magnification", "parity")
    )
    columns = len(sky.edge)
    left = np.lexsort((y, parity, star))
    while True:  # until no neighbor in this order is the same: several starts end at one place
        kept = np.ones(len(star), bool)
        for ahead in range(1, 4):
            one, other = left[:-ahead], left[ahead:]
            across = np.abs((x[one] - x[other] + 0.5 * columns) % columns - 0.5 * columns)
            same = (star[one] == star[other]) & (parity[one] == parity[other])
            same &= (across < SAME) & (np.abs(y[one] - y[other]) < SAME)
            kept[np.maximum(one, other)[same]] = False
        if kept[left].all():
            break
        left = left[kept[left]]
    left.sort()
    return Images(star[left], x[left], y[left], magnification[left], parity[left])
