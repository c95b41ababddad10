# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk's passes: interpolated against traced, coverage against counting, files, and sharing between frames."""

import dataclasses
import math

import numpy as np
import pytest
from shots import AWAY, shot

from physics import (
    BlackHoleError,
    Disk,
    PanoramaCamera,
    WarpMapError,
    WarpMapParameters,
    bake,
    read_disk_pass,
    read_warp_map,
    turned_map,
    write_disk_pass,
    write_warp_map,
)
from physics.disk_passes.annulus import share_above
from physics.disk_passes.disk_samples import PIXEL_ERROR
from physics.geodesics.radial_path import winding
from physics.sampling.view import View

DISK = Disk()
SHOTS = {
    "ordinary": shot(160, 90, radius=30.0, motion="fido", spin=0.9, disk=DISK),
    "over the pole": shot(160, 90, radius=30.0, inclination=0.0, motion="fido", spin=0.9, disk=DISK),
    "inside the photon orbits": shot(
        camera=PanoramaCamera(128, 64), camera_position=(2.2, 0.5, 0.3), motion="fido", spin=0.9, disk=DISK
    ),
    "narrow lens": shot(160, 90, fov=5.0, radius=60.0, motion="fido", disk=DISK),
    "wide lens": shot(160, 90, fov=160.0, radius=6.0, disk=DISK),
    "whole sky": shot(camera=PanoramaCamera(160, 80), radius=12.0, spin=0.5, disk=DISK),
    "extreme spin, matter that falls": shot(
        160, 90, spin=0.9999, radius=8.0, motion="fido", disk=Disk(inner_radius=1.03, outer_radius=6.0, crossings=2)
    ),
    "close to the plane": shot(160, 90, radius=40.0, inclination=89.5, motion="fido", spin=0.3, disk=DISK),
    "within the disk's plane": shot(160, 90, radius=40.0, inclination=90.0, motion="fido", spin=0.3, disk=DISK),
    "far away, retrograde": shot(160, 90, radius=500.0, fov=8.0, disk=Disk(retrograde=True)),
    "looking away from above the disk": shot(
        160, 90, camera_position=(10.0, 0.0, 1.0), camera_to_hole=AWAY, motion="fido", spin=0.9, disk=DISK
    ),
}
# Shadows large enough for tables of the later images.
LARGE_SHOTS = {
    "ordinary": shot(480, 270, spin=0.6, radius=30.0, fov=42.0, disk=DISK),
    "extreme spin": shot(480, 270, spin=0.999, radius=10.0, disk=DISK),
    "matter that falls": shot(
        320, 180, spin=0.9, radius=12.0, fov=70.0, motion="fido", disk=Disk(inner_radius=1.6, outer_radius=9.0)
    ),
    "matter that falls, extreme spin": shot(
        320, 180, spin=0.9999, radius=8.0, motion="fido", disk=Disk(inner_radius=1.03, outer_radius=6.0)
    ),
    "close to the plane, retrograde": shot(
        320, 180, spin=0.7, radius=20.0, inclination=89.0, fov=40.0, disk=Disk(retrograde=True)
    ),
    "from above, five images": shot(320, 180, spin=0.5, radius=15.0, inclination=20.0, disk=Disk(crossings=5)),
    "whole sky": shot(camera=PanoramaCamera(360, 180), spin=0.8, radius=8.0, disk=DISK),
    "fast, narrow lens": shot(
        320, 180, spin=0.9, radius=60.0, fov=12.0, motion="velocity", velocity=(-0.5, 0.04, 0.03), disk=DISK
    ),
    "a thin ring": shot(320, 180, spin=0.3, radius=25.0, fov=40.0, disk=Disk(inner_radius=10.0, outer_radius=10.3)),
    "far larger than the picture": shot(320, 180, spin=0.9, radius=9.0, disk=Disk(outer_radius=2000.0)),
}
# Places inside a pixel whose mean is the coverage, for the check.
PLACES = 8


def counted_coverage(parameters, columns, rows):
    """Share of places in each pixel whose ray crosses the disk, (crossings, n), and radii there."""
    view = View(parameters)
    steps = (np.arange(PLACES) + 0.5) / PLACES
    x = (columns[:, None, None] + steps).repeat(PLACES, axis=1)
    y = (rows[:, None, None] + steps[:, None]).repeat(PLACES, axis=2)
    found, _ = view.crossings(x.ravel(), y.ravel(), parameters.disk.crossings, 1e-8, "gauss-legendre")
    inner, outer = parameters.disk.radii(parameters.spin)
    inside = (found.u >= 1.0 / outer) & (found.u <= 1.0 / inner)
    return inside.reshape(len(inside), -1, PLACES * PLACES).mean(axis=-1)


def some_pixels(parameters):
    """Columns and rows of 1500 pixels all over the picture, and of more next to the shadow's edge."""
    random = np.random.default_rng(1)
    width, height = parameters.map_size
    columns, rows = random.integers(0, width, 1500), random.integers(0, height, 1500)
    x, y = (np.nan_to_num(each, nan=-9.0) for each in View(parameters).outline())
    chosen = random.integers(0, len(x), 1500)
    x, y = (np.floor(each[chosen] + random.normal(0.0, 1.5, 1500)).astype(int) for each in (x, y))
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return np.append(columns, x[inside]), np.append(rows, y[inside])


@pytest.mark.parametrize(
    "parameters", [*SHOTS.values(), *LARGE_SHOTS.values()], ids=[*SHOTS, *map("large: {}".format, LARGE_SHOTS)]
)
def test_passes_are_those_of_rays_traced_everywhere(parameters):
    passes = bake(parameters).disk_passes
    assert len(passes) == parameters.disk.crossings
    columns, rows = some_pixels(parameters)
    counted = counted_coverage(parameters, columns, rows)
    inner, outer = parameters.disk.radii(parameters.spin)
    count = parameters.disk.crossings
    (center, light), *beside = (
        View(parameters).crossings(columns + 0.5 + right, rows + 0.5 + down, count, 1e-9, "gauss-legendre")
        for right, down in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    )
    g, *g_beside = (
        each.g(parameters.spin, there.u, there.u_slope, parameters.disk.retrograde)
        for there, each in ((center, light), *beside)
    )
    change_of_g = np.hypot(*(there / g - 1.0 for there in g_beside))
    change_of_radius = np.hypot(*(there.u / center.u - 1.0 for there, _ in beside))
    assert (passes[0].coverage > 0.0).any()
    for order, one in enumerate(passes):
        share = one.coverage[rows, columns]
        # 64 places know a straight rim to 2 %, and the images are crowded next to the shadow.
        error = np.abs(share - counted[order])
        assert error[:1500].mean() < 0.004
        assert np.quantile(error[:1500], 0.99) < 0.15
        assert error.max() < 0.6
        # Next to the edge they miss some thin images and count too much of others, but not on average.
        at_edge = (share - counted[order])[1500:]
        if len(at_edge):
            large = parameters in LARGE_SHOTS.values()
            assert np.abs(at_edge).mean() < (0.008 if large else 0.04)
            assert abs(at_edge.mean()) < (0.004 if large else 0.03)
        seen = one.coverage > 0.0
        assert ((one.radius[seen] >= inner * (1 - 1e-6)) & (one.radius[seen] <= outer * (1 + 1e-6))).all()
        assert (one.g[seen] > 0.0).all()
        whole = (share == 1.0) & (counted[order] == 1.0)
        assert (np.isnan(center.u[order]) & whole).sum() <= 2  # such a ray asks for more points than there are
        whole &= np.isfinite(center.u[order])
        if whole.sum() > 20:
            radius = np.abs(one.radius[rows, columns] * center.u[order] - 1.0)[whole]
            phi = center.unwound[order][whole] + winding(parameters.spin, center.u[order][whole])
            turn = np.abs((one.phi[rows, columns][whole] - phi + math.pi) % (2 * math.pi) - math.pi)
            shift = np.abs(one.g[rows, columns] / g[order] - 1.0)[whole]
            # 2e-4 is promised, and where the image is crowded a share of what neighboring pixels differ by.
            crowd = PIXEL_ERROR * change_of_radius[order][whole]
            assert np.median(radius / np.fmax(2e-4, crowd)) < 1.0
            assert np.median(turn / np.fmax(2e-4, crowd)) < 1.0
            assert np.median(shift / np.fmax(2e-4, PIXEL_ERROR * change_of_g[order][whole])) < 1.0
            assert np.quantile(radius, 0.95) < 0.01


def test_a_band_thinner_than_a_pixel_keeps_its_light_at_any_resolution():
    """The area of the third image, 0.1 to 0.7 pixels thick, is that of a picture in which it is eight times as thick;
    and all along the shadow's edge there is some of it in each row of pixels."""
    areas = []
    for size in (1, 8):
        parameters = shot(240 * size, 135 * size, spin=0.6, radius=30.0, fov=42.0, inclination=60.0, disk=DISK)
        third = bake(parameters).disk_passes[2]
        areas.append(third.coverage.sum() / size**2)
        if size == 1:
            x, y = View(parameters).outline()
            near = np.zeros(third.coverage.shape, dtype=bool)
            for column in (-1.0, 0.0, 1.0):
                for row in (-1.0, 0.0, 1.0):
                    near[(y + row).astype(int), (x + column).astype(int)] = True
            rows = np.arange(math.ceil(y.min()), math.floor(y.max()))
            assert ((third.coverage * near)[rows].max(axis=1) > 0.02).all()
            assert third.coverage.max() < 1.0
            assert areas[0] > 20.0
    assert areas[0] == pytest.approx(areas[1], rel=0.01)


def test_interpolation_traces_few_rays_of_a_large_picture():
    parameters = shot(960, 540, radius=30.0, motion="fido", spin=0.5, disk=Disk(crossings=1))
    assert bake(parameters).counts["disk_rays"] < 0.25 * 960 * 540


def test_tracing_every_pixel_gives_the_same():
    parameters = SHOTS["ordinary"]
    adaptive, every = bake(parameters), bake(dataclasses.replace(parameters, interpolation=0.0))
    for one, other in zip(adaptive.disk_passes, every.disk_passes, strict=True):
        assert np.abs(one.coverage - other.coverage).mean() < 1e-3
        both = (one.coverage == 1.0) & (other.coverage == 1.0)
        if both.any():
            assert np.quantile(np.abs(one.radius / np.where(both, other.radius, 1.0) - 1.0)[both], 0.99) < 2e-3


def test_passes_traced_by_steps_are_the_same():
    parameters = shot(32, 18, radius=30.0, fov=50.0, motion="fido", spin=0.9, disk=Disk(crossings=2))
    by_steps = bake(dataclasses.replace(parameters, method="cash-karp", interpolation=0.0))
    assert by_steps.counts["disk_unresolved"] == 0
    for one, other in zip(bake(parameters).disk_passes, by_steps.disk_passes, strict=True):
        assert one.coverage == pytest.approx(other.coverage, abs=1e-3)
        assert one.radius == pytest.approx(other.radius, rel=1e-3)


def test_the_share_of_a_square_above_a_plane():
    random = np.random.default_rng(0)
    x, y = np.meshgrid((np.arange(200) + 0.5) / 200 - 0.5, (np.arange(200) + 0.5) / 200 - 0.5)
    for _ in range(30):
        height, across, down = random.normal(0.0, (0.5, 1.0, 1.0))
        assert share_above(height, across, down) == pytest.approx((height + across * x + down * y > 0).mean(), abs=0.01)
    assert share_above(np.array([1.0, -1.0, 0.0]), 0.0, 0.0) == pytest.approx([1.0, 0.0, 0.5])
    assert share_above(np.array(0.25), np.array(1.0), np.array(0.0)) == pytest.approx(0.75, abs=1e-4)


def test_a_map_without_a_disk_is_what_it_was():
    plain = shot()
    assert "disk" not in plain.to_metadata()
    assert bake(plain).disk_passes == ()
    assert WarpMapParameters.from_metadata(plain.to_metadata()) == plain
    with_disk = shot(disk=DISK)
    assert with_disk.hash != plain.hash
    assert WarpMapParameters.from_metadata(with_disk.to_metadata()) == with_disk
    assert np.array_equal(bake(plain).theta, bake(with_disk).theta)


def test_impossible_disks_are_refused():
    for disk, words in (
        (Disk(inner_radius=0.5), "horizon"),
        (Disk(inner_radius=9.0, outer_radius=5.0), "outer radius"),
        (Disk(outer_radius=math.inf), "outer radius"),
        (Disk(crossings=0), "crossings"),
    ):
        with pytest.raises(BlackHoleError, match=words):
            bake(shot(disk=disk))
    with pytest.raises(BlackHoleError, match="knows no disk"):
        bake(shot(disk=DISK, method="cash-karp-printed"))


def test_a_pass_survives_its_file(tmp_path):
    baked = bake(shot(disk=DISK))
    for one in baked.disk_passes:
        path = tmp_path / f"{one.metadata['crossing']}.exr"
        write_disk_pass(path, one)
        read = read_disk_pass(path)
        for name in ("radius", "phi", "g", "coverage"):
            assert np.array_equal(getattr(read, name), getattr(one, name))
        assert read.metadata["crossing"] == one.metadata["crossing"]
        assert read.metadata["parameters"] == one.metadata["parameters"]
    with pytest.raises(WarpMapError, match="not a warp map"):
        read_warp_map(path)
    write_warp_map(tmp_path / "map.exr", baked)
    with pytest.raises(WarpMapError, match="not a disk pass"):
        read_disk_pass(tmp_path / "map.exr")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(WarpMapError, match="bake it again"):
        read_disk_pass(path)


def test_frames_of_an_orbit_share_passes():
    first = shot(96, 54, radius=25.0, motion="fido", spin=0.7, disk=Disk(crossings=2))
    angle = 0.7
    x, _, z = first.camera_position
    turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    later = dataclasses.replace(
        first,
        camera_position=tuple(turn @ [x, 0.0, z]),
        camera_to_hole=tuple(map(tuple, turn @ np.array(first.camera_to_hole))),
    )
    shared, baked = turned_map(bake(first), later), bake(later)
    assert shared is not None
    for one, other in zip(shared.disk_passes, baked.disk_passes, strict=True):
        assert np.abs(one.coverage - other.coverage).max() < 0.05
        both = (one.coverage == 1.0) & (other.coverage == 1.0)
        turned = np.abs((one.phi - other.phi + math.pi) % (2 * math.pi) - math.pi)[both]
        assert np.quantile(turned, 0.99) < 1e-3
        assert one.metadata["hash"] == later.hash


def test_negative_energies_have_their_redshift():
    """In the ergosphere the disk is seen along rays of negative energy too, with g > 0."""
    parameters = shot(
        camera=PanoramaCamera(64, 32),
        camera_position=(1.3, 0.0, 0.05),
        motion="fido",
        spin=0.9999,
        disk=Disk(crossings=1, inner_radius=1.02),
    )
    view = View(parameters)
    x, y = np.meshgrid(np.arange(64) + 0.5, np.arange(32) + 0.5)
    _, light = view.crossings(x.ravel(), y.ravel(), 1, 1e-6, "gauss-legendre")
    negative = (light.energy < 0.0).reshape(32, 64)
    (one,) = bake(parameters).disk_passes
    seen = negative & (one.coverage > 0.0)
    assert seen.any()
    assert (one.g[seen] > 0.0).all()


@pytest.mark.parametrize(
    ("spin", "radius", "inclination", "inner"),
    [(0.0, 8.0, 45.8, 2.773), (0.9, 8.0, 89.4, 1.46), (0.9, 20.0, 89.4, 2.07), (0.998, 12.0, 80.0, 1.12)],
)
def test_light_at_the_rim_of_falling_matter_can_be(spin, radius, inclination, inner):
    """A place that is moved to a rim next to the horizon keeps a redshift that light can have."""
    parameters = shot(
        320, 180, spin=spin, radius=radius, inclination=inclination, fov=46.0, disk=Disk(inner_radius=inner)
    )
    for one in bake(parameters).disk_passes:
        seen = one.coverage > 0.0
        assert (one.g[seen] > 0.0).all()
        assert one.g[seen].max(initial=0.0) < 30.0
        assert not one.g[~seen].any()


@pytest.mark.parametrize("outer", [1e3, 1e4, 1e5])
def test_a_disk_of_any_size_has_its_second_image(outer):
    """What is off a large disk is no less than what is off a small one."""
    parameters = shot(
        960,
        540,
        spin=0.6,
        radius=300.0,
        inclination=74.5,
        camera=PanoramaCamera(960, 540),
        disk=Disk(crossings=2, outer_radius=outer),
    )
    adaptive = bake(parameters).disk_passes[1]
    rows, columns = np.mgrid[0:540:2, 0:960:2].reshape(2, -1)
    exact, _ = View(parameters).crossings(columns + 0.5, rows + 0.5, 2, 1e-6, "gauss-legendre")
    inner = parameters.disk.radii(parameters.spin)[0]
    on_disk = (exact.u[1] > 1.5 / outer) & (exact.u[1] < 0.7 / inner)
    assert (adaptive.coverage[rows[on_disk], columns[on_disk]] > 0.0).mean() > 0.9


@pytest.mark.parametrize("spin", [1e-300, -1e-170])
def test_next_to_no_spin(spin):
    one = bake(shot(spin=spin, motion="fido", disk=Disk())).disk_passes[0]
    other = bake(shot(spin=0.0, motion="fido", disk=Disk(retrograde=spin < 0.0))).disk_passes[0]
    np.testing.assert_allclose(one.radius, other.radius, rtol=1e-6)


def test_winding_keeps_its_digits():
    """Against exact rational numbers: W = a / (r_+ - r_-) ln((1 - r_+ u) / (1 - r_- u)), in single precision too."""
    for spin, u in ((0.5, 0.3), (1.0 - 2.0**-30, 0.25), (1.0 - 2.0**-40, 0.5)):
        gap = 2.0 * math.sqrt((1.0 - spin) * (1.0 + spin))
        # ln(1 - x) = -x - x^2 / 2 - ..., x = gap u / (1 - r_- u) small for the fastest holes
        small = gap * u / (1.0 - (1.0 - 0.5 * gap) * u)
        expected = spin / gap * sum(-(small**k) / k for k in range(1, 200))
        assert winding(spin, np.array([u], np.float32))[0] == pytest.approx(expected, rel=2e-6)


# Cameras inside the ergosphere that see the disk by light of negative energy or beside such light: above the plane and
# next to it, inside the disk's inner rim and outside, of either spin.
DEEP = [
    (0.999, 1.4, 70.0, 1.33),
    (0.999, 1.1, 87.0, None),
    (0.95, 1.7, 87.0, None),
    (0.95, 1.4, 87.0, None),
    (-0.95, 1.4, 87.0, 1.325),
    (0.999, 1.7, 70.0, 1.615),
]


@pytest.mark.parametrize(("spin", "radius", "inclination", "inner"), DEEP)
def test_no_pixel_shows_a_disk_that_is_not_there(spin, radius, inclination, inner):
    """Light of no or negative energy ends at the horizon: no place near a pixel without the disk sees it.

    All of a pixel and half of those around it are looked at, by 15 x 15 rays. A disk that none of these meets covers
    no part of the pixel.
    """
    theta = math.radians(inclination)
    parameters = shot(
        spin=spin,
        camera=PanoramaCamera(128, 64),
        camera_position=(radius * math.sin(theta), 0.0, radius * math.cos(theta)),
        camera_to_hole=((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
        motion="fido",
        disk=Disk(crossings=1, inner_radius=inner, outer_radius=10.0),
    )
    view, (width, height) = View(parameters), parameters.map_size
    (one,) = bake(parameters).disk_passes
    rows, columns = np.nonzero(one.coverage > 0.0)
    low, high = parameters.disk.radii(spin)
    centers = np.mgrid[0:height, 0:width].reshape(2, -1) + 0.5
    found, light = view.crossings(centers[1], centers[0], 1, 1e-6, "gauss-legendre")
    assert (light.energy <= 0.0).sum() > 100
    with np.errstate(invalid="ignore"):
        on_disk = ((found.u >= 1.0 / high) & (found.u <= 1.0 / low)).reshape(height, width)
    beside = np.pad(on_disk, 1)
    near = sum(beside[1 + y : 1 + y + height, 1 + x : 1 + x + width] for y in (-1, 0, 1) for x in (-1, 0, 1)) > 0
    left = np.flatnonzero(~near[rows, columns])
    rows, columns = rows[left], columns[left]
    places = np.linspace(-0.5, 1.5, 15)
    y, x = (each.astype(np.float64) for each in (rows, columns))
    y, x = np.broadcast_arrays(y[:, None, None] + places[:, None], x[:, None, None] + places)
    found, _ = view.crossings(x.ravel(), y.ravel(), 1, 1e-6, "gauss-legendre")
    with np.errstate(invalid="ignore"):
        seen = ((found.u >= 1.0 / high) & (found.u <= 1.0 / low)).reshape(x.shape).any(axis=(1, 2))
    assert seen.all(), (rows[~seen], columns[~seen])
