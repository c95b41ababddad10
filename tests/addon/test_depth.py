# SPDX-License-Identifier: GPL-3.0-or-later
"""What is behind the hole is hidden inside its shadow, and nothing else is.

The shadow's size is Synge's closed form for a hole without spin, depths are those of planes whose places are known, and
what is not hidden is Blender's own picture without a hole.
"""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from compositor_scene import GroupRenderer
from small_scene import add_hole, compositor, links_of, read, render

SIZE = (64, 48)
FOCAL = 64 / 36 * 50.0  # pixels per unit of tangent: 50 mm on a sensor of 36 mm
M = 0.5  # scene units
DISTANCE = 12.0  # of camera and hole, scene units: 24 M


@pytest.fixture
def scene(scene: bpy.types.Scene) -> bpy.types.Scene:
    """A hole without spin at the origin, seen by a level camera from -y, in a black sky."""
    for each in list(bpy.data.objects):
        if each.type != "CAMERA":
            bpy.data.objects.remove(each)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    camera = scene.camera
    camera.location, camera.rotation_euler = (0.0, -DISTANCE, 0.0), (math.pi / 2.0, 0.0, 0.0)
    camera.data.lens, camera.data.sensor_width, camera.data.clip_end = 50.0, 36.0, 1000.0
    bpy.ops.object.select_all(action="DESELECT")
    scene.cursor.location = (0.0, 0.0, 0.0)
    add_hole(scene, spin=0.0, mass_scale=M)
    group(scene).inputs["Environment Strength"].default_value = 0.0
    return scene


def group(scene: bpy.types.Scene) -> bpy.types.Node:
    return compositor(scene).nodes["Umbra Black Hole"]


def add_plane(corners: list[tuple[float, float, float]]) -> bpy.types.Object:
    """A face that shines."""
    mesh = bpy.data.meshes.new("Plane")
    mesh.from_pydata(corners, [], [tuple(range(len(corners)))])
    material = bpy.data.materials.new("Light")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    light, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    light.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(light.outputs[0], output.inputs["Surface"])
    mesh.materials.append(material)
    made = bpy.data.objects.new("Plane", mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def wall(y: float, left: float = -100.0, right: float = 100.0) -> bpy.types.Object:
    """A face across the view at depth y from the hole."""
    return add_plane([(left, y, -100.0), (right, y, -100.0), (right, y, 100.0), (left, y, 100.0)])


def shadow_radius(distance: float) -> float:
    """Radius in pixels of the centered shadow of a hole without spin, by Synge's formula."""
    r = distance / M
    sine = math.sqrt(27.0) * math.sqrt(1.0 - 2.0 / r) / r
    return FOCAL * math.tan(math.asin(sine))


def from_center() -> tuple[np.ndarray, np.ndarray]:
    """Pixels to the right of and below the picture's center."""
    row, column = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    return column + 0.5 - SIZE[0] / 2.0, row + 0.5 - SIZE[1] / 2.0


def inside_and_outside(distance: float = DISTANCE) -> tuple[np.ndarray, np.ndarray]:
    """Pixels that lie wholly in the shadow, and wholly beside it."""
    radius = np.hypot(*from_center())
    edge = shadow_radius(distance)
    return radius < edge - 1.0, radius > edge + 1.0


def test_the_shadow_hides_a_wall_behind_the_hole(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    wall(5.0)
    picture = render(scene, tmp_path / "behind.exr", exr)[..., 0]
    inside, outside = inside_and_outside()
    assert np.all(picture[inside] == 0.0)
    assert np.all(picture[outside] == 1.0)
    # The edge is smooth: what is missing is the shadow's area. Half a percent is what the map's own edge allows.
    assert np.sum(1.0 - picture) == pytest.approx(math.pi * shadow_radius(DISTANCE) ** 2, rel=5e-3)
    group(scene).inputs["Hide Behind"].default_value = 0.0  # set back by a render
    scene.umbra.hide_behind = False
    assert np.all(render(scene, tmp_path / "shown.exr", exr)[..., 0] == 1.0)


def test_a_wall_before_the_hole_stays(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    wall(-0.01)
    assert np.all(render(scene, tmp_path / "before.exr", exr)[..., 0] == 1.0)


def test_a_floor_is_hidden_beyond_the_hole_only(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    height = 0.9  # below camera and hole
    add_plane([(-500.0, -20.0, -height), (500.0, -20.0, -height), (500.0, 900.0, -height), (-500.0, 900.0, -height)])
    picture = render(scene, tmp_path / "floor.exr", exr)[..., 0]
    _, below = from_center()
    inside, outside = inside_and_outside()
    depth = height * FOCAL / np.where(below > 0.0, below, np.nan)  # of the floor at the pixel's center
    near, far = depth < DISTANCE - 0.8, depth > DISTANCE + 0.8
    assert np.any(near & inside)
    assert np.any(far & inside)
    assert np.all(picture[near] == 1.0)
    assert np.all(picture[far & inside & (below > 1.0)] == 0.0)
    assert np.all(picture[far & outside & (below > 1.0)] == 1.0)
    assert np.all(picture[below < -1.0] == 0.0)  # the sky


def test_the_depth_is_that_of_the_same_frame(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    """The camera comes by a parent and goes to and fro; each wall would be on the other side of the frame before."""
    scene.camera.parent = bpy.data.objects.new("Dolly", None)
    scene.collection.objects.link(scene.camera.parent)
    distances = {1: 12.0, 2: 24.0, 3: 10.0}
    for frame, distance in distances.items():
        scene.camera.parent.location = (0.0, DISTANCE - distance, 0.0)
        scene.camera.parent.keyframe_insert("location", frame=frame)
    wall(-8.0, right=0.0)
    wall(8.0, left=0.0)
    scene.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    across, _ = from_center()
    for frame, distance in distances.items():
        picture = read(tmp_path / f"frame_{frame:04d}.exr", exr)[..., 0]
        inside, outside = inside_and_outside(distance)
        assert np.all(picture[across < -1.0] == 1.0), frame
        assert np.all(picture[inside & (across > 1.0)] == 0.0), frame
        assert np.all(picture[outside & (across > 1.0)] == 1.0), frame


def test_a_marker_changes_the_camera_in_time(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    cameras = {1: scene.camera, 2: scene.camera.copy(), 3: scene.camera}
    cameras[2].location.y = -24.0
    scene.collection.objects.link(cameras[2])
    for frame, camera in cameras.items():
        scene.timeline_markers.new(str(frame), frame=frame).camera = camera
    wall(-8.0, right=0.0)
    wall(8.0, left=0.0)
    scene.render.filepath = str(tmp_path / "marker_")
    bpy.ops.render.render(animation=True)
    across, _ = from_center()
    for frame, camera in cameras.items():
        picture = read(tmp_path / f"marker_{frame:04d}.exr", exr)[..., 0]
        inside, _ = inside_and_outside(-camera.location.y)
        assert np.all(picture[across < -1.0] == 1.0), frame
        assert np.all(picture[inside & (across > 1.0)] == 0.0), frame


def test_a_panorama_measures_distances(scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType) -> None:
    """A wall nearer than the hole, along the axis, is hidden where it is farther away than the hole."""
    data = scene.camera.data
    data.type = "PANO"
    owner = data if hasattr(data, "panorama_type") else data.cycles
    owner.panorama_type = "EQUIRECTANGULAR"
    half = math.radians(30.0)
    for name in ("latitude", "longitude"):
        setattr(owner, f"{name}_min", -half)
        setattr(owner, f"{name}_max", half)
    scene.umbra.active_hole.umbra.mass_scale = 1.2  # 10 M
    depth = 0.95 * DISTANCE
    wall(depth - DISTANCE)
    picture = render(scene, tmp_path / "panorama.exr", exr)[..., 0]
    across, below = from_center()
    cosine = np.cos(across / SIZE[0] * 2.0 * half) * np.cos(below / SIZE[1] * 2.0 * half)
    angle = np.arccos(cosine)
    shadow = math.asin(math.sqrt(27.0) * math.sqrt(0.8) / 10.0)
    pixel = 2.0 * half / SIZE[1]
    is_far = angle > math.acos(0.95) + pixel
    hidden = is_far & (angle < shadow - 1.5 * pixel)
    assert np.any(hidden)
    assert np.all(picture[hidden] == 0.0)
    assert np.all(picture[(angle < math.acos(0.95) - pixel) | (angle > shadow + 1.5 * pixel)] == 1.0)


def test_edges_of_near_objects_stay_smooth_and_far_ones_leave_none(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType
) -> None:
    """A slanted triangle across the shadow, covering its edge pixels in part: as without a hole, or not at all."""
    scene.cycles.samples = 16
    bound = shadow_radius(DISTANCE) / FOCAL

    def triangle(depth: float) -> bpy.types.Object:
        size, y = 0.6 * bound * depth, depth - DISTANCE
        return add_plane([(-size, y, -size), (size, y, -0.7 * size), (0.2 * size, y, size)])

    near = triangle(6.0)
    picture = render(scene, tmp_path / "near.exr", exr)[..., 0]
    scene.umbra.hide_behind = False
    plain = render(scene, tmp_path / "plain.exr", exr)[..., 0]
    assert np.any((plain > 0.1) & (plain < 0.9))
    np.testing.assert_array_equal(picture, plain)
    scene.umbra.hide_behind = True
    bpy.data.objects.remove(near)
    triangle(20.0)
    assert np.max(render(scene, tmp_path / "far.exr", exr)[..., 0]) == 0.0


@pytest.mark.parametrize("hidden", [True, False])
def test_the_disk_before_the_shadow_stays(
    addon_module: Callable[[str], ModuleType], tmp_path: Path, hidden: bool
) -> None:
    """Each pixel as the sum of its share of shadow and the rest, in which the layers lie over one another."""
    rng = np.random.default_rng(3)
    height, width = 12, 20
    warp_map = np.ones((height, width, 4), np.float32)
    warp_map[..., 3] = visibility = rng.random((height, width), np.float32)

    def layer() -> np.ndarray:
        alpha = rng.random((height, width, 1), np.float32)
        return np.concatenate([rng.random((height, width, 3), np.float32) * alpha, alpha], axis=-1)

    scene, disk = layer(), layer()
    node_group = addon_module("nodes.black_hole_group")
    depth = 7.0 if hidden else 5.0
    values = {"Environment": (0.7, 0.5, 0.3, 1.0), "Redshift Color": 0.0, "Redshift Brightness": 0.0}
    values |= {"Depth": depth, "Hole Depth": 6.0, "Hide Behind": 1.0}
    passes = np.concatenate([disk[..., :3], 1.0 - disk[..., 3:]], axis=-1)
    picture = GroupRenderer(node_group, tmp_path).render(
        (width, height), warp_map=warp_map, foreground=scene, disk=passes, values=values
    )

    def over(front: np.ndarray, back: np.ndarray) -> np.ndarray:
        return front[..., :3] + (1.0 - front[..., 3:]) * back

    seen = over(scene, over(disk, np.array((0.7, 0.5, 0.3))))
    in_shadow = over(disk, np.zeros(3)) if hidden else over(scene, over(disk, np.zeros(3)))
    share = visibility[..., None]
    np.testing.assert_allclose(picture[..., :3], share * seen + (1.0 - share) * in_shadow, atol=2e-6)


def test_switched_off_and_removed_it_leaves_no_trace(scene: bpy.types.Scene) -> None:
    layer, other = scene.view_layers[0], scene.view_layers.new("Other")
    tree = compositor(scene)
    assert (layer.use_pass_z, other.use_pass_z) == (True, False)
    shown = links_of(tree)
    scene.umbra.hide_behind = False
    assert not layer.use_pass_z
    assert [link[2:] for link in shown - links_of(tree)] == [
        (group(scene).name, group(scene).inputs["Depth"].identifier)
    ]
    assert not any(each.data_path.startswith(group(scene).path_from_id()) for each in tree.animation_data.drivers)
    scene.umbra.hide_behind = True
    layer.name = "Renamed"
    assert bpy.ops.umbra.remove_compositor() == {"FINISHED"}
    assert not layer.use_pass_z
    assert not [key for key in layer.keys() if key.startswith("umbra")]  # noqa: SIM118


def test_a_depth_pass_of_the_artists_stays(scene: bpy.types.Scene) -> None:
    scene.umbra.hide_behind = False
    layer = scene.view_layers[0]
    layer.use_pass_z = True
    scene.umbra.hide_behind = True
    assert bpy.ops.umbra.remove_compositor() == {"FINISHED"}
    assert layer.use_pass_z


def test_the_pass_follows_the_layer_behind_which_the_sky_is(scene: bpy.types.Scene) -> None:
    other = scene.view_layers.new("Other")
    tree, node = compositor(scene), group(scene)
    layer = tree.nodes.new("CompositorNodeRLayers")
    layer.scene, layer.layer = scene, other.name
    tree.links.new(layer.outputs["Image"], node.inputs["Render"])
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    assert [link.from_node for link in node.inputs["Depth"].links] == [layer]
    assert (scene.view_layers[0].use_pass_z, other.use_pass_z) == (False, True)


def test_a_file_of_before_has_the_picture_of_before(addon_module: Callable[[str], ModuleType]) -> None:
    path = Path(__file__).resolve().parents[1] / "data" / "saved_files" / "group_1.blend"
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = next(each for each in bpy.data.scenes if addon_module("outputs.shared.compositor_tree").find_setup(each))
    assert not scene.umbra.hide_behind
    node = addon_module("outputs.shared.compositor_tree").find_setup(scene).group
    assert node.inputs["Hide Behind"].default_value == 0.0
    assert not node.inputs["Depth"].is_linked
    assert not any(each.use_pass_z for each in scene.view_layers)
