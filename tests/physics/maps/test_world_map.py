# SPDX-License-Identifier: GPL-3.0-or-later
"""World maps: what their look-up says against rays traced one by one, and their file."""

import math
from dataclasses import replace

import numpy as np
import pytest

from physics import Observer, PanoramaCamera, WarpMapError, WarpMapParameters
from physics.files.world_map_file import read_world_map, read_world_map_metadata, write_world_map
from physics.geodesics.tracer import Fate, trace_block
from physics.images.exr import write_channels
from physics.kerr.critical_curve import around_hole, edge_function, rays_from_triad
from physics.kerr.rays import rays_from_axes
from physics.maps.world_map import FINAL, HEADER_PARTS, PREVIEW, WorldMap, world_map_steps, world_parameters
from physics.numerics.sphere import spherical_triad

PLACES = [
    (0.9, (30.0, 0.0, 5.0), "fido", (0.0, 0.0, 0.0)),
    (0.998, (0.0, -6.0, 0.2), "circular", (0.0, 0.0, 0.0)),
    (0.5, (1.0, 2.0, 60.0), "free_fall", (0.0, 0.0, 0.0)),
    (0.0, (0.0, 0.0, 20.0), "static", (0.0, 0.0, 0.0)),
    (0.7, (-8.0, 5.0, -3.0), "velocity", (0.5, -0.6, 0.3)),
]
TILTED = ((0.36, 0.48, -0.8), (-0.8, 0.6, 0.0), (0.48, 0.64, 0.6))


def made(parameters: WarpMapParameters, grid: tuple[int, int] = FINAL) -> WorldMap:
    steps = world_map_steps(world_parameters(parameters, grid))
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def shot(spin: float, position, motion: str = "fido", velocity=(0.0, 0.0, 0.0)) -> WarpMapParameters:
    return WarpMapParameters(
        spin, PanoramaCamera(8, 4), position, motion=motion, velocity=velocity, hole_to_world=TILTED
    )


def directions_about(parameters: WarpMapParameters, count: int = 3000) -> np.ndarray:
    """World directions: half of them over all the sky, half crowded about the hole."""
    random = np.random.default_rng(5)
    everywhere, near = random.normal(size=(2, count, 3))
    hole = -np.array(TILTED) @ np.array(parameters.camera_position) / parameters.radius
    near = hole + near * min(1.0, 6.0 / parameters.radius)
    both = np.concatenate([everywhere, near])
    return both / np.linalg.norm(both, axis=1, keepdims=True)


def traced(parameters: WarpMapParameters, directions: np.ndarray):
    """Each ray by itself, in the hole's frame, with aberration in the tracer: another way to the same answer."""
    observer = parameters.observer()
    in_hole = directions @ np.array(TILTED)
    rays = rays_from_axes(parameters.spin, observer, in_hole, spherical_triad(observer.theta, observer.phi).T)
    fate, origin = trace_block(rays, 1e-10, "gauss-legendre")
    return fate == Fate.SKY, origin @ np.array(TILTED).T, rays.one_plus_z


@pytest.mark.parametrize(("spin", "most", "close_most"), [(0.999, 2e-2, 5e-2), (0.9999, 4e-2, 1.5e-1)])
@pytest.mark.parametrize("theta", [90.0, 75.0])
def test_the_look_up_next_to_a_fast_hole_is_as_good_as_the_manual_says(spin, most, close_most, theta) -> None:
    """Beside the flat side of the shadow, 2.2 M from the hole; close to it are the second half of the directions."""
    place = (2.2 * math.sin(math.radians(theta)), 0.0, 2.2 * math.cos(math.radians(theta)))
    parameters = shot(spin, place)
    directions = directions_about(parameters)
    sky, origin, _ = traced(parameters, directions)
    found, _, visible = made(parameters).look_up(directions)
    both = sky & visible
    errors = 2.0 * np.arcsin(np.minimum(np.linalg.norm(found - origin, axis=1) / 2.0, 1.0))
    close = np.arange(len(directions)) >= len(directions) // 2
    assert np.quantile(errors[both], 0.99) < most
    assert np.quantile(errors[both & close], 0.99) < close_most


# The bilinear error falls by four when steps are halved: the grids' steps are 0.14 and 0.03 of s, where the sky turns
# by up to twice that. The largest errors lie where the sky is crowded, a thousandth of the shadow's size from its edge.
@pytest.mark.parametrize(("grid", "median", "most"), [(FINAL, 2e-5, 1e-3), (PREVIEW, 4e-4, 1.5e-2)])
@pytest.mark.parametrize(("spin", "position", "motion", "velocity"), PLACES)
def test_the_look_up_finds_where_rays_come_from(spin, position, motion, velocity, grid, median, most) -> None:
    parameters = shot(spin, position, motion, velocity)
    directions = directions_about(parameters)
    sky, origin, one_plus_z = traced(parameters, directions)
    found, shift, visible = made(parameters, grid).look_up(directions)
    # The edge is interpolated between 192 or 512 angles; a ray in ten thousand may fall between.
    assert np.count_nonzero(sky != visible) <= 2
    assert 0.01 < np.mean(~sky) < 0.6
    both = sky & visible
    errors = 2.0 * np.arcsin(np.linalg.norm(found - origin, axis=1)[both] / 2.0)
    assert np.median(errors) < median
    assert np.quantile(errors, 0.99) < most
    # 1 + z is a formula of the direction (Eq. 13); single precision of its four coefficients is all that it loses
    assert np.abs(shift - one_plus_z)[both].max() < 1e-6 * one_plus_z[both].max()


def test_without_a_hole_nearby_the_sky_stays_where_it_is() -> None:
    """From a million M away light is deflected by 4 M / b: nothing at right angles to the hole, to 2e-6."""
    parameters = shot(0.3, (1e6, 0.0, 0.0))
    directions = directions_about(parameters)
    away = directions @ (-np.array(TILTED)[:, 0])
    directions = directions[np.abs(away) < 0.9]
    found, shift, visible = made(parameters).look_up(directions)
    assert visible.all()
    # Steps of s are 0.054 here, and the angle's second derivative by s is at most 4 / 27: 0.054 ** 2 / 8 * 4 / 27.
    assert np.linalg.norm(found - directions, axis=1).max() < 6e-5
    assert np.abs(shift - 1.0).max() < 2e-6  # sqrt(1 - 2 / r)


def test_the_edge_is_that_of_the_shadow() -> None:
    """Between the angles kept, too: the edge function changes its sign within 1e-5 radians of the interpolated edge."""
    parameters = shot(0.95, (12.0, 3.0, -2.0))
    world_map = made(parameters)
    edges = world_map.texture[5, :, 3].astype(np.float64)
    middle = 0.5 * (edges + np.roll(edges, -1))
    angle = 2.0 * math.pi * (np.arange(len(edges)) + 1.0) / len(edges)
    observer = parameters.observer()
    fido = Observer.fido(observer.r, observer.theta, observer.phi)
    for change, sign in ((1e-5, 1.0), (-1e-5, -1.0)):
        looking = around_hole(middle + change, np.cos(angle), np.sin(angle))
        assert (np.sign(edge_function(rays_from_triad(0.95, fido, looking))) == sign).all()


def test_a_map_depends_on_the_place_and_not_on_the_camera() -> None:
    parameters = shot(0.9, (20.0, 0.0, 1.0))
    turned = replace(
        parameters, camera=PanoramaCamera(64, 32), camera_to_hole=TILTED, supersampling=4, interpolation=1e-5
    )
    assert world_parameters(turned).hash == world_parameters(parameters).hash
    moved = replace(parameters, camera_position=(20.0, 0.0, 1.1))
    assert world_parameters(moved).hash != world_parameters(parameters).hash


def test_the_header_is_read_without_knowing_the_width() -> None:
    texture = made(shot(0.9, (20.0, 0.0, 1.0)), PREVIEW).texture
    parts = texture[0].reshape(HEADER_PARTS, -1, 4)
    assert (parts == parts[:, :1]).all()
    assert parts[4, 0, 1:].tolist() == [1.0, PREVIEW[0], PREVIEW[1] + 1]


def test_a_file_holds_the_map(tmp_path) -> None:
    world_map = made(shot(0.9, (20.0, 0.0, 1.0)), PREVIEW)
    path = tmp_path / "map_0001.exr"
    write_world_map(path, world_map)
    again = read_world_map(path)
    assert np.array_equal(again.texture, world_map.texture)
    assert again.metadata["hash"] == world_map.metadata["hash"] == read_world_map_metadata(path)["hash"]
    assert again.counts == {"rays": PREVIEW[0] * PREVIEW[1], "unresolved": 0}


def test_files_that_are_no_world_maps_are_refused(tmp_path) -> None:
    world_map = made(shot(0.9, (20.0, 0.0, 1.0)), PREVIEW)
    path = tmp_path / "map.exr"
    write_world_map(path, world_map)
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(WarpMapError, match=r"map\.exr"):
        read_world_map(path)
    bent = world_map.texture.copy()
    bent[7, 3, :3] *= 1.5
    write_world_map(path, replace(world_map, texture=bent))
    with pytest.raises(WarpMapError, match="values that no world map has"):
        read_world_map(path)
    write_channels(path, {name: np.zeros((4, 8), np.float32) for name in "RGBA"}, {})
    with pytest.raises(WarpMapError, match="is not a world map"):
        read_world_map(path)
