# SPDX-License-Identifier: GPL-3.0-or-later
"""What the Cycles Lens renders, against Blender's own camera and against rays."""

import math
from pathlib import Path

import bpy
import numpy as np
import pytest
from lens_scene import add_ball, add_lens, in_the_dark
from small_scene import render, shrink

SPHERES = 2000.0  # distance of what stands for "infinitely far", in M

pytestmark = pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    return in_the_dark(tmp_path / "maps")


@pytest.mark.parametrize("view", ["plain", "shift", "portrait", "border", "crop", "percentage", "panorama", "dof"])
def test_a_hole_without_mass_changes_nothing(scene, tmp_path, exr, view) -> None:
    """Same samples, same pixels: what differs is single precision at the balls' outlines."""
    for place, radius in (((0.5, 3.0, 0.2), 0.6), ((-1.5, 8.0, 1.0), 1.5), ((0.6, -2.0, -0.3), 0.3)):
        add_ball(place, radius)
    data, settings = scene.camera.data, scene.render
    scene.cycles.samples = 4
    if view in ("shift", "crop"):
        data.shift_x, data.shift_y = 0.1, -0.05
    if view == "portrait":
        settings.resolution_x, settings.resolution_y, data.shift_y = 90, 160, 0.1
    if view in ("border", "crop"):
        settings.use_border, settings.use_crop_to_border = True, view == "crop"
        settings.border_min_x, settings.border_max_x = 0.2, 0.7
        settings.border_min_y, settings.border_max_y = 0.3, 0.9
    if view == "percentage":
        settings.resolution_percentage = 50
    if view == "panorama":
        data.type = "PANO"
        owner = data if hasattr(data, "panorama_type") else data.cycles
        owner.panorama_type = "EQUIRECTANGULAR"
    if view == "dof":
        data.dof.use_dof, data.dof.focus_distance, data.dof.aperture_fstop = True, 9.0, 0.1
    expected = render(scene, tmp_path / "plain.exr", exr)
    add_lens(scene, 1e-6, spin=0.0)
    for rays in ("IN_SHADER", "EXIT_MAP"):
        scene.umbra.lens_rays = rays
        picture = render(scene, tmp_path / f"{rays}.exr", exr)
        assert picture.shape == expected.shape
        different = np.abs(picture - expected)[..., :3].max(axis=-1) > 1e-3
        assert expected[..., :3].max() > 0.5
        assert different.mean() < 2e-3, f"{different.sum()} pixels differ"


def swept(b: float, r_cam: float, r_end: float) -> float:
    """Angle about a hole without spin that light with impact parameter b sweeps; midpoint rule, u = u_t (1 - x^2)."""
    roots = np.roots([2.0 * b * b, -b * b, 0.0, 1.0])
    turning = min(root.real for root in roots if abs(root.imag) < 1e-9 and root.real > 0.0)
    total = 0.0
    for radius in (r_cam, r_end):
        end = math.sqrt(1.0 - 1.0 / (radius * turning))
        x = (np.arange(4000) + 0.5) * end / 4000
        u = turning * (1.0 - x * x)
        rate = 1.0 - b * b * u * u + 2.0 * b * b * u**3
        total += float(np.sum(2.0 * b * turning * x / np.sqrt(rate))) * end / 4000
    return total


@pytest.mark.parametrize(("distance", "socket"), [(40.0, "Surface"), (1e5, "Surface"), (40.0, "Volume")])
def test_a_ball_straight_behind_makes_the_einstein_ring(scene, tmp_path, exr, distance, socket) -> None:
    """From r = 20; the ring of an infinitely distant ball is at 0.5206023578 radians (tests/data, Einstein rings)."""
    r_cam, length = 20.0, 0.3
    low, high = 5.3, 19.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if swept(middle, r_cam, distance) > math.pi else (low, middle)
    angle = math.asin(low * math.sqrt(1.0 - 2.0 / r_cam) / r_cam)
    if distance > 1e4:
        assert angle == pytest.approx(0.520602357786737, abs=1e-4)
    add_ball((0.0, distance * length, 0.0), 0.02 * distance * length, socket=socket)
    scene.camera.data.lens = 15.0
    scene.camera.data.sensor_fit = "HORIZONTAL"
    shrink(scene, (160, 120))
    scene.cycles.samples = 16
    add_lens(scene, length, spin=0.0, motion="STATIC")
    picture = render(scene, tmp_path / "ring.exr", exr)[..., 0]
    row, column = np.mgrid[0:120, 0:160]
    across, down = column + 0.5 - 80.0, row + 0.5 - 60.0
    radius = np.hypot(across, down)
    expected = math.tan(angle) * 160.0 * 15.0 / 36.0
    near = np.abs(radius - expected) < 8.0  # the secondary ring lies at the shadow, farther in
    for sector in range(8):
        part = near & (np.floor((np.arctan2(down, across) + math.pi) / (math.pi / 4.0)) == sector)
        assert picture[part].sum() > 1.0
        assert abs((picture * radius)[part].sum() / picture[part].sum() - expected) < 1.0


@pytest.mark.parametrize(
    ("spin", "motion", "offset", "primary"),
    [
        (0.9, "FIDO", (0.42, 0.1), True),
        (0.9, "FIDO", (-0.24, 0.06), False),
        (0.9, "FIDO", (0.05, -0.26), False),
        (0.9, "FIDO", (-0.125, 0.02), False),
        (0.8, "CIRCULAR", (-0.24, 0.06), True),
        (0.8, "CIRCULAR", (0.42, 0.1), False),
        (0.8, "CIRCULAR", (-0.125, 0.02), False),
    ],
)
def test_a_ball_is_seen_where_its_ray_says(scene, tmp_path, exr, addon_module, spin, motion, offset, primary) -> None:
    """Rays traced by Eq. 2 as printed, which shares no equation of motion with the lens.

    A primary image stands on the same side of the hole as its ball, a secondary one on the other.
    """
    physics = addon_module("core.physics_api").physics
    length, r_cam = 0.2, 30.0
    position = (0.0, -r_cam, 0.0)
    observer = physics.WarpMapParameters(
        spin=spin,
        camera=physics.PerspectiveCamera(160, 90, focal_length=50.0),
        camera_position=position,
        motion=motion.lower(),
    ).observer()
    look = np.array([offset[0], 1.0, offset[1]]) * (r_cam / 26.0, 1.0, r_cam / 26.0)
    look /= np.linalg.norm(look)
    # FIDO's triad at (0, -r, 0): r-hat = -y, theta-hat = -z, phi-hat = x; with B = phi-hat the camera's axes are
    # r-hat, phi-hat and -theta-hat
    theta_rd, phi_rd = math.acos(look[2]), math.atan2(look[0], -look[1])
    result = physics.trace_rays(spin, observer, theta_rd, phi_rd, method="cash-karp-printed", tolerance=1e-9)
    assert result.fate == physics.Fate.SKY
    theta, phi = float(result.theta), float(result.phi)
    towards = np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])
    assert (look[0] * towards[0] + look[2] * towards[2] > 0.0) == primary
    add_ball(tuple(SPHERES * length * towards), 0.012 * SPHERES * length)
    scene.cycles.samples = 64
    scene.camera.data.lens = 30.0
    add_lens(scene, length, spin=spin, motion=motion)
    picture = render(scene, tmp_path / "ball.exr", exr)[..., 0]
    per_pixel = 36.0 / 30.0 / 160.0
    x, y = 80.0 + look[0] / look[1] / per_pixel, 45.0 - look[2] / look[1] / per_pixel
    row, column = np.mgrid[0:90, 0:160]
    near = np.hypot(column + 0.5 - x, row + 0.5 - y) < 5.0
    light = np.where(near, picture, 0.0)
    assert light.sum() > 0.02
    seen = ((light * (column + 0.5)).sum() / light.sum(), (light * (row + 0.5)).sum() / light.sum())
    assert math.hypot(seen[0] - x, seen[1] - y) < 1.0


@pytest.mark.parametrize("primary", [True, False])
@pytest.mark.parametrize("rays", ["EXIT_MAP", "IN_SHADER"])
def test_balls_are_seen_where_reference_rays_say(scene, tmp_path, exr, rays, primary) -> None:
    """Balls, red, green and blue, in the directions of reference rays from a circular orbit, spin 0.8, r = 9.

    The camera looks along -x, so that the hole's x, y, z point against its view, to its right and up.
    """
    with np.load(Path(__file__).parent.parent / "data" / "reference_rays.npz") as archive:
        table = {name: archive[name] for name in archive.files}
    theta, phi = table["theta_rd"], table["phi_rd"]
    seen = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    length, per_pixel = 0.2, 36.0 / 15.0 / 160.0
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = 80.0 - seen[:, 1] / seen[:, 0] / per_pixel, 45.0 + seen[:, 2] / seen[:, 0] / per_pixel
    usable = (table["name"] == "D01_orbit") & (seen[:, 0] < -0.3) & ~table["shadow"] & (table["edge_dist"] > 0.03)
    usable &= (np.abs(x - 80.0) < 70.0) & (np.abs(y - 45.0) < 36.0) & (table["amp"] < 8.0)
    side = (seen[:, 1:] * table["n_cs"][:, 1:]).sum(axis=1)
    chosen = np.flatnonzero(usable & (side > 0.05 if primary else side < -0.05))[:3]
    assert len(chosen) >= 2
    for color, ray in zip(np.eye(3)[: len(chosen)], chosen, strict=True):
        add_ball(tuple(SPHERES * length * table["n_cs"][ray]), 0.02 * SPHERES * length, tuple(color))
    scene.camera.location, scene.camera.rotation_euler = (9.0 * length, 0.0, 0.0), (math.pi / 2, 0.0, math.pi / 2)
    scene.camera.data.lens, scene.camera.data.sensor_fit = 15.0, "HORIZONTAL"
    scene.cycles.samples = 64
    add_lens(scene, length, spin=0.8, motion="CIRCULAR")
    scene.umbra.lens_rays, scene.umbra.sphere_radius = rays, 6.0
    picture = render(scene, tmp_path / "balls.exr", exr)
    row, column = np.mgrid[0:90, 0:160]
    for channel, ray in enumerate(chosen):
        near = np.hypot(column + 0.5 - x[ray], row + 0.5 - y[ray]) < 6.0
        light = np.where(near, picture[..., channel], 0.0)
        assert light.sum() > 0.02
        place = (light * (column + 0.5)).sum() / light.sum(), (light * (row + 0.5)).sum() / light.sum()
        assert math.hypot(place[0] - x[ray], place[1] - y[ray]) < 1.0


def test_denoising_and_adaptive_sampling_keep_the_picture(scene, tmp_path, exr) -> None:
    for place, radius in (((0.7, 6.0, 0.3), 1.0), ((-3.0, 20.0, 2.0), 3.0)):
        add_ball(place, radius)
    add_lens(scene, 0.2, spin=0.9)
    scene.cycles.samples = 64
    plain = render(scene, tmp_path / "plain.exr", exr)[..., 0]
    scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = True, True
    scene.cycles.adaptive_threshold = 0.02
    cleaned = render(scene, tmp_path / "cleaned.exr", exr)[..., 0]
    assert np.isfinite(cleaned).all()
    assert 0.02 < plain.mean() < 0.9
    # The denoiser moves light at the outlines, where a pixel is partly covered.
    assert np.abs(cleaned - plain).mean() < 0.01
    assert cleaned[plain == 0.0].mean() < 0.01


def test_the_picture_does_not_depend_on_the_sphere_nor_on_the_map(scene, tmp_path, exr) -> None:
    for place, radius in (((0.7, 6.0, 0.3), 1.0), ((-3.0, 20.0, 2.0), 3.0), ((2.0, 4.5, -1.5), 0.7)):
        add_ball(place, radius)
    scene.cycles.samples = 16
    add_lens(scene, 0.2, spin=0.9)
    pictures = []
    for rays, sphere in (("IN_SHADER", 15.0), ("IN_SHADER", 6.0), ("EXIT_MAP", 15.0)):
        scene.umbra.lens_rays, scene.umbra.sphere_radius = rays, sphere
        pictures.append(render(scene, tmp_path / f"{len(pictures)}.exr", exr)[..., 0])
    assert 0.01 < pictures[0].mean() < 0.9
    for other in pictures[1:]:
        # a sample or two flips at an outline
        assert np.abs(other - pictures[0]).mean() < 1e-3
        assert np.abs(other - pictures[0]).max() < 0.3


def show_directions(scene: bpy.types.Scene) -> None:
    """Make the World's color the direction that is looked up, and each sample one of a pixel's center."""
    scene.world = bpy.data.worlds.new("Directions")
    scene.world.use_nodes = True
    tree = scene.world.node_tree
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    shifted = tree.nodes.new("ShaderNodeVectorMath")
    shifted.inputs[1].default_value = (1.0, 1.0, 1.0)
    tree.links.new(coordinates.outputs["Generated"], shifted.inputs[0])
    tree.links.new(shifted.outputs[0], tree.nodes["Background"].inputs["Color"])
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01


@pytest.mark.parametrize("spin", [0.0, 0.9, 0.9999])
@pytest.mark.parametrize("motion", ["FIDO", "CIRCULAR", "FREE_FALL", "STATIC"])
@pytest.mark.parametrize("rays", ["IN_SHADER", "EXIT_MAP"])
def test_directions_of_the_shader_are_those_of_the_map(scene, tmp_path, exr, addon_module, spin, motion, rays) -> None:
    """To 2e-4 radians two pixels and more away from the edge.

    Cycles' narrowest filter places a sample within half a hundredth of a pixel of its center: so much of the difference
    between neighbors is allowed besides.
    """
    physics = addon_module("core.physics_api").physics
    show_directions(scene)
    scene.camera.location = (0.3, -6.0, 2.0)
    scene.camera.rotation_euler = (math.radians(72.0), 0.0, 0.05)
    hole = add_lens(scene, 0.3, spin=spin, motion=motion)
    hole.rotation_euler = (0.2, -0.3, 0.5)
    scene.umbra.lens_rays = rays
    picture = render(scene, tmp_path / "directions.exr", exr)[..., :3].astype(float) - 1.0
    warp_map = physics.bake(addon_module("outputs.frames").read_at(scene, scene.frame_current).parameters)
    clear = warp_map.visibility == 1.0
    for _ in range(2):
        grown = clear.copy()
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            grown &= np.roll(clear, step, axis=axis)
        clear = grown
    theta, phi = warp_map.theta.astype(float), warp_map.phi.astype(float)
    expected = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    wrong = np.linalg.norm(picture - expected, axis=-1)
    steps = [
        np.linalg.norm(expected - np.roll(expected, step, axis=axis), axis=-1)
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1))
    ]
    allowed = 2e-4 + 0.01 * np.max(steps, axis=0)
    assert clear.mean() > 0.3
    assert (wrong[clear] < allowed[clear]).all()
    assert np.median(wrong[clear]) < 5e-5


@pytest.mark.parametrize("rays", ["IN_SHADER", "EXIT_MAP"])
def test_the_redshift_dims_and_tints_a_uniform_world(scene, tmp_path, exr, addon_module, rays) -> None:
    """A World of one color, seen from a fast orbit: each pixel is that color times the gain of its own 1 + z."""
    physics, color = addon_module("core.physics_api").physics, addon_module("core.physics_api").physics
    scene.world = bpy.data.worlds.new("Uniform")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.8, 0.5, 0.2, 1.0)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    add_lens(scene, 0.6, spin=0.9, motion="CIRCULAR")
    scene.umbra.lens_rays, scene.umbra.sky_temperature = rays, 5000.0
    scene.umbra.redshift_color, scene.umbra.redshift_brightness = 0.7, 1.0
    picture = render(scene, tmp_path / "shifted.exr", exr)[..., :3]
    warp_map = physics.bake(addon_module("outputs.frames").read_at(scene, scene.frame_current).parameters)
    clear = warp_map.visibility == 1.0
    gain = color.redshift_gain(warp_map.one_plus_z[clear].astype(float), 0.7, 1.0, 5000.0)
    expected = gain * np.array([0.8, 0.5, 0.2])
    assert expected[:, 0].max() > 1.5 * expected[:, 0].min()
    # Single precision, and samples half a hundredth of a pixel off its center.
    assert picture[clear] == pytest.approx(expected, rel=5e-3)
