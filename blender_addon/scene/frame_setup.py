# SPDX-License-Identifier: GPL-3.0-or-later
"""Read what a frame needs from Blender: hole, camera and render size become `physics.WarpMapParameters`.

Plain functions over evaluated data. Nothing here writes to the scene, except `read_at` and `camera_velocity`,
which step to other frames and back.
"""

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..core import image_library
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..settings.disk_properties import disk_of
from ..settings.hole_properties import CAMERA_ANIMATION, MOTIONS
from ..settings.scene_properties import tolerances_of
from . import drivers, instanced_hole, rotations, shutter
from .camera_type import original_type
from .enabled import is_enabled
from .rotations import Matrix, Vector
from .shutter import Motion
from .stepping import frame_kept

# Object matrices are float32: axes may differ in length, and from right angles, by so much from
# rounding.
MATRIX_TOLERANCE = 1e-4

# Share by which velocities over one frame and over two can differ on a smooth way; on a circle of 4 frames it is 0.3.
LEAP = 0.5

Row = tuple[float, float, float]
Rows = tuple[Row, Row, Row]


@dataclass(frozen=True)
class Traits:
    """What an output can do with cameras and render settings; the defaults are those of a picture made of maps."""

    crops: bool = False
    """Whether Crop to Render Region is supported."""
    any_camera: bool = False
    """Whether the map is looked up by direction, so that the camera's lens does not matter."""
    blurs: bool = True
    """Whether motion blur of camera or hole makes no wrong picture, at most a sharp one; else it is refused."""


PLAIN = Traits()


@dataclass(frozen=True)
class FrameSetup:
    """Everything that makes the maps of one frame."""

    frame: int
    hole_name: str
    parameters: physics.WarpMapParameters
    length_of_m: float
    """Scene units."""
    shift: tuple[float, float]
    """Lens shift of the camera as Blender has it."""
    aperture: float
    """Radius of the camera's aperture, scene units, 0 without depth of field: Cycles' for any but custom cameras."""

    motion: Motion = Motion.NONE
    """What camera and hole do while the shutter is open; none without motion blur."""

    @property
    def distance(self) -> float:
        """Distance of the camera from the hole's center, in units of M."""
        return float(np.linalg.norm(self.parameters.camera_position))


@dataclass(frozen=True)
class Pose:
    """Where an object is (scene units), its axes (columns, a rotation) and its uniform scale."""

    position: Vector
    rotation: Matrix
    scale: float


# --- hole -----------------------------------------------------------------------------------------


def holes(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """All black holes of a scene, by name."""
    found = [each for each in scene.objects if each.umbra.is_black_hole]
    return sorted(found, key=lambda each: each.name)


def find_active_hole(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The hole that is rendered: the chosen one while it is there, or the only one; None where there is neither."""
    chosen = scene.umbra.active_hole
    if chosen is not None and chosen.umbra.is_black_hole and scene in chosen.users_scene:
        return chosen
    found = holes(scene)
    return found[0] if len(found) == 1 else None


def active_hole(scene: bpy.types.Scene) -> bpy.types.Object:
    """The hole that is rendered.

    Raises
    ------
    SceneError
        There is none, or it was deleted, or is in a collection instance, or there are several and none is chosen.
    """
    hole = find_active_hole(scene)
    if hole is not None:
        return hole
    if not holes(scene):
        instanced_hole.check(scene)
    chosen = scene.umbra.active_hole
    if chosen is not None:
        raise SceneError(
            f'The black hole "{chosen.name}" is no longer in scene "{scene.name}": choose another one in the '
            "Umbra panel, add one with Add > Black Hole, or take the compositor set-up out with Remove from "
            "Compositor.",
            code="hole.gone",
        )
    if holes(scene):
        raise SceneError(
            f'Scene "{scene.name}" contains several black holes: choose in the Umbra panel which one is rendered.',
            code="hole.several",
        )
    raise SceneError(
        f'Scene "{scene.name}" contains no black hole: add one with Add > Black Hole, or take the compositor '
        "set-up out with Remove from Compositor.",
        code="hole.none",
    )


def _check_evaluated(hole: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> None:
    """Refuse a hole whose animation Blender does not evaluate here: it would stand still, without a word."""
    rendering = depsgraph.mode == "RENDER"
    if hole.hide_render if rendering else hole.hide_viewport:
        where = "renders" if rendering else "viewports"
        raise SceneError(
            f'The black hole "{hole.name}" is disabled in {where}, so Blender does not move it: enable it in '
            "the Outliner, or take the compositor set-up out with Remove from Compositor.",
            code="hole.disabled",
        )
    layer = depsgraph.view_layer
    if layer.objects.get(hole.name) is None:
        raise SceneError(
            f'The black hole "{hole.name}" is in a collection that view layer "{layer.name}" excludes, so '
            "Blender does not move it: include that collection.",
            code="hole.excluded",
        )
    if not is_enabled(hole, layer.layer_collection, "hide_render" if rendering else "hide_viewport"):
        where = "renders" if rendering else "viewports"
        raise SceneError(
            f'The black hole "{hole.name}" is in a collection that is disabled in {where}, so Blender does not move '
            "it: enable that collection in the Outliner.",
            code="hole.disabled",
        )


# --- places ---------------------------------------------------------------------------------------


def pose(evaluated: bpy.types.Object, what: str, *, keep_scale: bool) -> Pose:
    """Place, axes and scale of an evaluated object, parents and constraints included.

    Parameters
    ----------
    evaluated : Object
        The object as a dependency graph evaluated it.
    what : str
        How a message names it.
    keep_scale : bool
        True where the scale means something (the hole: it must be uniform), False where it does not.

    Raises
    ------
    SceneError
        The axes are not a rotation times a scale: non-uniform, sheared, mirrored or zero.
    """
    matrix = np.array(evaluated.matrix_world, dtype=np.float64)
    lengths = rotations.length(matrix[:3, :3])
    if not np.all(np.isfinite(matrix)):
        raise SceneError(
            f'{what} "{evaluated.name}" is at a place, or of a size, that is not a number: mend its location, rotation '
            "and scale, and those of its parents.",
            code="hole.not-finite",
        )
    if lengths.min() <= 0.0:
        raise SceneError(
            f'{what} "{evaluated.name}" has a scale of zero: set its scale to a positive number.',
            code="hole.scale-zero",
        )
    if keep_scale and lengths.max() - lengths.min() > MATRIX_TOLERANCE * lengths.max():
        raise SceneError(
            f'{what} "{evaluated.name}" has a different scale along x, y and z: make all three the same (its '
            "parents' scales count too).",
            code="hole.scale-uneven",
        )
    axes = matrix[:3, :3] / lengths
    if np.abs(rotations.times(axes.T, axes) - np.eye(3)).max() > MATRIX_TOLERANCE:
        raise SceneError(
            f'{what} "{evaluated.name}" is sheared by the non-uniform scale of a parent: make that scale uniform.',
            code="hole.scale-uneven",
        )
    if rotations.determinant(axes) < 0.0:
        raise SceneError(
            f'{what} "{evaluated.name}" is mirrored by a negative scale: make its scale positive.',
            code="hole.scale-negative",
        )
    scale = float(lengths[0] + lengths[1] + lengths[2]) / 3.0
    return Pose(matrix[:3, 3], rotations.nearest_rotation(axes), scale)  # free of float32's rounding


def camera_velocity(
    scene: bpy.types.Scene, hole: bpy.types.Object, camera: bpy.types.Object, view_layer: bpy.types.ViewLayer
) -> Vector:
    """Velocity of the camera relative to the hole's center at the current frame, scene units a second.

    Along the scene's world axes, which are those of the stars: a hole that turns does not move the camera.

    Central differences over one frame and over two, extrapolated to none (Richardson). On a circle that takes n frames
    the error is (2 pi / n)^4 / 480 of the speed, 1e-5 for n = 24; over one frame alone it would be 0.3 %. Steps shorter
    than a frame would take a motion in steps of whole frames for a leap. Where a leap lies within the two frames, the
    one frame counts alone.
    """
    frame = scene.frame_current
    rate = scene.render.fps / scene.render.fps_base

    def separation(whole: int, part: float) -> Vector:
        scene.frame_set(whole, subframe=part)
        depsgraph = view_layer.depsgraph
        places = [np.array(each.evaluated_get(depsgraph).matrix_world.translation) for each in (camera, hole)]
        difference: Vector = np.subtract(places[0], places[1], dtype=np.float64)
        return difference

    with frame_kept(scene):
        earlier, early = separation(frame - 1, 0.0), separation(frame - 1, 0.5)
        late, later = separation(frame, 0.5), separation(frame + 1, 0.0)
    over_one, over_two = late - early, 0.5 * (later - earlier)
    change = over_one - over_two
    largest = max(np.linalg.norm(over_one), np.linalg.norm(over_two))
    is_smooth = np.linalg.norm(change) < LEAP * largest
    velocity: Vector = (over_one + change / 3.0 if is_smooth else over_one) * rate
    return velocity


def _local_velocity(
    spin: float, position: Row, velocity: Row, frame: int, camera: bpy.types.Object
) -> tuple[float, float, float]:
    """Return the camera's velocity as the local FIDO measures it, or refuse one that is impossible.

    Parameters
    ----------
    spin : float
        The hole's.
    position, velocity : tuple of float, shape (3,)
        In the hole's frame, units of M and of c.
    frame : int
        For the message.
    camera : Object
        For the message.

    Raises
    ------
    SceneError
        If it is not slower than light.
    """
    local = physics.local_velocity(spin, position, velocity)
    speed = float(np.linalg.norm(local))
    if speed < 1.0:
        return local
    r = float(np.linalg.norm(position))
    limit = physics.ergosphere_radius(spin, float(np.arctan2(np.hypot(*position[:2]), position[2])))
    if r <= limit:
        raise SceneError(
            f'Frame {frame}: camera "{camera.name}" is inside the ergosphere (at {r:.4g} M; here it reaches to '
            f"{limit:.4g} M), where everything must turn with the hole, and its animation does not carry it round at a "
            "possible speed; move it out, or choose another Camera Motion.",
            code="camera.ergosphere",
        )
    raise SceneError(
        f'Frame {frame}: camera "{camera.name}" moves at {speed:.3g} times the speed of light, as it is measured at '
        "its place beside the hole; slow its animation down, or raise the black hole's Speed of Light.",
        code="camera.too-fast",
    )


# --- camera ---------------------------------------------------------------------------------------


def render_size(render: bpy.types.RenderSettings) -> tuple[int, int]:
    """Width and height of the picture that is rendered now, in pixels (the resolution percentage counts)."""
    percentage = render.resolution_percentage
    return (
        max(render.resolution_x * percentage // 100, 1),
        max(render.resolution_y * percentage // 100, 1),
    )


def check_render(render: bpy.types.RenderSettings, traits: Traits = PLAIN) -> None:
    """Refuse render settings for which the map would not fit the picture.

    Raises
    ------
    SceneError
        Crop to Render Region, or Stereoscopy.
    """
    if render.use_border and render.use_crop_to_border and not traits.crops:
        raise SceneError(
            "Crop to Render Region is not supported with a black hole in the compositor: switch it off in Output "
            "Properties > Format (the render region itself works), or choose Output: Cycles Lens.",
            code="camera.crop",
        )
    if render.use_multiview:
        raise SceneError(
            "Stereoscopy is not supported with a black hole: switch it off in Output Properties, or render "
            "each eye as a camera of its own.",
            code="camera.stereo",
        )


def _panorama_setting(camera: bpy.types.Camera, name: str) -> Any:
    """A panorama setting, which Cycles kept for itself before Blender took it over."""
    owner = camera if hasattr(camera, name) else camera.cycles
    return getattr(owner, name)


def active_camera(scene: bpy.types.Scene) -> bpy.types.Object:
    """Return the scene's camera.

    Raises
    ------
    SceneError
        If there is none.
    """
    camera = scene.camera
    if camera is None or camera.type != "CAMERA":
        raise SceneError(
            f'Scene "{scene.name}" has no camera: add one, or choose one in Scene Properties > Scene.',
            code="camera.none",
        )
    return camera


def camera_model(
    camera: bpy.types.Camera, render: bpy.types.RenderSettings, engine: str, traits: Traits = PLAIN
) -> "physics.PerspectiveCamera | physics.PanoramaCamera":
    """Return the physics' camera for a Blender camera's (evaluated) settings.

    Raises
    ------
    SceneError
        An orthographic or custom camera, a panorama other than equirectangular, or one outside Cycles.
    """
    width, height = render_size(render)
    kind_of_lens = original_type(camera)
    if traits.any_camera and kind_of_lens != "ORTHO":
        return physics.PanoramaCamera(width, height)  # the World is looked up by direction, whatever the lens
    if kind_of_lens == "PERSP":
        return physics.PerspectiveCamera(
            width,
            height,
            focal_length=camera.lens,
            sensor_width=camera.sensor_width,
            sensor_height=camera.sensor_height,
            sensor_fit=camera.sensor_fit,
            shift_x=camera.shift_x,
            shift_y=camera.shift_y,
            pixel_aspect_x=render.pixel_aspect_x,
            pixel_aspect_y=render.pixel_aspect_y,
        )
    if kind_of_lens == "PANO":
        kind = _panorama_setting(camera, "panorama_type")
        if kind != "EQUIRECTANGULAR":
            raise SceneError(
                f'Camera "{camera.name}" is a panorama of type {str(kind).replace("_", " ").title()}: only '
                "Equirectangular panoramas can show a black hole; choose that, or a perspective camera.",
                code="camera.type",
            )
        if engine != "CYCLES":
            raise SceneError(
                f'Camera "{camera.name}" is a panorama, which only Cycles renders: choose Cycles, or a '
                "perspective camera.",
                code="camera.panorama-engine",
            )
        limits = ("latitude_min", "latitude_max", "longitude_min", "longitude_max")
        return physics.PanoramaCamera(width, height, **{name: _panorama_setting(camera, name) for name in limits})
    if kind_of_lens == "ORTHO":
        raise SceneError(
            f'Camera "{camera.name}" is orthographic: a black hole needs a place to be seen from; make the '
            "camera perspective.",
            code="camera.orthographic",
        )
    raise SceneError(
        f'Camera "{camera.name}" is of type {camera.type.title()}, which cannot show a black hole: make it '
        "perspective or an equirectangular panorama.",
        code="camera.type",
    )


def _aperture(camera: bpy.types.Camera) -> float:
    if not camera.dof.use_dof:
        return 0.0
    return camera.lens * 1e-3 / (2.0 * max(camera.dof.aperture_fstop, 1e-5))


def _motion(
    scene: bpy.types.Scene,
    objects: tuple[bpy.types.Object, bpy.types.Object],
    depsgraph: bpy.types.Depsgraph,
    measured: bool,
    traits: Traits,
) -> Motion:
    """Return what camera and hole do within the frame, or refuse it for an output that would draw it wrong.

    Raises
    ------
    SceneError
        Motion blur is on, and the camera or the hole moves.
    """
    found = Motion.NONE
    for each in objects if shutter.is_blurred(scene) else ():
        motion = shutter.motion_of(scene, each)
        if motion is not Motion.NONE and measured and not traits.blurs:
            layer = scene.view_layers.get(depsgraph.view_layer.name) or scene.view_layers[0]
            motion = Motion.MOVES if shutter.moves(scene, each, layer) else Motion.NONE
        if motion is Motion.MOVES and not traits.blurs:
            raise SceneError(
                f'Motion Blur is on, and "{each.name}" moves while the shutter is open, which the bent rays cannot '
                "follow: switch Motion Blur off in Render Properties, or choose Output: Compositor.",
                code="lens.motion-blur",
            )
        found = found if motion is Motion.NONE or found is Motion.MOVES else motion
    return found


# --- all together ---------------------------------------------------------------------------------


def _row(vector: Vector) -> Row:
    x, y, z = (float(value) for value in vector)
    return x, y, z


def _rows(matrix: Matrix) -> Rows:
    first, second, third = (_row(row) for row in matrix)
    return first, second, third


def read(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    measured: bool = True,
    traits: Traits = PLAIN,
) -> FrameSetup:
    """Return the setup of the frame at which the dependency graph stands.

    Parameters
    ----------
    scene : Scene
        The (original) scene.
    depsgraph : Depsgraph
        Evaluated at the frame; of a render, or of a viewport.
    measured : bool
        Whether the camera's velocity is measured for the motion Camera Animation, which steps the scene to the frames
        beside this one. Otherwise the camera counts as carried by space there.
    traits : Traits
        What the scene's output can do.

    Raises
    ------
    physics.BlackHoleError
        Whatever makes the frame impossible, as one sentence for the artist.
    """
    image_library.check()
    check_render(scene.render, traits)
    hole = active_hole(scene)
    _check_evaluated(hole, depsgraph)
    camera = active_camera(scene)
    drivers.check(scene, scene.frame_current, depsgraph, ("umbra.", "render."))
    drivers.check_objects((hole, camera), scene.frame_current, depsgraph)

    evaluated_hole = hole.evaluated_get(depsgraph)
    evaluated_camera = camera.evaluated_get(depsgraph)
    hole_settings = evaluated_hole.umbra
    hole_pose = pose(evaluated_hole, "The black hole", keep_scale=True)
    camera_pose = pose(evaluated_camera, "The camera", keep_scale=False)
    world_to_hole = hole_pose.rotation.T
    length_of_m = hole_settings.mass_scale * hole_pose.scale

    spin = float(hole_settings.spin)
    position = _row(rotations.times(world_to_hole, camera_pose.position - hole_pose.position) / length_of_m)
    velocity = (0.0, 0.0, 0.0)
    if hole_settings.motion == CAMERA_ANIMATION and measured:
        layer = scene.view_layers.get(depsgraph.view_layer.name) or scene.view_layers[0]
        seen = (
            rotations.times(world_to_hole, camera_velocity(scene, hole, camera, layer)) / hole_settings.speed_of_light
        )
        velocity = _local_velocity(spin, position, _row(seen), scene.frame_current, camera)

    settings = scene.umbra
    tolerance, interpolation = tolerances_of(settings)
    parameters = physics.WarpMapParameters(
        spin=spin,
        camera=camera_model(evaluated_camera.data, scene.render, scene.render.engine, traits),
        camera_position=position,
        camera_to_hole=_rows(rotations.times(world_to_hole, camera_pose.rotation)),
        hole_to_world=_rows(hole_pose.rotation),
        motion=MOTIONS[hole_settings.motion],
        velocity=velocity,
        supersampling=int(settings.supersampling),
        tolerance=tolerance,
        method=settings.method,
        interpolation=interpolation,
        disk=disk_of(hole_settings.disk),
    )
    parameters.validate()
    motion = _motion(scene, (camera, hole), depsgraph, measured, traits)
    data = evaluated_camera.data
    shift = (data.shift_x, data.shift_y)
    return FrameSetup(scene.frame_current, hole.name, parameters, length_of_m, shift, _aperture(data), motion)


def read_at(
    scene: bpy.types.Scene, frame: int, view_layer: bpy.types.ViewLayer | None = None, traits: Traits = PLAIN
) -> FrameSetup:
    """Return the setup of any frame; the scene is back at its current frame afterwards.

    Parameters
    ----------
    scene : Scene
        The scene.
    frame : int
        The frame to read.
    view_layer : ViewLayer, optional
        The layer whose objects count; the first that is rendered by default.
    traits : Traits
        What the scene's output can do.

    Raises
    ------
    physics.BlackHoleError
        See `read`.
    """
    layer = view_layer or next((each for each in scene.view_layers if each.use), scene.view_layers[0])
    with frame_kept(scene):
        scene.frame_set(frame)
        return read(scene, layer.depsgraph, traits=traits)


def frames_of(scene: bpy.types.Scene) -> range:
    """Return the frames that rendering the scene's animation renders."""
    return range(scene.frame_start, scene.frame_end + 1, max(scene.frame_step, 1))


def depsgraph_of(scene: bpy.types.Scene) -> bpy.types.Depsgraph:
    """Return the dependency graph of the scene's view layer, up to date."""
    context = bpy.context
    layer = context.view_layer if context.scene == scene and context.view_layer else scene.view_layers[0]
    layer.update()
    return layer.depsgraph
