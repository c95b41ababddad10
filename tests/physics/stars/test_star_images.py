# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of stars against rays traced to them, two formulas of magnification, and the sky's own area."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from shots import shot

import physics
from physics.geodesics.tracer import Fate, trace_block
from physics.kerr.critical_curve import around_hole
from physics.kerr.metric import metric_functions
from physics.kerr.observer import Observer
from physics.kerr.rays import Rays, rays_from_triad
from physics.numerics.sphere import celestial_coordinates, cos_sin
from physics.sampling.view import View
from physics.stars.folds import folded_cells, with_pairs
from physics.stars.local_sky import local_sky
from physics.stars.refinement import interpolate, refine
from physics.stars.search import find_images, mesh_for, mesh_of
from physics.stars.star_layer import StarBaker

PIXELS = 1920, 1080


def traced(view: View, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Directions on the scene's axes, by the stepping method, which the table does not use."""
    fate, directions = trace_block(view.rays(x, y), 1e-10, "cash-karp")
    directions[fate != Fate.SKY] = np.nan
    return directions @ view.hole_to_world.T


@pytest.mark.parametrize(
    ("spin", "settings"),
    [
        (0.9, {"radius": 22.0, "motion": "circular"}),
        (-0.5, {"radius": 8.0, "motion": "velocity", "velocity": (0.3, -0.2, 0.4), "fov": 70.0}),
        (0.9, {"camera": physics.PanoramaCamera(*PIXELS), "radius": 15.0, "motion": "free_fall"}),
    ],
)
def test_stars_are_where_rays_meet_them_and_as_bright(spin: float, settings: dict) -> None:
    """A star is put where the ray of a place in the picture ends: an image of it must be at that place."""
    settings = {"width": PIXELS[0], "height": PIXELS[1], "fov": 40.0, **settings}
    tilt = np.linalg.qr(np.array([[1.0, 0.2, 0.1], [-0.3, 1.0, 0.2], [0.1, -0.4, 1.0]]))[0]
    tilt *= np.sign(np.linalg.det(tilt))
    parameters = shot(spin=spin, hole_to_world=tilt.tolist(), **settings)
    view = View(parameters)
    random = np.random.default_rng(4)
    x, y = random.uniform(0.0, PIXELS[0], 1500), random.uniform(0.0, PIXELS[1], 1500)
    toward = traced(view, x, y)
    # at the size of a pixel, by central differences of rays
    step = 0.02
    along = [traced(view, x + i * step, y + j * step) for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    # Images are found that are farther than a pixel from the shadow's edge.
    beside = [view.edge(x + i, y + j) > 0.0 for i, j in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))]
    known = np.all(beside, axis=0) & np.isfinite(toward).all(axis=1) & np.isfinite(sum(along)).all(axis=1)
    on_sky = np.abs((toward * np.cross(along[0] - along[1], along[2] - along[3])).sum(axis=1)) / (4.0 * step**2)
    a, b, c, d, middle = (
        parameters.camera.directions(x + i, y + j)
        for i, j in ((step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step), (0.0, 0.0))
    )
    pixels = np.abs((middle * np.cross(a - b, d - c)).sum(axis=1)) / (4.0 * step**2)
    # Beside caustics pairs of images exist that the mesh does not have yet.
    known &= pixels < 1000.0 * on_sky
    theta, phi = celestial_coordinates(toward[known])
    stars = physics.Stars(phi, 0.5 * math.pi - theta, np.zeros(len(phi)), np.full(len(phi), 0.65))
    points, _vanished = StarBaker().points(parameters, stars, physics.StarSettings())
    away, bright, shift = np.full((3, len(phi)), np.nan)
    for star in range(len(phi)):
        mine = np.flatnonzero(points.star == star)
        distance = np.hypot(points.x[mine] - x[known][star], points.y[mine] - y[known][star])
        nearest = mine[distance.argmin()]
        away[star] = distance.min()
        expected = (pixels / on_sky)[known][star]
        bright[star] = points.magnification[nearest] / expected - 1.0
        shift[star] = points.one_plus_z[nearest]
    assert known.sum() > 700
    assert np.quantile(away, 0.999) < 0.03
    assert np.quantile(np.abs(bright), 0.999) < 0.02
    expected = view.rays(x[known], y[known]).one_plus_z
    np.testing.assert_allclose(shift, expected, rtol=1e-4)


def test_magnification_is_the_exact_determinant() -> None:
    """1 / mu = 2 sin(theta_c) (R Theta)^(1/2) (1 + z)^-2 |d(cos theta_s, phi_s) / d(b, q)| at a fixed camera.

    The constants of motion are varied instead of the direction (compare James et al. 2015, appendix A.1).
    """
    spin, r, theta = 0.9, 12.0, 1.3
    fido = Observer.fido(r, theta, 0.0)
    sky = local_sky(spin, r, theta, 1e-3, 256)
    random = np.random.default_rng(7)
    x, y = random.uniform(0.0, 256.0, 300), random.uniform(20.0, sky.rows - 5.0, 300)
    psi, away, area = sky.angles(x, y)
    rays = rays_from_triad(spin, fido, around_hole(away, *cos_sin(psi)))
    here, along_x, along_y = interpolate(sky, x, y)
    found = area / np.abs((here * np.cross(along_x, along_y, axis=0)).sum(axis=0))
    metric = metric_functions(spin, r, theta)

    def coordinates(b: np.ndarray, q: np.ndarray) -> np.ndarray:
        radial2 = (r * r + spin**2 - spin * b) ** 2 - metric.delta * ((b - spin) ** 2 + q)
        polar2 = q + math.cos(theta) ** 2 * (spin**2 - b * b / math.sin(theta) ** 2)
        moved = dataclasses.replace(
            rays,
            b=b,
            q_plus_b2=q + b * b,
            radial=np.copysign(np.sqrt(radial2), rays.radial),
            polar=np.copysign(np.sqrt(polar2), rays.polar),
            azimuthal=b / math.sin(theta),
        )
        assert isinstance(moved, Rays)
        _fate, directions = trace_block(moved, 1e-11, "cash-karp")
        return np.stack([directions[:, 2], np.arctan2(directions[:, 1], directions[:, 0])])

    def change(step_b: float, step_q: float, step: float) -> np.ndarray:
        difference = coordinates(rays.b + step_b, rays.q + step_q) - coordinates(rays.b - step_b, rays.q - step_q)
        difference[1] = (difference[1] + math.pi) % (2.0 * math.pi) - math.pi
        return difference / (2.0 * step)

    # Away from turning points, where the formula is 0 times infinity.
    regular = (np.abs(rays.radial) > 0.1 * r * r) & (np.abs(rays.polar) > 0.5)
    with np.errstate(invalid="ignore"):
        by_b, by_q = change(1e-5, 0.0, 1e-5), change(0.0, 1e-4, 1e-4)
    determinant = np.abs(by_b[0] * by_q[1] - by_b[1] * by_q[0])
    # |Delta p_r| and |p_theta| are the roots of R and Theta. Energies are at infinity, mu is the FIDO's.
    exact = 1.0 / (2.0 * math.sin(theta) * np.abs(rays.radial * rays.polar) * determinant / rays.one_plus_z**2)
    scale = np.abs(found / exact)[regular]
    assert regular.sum() > 100
    np.testing.assert_allclose(scale, 1.0, rtol=2e-3)


def test_each_image_of_a_hole_without_spin_covers_the_sky_once() -> None:
    """The integral of dOmega / mu over the zone of an image is 4 pi: images change parity where zones meet."""
    sky = local_sky(0.0, 30.0, 1.4, 1e-3, 256)
    row, column = np.mgrid[0 : sky.rows - 1, 0:256] + 0.5
    here, along_x, along_y = interpolate(sky, column.ravel(), row.ravel())
    area = (here * np.cross(along_x, along_y, axis=0)).sum(axis=0).reshape(row.shape).sum(axis=1)
    zones = np.split(area, np.flatnonzero(np.diff(np.sign(area))) + 1)[::-1]
    np.testing.assert_allclose([abs(zone.sum()) / (4.0 * math.pi) for zone in zones[:3]], 1.0, atol=2e-3)


def test_an_even_sky_of_stars_is_as_bright_as_the_sky_that_is_seen() -> None:
    """Surface brightness is conserved: the stars' light is the share of the sphere that is not shadow."""
    count = 20000
    number = np.arange(count) + 0.5
    z, azimuth = 1.0 - 2.0 * number / count, number * math.pi * (3.0 - math.sqrt(5.0))
    toward = np.stack([np.sqrt(1.0 - z * z) * np.cos(azimuth), np.sqrt(1.0 - z * z) * np.sin(azimuth), z], axis=-1)
    sky = local_sky(0.9, 6.0, 1.5, 1e-3, 512)
    mesh = mesh_of(sky)
    images, _vanished = refine(sky, find_images(mesh, toward), toward)
    edge = sky.edge_at(np.arange(2048) * 0.25)
    seen = np.mean(0.5 * (1.0 + np.cos(edge)))
    assert images.magnification.sum() / count == pytest.approx(seen, rel=0.01)


def test_frames_of_an_orbit_share_what_they_can() -> None:
    baker = StarBaker()
    first = shot(spin=0.9, radius=22.0)
    x, y, z = first.camera_position
    turned = (x * math.cos(1.1) - y * math.sin(1.1), x * math.sin(1.1) + y * math.cos(1.1), z)
    second = dataclasses.replace(first, camera_position=turned, camera_to_hole=physics.looking_at_hole(turned))
    baker.bake(first)
    table = baker._mesh
    shared = baker.bake(second)
    assert baker._mesh is table
    alone = StarBaker().bake(second)
    np.testing.assert_allclose(shared.image, alone.image, rtol=1e-3, atol=1e-6 * alone.image.max())


def test_pairs_beside_caustics_are_found_and_none_counts_twice() -> None:
    """Stars at the ends of rays in folded cells: an image must be where each ray begins. Triangles miss 1 in 20."""
    mesh = mesh_for(0.9, 22.0, 1.4, 5e-4)
    sky, columns = mesh.sky, len(mesh.sky.edge)
    row, column = folded_cells(sky)
    random = np.random.default_rng(1)
    chosen = random.integers(0, len(row), 1500)
    x = column[chosen] + random.uniform(-0.3, 1.3, 1500)
    y = np.clip(row[chosen] + random.uniform(-0.3, 1.3, 1500), 0.01, sky.rows - 1.01)
    toward, known = sky.trace(sky.looking(x, y))
    x, y, toward = x[known], y[known], toward[known]
    images, _vanished = refine(sky, find_images(mesh, toward), toward)
    missed = []
    for found in (images, with_pairs(sky, images, toward)):
        across = (found.x - x[found.star] + 0.5 * columns) % columns - 0.5 * columns
        is_there = (np.abs(across) < 0.02) & (np.abs(found.y - y[found.star]) < 0.02)
        missed.append(1.0 - len(np.unique(found.star[is_there])) / len(x))
        place = np.stack([found.star, found.parity, np.round(found.x, 2) % columns, np.round(found.y, 2)])
    assert missed[0] > 0.03
    assert missed[1] < 0.02
    assert len(np.unique(place, axis=1).T) == len(found.star)
