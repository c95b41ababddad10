# SPDX-License-Identifier: GPL-3.0-or-later
"""Output: Cycles Lens, as the rest of the add-on knows it."""

from collections.abc import Callable

import bpy

from ...bake.kinds import EXIT_MAP
from ...bake.request import MapRequest, request
from ...core import messages
from ...core.errors import SceneError
from ...core.session import SESSION, Life
from ...scene import cameras, frame_setup
from ...scene.camera_type import is_converted
from ...scene.frame_setup import FrameSetup
from ...scene.sky import environment
from ...settings.hole_properties import CAMERA_ANIMATION
from ..protocol import FrameCarrier, Look, Notice, Output, refusals
from ..shared import disk_sync, leaving, sequencer, world_files
from ..shared.compositor_tree import check_unmuted, find_tree
from ..shared.look import look_of_scene
from ..shared.tree_editing import check_shared
from . import foreground, lens_camera, lens_disk, lens_objects, lens_shader, lens_sky, lens_sync, lens_tree, panel
from .carrier import LensCarrier

# The device of a scene that is rendered on the CPU in place of a GPU, to be set back.
_devices = SESSION.per_scene(str, Life.FILE)

ANOTHER_SKY = (
    'World "{}" was chosen since, and is shown in place of the sky image; Sky: World and Image brings that back.'
)
NO_MAPS = "The lens traces its rays itself (Rays: No Bake): there is no map to check."


class LensOutput(Output):
    """The camera's own rays are bent by its shader."""

    identifier = "CYCLES_LENS"
    number = 1
    label = "Cycles Lens"
    description = "The camera's own rays are bent: objects, lights, volumes and World are all seen through the hole"
    traits = lens_sync.TRAITS
    engine = "CYCLES"
    settings_label = "Lens"

    # --- setting a scene up -----------------------------------------------------------------------

    def check(self, scene: bpy.types.Scene) -> None:
        """Refuse another engine than Cycles, a Cycles without OSL, and cameras that cannot be converted."""
        lens_sync.check(scene)
        tree = find_tree(scene)
        if tree is not None and disk_sync.wanted_hole(scene) is not None:
            check_shared(scene, tree)
        if scene.umbra.environment_source == "IMAGE" and scene.umbra.environment_image is not None:
            environment.chosen_image(scene)
        cameras.active_camera(scene)
        for camera in lens_camera.cameras_of(scene):
            lens_camera.check(camera)
        lens_shader.bytecode(uses_map=False)

    def install(self, scene: bpy.types.Scene, look: Look) -> list[str]:
        """Convert the scene's cameras, and put the sky of the settings behind them."""
        for camera in lens_camera.cameras_of(scene):
            lens_camera.convert(camera)
        environment.take_world(scene)
        lens_sky.install(scene, look)
        return []

    def remove(self, scene: bpy.types.Scene) -> None:
        """Make the cameras what they were, and take disk and foreground out of the compositor."""
        lens_disk.take_out(scene)
        foreground.remove(scene)
        for camera in lens_camera.cameras_of(scene):
            lens_camera.restore(camera)
        lens_sky.remove(scene)

    def look(self, scene: bpy.types.Scene) -> Look:
        """Return the scene's own settings, and those of the sky's image."""
        return look_of_scene(scene) | lens_sky.look(scene)

    def marks(self, scene: bpy.types.Scene) -> bool:
        """Return whether the compositor was left, and not for another output."""
        return leaving.is_left(scene)

    def refresh(self, scene: bpy.types.Scene) -> None:
        """Let the viewport see the scene as it stands, and the disk read the layers of the settings."""
        lens_sync.show_live(scene)
        try:
            lens_sky.refresh(scene)
            lens_disk.refresh(scene)
        except SceneError as error:
            messages.warn(error.for_user())

    def refresh_disk(self, scene: bpy.types.Scene) -> None:
        """Put the disk over the lens's picture, or take it out."""
        lens_disk.refresh(scene)

    # --- rendering --------------------------------------------------------------------------------

    def is_in_use(self, scene: bpy.types.Scene) -> bool:
        """Return True: the camera itself is the lens."""
        return True

    def uses_compositor(self, scene: bpy.types.Scene) -> bool:
        """Return whether disk or foreground are in the compositor."""
        return lens_tree.BEFORE in scene

    def needs_maps(self, scene: bpy.types.Scene) -> bool:
        """Return whether the lens looks its rays up, or its disk has layers."""
        return lens_sync.uses_maps(scene) or lens_disk.is_in_use(scene)

    def map_requests(self, scene: bpy.types.Scene, frame: FrameSetup) -> list[MapRequest]:
        """Return the frame's exit map, and the layer of light of its disk."""
        needed = [_exit_map(scene, frame)] if lens_sync.uses_maps(scene) else []
        light = lens_disk.request_of(scene, frame) if lens_disk.is_in_use(scene) else None
        return needed if light is None else [*needed, light]

    def request_to_check(self, scene: bpy.types.Scene, frame: FrameSetup) -> MapRequest:
        """Return the frame's exit map."""
        if not lens_sync.uses_maps(scene):
            raise SceneError(NO_MAPS, code="lens.no-maps")
        return _exit_map(scene, frame)

    def begin_render(self, scene: bpy.types.Scene) -> None:
        """Refuse what cannot be rendered; render on the CPU where the GPU cannot run the shader."""
        lens_sync.check(scene)
        problem = lens_shader.device_problem(scene)
        if problem is not None:
            if not scene.umbra.cpu_fallback:
                raise problem
            messages.warn(f"{problem} This render is made on the CPU.")
            _devices.put(scene, scene.cycles.device)
            scene.cycles.device = "CPU"

    def take_away(self, scene: bpy.types.Scene) -> None:
        """Let neither camera nor disk show anything."""
        lens_sync.break_camera(scene)
        lens_disk.point_at_nothing(scene)
        sequencer.check(scene)
        if lens_disk.is_in_use(scene):
            check_unmuted(scene)

    def point_at(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> list[str]:
        """Give the camera the frame's parameters and its map."""
        world_files.check(scene)
        warnings = lens_objects.warnings(scene, depsgraph, frame)
        if lens_disk.is_in_use(scene):
            lens_disk.point_at_layers(scene)
            light = lens_disk.request_of(scene, frame)
            warnings += [] if light is None else disk_sync.unresolved(light)
        if scene.umbra.foreground_scene is not None:
            camera = cameras.active_camera(scene).evaluated_get(depsgraph)
            foreground.copy_lens(scene.umbra.foreground_scene, camera.data)
        path = _exit_map(scene, frame).path if lens_sync.uses_maps(scene) else None
        lens_sync.show(scene, frame, path)
        return warnings

    def stand_aside(self, scene: bpy.types.Scene) -> Callable[[], None]:
        """Let the cameras and the World be what they were, and no disk be drawn."""
        shown = scene.world
        if lens_sky.world_of_image(scene) is not None:
            scene.world = scene.get(environment.WORLD_BEFORE)
        cameras = [each for each in lens_camera.cameras_of(scene) if is_converted(each)]
        for camera in cameras:
            lens_camera.restore(camera)
        link_back = lens_disk.stand_aside(scene)

        def undo() -> None:
            for camera in cameras:
                lens_camera.convert(camera)
            link_back()
            scene.world = shown

        return undo

    def end_render(self, scene: bpy.types.Scene, *, canceled: bool) -> None:
        """Let the viewport see the scene again, which needs no map."""
        if canceled:
            lens_disk.point_at_layers(scene)
        device = _devices.drop(scene)
        if device is not None:
            scene.cycles.device = device
        lens_sync.show_live(scene)

    def follow(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        """Let the viewport see the scene as it stands now."""
        lens_sync.show_live(scene, depsgraph)

    # --- files ------------------------------------------------------------------------------------

    def point_at_files(self, scene: bpy.types.Scene) -> None:
        """Let the disk read the layers of the settings that are saved."""
        lens_disk.point_at_layers(scene)

    def forget_loaded_maps(self, scene: bpy.types.Scene) -> None:
        """Let Blender read the layers from their files again."""
        lens_disk.point_at_layers(scene)
        lens_disk.forget_loaded_layers(scene)

    def carrier(self, scene: bpy.types.Scene) -> FrameCarrier | None:
        """Return what carries the camera's parameters into each frame."""
        return LensCarrier(scene)

    # --- the panel --------------------------------------------------------------------------------

    def notices(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> list[Notice]:
        """Say what the picture lacks."""
        if scene.render.engine != self.engine:
            return [Notice("The Cycles Lens needs the render engine Cycles.", "ERROR", "umbra.use_cycles")]
        found = refusals(scene, sequencer.check)
        problem = lens_shader.device_problem(scene)
        if problem is not None:
            found.append(Notice(problem.for_user(), "INFO" if scene.umbra.cpu_fallback else "ERROR"))
        hidden_by = lens_sky.hidden_by(scene)
        if hidden_by is not None:
            found.append(Notice(ANOTHER_SKY.format(hidden_by.name)))
        found += [Notice(each) for each in lens_objects.warnings(scene, depsgraph, frame)]
        if frame_setup.active_hole(scene).umbra.motion == CAMERA_ANIMATION:
            found.append(Notice("The viewport shows the lens without the camera's speed; a render has it."))
        return found

    def draw_settings(self, layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
        """Draw the lens's settings."""
        panel.draw(layout, scene)

    def brighten_stars(self, scene: bpy.types.Scene) -> None:
        """Brighten the star sky, unless the artist has set an exposure."""
        lens_sky.brighten_stars(scene)


def _exit_map(scene: bpy.types.Scene, frame: FrameSetup) -> MapRequest:
    return request(scene, frame, EXIT_MAP, lens_sync.exit_parameters(frame.parameters))
