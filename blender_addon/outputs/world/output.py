# SPDX-License-Identifier: GPL-3.0-or-later
"""Output: World, as the rest of the add-on knows it."""

from collections.abc import Callable

import bpy

from ...bake.kinds import WORLD_MAP
from ...bake.request import MapRequest, request
from ...core.errors import SceneError
from ...core.physics_api import physics
from ...nodes import world_group
from ...scene.camera_type import check_unbent
from ...scene.cameras import Traits
from ...scene.frame_setup import FrameSetup
from ...scene.shutter import Motion
from ...scene.sky import environment
from ..protocol import Look, Notice, Output, refusals
from ..shared import disk_sync, sequencer, world_files
from ..shared.look import CARRIED, EXPOSURE, PLACEMENT, look_of_group, write_to_group
from . import lensed_world, panel, world_disk_sync, world_sync
from .live import WorldLiveMap

ANOTHER_WORLD = 'Scene "{}" has the output World, but another World was chosen since: set Output: World again.'
MOTION_BLUR = "Motion Blur is on: the camera's turning blurs the World; its way past the hole, or the hole's, does not."
DISK_BEHIND = "The disk is a part of the World: it is behind all objects."
NOT_CHECKED = "Check Accuracy knows no world maps: choose Output: Compositor or Cycles Lens, and bake this frame."


class WorldOutput(Output):
    """The World is looked up along bent rays."""

    identifier = "WORLD"
    number = 2
    label = "World"
    description = "The World itself is bent: in the viewport too, in Cycles and EEVEE, with its light and reflections"
    traits = Traits(crops=True, any_camera=True)
    settings_label = "World"
    follows_preview = True
    live = WorldLiveMap()

    # --- setting a scene up -----------------------------------------------------------------------

    def check(self, scene: bpy.types.Scene) -> None:
        """Refuse a scene without a sky that could be lensed."""
        lensed_world.check(scene)

    def install(self, scene: bpy.types.Scene, look: Look) -> list[str]:
        """Give the scene a lensed copy of its World; the artist's own values stay in one that is there."""
        is_new = lensed_world.lensed_world(scene) is None
        has_taken = environment.take_world(scene)
        try:
            node = lensed_world.install(scene)
        except SceneError:
            if has_taken:
                environment.leave_world(scene, scene.umbra.environment_image)
            raise
        if has_taken:  # what the stars were brightened by
            look = look | {EXPOSURE: 0.0}
        if is_new:
            write_to_group(node, {name: value for name, value in look.items() if name in CARRIED})
            if PLACEMENT["Rotation"] in look:
                lensed_world.place(scene, look[PLACEMENT["Rotation"]], look.get(PLACEMENT["Strength"], 1.0))
        return lensed_world.unbent(scene)

    def remove(self, scene: bpy.types.Scene) -> None:
        """Put the World back that was there."""
        lensed_world.remove(scene)

    def look(self, scene: bpy.types.Scene) -> Look:
        """Return the values of the group's inputs, and how the sky's image is placed."""
        node = self.look_node(scene)
        inputs = {} if node is None else look_of_group(node)
        placed = {PLACEMENT[name]: value for name, value in lensed_world.placement(scene).items()}
        return {name: value for name, value in (inputs | placed).items() if name in CARRIED}

    def marks(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene has a World to put back."""
        return lensed_world.IS_BENT in scene

    def refresh(self, scene: bpy.types.Scene) -> None:
        """Carry the scene's settings into the lensed World."""
        if scene.library is None:
            world_sync.refresh(scene)
            world_disk_sync.refresh(scene)

    def refresh_disk(self, scene: bpy.types.Scene) -> None:
        """Put the disk into the lensed World, bring it up to date, or take it out."""
        if scene.library is None:
            world_disk_sync.refresh(scene)

    # --- rendering --------------------------------------------------------------------------------

    def is_in_use(self, scene: bpy.types.Scene) -> bool:
        """Return True: the World is in every picture."""
        return True

    def map_requests(self, scene: bpy.types.Scene, frame: FrameSetup) -> list[MapRequest]:
        """Return the frame's world map, and its layer of light for all directions if it has a disk."""
        needed = [request(scene, frame, WORLD_MAP, physics.world_map_parameters(frame.parameters))]
        light = world_disk_sync.request_of(scene, frame)
        return needed if light is None else [*needed, light]

    def request_to_check(self, scene: bpy.types.Scene, frame: FrameSetup) -> MapRequest:
        """Refuse: world maps have no pixels of a picture."""
        raise SceneError(NOT_CHECKED, code="map.not-checkable")

    def take_away(self, scene: bpy.types.Scene) -> None:
        """Let the World read no map, and refuse one that is not the lensed one any more."""
        world_sync.point_at_nothing(scene)
        world_disk_sync.point_at_nothing(scene)
        sequencer.check(scene)
        check_unbent(scene)
        check_world(scene)

    def point_at(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> list[str]:
        """Let the World read the frame's map."""
        wanted, *others = self.map_requests(scene, frame)
        world_files.check(scene)
        _check_resolved(wanted, frame)
        world_sync.point_at_files(scene)
        world_sync.forget_loaded_map(scene)
        warnings = _warnings(scene)
        for light in others:
            world_disk_sync.point_at_files(scene)
            world_disk_sync.forget_loaded_layer(scene)
            warnings += disk_sync.unresolved(light)
        return warnings

    def stand_aside(self, scene: bpy.types.Scene) -> Callable[[], None]:
        """Let the scene have its own World."""
        lensed, scene.world = scene.world, scene.get(lensed_world.BEFORE)

        def undo() -> None:
            scene.world = lensed

        return undo

    # --- files ------------------------------------------------------------------------------------

    def point_at_files(self, scene: bpy.types.Scene) -> None:
        """Let the World read the maps of the settings that are saved."""
        if scene.library is None:
            world_sync.point_at_files(scene)
            world_disk_sync.point_at_files(scene)

    def forget_loaded_maps(self, scene: bpy.types.Scene) -> None:
        """Let Blender read the maps from their files again."""
        world_sync.forget_loaded_map(scene)
        world_disk_sync.forget_loaded_layer(scene)

    # --- the panel --------------------------------------------------------------------------------

    def look_node(self, scene: bpy.types.Scene) -> bpy.types.Node | None:
        """Return the node of the group in the lensed World."""
        return lensed_world.group_node(lensed_world.lensed_world(scene))

    def notices(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> list[Notice]:
        """Say what hides the World."""
        found = refusals(scene, sequencer.check, check_unbent, check_world)
        found += [Notice(each) for each in lensed_world.unbent(scene)]
        if frame.motion is not Motion.NONE:
            found.append(Notice(MOTION_BLUR))
        if frame.light is not None:
            found.append(Notice(DISK_BEHIND))
        return found + [Notice(each, "ERROR") for each in _warnings(scene)]

    def draw_settings(self, layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
        """Draw the sky and the World's group."""
        panel.draw(layout, scene)


def check_world(scene: bpy.types.Scene) -> None:
    """Refuse a scene whose World is not the lensed one any more.

    Raises
    ------
    SceneError
        If another World was chosen, or a view layer has one of its own.
    """
    if lensed_world.lensed_world(scene) is None:
        raise SceneError(ANOTHER_WORLD.format(scene.name), code="sky.world-changed")
    node = lensed_world.group_node(scene.world)
    if node is not None:
        _check_used(scene, node)
    for layer in scene.view_layers:
        if layer.use and getattr(layer, "world_override", None) is not None:
            raise SceneError(
                f'View layer "{layer.name}" has a World Override, which hides the lensed World: clear it in View Layer '
                "Properties, or choose another output.",
                code="sky.world-override",
            )


def _check_used(scene: bpy.types.Scene, node: bpy.types.Node) -> None:
    needed = [node.outputs[each.name] for each in (world_group.VECTOR, world_group.SHIFT, world_group.LIGHT)]
    links = [link for socket in needed for link in socket.links]
    muted = node.mute or any(link.is_muted or link.to_node.mute for link in links)
    if muted or not all(socket.is_linked for socket in needed[1:]):
        raise SceneError(
            f'The node "{node.name}" in World "{scene.world.name if scene.world else ""}", or what it feeds, is muted '
            "or cut off: unmute it (M) and connect its Vector, Shift and Light again, or choose another output and "
            "then Output: World.",
            code="sky.group-cut",
        )


def _check_resolved(wanted: MapRequest, frame: FrameSetup) -> None:
    unresolved = wanted.kind.format.read_metadata(wanted.path)["counts"]["unresolved"]
    if unresolved:
        label = physics.METHODS[frame.parameters.method].label
        raise SceneError(
            f"Frame {frame.frame}: {unresolved} rays of the world map could not be resolved by the method "
            f'"{label}"; choose the method "Fast" in the Umbra panel, which resolves them.',
            code="map.unresolved",
        )


def _warnings(scene: bpy.types.Scene) -> list[str]:
    """What a render leaves out, in sentences."""
    found = []
    if scene.render.film_transparent:
        found.append("Film > Transparent is on: the camera does not see the World.")
    return found
