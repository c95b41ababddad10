# SPDX-License-Identifier: GPL-3.0-or-later
"""Filling the passes of a disk: interpolated where its image is smooth, from tables or traced where it is not.

For each crossing, u = 1 / r and the azimuth, unwound as in `radial_path`, are smooth functions of the pixel: across the
disk's rims, across the shadow's edge, and on beyond infinity and the horizon. So are the light's energy and angular
momentum for a camera energy of 1, from which a formula gives the redshift at the disk. So tiles are sampled as for the
sky (`tiles`), rims and all, and how much of a pixel the annulus covers follows from u and its slope there
(`disk_planes`). Mostly the azimuth itself and the redshift are smooth enough to be interpolated in place of what they
are worked out from. Tiles where samples are not enough are divided, down to the smallest. What is left of images that
are bands around the shadow is filled from their tables, pixel by pixel (`ring_painting`), as are from the start those
that are too thin for tiles; the rest is traced pixel by pixel (`disk_pixels`).
"""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from ..numerics.arrays import Array, Mask
from ..numerics.blocks import BLOCK_SIZE
from ..sampling.tiles import (
    TAIL_SHARE,
    TILE_SIDES,
    Tiles,
    coefficients_of,
    pool,
    sample_places,
    sides_for,
    tails_of,
    tiles_of,
)
from ..sampling.view import View
from ..shot.map_parameters import WarpMapParameters
from .annulus import near_annulus
from .disk_pass import DiskPass
from .disk_pixels import DiskTracing
from .disk_planes import BentU, Channels, DiskPlanes, mean_matter
from .disk_samples import MOMENTUM, PHI, PIXEL_ERROR, PLACE_ERROR, SLOPE, DiskSamples, Matter, U
from .ring_painting import WEIGHTS, RingPainting, RingPixels, TileSurvey

# Chebyshev points along each side of a tile: the sky, which has to be better known, has more.
DISK_POINTS = 8

# A tile is empty if its samples stay off the disk by this many times what they may be wrong by.
EMPTY_MARGIN = 4.0

# From this crossing on, counted from 0, images are too thin for tiles.
FIRST_THIN = 2

# Circles and places on each that mark where the disk is, for tiles whose samples may miss it.
MARKED_CIRCLES, MARKED_PLACES = 8, 256

# Pixels below which the spread of these places, across where it is least, makes a slim disk.
SLIM = 8.0


class DiskPainting:
    """The passes of a disk in the making."""

    def __init__(self, parameters: WarpMapParameters, view: View) -> None:
        assert parameters.disk is not None
        self._interpolation = parameters.interpolation
        self._inner, self._outer = parameters.disk.radii(parameters.spin)
        self._crossings = parameters.disk.crossings
        self._width, self._height = parameters.map_size
        self._view = view
        self._samples = DiskSamples(parameters, view)
        self._bent = BentU(self._inner, self._outer)
        self._planes = DiskPlanes(self._crossings, self._width, self._height, self._bent)
        self._tracing = DiskTracing(
            self._samples, self._planes, (self._inner, self._outer), (self._width, self._height)
        )

    def counts(self) -> dict[str, int]:
        """Number of rays that were traced for the passes, and of pixels whose ray was given up."""
        lost = int(np.count_nonzero(self._tracing.unresolved))
        return {"disk_rays": self._samples.rays, "disk_unresolved": lost}

    def passes(self, metadata: dict[str, object]) -> tuple[DiskPass, ...]:
        """Return the passes in order."""
        return tuple(
            DiskPass(planes[0], planes[1], planes[2], planes[3], {**metadata, "crossing": order})
            for order, planes in enumerate(self._planes.planes, start=1)
        )

    def steps(self) -> Generator[float, None, None]:
        """Fill the passes, yielding the fraction done after each step."""
        if self._interpolation > 0.0:
            yield from self._adaptive()
        else:
            tiles = tiles_of(self._width, self._height, TILE_SIDES[-1])
            self._tracing.asked[:] = True
            yield from self._tracing.steps(tiles, np.ones((len(tiles), self._crossings), dtype=bool), 0.0)

    # --- tiles ---------------------------------------------------------------------------------------

    def _adaptive(self) -> Generator[float, None, None]:
        self._samples.make_tables()
        rings = self._rings()
        yield 0.1
        slim, center = self._slim_disk(), self._view.center()
        sides = sides_for(self._width, self._height)
        waiting = tiles_of(self._width, self._height, sides[0])
        wanted = np.ones((len(waiting), self._crossings), dtype=bool)
        wanted[:, [order for order in rings if order >= FIRST_THIN]] = False
        done, share = 0.1, 0.5 / len(sides)
        for side in sides:
            for order, ring in rings.items():
                touched = pool(ring.touched, side // TILE_SIDES[-1])
                wanted[:, order] &= touched[waiting.row // side, waiting.column // side]
            # Samples may miss a disk that is seen from the edge; a whole one, hole and all, where it is small.
            marked = self._marked(waiting, *slim)
            if center is not None and (side != TILE_SIDES[-1] or not self._samples.has_tables):
                marked |= self._marked(waiting, *map(np.atleast_1d, center))
            group = max(1, BLOCK_SIZE // DISK_POINTS**2)
            for start in range(0, len(waiting), group):
                part = np.arange(start, min(start + group, len(waiting)))
                self._settle(waiting.select(part), marked[part], wanted, part)
                yield done + share * (start + len(part)) / len(waiting)
            done += share
            left = wanted.any(axis=1)
            waiting, wanted = waiting.select(left), wanted[left]
            if side != TILE_SIDES[-1]:
                waiting = waiting.divided()
                wanted = np.repeat(wanted, 4, axis=0)
                inside = (waiting.column < self._width) & (waiting.row < self._height)
                waiting, wanted = waiting.select(inside), wanted[inside]
        self._planes.fill_rims()
        for order, ring in rings.items():
            tiles = ring.tiles() if order >= FIRST_THIN else waiting.select(wanted[:, order])
            wanted[:, order] = False
            waiting, wanted = _joined(waiting, wanted, self._paint_ring(order, ring, tiles), order)
            yield done
        left = wanted.any(axis=1)
        yield from self._tracing.steps(waiting.select(left), wanted[left], done)

    def _slim_disk(self) -> tuple[Array, Array]:
        """Return pixel coordinates of places on the disk as flat space would show it, if it is slim."""
        radii = np.linspace(self._inner, self._outer, MARKED_CIRCLES)
        turn = np.arange(MARKED_PLACES) * (2.0 * math.pi / MARKED_PLACES)
        x, y = self._view.places_in_plane(np.repeat(radii, len(turn)), np.tile(turn, len(radii)))
        known = np.isfinite(x) & np.isfinite(y)
        x, y = x[known], y[known]
        if len(x) > 1 and math.sqrt(max(np.linalg.eigvalsh(np.cov(x, y))[0], 0.0)) > SLIM:
            x, y = x[:0], y[:0]
        return x, y

    def _marked(self, tiles: Tiles, x: Array, y: Array) -> Mask:
        """Return which tiles hold any of some places given by pixel coordinates, shape (n,)."""
        seen = (x > -1.0) & (x < self._width + 1.0) & (y > -1.0) & (y < self._height + 1.0)
        x, y = x[seen], y[seen]
        held = np.zeros((self._height // tiles.side + 2, self._width // tiles.side + 2), dtype=bool)
        held[(y // tiles.side).astype(np.intp), (x // tiles.side).astype(np.intp)] = True
        marked: Mask = held[tiles.row // tiles.side, tiles.column // tiles.side]
        return marked

    def _settle(self, tiles: Tiles, marked: Mask, wanted: Mask, part: NDArray[np.intp]) -> None:
        """Sample tiles, fill what they determine and strike it from `wanted`, whose rows `part` they are."""
        x, y = sample_places(tiles, DISK_POINTS)
        places = np.repeat(wanted[part].T, DISK_POINTS**2, axis=1)
        values, lost = self._samples.at(x, y, places, smooth=False)
        values = values.reshape(*values.shape[:2], len(tiles), DISK_POINTS, DISK_POINTS)
        broken = lost.reshape(len(tiles), -1).any(axis=1)
        if tiles.side == TILE_SIDES[-1] and broken.any():
            whole = tiles.select(broken)
            for asked in self._tracing.asked:
                whole.put(asked, np.ones((len(whole), whole.side, whole.side), dtype=bool))
        for order, sampled in enumerate(values):
            chosen = np.flatnonzero(wanted[part, order] & ~broken)
            if not len(chosen):
                continue
            settled = self._settle_order(order, tiles.select(chosen), sampled[:, chosen], marked[chosen])
            wanted[part[chosen[settled]], order] = False

    def _settle_order(self, order: int, tiles: Tiles, sampled: Array, marked: Mask) -> Mask:
        """Fill those tiles that samples of one crossing, shape (channels, n, points, points), determine; return which
        are filled or empty."""
        sampled[PHI] = _continuous(sampled[PHI], sampled[MOMENTUM] > 0.0)
        u = sampled[U]
        bent = self._bent.bent(u)
        coefficients = coefficients_of(np.stack([bent, *sampled[PHI:]], axis=1))
        tail, allowed = self._tails(coefficients, tiles.side)
        flat = bent.reshape(len(tiles), -1)
        off = np.maximum(self._bent.low - flat.max(axis=1), flat.min(axis=1) - self._bent.high)
        smooth = TAIL_SHARE * tail < allowed
        empty = (off > EMPTY_MARGIN * tail[:, U]) & (~marked | smooth[:, U])
        good = smooth[:, U] & smooth[:, PHI] & ~empty
        if self._samples.channels > SLOPE:
            good &= smooth[:, SLOPE]
        filled = np.flatnonzero(good)
        direct, simple = self._matter_coefficients(bent[filled], sampled[:, filled], tiles.side)
        self._planes.fill(order, tiles.select(filled[simple]), direct, self._bent.matter)
        self._planes.fill(order, tiles.select(filled[~simple]), coefficients[filled[~simple]], self._matter)
        if tiles.side == TILE_SIDES[-1] and order not in self._samples.rings:
            left = np.flatnonzero(~(good | empty))
            near = near_annulus(bent[left], self._bent.low, self._bent.high)
            near[marked[left]] = True
            tiles.select(left).put(self._tracing.asked[order], near)
            empty[left] = ~near.any(axis=(1, 2))
        settled: Mask = good | empty
        return settled

    def _tails(self, coefficients: Array, side: int) -> tuple[Array, Array]:
        """Return what tells the error of tiles, by channel, shape (n, channels), and what it may be."""
        pixel = np.hypot(coefficients[:, :, 0, 1], coefficients[:, :, 1, 0]) * (2.0 * PIXEL_ERROR / side)
        allowed = np.full(coefficients.shape[1], PLACE_ERROR * self._interpolation)
        allowed[U] /= self._outer
        return tails_of(coefficients), np.maximum(pixel, allowed)

    def _matter_coefficients(self, bent: Array, sampled: Array, side: int) -> tuple[Array, Mask]:
        """Return the coefficients of bent u, azimuth and g of those tiles that are good with them, and which these are;
        from bent u and the channels, shape (n, points, points) and (channels, n, points, points)."""
        if not len(bent):
            return np.empty((0, 3, *bent.shape[1:])), np.zeros(0, dtype=bool)
        with np.errstate(all="ignore"):  # far beyond the rims there is no matter
            azimuth, g = self._samples.azimuth_and_g(sampled)
            coefficients = coefficients_of(np.stack([bent, azimuth, g], axis=1))
            tail, allowed = self._tails(coefficients, side)
            good = (TAIL_SHARE * tail < allowed)[:, PHI:].all(axis=1)  # NaN: False
        return coefficients[good], good

    def _matter(self, values: Channels) -> Matter:
        """Return the matter at places given by the channels, of which u is bent."""
        return self._samples.matter(np.stack([1.0 / self._bent.radius(values[U]), *values[PHI:]]))

    # --- bands around the shadow ---------------------------------------------------------------------

    def _rings(self) -> dict[int, RingPainting]:
        """Return what paints those images that are bands, by order, counted from 0."""
        tables = self._samples.rings
        if not tables:
            return {}
        survey = TileSurvey(self._view, self._width, self._height)
        return {order: RingPainting(survey, table) for order, table in tables.items()}

    def _paint_ring(self, order: int, ring: RingPainting, tiles: Tiles) -> Tiles:
        """Fill the smallest tiles from an image's table; return those that hold pixels it does not know."""
        if not len(tiles):
            return tiles
        found, columns, rows = ring.pixels(tiles)
        for pixels in found:
            for block in pixels.blocks():
                known = self._write_ring(order, block)
                columns, rows = np.append(columns, block.column[~known]), np.append(rows, block.row[~known])
        return self._tracing.trace_only(order, columns, rows)

    def _write_ring(self, order: int, pixels: RingPixels) -> Mask:
        """Write those pixels that an image's table knows; return which these are."""
        radius, phi, g = self._samples.at_ring(order, (pixels.energy, pixels.momentum), pixels.away, pixels.angle)
        known: Mask = np.isfinite(radius).all(axis=0)
        radius, phi, g = radius[:, known], phi[:, known], g[:, known]
        one = (radius[0], phi[0], g[0]) if len(radius) == 1 else mean_matter(radius, phi, g, WEIGHTS[:, None])
        self._planes.write(order, (pixels.column[known], pixels.row[known]), one, pixels.share[known])
        return known


def _continuous(azimuth: Array, positive: Mask) -> Array:
    """Return the azimuths of tiles, shape (n, points, points), without the whole turns that they jump by where the
    angular momentum changes sign, and from the first circle on."""
    whole = 2.0 * math.pi
    azimuth = azimuth - whole * np.floor(azimuth[:, :1, :1] / whole)
    mixed = np.flatnonzero(positive.any(axis=(1, 2)) & ~positive.all(axis=(1, 2)))
    if len(mixed):
        values, sign = azimuth[mixed], positive[mixed]
        turned = np.diff(sign, axis=2) * whole * np.round(np.diff(values, axis=2) / whole)
        values[:, :, 1:] -= np.cumsum(turned, axis=2)
        turned = np.diff(sign[:, :, :1], axis=1) * whole * np.round(np.diff(values[:, :, :1], axis=1) / whole)
        values[:, 1:] -= np.cumsum(turned, axis=1)
        azimuth[mixed] = values
    return azimuth


def _joined(tiles: Tiles, wanted: Mask, more: Tiles, order: int) -> tuple[Tiles, Mask]:
    """Return the smallest tiles, and which crossings are wanted of each, with more of one crossing."""
    also = np.zeros((len(more), wanted.shape[1]), dtype=bool)
    also[:, order] = True
    both = Tiles(TILE_SIDES[-1], np.append(tiles.column, more.column), np.append(tiles.row, more.row))
    return both, np.concatenate([wanted, also])
