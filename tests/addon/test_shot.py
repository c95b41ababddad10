# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read from the scene, against geometry worked out by hand or by Blender itself."""

import math
from collections.abc import Callable
from types import ModuleType

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector
from small_scene import add_hole, shrink


@pytest.fixture
def shot(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("outputs.frames")


@pytest.fixture
def errors(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api").physics


def read(shot: ModuleType, frame: int = 1):
    return shot.read_at(bpy.context.scene, frame).parameters


def place_camera(location: tuple[float, float, float], rotation: tuple[float, float, float]) -> bpy.types.Object:
    camera = bpy.context.scene.camera
    camera.location = location
    camera.rotation_euler = rotation
    return camera


def test_camera_on_the_x_axis(shot: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene, mass_scale=0.5)
    place_camera((6.0, 0.0, 0.0), (math.pi / 2, 0.0, math.pi / 2))  # looks along -x, up is z
    parameters = read(shot)
    assert parameters.camera_position == pytest.approx((12.0, 0.0, 0.0), abs=1e-6)
    # right is +y, up is +z, backwards is +x
    expected = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)
    np.testing.assert_allclose(parameters.camera_to_hole, expected, atol=1e-6)
    np.testing.assert_allclose(parameters.hole_to_world, np.eye(3), atol=1e-12)
    assert parameters.motion == "fido"
    assert parameters.map_size == (64, 36)


def test_rotated_scaled_moved_hole_with_a_parent(shot: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene, mass_scale=0.25)
    parent = bpy.data.objects.new("Parent", None)
    scene.collection.objects.link(parent)
    parent.location = (1.0, -2.0, 0.5)
    parent.rotation_euler = (0.3, -0.2, 0.9)
    parent.scale = (2.0, 2.0, 2.0)
    hole.parent = parent
    hole.location = (0.4, 0.1, -0.3)
    hole.rotation_euler = (-1.1, 0.4, 0.2)
    hole.scale = (1.5, 1.5, 1.5)
    camera = place_camera((7.0, -6.0, 5.0), (1.1, 0.1, 0.8))
    camera.scale = (3.0, 0.5, 1.0)  # a camera's scale means nothing
    parameters = read(shot)

    turn = Euler((0.3, -0.2, 0.9)).to_matrix() @ Euler((-1.1, 0.4, 0.2)).to_matrix()
    center = Vector((1.0, -2.0, 0.5)) + Euler((0.3, -0.2, 0.9)).to_matrix() @ (2.0 * Vector((0.4, 0.1, -0.3)))
    in_hole = turn.transposed() @ (Vector((7.0, -6.0, 5.0)) - center) / (0.25 * 3.0)
    assert parameters.camera_position == pytest.approx(tuple(in_hole), abs=2e-5)
    np.testing.assert_allclose(parameters.hole_to_world, np.array(turn), atol=2e-6)
    camera_axes = Euler((1.1, 0.1, 0.8)).to_matrix()
    np.testing.assert_allclose(parameters.camera_to_hole, np.array(turn.transposed() @ camera_axes), atol=2e-6)


@pytest.mark.parametrize("size", [(64, 36), (36, 64), (50, 50)])
@pytest.mark.parametrize("fit", ["AUTO", "HORIZONTAL", "VERTICAL"])
def test_the_frame_of_a_shifted_lens_is_blenders_own(shot: ModuleType, fit: str, size: tuple[int, int]) -> None:
    scene = bpy.context.scene
    shrink(scene, size)
    add_hole(scene)
    data = scene.camera.data
    data.sensor_fit = fit
    data.sensor_width, data.sensor_height, data.lens = 30.0, 20.0, 28.0
    data.shift_x, data.shift_y = 0.17, -0.08
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.0, 1.5
    width, height = size
    top_right, bottom_right, bottom_left, top_left = (
        np.array(corner.normalized()) for corner in data.view_frame(scene=scene)
    )
    directions = read(shot).camera.directions(np.array([width, width, 0.0, 0.0]), np.array([0.0, height, height, 0.0]))
    np.testing.assert_allclose(directions, [top_right, bottom_right, bottom_left, top_left], atol=1e-6)


def test_field_of_view_as_the_lens_unit(shot: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene)
    scene.camera.data.lens_unit = "FOV"
    scene.camera.data.angle = math.radians(60.0)
    camera = read(shot).camera
    edge = camera.directions(np.array([64.0]), np.array([18.0]))[0]
    assert math.atan2(edge[0], -edge[2]) == pytest.approx(math.radians(30.0), abs=1e-6)


def test_resolution_percentage_and_samples(shot: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene, (101, 57))
    add_hole(scene)
    scene.render.resolution_percentage = 50
    scene.umbra.supersampling = "2"
    parameters = read(shot)
    assert (parameters.camera.width, parameters.camera.height) == (50, 28)
    assert parameters.map_size == (100, 56)


def test_panorama(shot: ModuleType, errors: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene)
    data = scene.camera.data
    data.type = "PANO"
    owner = data if hasattr(data, "panorama_type") else data.cycles
    owner.panorama_type = "EQUIRECTANGULAR"
    owner.latitude_min, owner.longitude_max = -0.5, 1.25
    camera = read(shot).camera
    assert isinstance(camera, errors.PanoramaCamera)
    assert (camera.latitude_min, camera.longitude_max) == pytest.approx((-0.5, 1.25))

    owner.panorama_type = "FISHEYE_EQUISOLID"
    with pytest.raises(errors.BlackHoleError, match=r"Fisheye Equisolid.*Equirectangular"):
        read(shot)
    owner.panorama_type = "EQUIRECTANGULAR"
    scene.render.engine = "BLENDER_WORKBENCH"
    with pytest.raises(errors.BlackHoleError, match="only Cycles"):
        read(shot)


def test_impossible_shots_say_what_to_do(shot: ModuleType, errors: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene)
    camera = scene.camera

    def refused(pattern: str) -> None:
        with pytest.raises(errors.BlackHoleError, match=pattern):
            read(shot)

    camera.data.type = "ORTHO"
    refused("orthographic.*perspective")
    camera.data.type = "PERSP"

    scene.camera = None
    refused("no camera")
    scene.camera = camera

    hole.scale = (1.0, 2.0, 1.0)
    refused("different scale")
    hole.scale = (0.0, 0.0, 0.0)
    refused("scale of zero")
    hole.scale = (-1.0, -1.0, -1.0)
    refused("mirrored")
    hole.scale = (1.0, 1.0, 1.0)

    camera.location = hole.location + Vector((0.1, 0.0, 0.0))
    refused("horizon")
    camera.location = (7.0, -6.0, 5.0)

    scene.render.use_border = scene.render.use_crop_to_border = True
    refused("Crop to Render Region")
    scene.render.use_crop_to_border = False
    read(shot)  # a region without cropping is fine

    scene.render.use_multiview = True
    refused("Stereoscopy")
    scene.render.use_multiview = False

    hole.hide_viewport = True
    refused("disabled in viewports")
    hole.hide_viewport = False

    other = hole.copy()
    scene.collection.objects.link(other)
    bpy.data.objects.remove(hole)
    scene.umbra.active_hole = None
    assert read(shot).spin == pytest.approx(0.9)  # the only one left
    scene.umbra.active_hole = other
    for collection in other.users_collection:
        collection.objects.unlink(other)
    refused("no longer in scene")
    scene.umbra.active_hole = None
    refused("contains no black hole")


def test_two_holes_and_none_chosen(shot: ModuleType, errors: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene)
    add_hole(scene)
    assert len([each for each in scene.objects if each.umbra.is_black_hole]) == 2
    read(shot)  # the one added last is the chosen one
    scene.umbra.active_hole = None
    with pytest.raises(errors.BlackHoleError, match="several black holes"):
        read(shot)


def test_everything_can_be_animated(shot: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene)
    for frame, factor in ((1, 1.0), (11, 2.0)):
        hole.location.x = 0.1 * factor
        hole.umbra.spin = 0.2 * factor
        hole.umbra.mass_scale = 0.3 * factor
        hole.scale = (factor, factor, factor)
        scene.camera.data.lens = 35.0 * factor
        hole.keyframe_insert("location", frame=frame)
        hole.keyframe_insert("scale", frame=frame)
        hole.umbra.keyframe_insert("spin", frame=frame)
        hole.umbra.keyframe_insert("mass_scale", frame=frame)
        scene.camera.data.keyframe_insert("lens", frame=frame)
    scene.frame_set(5)
    for frame, factor in ((1, 1.0), (11, 2.0)):
        parameters = read(shot, frame)
        assert parameters.spin == pytest.approx(0.2 * factor)
        assert parameters.camera.focal_length == pytest.approx(35.0 * factor)
        away = np.array(scene.camera.location) - (0.1 * factor, 0.0, 0.0)
        assert parameters.camera_position == pytest.approx(tuple(away / (0.3 * factor * factor)), rel=1e-5)
    assert scene.frame_current == 5


def test_constraints_and_drivers_count(shot: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene)
    constraint = scene.camera.constraints.new("TRACK_TO")
    constraint.target = hole
    curve = hole.driver_add("location", 2)
    curve.driver.expression = "frame * 0.1"
    parameters = read(shot, 7)
    away = np.array(scene.camera.location) - (0.0, 0.0, 0.7)
    assert parameters.camera_position == pytest.approx(tuple(away / hole.umbra.mass_scale), rel=1e-5)
    backwards = np.array(parameters.camera_to_hole)[:, 2]
    np.testing.assert_allclose(backwards, away / np.linalg.norm(away), atol=1e-5)


def test_marker_cameras(shot: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene, mass_scale=1.0)
    first = scene.camera
    second = bpy.data.objects.new("Second", bpy.data.cameras.new("Second"))
    second.location = (0.0, 0.0, 30.0)
    scene.collection.objects.link(second)
    for frame, camera in ((1, first), (6, second)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    assert read(shot, 6).camera_position == pytest.approx((0.0, 0.0, 30.0), abs=1e-6)
    assert read(shot, 5).camera_position == pytest.approx(tuple(first.location), abs=1e-5)


def test_velocity_from_the_cameras_animation(shot: ModuleType, errors: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    scene.render.fps, scene.render.fps_base = 30, 1.001
    hole = add_hole(scene, motion="CAMERA_ANIMATION", speed_of_light=200.0)
    hole.rotation_euler = (math.pi / 2, 0.0, 0.0)  # hole's y is world z, hole's z is world -y
    camera = scene.camera
    camera.animation_data_clear()
    for frame in (1, 11):
        camera.location = (10.0, 0.2 * frame, 0.5 * frame)
        hole.location = (0.0, 0.0, 0.1 * frame)
        for each in (camera, hole):
            each.keyframe_insert("location", frame=frame)
    for each in (camera, hole):
        for curve in curves_of(each):
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"
    rate = 30 / 1.001
    world = Vector((0.0, 0.2, 0.4)) * rate / 200.0
    in_hole = Matrix.Rotation(-math.pi / 2, 3, "X") @ world
    parameters = read(shot, 6)
    assert parameters.motion == "velocity"
    expected = errors.local_velocity(parameters.spin, parameters.camera_position, tuple(in_hole))
    assert parameters.velocity == pytest.approx(expected, rel=1e-4, abs=1e-7)
    assert scene.frame_current == 1

    hole.umbra.speed_of_light = 10.0
    with pytest.raises(errors.BlackHoleError, match=r"Frame 6.*times the speed of light.*Speed of Light"):
        read(shot, 6)


def curves_of(owner: bpy.types.ID) -> list[bpy.types.FCurve]:
    action = owner.animation_data.action
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    return list(action.layers[0].strips[0].channelbag(owner.animation_data.action_slot).fcurves)


def test_a_cut_between_cameras_is_not_a_motion(shot: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene, motion="CAMERA_ANIMATION", speed_of_light=1.0)
    second = bpy.data.objects.new("Second", bpy.data.cameras.new("Second"))
    second.location = (0.0, 0.0, 30.0)
    scene.collection.objects.link(second)
    for frame, camera in ((1, scene.camera), (6, second)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    parameters = read(shot, 6)  # the second camera stands on the axis, where there is no dragging
    assert parameters.camera_position[2] > 0.0
    assert parameters.velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def let_it_orbit(hole: bpy.types.Object, radius: float, turns_a_frame: float) -> bpy.types.Object:
    """Parent the camera to an Empty at the hole that turns evenly about the hole's axis: an exact circle."""
    scene = bpy.context.scene
    camera = scene.camera
    camera.animation_data_clear()
    hub = bpy.data.objects.new("Hub", None)
    scene.collection.objects.link(hub)
    hub.location = hole.location
    camera.parent = hub
    camera.matrix_parent_inverse.identity()
    camera.location = (radius, 0.0, 0.0)
    for frame in (0, 100):
        hub.rotation_euler.z = math.tau * turns_a_frame * frame
        hub.keyframe_insert("rotation_euler", frame=frame)
    for curve in curves_of(hub):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    return hub


@pytest.mark.parametrize(
    ("spin", "radius", "frames", "tolerance"),
    [
        (0.0, 6.0, 100, 2e-5),  # float32 places, 1e-7 of the radius, over a step of 0.06 radii
        (0.9, 10.0, 24, 4e-5),  # a turn a second
        (0.9, 3.0, 8, 2e-3),  # eight frames for a turn: (2 pi / 8)^4 / 480 = 8e-4 of a speed that alpha enlarges
    ],
)
def test_a_keyframed_circular_orbit_has_the_speed_of_equation_14(
    shot: ModuleType, errors: ModuleType, spin: float, radius: float, frames: int, tolerance: float
) -> None:
    """BPT Eq. 3.10 of the orbit whose angular velocity the keyframes have; 0.5 for spin 0 at 6 M."""
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene, motion="CAMERA_ANIMATION", mass_scale=0.5, spin=spin)
    hole.location = (1.0, 2.0, -1.0)
    omega = 1.0 / (radius**1.5 + spin)  # radians per M of time
    let_it_orbit(hole, 0.5 * radius, 1.0 / frames)
    seconds = frames / (scene.render.fps / scene.render.fps_base)
    hole.umbra.speed_of_light = 0.5 * math.tau / omega / seconds  # scene units: a turn takes 2 pi / omega M of time
    parameters = read(shot, 9)
    speed = (radius**2 - 2.0 * spin * radius**0.5 + spin**2) / (
        math.sqrt(radius**2 - 2.0 * radius + spin**2) * (radius**1.5 + spin)
    )
    if (spin, radius) == (0.0, 6.0):
        assert speed == pytest.approx(0.5)
    observer = parameters.observer()
    assert observer.beta == pytest.approx(speed, abs=tolerance)
    assert observer.direction == pytest.approx((0.0, 0.0, 1.0), abs=tolerance)
    preset = errors.Observer.circular_orbit(spin, radius)
    assert observer.beta == pytest.approx(preset.beta, abs=tolerance)


def test_a_keyframed_fall_from_rest_at_infinity(shot: ModuleType, errors: ModuleType) -> None:
    """dr/dt = -(1 - 2 M / r) sqrt(2 M / r) without spin, stepped here; the speed is the closed form sqrt(2 M / r).

    The camera has a key each frame and moves straight between them. Within a frame its speed changes by a hundredth, by
    which the mean of both sides is off in second order: 2e-3 is ample.
    """
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene, motion="CAMERA_ANIMATION", mass_scale=1.0, spin=0.0)
    hole.umbra.speed_of_light = 6.0
    step = 6.0 / (scene.render.fps / scene.render.fps_base)  # M of time a frame
    camera = scene.camera
    camera.animation_data_clear()
    r, found = 10.0, {}
    for frame in range(1, 31):
        camera.location = (0.0, -r, 0.0)
        camera.keyframe_insert("location", frame=frame)
        found[frame] = r
        for _ in range(1000):
            r -= step / 1000 * (1.0 - 2.0 / r) * math.sqrt(2.0 / r)
    hole.location = (0.0, 0.0, 0.0)
    for curve in curves_of(camera):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    observer = read(shot, 15).observer()
    assert 7.0 < found[15] < 9.0
    assert observer.beta == pytest.approx(math.sqrt(2.0 / found[15]), rel=2e-3)
    assert observer.direction == pytest.approx((-1.0, 0.0, 0.0), abs=1e-4)


def test_a_camera_at_rest_is_the_static_observer_whatever_the_hole_turns_about(
    shot: ModuleType, errors: ModuleType
) -> None:
    """The stars stand along the scene's axes: a hole whose object turns about its own axis looks the same."""
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene, motion="CAMERA_ANIMATION", mass_scale=1.0, spin=0.9)
    hole.location = (0.0, 0.0, 0.0)
    scene.camera.animation_data_clear()
    scene.camera.location = (0.0, -4.0, 1.0)
    for frame in (1, 21):
        hole.rotation_euler.z = 0.1 * frame
        hole.keyframe_insert("rotation_euler", frame=frame)
    parameters = read(shot, 11)
    r, theta = math.sqrt(17.0), math.atan2(4.0, 1.0)
    static = errors.Observer.static(0.9, r, theta, 0.0)
    observer = parameters.observer()
    assert static.beta > 0.02
    assert observer.beta == pytest.approx(static.beta, abs=1e-6)
    assert observer.direction == pytest.approx((0.0, 0.0, -1.0), abs=1e-5)


def test_nothing_is_at_rest_within_the_ergosphere(shot: ModuleType, errors: ModuleType) -> None:
    scene = bpy.context.scene
    shrink(scene)
    hole = add_hole(scene, motion="CAMERA_ANIMATION", mass_scale=1.0, spin=0.9)
    hole.location = (0.0, 0.0, 0.0)
    scene.camera.animation_data_clear()
    scene.camera.location = (1.8, 0.0, 0.0)
    with pytest.raises(errors.BlackHoleError, match=r'^Frame 3: camera "Camera" is inside the ergosphere') as caught:
        read(shot, 3)
    assert caught.value.code == "camera.ergosphere"
    let_it_orbit(hole, 1.8, 1.0 / 24.0)
    hole.umbra.speed_of_light = (
        math.tau / 0.2
    )  # a turn a second is 0.2 radians per M of time; light allows 0.07 to 0.34
    assert read(shot, 3).observer().beta < 1.0


def test_a_leap_beside_a_frame_does_not_move_its_camera(shot: ModuleType) -> None:
    """A camera that stands, and leaps between frame 4 and frame 5, is at rest at frames 3 and 4, and at 6."""
    scene = bpy.context.scene
    shrink(scene)
    add_hole(scene, motion="CAMERA_ANIMATION", mass_scale=1.0, spin=0.0)
    camera = scene.camera
    camera.animation_data_clear()
    for frame, x in ((1, 9.0), (5, -9.0)):
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
    for curve in curves_of(camera):
        for point in curve.keyframe_points:
            point.interpolation = "CONSTANT"
    for frame in (3, 4, 6):
        assert read(shot, frame).observer().beta == 0.0
