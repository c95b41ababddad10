# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake what is missing when Blender renders, and never let a wrong picture pass for a right one.

For each frame Blender calls render_pre, then frame_change_post with the render's own dependency graph, where
animation, constraints and the camera of this frame are evaluated; then it renders and runs the compositor. So
render_pre takes the map away (the picture is magenta now), and only frame_change_post gives a valid one back.
render_post, which comes when the picture has been written, only makes sure that this happened.
"""

from collections.abc import Callable
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from ..bake import baking, maps
from ..core import messages
from ..core.errors import MapFolderError, SceneError
from ..core.physics_api import physics
from ..nodes import black_hole_group
from ..outputs.compositor import compositor_sync
from ..outputs.lens import lens_disk, lens_render, lens_sync, lens_tree
from ..outputs.shared import disk_light, disk_sync
from ..outputs.shared.compositor_tree import check_linked, check_rendered, find_setup, is_in_use
from ..outputs.world import world_sync
from ..preview import live_preview
from ..scene import frame_setup

# Names of scenes whose current frame is being rendered and has no valid map yet.
_waiting: set[str] = set()
# The compositor device of scenes that are being rendered without a window, to be set back.
_devices: dict[str, str] = {}
# Scenes that an error was already shown for in this render.
_told: set[str] = set()
# Scenes whose unstable orbit was mentioned in this render.
_noted: set[str] = set()
# Scenes with the Cycles Lens that are being rendered: what the viewport would need stays away from them.
_rendering: set[str] = set()
# Set while this module itself steps the scene to other frames.
_busy = False


def _guarded(work: Callable[[bpy.types.Scene], None], scene: bpy.types.Scene) -> None:
    """Run a handler's work; what goes wrong must be seen, because Blender swallows exceptions here."""
    try:
        work(scene)
    except physics.BlackHoleError as error:
        frame = f"Frame {scene.frame_current}: "
        _fail(scene, str(error) if str(error).startswith(frame) else frame + str(error))
    except Exception as error:  # noqa: BLE001  a fault of ours must not end as a wrong picture either
        _fail(scene, f"An unexpected fault ({type(error).__name__}: {error}); please report it.")


def without_window() -> bool:
    """Whether nobody is there to read a message: a failure then has to end the process."""
    return bpy.app.background


def _fail(scene: bpy.types.Scene, text: str) -> None:
    _waiting.discard(scene.name)
    if without_window():
        messages.end_process(text)
        return
    if lens_sync.is_on(scene):
        lens_render.take_away(scene)
    elif world_sync.is_on(scene):
        world_sync.point_at_nothing(scene)
    else:
        compositor_sync.point_at_nothing(scene)
    messages.warn(text)
    if scene.name not in _told:
        _told.add(scene.name)
        messages.popup(text)


# --- rendering ------------------------------------------------------------------------------------


@persistent
def on_render_init(scene: bpy.types.Scene, _unused: object = None) -> None:
    """A render begins, of one frame or many."""
    _told.discard(scene.name)
    _noted.discard(scene.name)
    _guarded(lambda _scene: live_preview.suspend(), scene)
    if not _is_ours(scene):
        return
    if len(frame_setup.holes(scene)) > 1:
        messages.warn(f'scene "{scene.name}" contains several black holes; only the active one is rendered.')
    if lens_sync.is_on(scene):
        _rendering.add(scene.name)
        _guarded(lens_render.begin, scene)
        if lens_tree.BEFORE not in scene:  # neither a disk nor a foreground: the compositor is not ours
            return
    if world_sync.is_on(scene):
        return
    if bpy.app.background and getattr(scene.render, "compositor_device", "CPU") != "CPU":
        # without a display there is usually no OpenGL, and then Blender's GPU compositor ends the process
        _devices[scene.name] = scene.render.compositor_device
        scene.render.compositor_device = "CPU"
    if lens_sync.is_on(scene):
        return
    _guarded(_repair, scene)
    _guarded(compositor_sync.sync_sky, scene)
    _guarded(disk_sync.refresh, scene)


def _repair(scene: bpy.types.Scene) -> None:
    """Make what was changed by hand inside the set-up whole; what cannot be is refused."""
    if compositor_sync.repair(scene):
        messages.warn(
            f'the node group "{black_hole_group.GROUP_NAME}" was damaged or of another version, and is built anew.'
        )
    check_linked(scene)


@persistent
def on_render_pre(scene: bpy.types.Scene, _unused: object = None) -> None:
    """A frame begins; what is changed now is still evaluated for it."""
    _guarded(lambda each: disk_light.follow(each, frame_setup.find_active_hole(each)), scene)
    if not _is_ours(scene):
        return
    if messages.is_ending():
        messages.end_process("A frame before this one failed.")
    _waiting.add(scene.name)
    _guarded(_take_map_away, scene)


@persistent
def on_frame_change_post(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """The frame is evaluated."""
    if _busy or depsgraph is None:
        return
    live_preview.on_update(scene, depsgraph)
    if depsgraph.mode != "RENDER" and scene.name not in _rendering:
        disk_light.follow(scene, frame_setup.find_active_hole(scene))
        if lens_sync.is_on(scene):
            lens_sync.show_live(scene, depsgraph)
    if depsgraph.mode != "RENDER" or scene.name not in _waiting:
        return
    _guarded(lambda each: _provide_map(each, depsgraph), scene)


@persistent
def on_depsgraph_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """Something has changed: the viewport's camera and the preview follow."""
    if not _busy and depsgraph is not None:
        live_preview.on_update(scene, depsgraph)
    if depsgraph is None or _busy or scene.name in _rendering or not lens_sync.is_on(scene):
        return
    lens_sync.show_live(scene, depsgraph)


@persistent
def on_render_post(scene: bpy.types.Scene, _unused: object = None) -> None:
    """The frame is done."""
    if scene.name in _waiting:
        _fail(scene, f"Frame {scene.frame_current} was rendered without its warp map or lens.")


@persistent
def on_render_end(scene: bpy.types.Scene, _unused: object = None) -> None:
    """The render is complete or canceled.

    After a failure the map stays away: the window runs the compositor once more when the render is over, and an
    older map would then hide the magenta.
    """
    _restore_device(scene)
    baking.forget_shared_rays()
    live_preview.resume()
    if scene.name in _rendering:
        _rendering.discard(scene.name)
        if scene.name in _waiting:  # canceled half-way
            _waiting.discard(scene.name)
            lens_disk.point_at_passes(scene)
        lens_render.end(scene)
        return
    if scene.name in _waiting:  # canceled half-way
        _waiting.discard(scene.name)
        compositor_sync.refresh(scene)
        if world_sync.is_on(scene):
            world_sync.refresh(scene)


def _is_ours(scene: bpy.types.Scene) -> bool:
    """Whether rendering the scene shows its black hole."""
    return lens_sync.is_on(scene) or world_sync.is_on(scene) or is_in_use(scene)


def _take_map_away(scene: bpy.types.Scene) -> None:
    if lens_sync.is_on(scene):
        lens_render.take_away(scene)
        return
    if world_sync.is_on(scene):
        world_sync.check(scene)
        world_sync.point_at_nothing(scene)
        return
    compositor_sync.point_at_nothing(scene)
    check_rendered(scene)
    check_linked(scene)


def _restore_device(scene: bpy.types.Scene) -> None:
    device = _devices.pop(scene.name, None)
    if device is not None:
        scene.render.compositor_device = device


def _provide_map(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Make sure that the map of the frame being rendered is right, and let the compositor read it."""
    global _busy
    _busy = True
    try:
        frame_shot = frame_setup.read(scene, depsgraph)
    finally:
        _busy = False
    parameters = frame_shot.parameters
    _note_unstable_orbit(scene, parameters)
    if lens_sync.is_on(scene):
        lens_render.provide(scene, depsgraph, frame_shot)
        _waiting.discard(scene.name)
        return
    path = baking.path_of(scene, frame_shot)
    baking.provide_map(scene, path, baking.parameters_of(scene, frame_shot), frame_shot.frame)
    if world_sync.is_on(scene):
        for warning in world_sync.warnings(scene, frame_shot):
            messages.warn(warning)
        world_sync.check_resolved(maps.WORLD_MAP.format.read_metadata(path), frame_shot)
        world_sync.point_at_files(scene)
        world_sync.forget_loaded_map(scene)
        _waiting.discard(scene.name)
        return
    _check_resolved(path, frame_shot)
    disk_sync.check_shot(scene, parameters)
    compositor_sync.point_at_maps(scene)
    _waiting.discard(scene.name)


def _check_resolved(path: Path, frame_shot: frame_setup.Shot) -> None:
    """Refuse, where nobody sees the magenta, a map with pixels that its method could not resolve."""
    unresolved = physics.read_warp_map_metadata(path)["counts"]["unresolved"]
    if not unresolved:
        return
    text = (
        f"Frame {frame_shot.frame}: {unresolved} pixels could not be resolved by the method "
        f'"{physics.METHODS[frame_shot.parameters.method].label}" and are magenta; choose the method "Fast" in the '
        "Umbra panel, which resolves them."
    )
    if without_window():
        raise SceneError(text)
    messages.warn(text)


def _note_unstable_orbit(scene: bpy.types.Scene, parameters: "physics.WarpMapParameters") -> None:
    """Say once a render that the orbit is unstable: the picture is right, and the artist may want to know."""
    note = physics.unstable_orbit_warning(parameters)
    if note is not None and scene.name not in _noted:
        _noted.add(scene.name)
        print(f"Umbra: {note}", flush=True)


# --- files ----------------------------------------------------------------------------------------


@persistent
def on_load_post(_path: str = "", _unused: object = None) -> None:
    """A file was opened: bring node groups of an older version of this add-on up to date."""
    _waiting.clear()
    _devices.clear()
    _rendering.clear()
    lens_render.forget()
    live_preview.forget()
    for scene in bpy.data.scenes:
        if lens_sync.is_on(scene) and scene.library is None:
            lens_sync.show_live(scene)
            disk_sync.refresh_or_warn(scene)  # a render refuses what this only tells
        setup = find_setup(scene)
        if setup is not None and scene.library is None and setup.tree.library is None:
            compositor_sync.repair(scene)
            compositor_sync.refresh(scene)
        if world_sync.is_on(scene) and scene.library is None:
            world_sync.refresh(scene)
    live_preview.start_again()


@persistent
def on_save_pre(path: str = "", _unused: object = None) -> None:
    """A file is about to be saved: it should refer to the maps of the settings that are saved."""
    live_preview.drop_live()
    for scene in bpy.data.scenes:
        if lens_sync.is_on(scene):
            lens_disk.point_at_passes(scene)
        elif find_setup(scene) is None and not world_sync.is_on(scene):
            continue
        compositor_sync.refresh(scene)
        if world_sync.is_on(scene) and scene.library is None:
            world_sync.point_at_files(scene)
        try:
            folder = maps.adopt(scene, Path(path)) if path and not bpy.data.filepath else None
        except MapFolderError as error:
            messages.warn(str(error))
            continue
        if folder is not None:
            compositor_sync.move_map_path(scene, folder)
            world_sync.move_map_path(scene, folder)
            if lens_sync.is_on(scene):
                lens_disk.move_passes(scene, folder)


@persistent
def on_save_post(_path: str = "", _unused: object = None) -> None:
    """The file is saved: the preview shows itself again."""
    live_preview.start_again()


@persistent
def on_undo_post(_scene: bpy.types.Scene, _unused: object = None) -> None:
    """Undo or redo has replaced what the preview had shown."""
    live_preview.start_again()


# --- registration ---------------------------------------------------------------------------------

_HANDLERS = {
    "render_init": on_render_init,
    "render_pre": on_render_pre,
    "frame_change_post": on_frame_change_post,
    "depsgraph_update_post": on_depsgraph_update,
    "render_post": on_render_post,
    "render_complete": on_render_end,
    "render_cancel": on_render_end,
    "load_post": on_load_post,
    "save_pre": on_save_pre,
    "save_post": on_save_post,
    "undo_post": on_undo_post,
    "redo_post": on_undo_post,
}


def register() -> None:
    """Attach the handlers."""
    for name, handler in _HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    """Detach the handlers."""
    for name, handler in _HANDLERS.items():
        attached = getattr(bpy.app.handlers, name)
        if handler in attached:
            attached.remove(handler)
    messages.forget()
