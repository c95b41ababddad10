# SPDX-License-Identifier: GPL-3.0-or-later
"""The share of each pixel that sees sky, against brute force: the fates of many rays a pixel."""

import math

import numpy as np
import pytest
from shots import AWAY, shot

from physics import PanoramaCamera, PerspectiveCamera, bake
from physics.kerr.critical_curve import comes_from_sky
from physics.kerr.rays import rays_from_triad
from physics.numerics.sphere import spherical_triad
from physics.sampling.visibility import near_edge, refine


def brute_force_visibility(parameters, rows, columns, samples):
    """Mean of sky / shadow over samples x samples rays in each of the given pixels."""
    observer = parameters.observer()
    turn = (spherical_triad(observer.theta, observer.phi) @ np.array(parameters.camera_to_hole)).T
    offsets = (np.arange(samples) + 0.5) / samples
    x = columns[:, None, None] + offsets[None, None, :] + 0.0 * offsets[None, :, None]
    y = rows[:, None, None] + offsets[None, :, None] + 0.0 * offsets[None, None, :]
    seen = parameters.camera.directions(x, y).reshape(-1, 3) @ turn
    sky = comes_from_sky(rays_from_triad(parameters.spin, observer, seen))
    return sky.reshape(len(rows), -1).mean(axis=1)


@pytest.mark.parametrize(
    "parameters",
    [
        shot(),
        shot(radius=2.5, spin=0.5, motion="fido", camera=PanoramaCamera(64, 32)),
        shot(spin=0.0, inclination=0.0, motion="static"),
        shot(radius=60.0, fov=20.0, motion="free_fall"),
    ],
    ids=["orbit", "close", "pole", "narrow"],
)
def test_edge_pixels_have_their_exact_share(parameters):
    warp_map = bake(parameters)
    rows, columns = np.nonzero((warp_map.visibility > 0.0) & (warp_map.visibility < 1.0))
    assert len(rows) > 20
    expected = brute_force_visibility(parameters, rows, columns, 64)
    # A straight edge through 64 x 64 samples is itself known to 1/64 at worst, 0.003 typically.
    error = np.abs(warp_map.visibility[rows, columns] - expected)
    assert error.max() < 1.0 / 64.0
    assert np.sqrt((error**2).mean()) < 0.004


def test_pixels_away_from_the_edge_are_all_or_nothing():
    parameters = shot()
    warp_map = bake(parameters)
    rows, columns = (axis.ravel() for axis in np.mgrid[0:27, 0:48])
    expected = brute_force_visibility(parameters, rows, columns, 8).reshape(27, 48)
    for whole in (0.0, 1.0):
        # A corner of up to 1/16 of the pixel can pass between 8 x 8 samples.
        assert warp_map.visibility[expected == whole] == pytest.approx(whole, abs=1.0 / 16.0)
    assert (warp_map.visibility == 0.0).sum() > 100


@pytest.mark.parametrize("radius", [300.0, 3000.0])
def test_a_shadow_smaller_than_a_pixel_still_darkens_it(radius):
    """No corner of any pixel may fall in the shadow; its area must be missing all the same."""
    parameters = shot(width=33, height=21, radius=radius, spin=0.0, inclination=90.0, motion="static", fov=60.0)
    warp_map = bake(parameters)
    per_pixel = 2.0 * math.tan(math.radians(30.0)) / 21
    shadow = math.pi * (math.sqrt(27.0) / radius) ** 2 / per_pixel**2  # small-angle limit of Synge's formula
    assert (1.0 - warp_map.visibility).sum() == pytest.approx(shadow, rel=0.1)


def test_area_of_the_shadow_is_synges():
    """Schwarzschild, static: a circle of angular radius psi; on the image plane tan(psi), pi tan^2(psi)."""
    parameters = shot(width=60, height=60, radius=20.0, spin=0.0, inclination=90.0, motion="static", fov=50.0)
    warp_map = bake(parameters)
    psi = math.asin(3.0 * math.sqrt(3.0) * math.sqrt(1.0 - 2.0 / 20.0) / 20.0)
    per_pixel = 2.0 * math.tan(math.radians(25.0)) / 60
    area = math.pi * (math.tan(psi) / per_pixel) ** 2
    # The edge as chords of 1/4 pixel: 2e-5 of the area; visibility is stored in single precision.
    assert (1.0 - warp_map.visibility.astype(float)).sum() == pytest.approx(area, rel=3e-5)


def test_share_and_centroid_of_a_half_plane():
    x0 = 2.3
    share, x, y = refine(np.array([1, 2, 3]), np.array([5, 5, 5]), lambda x, y: x - x0)
    assert share == pytest.approx([0.0, 0.7, 1.0], abs=1e-12)
    assert x[1] == pytest.approx(2.65, abs=0.01)  # the middle of the visible part, to a tenth of a cell
    assert y == pytest.approx([5.5] * 3)
    assert (x[0], x[2]) == (1.5, 3.5)


def test_share_of_a_disc_inside_one_pixel():
    radius = 0.3
    share, x, y = refine(np.array([0]), np.array([0]), lambda x, y: radius - np.hypot(x - 0.5, y - 0.5), cells=8)
    # Chords across cells of 1/8: the sagitta of a circle of radius 0.3 loses 2 % of its area.
    assert share[0] == pytest.approx(math.pi * radius**2, rel=0.03)
    assert (x[0], y[0]) == pytest.approx((0.5, 0.5))


def test_the_point_that_stands_for_a_pixel_is_visible():
    """A thin ring of sky around a shadow: the centroid lies in the shadow, so another point must stand for it."""
    edge = lambda x, y: np.hypot(x - 0.5, y - 0.5) - 0.45  # noqa: E731
    share, x, y = refine(np.array([0]), np.array([0]), edge)
    assert 0.0 < share[0] < 1.0
    assert edge(x, y)[0] > 0.0


def test_near_edge_takes_pixels_that_the_edge_only_bulges_into():
    """Circles of all sizes: every pixel in which finer points see both sides is marked, few others are."""
    rows, columns = np.mgrid[-1:42, -1:42].astype(float)
    fine_rows, fine_columns = (np.mgrid[0:400, 0:400] + 0.5) / 10.0
    for radius in np.linspace(1.5, 18.0, 40):
        place = 20.0 + 0.5 * np.sin([7.0 * radius, 13.0 * radius])
        inside = lambda y, x, at=place, r=radius: np.hypot(y - at[0], x - at[1]) - r  # noqa: E731
        marked = near_edge(inside(rows, columns))
        sky = (inside(fine_rows, fine_columns) > 0.0).reshape(40, 10, 40, 10)
        mixed = sky.any(axis=(1, 3)) & ~sky.all(axis=(1, 3))
        assert not (mixed & ~marked).any()
        assert marked.sum() <= 1.5 * mixed.sum() + 8


def test_near_the_seam_of_a_panorama():
    """A hole behind the camera is cut by the picture's left and right sides: both halves are anti-aliased alike."""
    position = (12.0, 0.0, 0.0)
    parameters = shot(
        camera=PanoramaCamera(64, 32), camera_position=position, camera_to_hole=AWAY, motion="fido", spin=0.0
    )
    warp_map = bake(parameters)
    assert (warp_map.visibility[:, 0] < 1.0).any()
    # Cells are halved along one diagonal: mirror images have other chords, 1/(8 n^2 R) = 2e-3 with R about 5 pixels.
    assert warp_map.visibility == pytest.approx(warp_map.visibility[:, ::-1], abs=2e-3)


def test_a_hole_behind_a_perspective_camera_leaves_a_whole_sky():
    position = (12.0, 0.0, 0.0)
    camera = PerspectiveCamera(32, 18, 50.0)
    warp_map = bake(shot(camera=camera, camera_position=position, camera_to_hole=AWAY, motion="fido"))
    assert (warp_map.visibility == 1.0).all()
