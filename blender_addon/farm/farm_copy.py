# SPDX-License-Identifier: GPL-3.0-or-later
"""A copy of the .blend file that renders each of its frames alike in a Blender without this add-on.

Maps are image sequences and need no copy. What the add-on itself carries into each frame does: the parameters of the
lens, and the disk's settings where they are animated. The copy has them as keyframes, one a frame. In the copy the lens
traces its rays itself (as with Rays: No Bake), because the name of an exit map cannot be a keyframe.
"""

from collections import defaultdict
from collections.abc import Generator, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import bpy

from ..bake.names import FARM_FRAMES, FARM_SUFFIX
from ..core.errors import SceneError
from ..outputs import frames as frame_maps
from ..outputs import registry
from ..outputs.protocol import FrameCarrier, Track
from ..outputs.shared import disk_light
from ..scene import frame_setup
from . import catalog_copy

# What is animated, and its values by frame.
Tracks = dict[Track, dict[int, float]]

_ADDON = "umbra."  # the paths of this add-on's settings begin so


def path_beside(blend: Path) -> Path:
    """Where the copy of a file lies: beside it, so that relative paths hold."""
    return blend.with_name(f"{blend.stem}{FARM_SUFFIX}.blend")


def frames_of(scene: bpy.types.Scene) -> range:
    """Return the scene's frames, those between steps too: a farm's chunks have no steps."""
    return range(scene.frame_start, scene.frame_end + 1)


def save(scene: bpy.types.Scene, frames: range) -> Generator[float, None, Path]:
    """Write the copy for some frames; the open file stays as it is.

    A generator that yields the share of the work that is done, with the scene at some frame, and returns where the copy
    is. Nothing else may change the file meanwhile. Closing it cancels the work.

    Raises
    ------
    physics.BlackHoleError
        The file is not saved yet, a frame cannot be rendered, or a driver cannot be written as keyframes.
    """
    if not bpy.data.filepath:
        raise SceneError("This file is not saved yet: save it, then save its farm copy.", code="farm.not-saved")
    hole = frame_setup.active_hole(scene)
    if disk_light.find(hole) is not None and _has_animated_settings(hole):
        raise SceneError(
            f'The disk of "{hole.name}" lights the scene, and its settings are animated, which a mesh cannot follow '
            "without the add-on: switch Light the Scene off, or render with the add-on.",
            code="farm.lighting-disk",
        )
    path = path_beside(Path(bpy.data.filepath))
    if FARM_FRAMES in scene:
        raise SceneError(
            "This file is a farm copy already: open the file that it was made from.", code="farm.copy-of-copy"
        )
    drivers = list(_drivers_of_settings())
    carrier = registry.of(scene).carrier(scene)
    tracks = yield from _read(scene, frames, drivers, carrier)
    with catalog_copy.brought_along(scene, path), _written(scene, frames, tracks, carrier, drivers):
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, check_existing=False)
        except RuntimeError as error:
            raise SceneError(
                f"The farm copy {path} cannot be written ({str(error).strip()}).", code="farm.not-written"
            ) from error
    return path


def needs_copy(scene: bpy.types.Scene) -> bool:
    """Whether the scene's frames would be wrong without the add-on, but for those of such a copy."""
    if FARM_FRAMES in scene:
        return False
    return registry.of(scene).carrier(scene) is not None or any(True for _each in _drivers_of_settings())


# --- reading --------------------------------------------------------------------------------------


def _read(
    scene: bpy.types.Scene,
    frames: range,
    drivers: list[tuple[bpy.types.ID, bpy.types.FCurve]],
    carrier: FrameCarrier | None,
) -> Generator[float, None, Tracks]:
    """All values that change, by frame."""
    tracks: Tracks = defaultdict(dict)
    layer = next((each for each in scene.view_layers if each.use), scene.view_layers[0])
    current = scene.frame_current
    try:
        for done, frame in enumerate(frames if drivers or carrier is not None else ()):
            yield done / len(frames)
            scene.frame_set(frame)
            for owner, curve in drivers:
                tracks[owner, curve.data_path, curve.array_index][frame] = _source_value(owner, curve)
            if carrier is not None:
                for track, value in carrier.read(frame_maps.read(scene, layer.depsgraph)).items():
                    tracks[track][frame] = value
    finally:
        scene.frame_set(current)
    return {track: values for track, values in tracks.items() if len(set(values.values())) > 1}


def _drivers_of_settings() -> Iterator[tuple[bpy.types.ID, bpy.types.FCurve]]:
    """The drivers that read this add-on's settings, and what they belong to."""
    for group in bpy.data.bl_rna.properties:
        if group.type != "COLLECTION":
            continue
        for block in getattr(bpy.data, group.identifier):
            tree: bpy.types.ID | None = getattr(block, "node_tree", None)
            for owner in (block,) if tree is None else (block, tree):
                animation = getattr(owner, "animation_data", None)
                for curve in animation.drivers if animation is not None else ():
                    targets = [target for each in curve.driver.variables for target in each.targets]
                    if any(target.id is not None and target.data_path.startswith(_ADDON) for target in targets):
                        yield owner, curve


def _has_animated_settings(hole: bpy.types.Object) -> bool:
    animation = hole.animation_data
    if animation is None:
        return False
    bags = [] if animation.action is None else _channelbags(animation.action)
    curves = [*animation.drivers, *(curve for bag in bags for curve in bag.fcurves)]
    return any(curve.data_path.startswith(_ADDON) for curve in curves)


def _channelbags(action: bpy.types.Action) -> list[bpy.types.ActionChannelbag]:
    return [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]


def _source_value(owner: bpy.types.ID, curve: bpy.types.FCurve) -> float:
    variables = curve.driver.variables
    plain = curve.driver.type in {"SUM", "AVERAGE"} or curve.driver.expression.strip() == variables[0].name
    target = variables[0].targets[0]
    if len(variables) != 1 or variables[0].type != "SINGLE_PROP" or not plain or target.id is None:
        raise SceneError(
            f'The driver of "{owner.name}", {curve.data_path}, works with settings of the black hole, which a Blender '
            "without the add-on does not know: replace it by keyframes.",
            code="farm.driver",
        )
    return float(target.id.path_resolve(target.data_path))


# --- writing --------------------------------------------------------------------------------------


@contextmanager
def _written(
    scene: bpy.types.Scene,
    frames: range,
    tracks: Tracks,
    carrier: FrameCarrier | None,
    drivers: list[tuple[bpy.types.ID, bpy.types.FCurve]],
) -> Iterator[None]:
    """Have all that in the open file while it is saved, and nothing of it afterwards."""
    muted = [curve for _owner, curve in drivers if not curve.mute]
    device = getattr(scene.render, "compositor_device", None)
    made = []
    try:
        scene[FARM_FRAMES] = [frames[0], frames[-1]]
        if device is not None:
            scene.render.compositor_device = "CPU"  # without a display there is usually no OpenGL
        for curve in muted:
            curve.mute = True
        with nullcontext() if carrier is None else carrier.held():
            try:
                for track, values in tracks.items():
                    made.append(_Curve(track, values))
                yield
            finally:
                for each in reversed(made):
                    each.remove()
    finally:
        for curve in muted:
            curve.mute = False
        if device is not None:
            scene.render.compositor_device = device
        del scene[FARM_FRAMES]


class _Curve:
    """An animation curve with a keyframe a frame, held until the next, that can be taken out again."""

    def __init__(self, track: Track, values: dict[int, float]) -> None:
        self.owner, path, index = track
        self.had_animation = self.owner.animation_data is not None
        animation = self.owner.animation_data_create()
        self.action = animation.action or bpy.data.actions.new(f"Umbra Farm {self.owner.name}")
        self.is_new = animation.action is None
        if self.is_new:
            animation.action = self.action
        self.curve = self.action.fcurve_ensure_for_datablock(self.owner, path, index=index)
        if len(self.curve.keyframe_points):
            raise SceneError(
                f'"{self.owner.name}" has keyframes of its own on {path}, which the black hole writes: remove them.',
                code="farm.own-keyframes",
            )
        points = self.curve.keyframe_points
        points.add(len(values))
        points.foreach_set("co", [number for pair in values.items() for number in pair])
        points.foreach_set("interpolation", [0] * len(values))  # constant
        self.curve.update()

    def remove(self) -> None:
        """Take the curve out, and with it the action that was made for it."""
        if not self.is_new:
            for bag in _channelbags(self.action):
                if self.curve in bag.fcurves.values():
                    bag.fcurves.remove(self.curve)
            return
        self.owner.animation_data_create().action = None
        bpy.data.actions.remove(self.action)
        if not self.had_animation:
            self.owner.animation_data_clear()
