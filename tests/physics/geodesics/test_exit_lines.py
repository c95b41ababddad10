# SPDX-License-Identifier: GPL-3.0-or-later
"""Exit lines against integrals of motion, other methods, finite distances and reference rays; exit maps and files."""

import dataclasses
import math

import numpy as np
import pytest
from references import random_sky, reference_cameras, unit_vectors
from shots import shot

from physics import BlackHoleError, Observer, WarpMapError, bake, write_warp_map
from physics.files.exit_map_file import read_exit_map, read_exit_map_metadata, write_exit_map
from physics.geodesics.exit_lines import exit_lines
from physics.geodesics.tracer import Fate
from physics.kerr.critical_curve import find_barrier
from physics.kerr.rays import camera_directions, rays_from_camera
from physics.maps.exit_map import BILINEAR_TOLERANCE, IMPACT_SCALE, bake_exit_map


def rays_of(spin, observer, count=500):
    return rays_from_camera(spin, observer, camera_directions(*random_sky(count)))


CAMERAS = [
    (0.0, Observer.fido(30.0, 1.3, 0.3)),
    (0.9, Observer.fido(20.0, 1.2, 0.3)),
    (0.999, Observer.circular_orbit(0.999, 6.0)),
    (0.5, Observer.fido(12.0, 0.0, 0.0)),
    (0.95, Observer.fido(2.5, 0.4, 2.0)),
]


@pytest.mark.parametrize(("spin", "observer"), CAMERAS)
@pytest.mark.parametrize("method", ["gauss-legendre", "cash-karp"])
def test_impact_vectors_keep_the_constants_of_motion(spin, observer, method):
    """|D|^2 = q + b^2 + a^2 N_z^2, and D x N has b as its component along the axis: Carter 1968 at infinity."""
    rays = rays_of(spin, observer)
    fate, direction, impact = exit_lines(rays, 1e-10, method)
    sky = fate == Fate.SKY
    n, d = direction[sky], impact[sky]
    np.testing.assert_allclose((n * d).sum(axis=1), 0.0, atol=1e-7)
    # relative to the largest impact parameter: steps lose a little more than quadrature
    size = rays.q_plus_b2[sky] + (spin * n[:, 2]) ** 2
    np.testing.assert_allclose((d * d).sum(axis=1), size, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(np.abs(np.cross(d, n)[:, 2]), np.abs(rays.b[sky]), rtol=1e-7, atol=1e-6)


@pytest.mark.parametrize(("spin", "observer"), CAMERAS)
def test_both_methods_agree(spin, observer):
    rays = rays_of(spin, observer)
    fate, direction, impact = exit_lines(rays, 1e-10, "gauss-legendre")
    fate_2, direction_2, impact_2 = exit_lines(rays, 1e-10, "cash-karp")
    np.testing.assert_array_equal(fate, fate_2)
    # Cash-Karp's tolerance is of one step; rays that wind amplify it
    sky = fate == Fate.SKY
    assert np.percentile(np.abs(direction - direction_2)[sky], 99) < 1e-7
    assert np.percentile(np.abs(impact - impact_2)[sky], 99) < 1e-6


def test_directions_are_those_of_reference_rays():
    checked = 0
    for camera in reference_cameras():
        rays = rays_from_camera(
            camera.spin, camera.observer, camera_directions(camera.rows["theta_rd"], camera.rows["phi_rd"])
        )
        fate, direction, _ = exit_lines(rays, 1e-9)
        sky = fate == Fate.SKY
        expected = unit_vectors(camera.rows["theta_cs"][sky], camera.rows["phi_cs"][sky])
        wrong = np.linalg.norm(direction[sky] - expected, axis=1)
        checked += int(sky.sum())
        if sky.any():
            assert np.median(wrong) < 1e-7
    assert checked > 500


def schwarzschild_swept(b, r_cam, r_end):
    """The angle a ray without spin sweeps from the camera through its turning point and out to r_end.

    d phi / du = b / sqrt(1 - b^2 u^2 + 2 b^2 u^3), with u = u_t (1 - x^2) to take the turning point out, by the
    midpoint rule: nothing of this is shared with the tracer.
    """
    roots = np.roots([2.0 * b * b, -b * b, 0.0, 1.0])
    turning = min(root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 0.0)
    total = 0.0
    for radius in (r_cam, r_end):
        end = math.sqrt(1.0 - 1.0 / (radius * turning))
        x = (np.arange(20000) + 0.5) * end / 20000
        u = turning * (1.0 - x * x)
        rate = 1.0 - b * b * u * u + 2.0 * b * b * u**3
        total += float(np.sum(b * 2.0 * turning * x / np.sqrt(rate))) * end / 20000
    return total


@pytest.mark.parametrize("r_end", [20.0, 40.0, 200.0])
@pytest.mark.parametrize("b", [5.5, 7.0, 10.0])
def test_line_is_where_the_ray_is_at_a_finite_distance(b, r_end):
    """Without spin the ray leaves the line by b^3 / (4 r^3) in units of M: here twice that is allowed."""
    r_cam = 30.0
    sine = b * math.sqrt(1.0 - 2.0 / r_cam) / r_cam
    angle = math.pi - math.asin(sine)  # of the light seen, from outwards
    observer = Observer.fido(r_cam, math.pi / 2.0, 0.0)
    # In the camera's frame with B = phi-hat: x outwards, y along phi.
    look = np.array([[math.cos(angle), math.sin(angle), 0.0]])
    _, direction, impact = exit_lines(rays_from_camera(0.0, observer, look), 1e-10)
    s = math.sqrt(r_end**2 - b * b)
    on_line = impact[0] + s * direction[0]
    swept = schwarzschild_swept(b, r_cam, r_end)
    ray = r_end * np.array([math.cos(swept), math.sin(swept), 0.0])
    assert np.linalg.norm(on_line - ray) < 2.0 * b**3 / (4.0 * r_end**3) + 1e-3


def test_exit_map_is_what_rays_say_and_agrees_with_the_warp_map():
    parameters = dataclasses.replace(shot(160, 90, radius=30.0, spin=0.9), hole_to_world=np.eye(3).tolist())
    exits = bake_exit_map(parameters)
    each = bake_exit_map(dataclasses.replace(parameters, interpolation=0.0))
    # float32, and the interpolation that the parameters allow
    seen = np.linalg.norm(each.direction, axis=-1) > 0.0
    np.testing.assert_allclose(exits.direction, each.direction, atol=2.0 * parameters.interpolation)
    np.testing.assert_allclose(exits.impact, each.impact, atol=2.0 * parameters.interpolation * IMPACT_SCALE)
    warp_map = bake(parameters)
    clear = (warp_map.visibility == 1.0) & (exits.usable == 1.0)
    assert clear.sum() > 100
    angles = unit_vectors(warp_map.theta.astype(float), warp_map.phi.astype(float))
    np.testing.assert_allclose(exits.direction[clear], angles[clear], atol=2e-5)
    np.testing.assert_allclose(exits.one_plus_z[clear], warp_map.one_plus_z[clear], rtol=1e-6)
    assert 0 < (~seen).sum() == exits.counts["shadow"]
    assert not exits.usable[~seen].any()


def test_usable_pixels_interpolate_as_well_as_they_claim():
    """Between the centers of four usable pixels, rays of their own; three times the bound for what it leaves out."""
    parameters = shot(320, 180, radius=30.0, spin=0.9, motion="fido")
    exits = bake_exit_map(parameters)
    finer = bake_exit_map(dataclasses.replace(parameters, supersampling=2, interpolation=0.0))
    cells = exits.usable[:-1, :-1] * exits.usable[1:, :-1] * exits.usable[:-1, 1:] * exits.usable[1:, 1:] == 1.0
    assert cells.sum() > 1000
    # fine pixel (2 j + 1, 2 i + 1) has its center a quarter of the way from coarse center (j, i) to the next
    weights = ((0.75, 0.75, 0, 0), (0.75, 0.25, 0, 1), (0.25, 0.75, 1, 0), (0.25, 0.25, 1, 1))
    height, width = cells.shape
    mean = sum(wy * wx * exits.direction[j : j + height, i : i + width].astype(float) for wy, wx, j, i in weights)
    truth = finer.direction[1 : 2 * height : 2, 1 : 2 * width : 2]
    wrong = np.linalg.norm(mean - truth, axis=-1)[cells]
    assert wrong.max() < 3.0 * BILINEAR_TOLERANCE


def test_file_comes_back_as_written(tmp_path):
    exits = bake_exit_map(shot(40, 22, spin=0.7))
    write_exit_map(tmp_path / "exit.exr", exits)
    again = read_exit_map(tmp_path / "exit.exr")
    for name in ("direction", "impact", "one_plus_z", "usable"):
        np.testing.assert_array_equal(getattr(again, name), getattr(exits, name))
    assert again.metadata == {"format": "umbra exit map 1", **exits.metadata}
    assert read_exit_map_metadata(tmp_path / "exit.exr")["hash"] == exits.metadata["hash"]


def test_faulty_files_are_refused(tmp_path):
    with pytest.raises(WarpMapError, match="does not exist; bake it again"):
        read_exit_map(tmp_path / "none.exr")
    write_warp_map(tmp_path / "warp.exr", bake(shot(40, 22)))
    with pytest.raises(WarpMapError, match="is not an exit map"):
        read_exit_map(tmp_path / "warp.exr")
    write_exit_map(tmp_path / "exit.exr", bake_exit_map(shot(40, 22)))
    data = (tmp_path / "exit.exr").read_bytes()
    (tmp_path / "exit.exr").write_bytes(data[: len(data) // 2])
    with pytest.raises(WarpMapError, match="cut short"):
        read_exit_map(tmp_path / "exit.exr")


def test_a_method_without_exit_lines_is_refused():
    with pytest.raises(BlackHoleError, match="cannot tell where rays leave"):
        bake_exit_map(shot(40, 22, method="cash-karp-printed"))


def test_barrier_and_exit_lines_agree_about_the_shadow():
    rays = rays_of(0.9, Observer.fido(8.0, 1.0, 0.0))
    fate, direction, _ = exit_lines(rays, 1e-6)
    behind = find_barrier(rays).blocks & (rays.observer.r > find_barrier(rays).radius)
    assert (fate[behind & rays.escapes] == Fate.SKY).all()
    assert np.isnan(direction[fate == Fate.SHADOW]).all()
