# SPDX-License-Identifier: GPL-3.0-or-later
"""Read what a frame needs from Blender: hole, camera and render size become `physics.WarpMapParameters`.

Plain functions over evaluated data. Nothing here writes to the scene.
"""

from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..core import image_library
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..settings.disk_properties import disk_of, look_of
from ..settings.hole_properties import CAMERA_ANIMATION, MOTIONS
from ..settings.scene_properties import tolerances_of
from ..settings.typed import DiskSettings
from . import cameras, drivers, instanced_hole, rotations, shutter, velocity
from .disk_picture import picture_of
from .enabled import is_enabled
from .rotations import Matrix, Vector
from .shutter import Motion

# Object matrices are float32: axes may differ in length, and from right angles, by so much from
# rounding.
MATRIX_TOLERANCE = 1e-4

Row = tuple[float, float, float]
Rows = tuple[Row, Row, Row]


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

    light: "physics.LightParameters | None" = None
    """What the layer of light of the disk is made from, of the picture's own size; None without a disk."""

    motion: Motion = Motion.NONE
    """What camera and hole do while the shutter is open; none without motion blur."""
    star_settings: physics.StarSettings | None = None
    """How stars are drawn, the catalog's name excepted; None where they are not points."""

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


def _motion(
    scene: bpy.types.Scene,
    objects: tuple[bpy.types.Object, bpy.types.Object],
    depsgraph: bpy.types.Depsgraph,
    measured: bool,
    traits: cameras.Traits,
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
    traits: cameras.Traits = cameras.PLAIN,
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
    traits : cameras.Traits
        What the scene's output can do.

    Raises
    ------
    physics.BlackHoleError
        Whatever makes the frame impossible, as one sentence for the artist.
    """
    image_library.check()
    cameras.check_render(scene.render, traits)
    hole = active_hole(scene)
    _check_evaluated(hole, depsgraph)
    camera = cameras.active_camera(scene)
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
    beta = (0.0, 0.0, 0.0)
    if hole_settings.motion == CAMERA_ANIMATION and measured:
        layer = scene.view_layers.get(depsgraph.view_layer.name) or scene.view_layers[0]
        seen = (
            rotations.times(world_to_hole, velocity.camera_velocity(scene, hole, camera, layer))
            / hole_settings.speed_of_light
        )
        beta = velocity.local_velocity(spin, position, _row(seen), scene.frame_current, camera)

    settings = scene.umbra
    tolerance, interpolation = tolerances_of(settings)
    parameters = physics.WarpMapParameters(
        spin=spin,
        camera=cameras.camera_model(evaluated_camera.data, scene.render, scene.render.engine, traits),
        camera_position=position,
        camera_to_hole=_rows(rotations.times(world_to_hole, camera_pose.rotation)),
        hole_to_world=_rows(hole_pose.rotation),
        motion=MOTIONS[hole_settings.motion],
        velocity=beta,
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
    return FrameSetup(
        scene.frame_current,
        hole.name,
        parameters,
        length_of_m,
        shift,
        cameras.aperture(data),
        _light(scene, hole_settings.disk, parameters),
        motion,
    )


def _light(
    scene: bpy.types.Scene, disk: DiskSettings, parameters: "physics.WarpMapParameters"
) -> "physics.LightParameters | None":
    """Return what the frame's layer of light is made from; its time is that of the frame, at the disk's speed."""
    if parameters.disk is None:
        return None
    time = scene.frame_current_final * scene.render.fps_base / scene.render.fps * disk.turning_speed
    light = physics.LightParameters(replace(parameters, supersampling=1), look_of(disk), time, picture_of(disk))
    light.validate()
    return light


def frames_of(scene: bpy.types.Scene) -> range:
    """Return the frames that rendering the scene's animation renders."""
    return range(scene.frame_start, scene.frame_end + 1, max(scene.frame_step, 1))


def depsgraph_of(scene: bpy.types.Scene) -> bpy.types.Depsgraph:
    """Return the dependency graph of the scene's view layer, up to date."""
    context = bpy.context
    layer = context.view_layer if context.scene == scene and context.view_layer else scene.view_layers[0]
    layer.update()
    return layer.depsgraph
