# SPDX-License-Identifier: GPL-3.0-or-later
"""Output: Compositor, as the rest of the add-on knows it."""

from collections.abc import Callable
from dataclasses import replace

import bpy

from ...bake import star_sky
from ...bake.kinds import STAR_LAYER, WARP_MAP
from ...bake.request import MapRequest, request
from ...core import messages
from ...core.errors import SceneError
from ...core.physics_api import physics
from ...nodes import black_hole_group
from ...scene import frame_setup, instanced_hole
from ...scene.camera_type import check_unbent
from ...scene.frame_setup import FrameSetup
from ...scene.shutter import Motion
from ...scene.sky import environment, panorama, sky_frames
from ...settings.scene_properties import NEVER
from ..protocol import Look, Notice, Output, refusals
from ..shared import disk_sync, leaving, sequencer
from ..shared.compositor_tree import (
    check_linked,
    check_rendered,
    check_unmuted,
    find_setup,
    find_tree,
    is_in_use,
    takes_sky_from_settings,
)
from ..shared.look import look_of_group, write_to_group
from ..shared.tree_editing import check_shared
from . import compositing, compositor_sync, depth, disk, objects_behind, panel, sky_filter, stars
from .viewport import CompositorViewportMaps

NOT_SET_UP = "The compositor is not set up: a render shows no black hole."
MOTION_BLUR = "Motion Blur is on: where camera or hole move, objects are blurred; sky, shadow and disk stay sharp."
DEPTH_OF_FIELD = "Depth of Field is on: objects are blurred; sky, shadow and disk stay sharp."
NO_DEPTH = (
    "Hide Behind the Hole has no depth pass: connect the Image of a Render Layers node to Render of the node Umbra "
    "Black Hole, and press Update Compositor."
)


class CompositorOutput(Output):
    """The sky is bent behind the render by a node group."""

    identifier = "COMPOSITOR"
    number = 0
    label = "Compositor"
    description = "The sky is bent behind the render: every engine, and a new sky costs nothing"
    settings_label = "Sky"
    viewport = CompositorViewportMaps()

    # --- setting a scene up -----------------------------------------------------------------------

    def check(self, scene: bpy.types.Scene) -> None:
        """Refuse a compositor tree that is not the scene's alone."""
        tree = find_tree(scene)
        if tree is not None and leaving.is_left(scene):
            check_shared(scene, tree)

    def install(self, scene: bpy.types.Scene, look: Look) -> list[str]:
        """Set the compositor up again if it was when the scene left it."""
        if not leaving.give_back(scene):
            return []
        notes: list[str] = []
        is_left = False
        if scene.umbra.environment_source == "WORLD":
            try:
                environment.read_world(scene, may_render=True)
            except SceneError as error:
                is_left = error.code not in environment.NO_SKY
                if is_left:
                    notes = _leave_world(scene, error)
        notes += _prepare(scene) + compositing.set_up(scene)
        setup = find_setup(scene)
        if setup is not None:
            write_to_group(setup.group, look)
        if is_left:
            self.brighten_stars(scene)
        return notes

    def remove(self, scene: bpy.types.Scene) -> None:
        """Take the set-up out, and keep what is needed to put it back."""
        setup = find_setup(scene)
        look = {} if setup is None else look_of_group(setup.group)
        in_compositor = setup is not None or compositing.BEFORE in scene
        if in_compositor:
            compositing.remove(scene)
        leaving.keep(scene, look, in_compositor=in_compositor)

    def look(self, scene: bpy.types.Scene) -> Look:
        """Return the values of the group's inputs."""
        setup = find_setup(scene)
        return {} if setup is None else look_of_group(setup.group)

    def refresh(self, scene: bpy.types.Scene) -> None:
        """Carry the scene's settings into the set-up."""
        compositor_sync.refresh(scene)

    def refresh_disk(self, scene: bpy.types.Scene) -> None:
        """Carry the disk's settings into the set-up."""
        disk.refresh(scene)

    def set_up(self, scene: bpy.types.Scene) -> list[str]:
        """Put the black hole into the compositor, or bring it up to date there; return what the artist should know.

        A hole that came from another file, where no set-up is yet, is shown like one that was added.

        Raises
        ------
        SceneError
            If the scene has another output, or its compositor cannot be changed.
        """
        if scene.umbra.output != self.identifier:
            raise SceneError(
                "This scene's output is another one: choose Output: Compositor first.", code="compositor.other-output"
            )
        has_holes = bool(frame_setup.holes(scene))
        if not has_holes:
            instanced_hole.check(scene)
        if has_holes and find_setup(scene) is None:
            is_new_here = scene.umbra.active_hole is None
            if is_new_here:
                scene.umbra.active_hole = frame_setup.find_active_hole(scene)
            notes = self.on_hole_added(scene)
            if is_new_here:
                scene.umbra.hide_behind = True
            return notes
        star_sky.provide(scene, may_write=True)
        return _prepare(scene) + compositing.set_up(scene) + _alpha_note(scene)

    def can_be_removed(self, scene: bpy.types.Scene) -> bool:
        """Return whether anything of the set-up is in the compositor."""
        return find_setup(scene) is not None or compositing.BEFORE in scene

    def take_out(self, scene: bpy.types.Scene) -> None:
        """Take the black hole out of the compositor; the output stays.

        Raises
        ------
        SceneError
            If there is nothing to remove.
        """
        compositing.remove(scene)

    def on_hole_added(self, scene: bpy.types.Scene) -> list[str]:
        """Choose the star sky where the World has none that can be shown, and set the compositor up."""
        tree = find_tree(scene)
        if tree is not None:
            check_shared(scene, tree)
        settings = scene.umbra
        stars = find_setup(scene) is None and environment.shows_stars(scene)  # a new group has no exposure yet
        notes: list[str] = []
        if settings.environment_source == "WORLD":
            try:
                environment.read_world(scene, may_render=True)
            except SceneError as error:
                stars = settings.environment_image is None
                if error.code in environment.NO_SKY:
                    settings.environment_image = settings.environment_image or star_sky.load(scene)
                    settings.environment_source = "IMAGE"
                else:
                    notes = _leave_world(scene, error)
        notes += compositing.set_up(scene)
        if stars:
            self.brighten_stars(scene)
        return notes + _alpha_note(scene)

    def brighten_stars(self, scene: bpy.types.Scene) -> None:
        """Brighten the star sky, and let it glow, unless the artist has chosen otherwise."""
        if not scene.umbra.is_property_set("glare"):
            scene.umbra.glare = "SUBTLE"
        setup = find_setup(scene)
        exposure = None if setup is None else setup.group.inputs.get("Exposure")
        if exposure is not None and exposure.default_value == 0.0:
            exposure.default_value = environment.STAR_SKY_EXPOSURE

    def on_load(self, scene: bpy.types.Scene) -> None:
        """Bring a node group of an older version up to date; its sky is not filtered, and its stars are no points."""
        setup = find_setup(scene)
        if setup is not None and setup.tree.library is None:
            is_plain = black_hole_group.kind_of(setup.group.node_tree) == black_hole_group.group_of(0, 0)
            has_no_points = stars.SOCKET not in setup.group.inputs  # now: what is set below rebuilds the group
            if is_plain and not scene.umbra.is_property_set("sky_filter"):
                scene.umbra.sky_filter = "OFF"
            if has_no_points and not scene.umbra.is_property_set("stars"):
                scene.umbra.stars = NEVER
            compositor_sync.repair(scene)
            compositor_sync.refresh(scene)

    def prepare(self, scene: bpy.types.Scene) -> None:
        """Render the panorama of a World that is no plain image."""
        if find_setup(scene) is not None:
            for note in _prepare(scene):
                messages.warn(note)

    # --- rendering --------------------------------------------------------------------------------

    def is_in_use(self, scene: bpy.types.Scene) -> bool:
        """Return whether rendering the scene runs the group."""
        return is_in_use(scene)

    def uses_compositor(self, scene: bpy.types.Scene) -> bool:
        """Return True: the group is in the compositor."""
        return True

    def map_requests(self, scene: bpy.types.Scene, frame: FrameSetup) -> list[MapRequest]:
        """Return the frame's warp map, its disk's layer of light, and its layer of stars, as far as it has them."""
        view = frame.parameters if scene.umbra.disk_passes else replace(frame.parameters, disk=None)
        layers = (disk_sync.request_of(scene, frame), stars.request_of(scene, frame))
        return [request(scene, frame, WARP_MAP, view), *(each for each in layers if each is not None)]

    def complete(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> FrameSetup:
        """Add how the stars are drawn."""
        return replace(frame, star_settings=stars.settings_at(scene, depsgraph))

    def begin_render(self, scene: bpy.types.Scene) -> None:
        """Mend what was changed by hand inside the set-up; refuse what cannot be mended."""
        panorama.is_rendering.now = True
        if compositor_sync.repair(scene):
            messages.warn(
                f'the node group "{black_hole_group.GROUP_NAME}" was damaged or of another version, and is built anew.'
            )
        check_linked(scene)
        depth.refresh(scene)
        compositor_sync.refresh_stars(scene)
        compositor_sync.sync_sky(scene)
        self.prepare_files(scene, may_bake=scene.umbra.auto_bake)

    def prepare_files(self, scene: bpy.types.Scene, *, may_bake: bool) -> None:
        """Make the levels of the sky."""
        setup = find_setup(scene)
        if setup is not None and setup.sky is not None and not sky_frames.moves_at(setup.sky):
            sky_filter.ensure_files(scene, setup, may_bake=may_bake)

    def take_away(self, scene: bpy.types.Scene) -> None:
        """Let the group read no map, and refuse a compositor that could not show one."""
        compositor_sync.point_at_nothing(scene)
        sequencer.check(scene)
        check_unbent(scene)
        check_rendered(scene)
        check_linked(scene)
        check_unmuted(scene)

    def point_at(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> list[str]:
        """Let the group read the frame's map."""
        wanted, *others = self.map_requests(scene, frame)
        warnings = _unresolved(wanted, frame)
        for other in others:
            warnings += stars.unresolved(other) if other.kind is STAR_LAYER else disk_sync.unresolved(other)
        compositor_sync.check_frame(scene)
        compositor_sync.point_at_maps(scene)
        return warnings

    def stand_aside(self, scene: bpy.types.Scene) -> Callable[[], None]:
        """Let the film be as it was before the set-up: where it is not transparent, the group shows the render alone.

        Links and values of the compositor's nodes would change a frame too late.
        """
        film = scene.render.film_transparent
        scene.render.film_transparent = compositing.film_before(scene)
        compositor_sync.point_at_plain_map(scene)

        def undo() -> None:
            scene.render.film_transparent = film
            self.refresh(scene)

        return undo

    def end_render(self, scene: bpy.types.Scene, *, canceled: bool) -> None:
        """After a failure the map stays away.

        The window runs the compositor once more when the render is over, and an older map would then hide the magenta.
        """
        if canceled:
            self.refresh(scene)

    # --- files ------------------------------------------------------------------------------------

    def is_set_up(self, scene: bpy.types.Scene) -> bool:
        """Return whether the group is in the compositor."""
        return find_setup(scene) is not None

    def forget_loaded_maps(self, scene: bpy.types.Scene) -> None:
        """Let Blender read the maps from their files again."""
        compositor_sync.forget_loaded_map(scene)

    # --- the panel --------------------------------------------------------------------------------

    def look_node(self, scene: bpy.types.Scene) -> bpy.types.Node | None:
        """Return the group's node."""
        setup = find_setup(scene)
        return None if setup is None else setup.group

    def notices(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> list[Notice]:
        """Say where the compositor is not set up, and what it draws unbent or sharp."""
        setup = find_setup(scene)
        if setup is None:
            return [Notice(NOT_SET_UP, "ERROR", "umbra.setup_compositor")]
        found = [environment.world_left_out(scene), environment.alpha_note(scene, may_load=False)]
        found += [sky_filter.notice(scene, setup), stars.notice(scene, setup)]
        if scene.umbra.hide_behind and not depth.is_in_use(scene):
            found.append(NO_DEPTH)
        behind = objects_behind.find(scene, depsgraph)
        if behind:
            found.append(objects_behind.sentence(behind))
        if frame.motion is not Motion.NONE:
            found.append(MOTION_BLUR)
        if frame.aperture > 0.0:
            found.append(DEPTH_OF_FIELD)
        refused = refusals(scene, sequencer.check, check_unbent)
        return refused + [Notice(each) for each in found if each is not None]

    def sky_problem(self, scene: bpy.types.Scene) -> str | None:
        """Return why the sky cannot be read, unless it is the artist's own nodes."""
        setup = find_setup(scene)
        if setup is not None and not takes_sky_from_settings(setup):
            return None
        try:
            environment.check_image(environment.read(scene).image)
        except physics.BlackHoleError as error:
            return error.for_user()
        return None

    def draw_settings(self, layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
        """Draw the sky."""
        panel.draw(layout, scene, self.sky_problem(scene))


def _leave_world(scene: bpy.types.Scene, error: SceneError) -> list[str]:
    """Choose an image in place of a World that cannot be the sky, and say why."""
    environment.leave_world(scene, scene.umbra.environment_image or star_sky.load(scene))
    return [f"The World is not the sky of the black hole. {error.for_user()}"]


def _alpha_note(scene: bpy.types.Scene) -> list[str]:
    note = environment.alpha_note(scene, may_load=True)
    return [] if note is None else [note]


def _prepare(scene: bpy.types.Scene) -> list[str]:
    """Render the panorama that the sky needs; why there is none. What else is wrong with the sky is found later on."""
    try:
        environment.prepare(scene)
    except SceneError as error:
        return [error.for_user()] if error.code == "sky.panorama-failed" else []
    return []


def _unresolved(wanted: MapRequest, frame: FrameSetup) -> list[str]:
    """Refuse, where nobody sees the magenta, a map with pixels that its method could not resolve."""
    count = wanted.kind.format.read_metadata(wanted.path)["counts"]["unresolved"]
    if not count:
        return []
    text = (
        f"Frame {frame.frame}: {count} pixels could not be resolved by the method "
        f'"{physics.METHODS[frame.parameters.method].label}" and are magenta; choose the method "Fast" in the '
        "Umbra panel, which resolves them."
    )
    if messages.without_window():
        raise SceneError(text, code="map.unresolved")
    return [text]
