# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake what is missing when Blender renders, and never let a wrong picture pass for a right one.

For each frame Blender calls render_pre, then frame_change_post with the render's own dependency graph, where
animation, constraints and the camera of this frame are evaluated; then it renders and runs the compositor. So
render_pre takes the map away (the picture is magenta now), and only frame_change_post gives a valid one back.
render_post, which comes when the picture has been written, only makes sure that this happened.

Other add-ons move things in frame_change_post too, and Blender evaluates once more when all handlers have run, without
calling them again. So ours waits until the others have run, and evaluates what they have changed.
"""

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import bpy

from ..bake import baking, check, star_sky
from ..core import messages
from ..core.blender_version import SCENE_OWNS_COMPOSITOR
from ..core.errors import SceneError, unexpected
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..outputs import frames, refreshing, registry, saving
from ..outputs.shared import disk_light
from ..preview import live_preview, viewport
from ..scene import frame_setup, presence
from ..scene.placement import placement
from ..settings import former_disks, saved_names

Handler = TypeVar("Handler", bound=Callable[..., None])
persistent: Callable[[Handler], Handler] = bpy.app.handlers.persistent


@dataclass
class _Render:
    """What is known of a scene while it is rendered."""

    is_running: bool = False
    """A render of the scene's output runs: what the viewport would need stays away from it."""
    is_waiting: bool = False
    """The current frame has no valid map yet."""
    device: str | None = None
    """The compositor device, to be set back."""
    has_failed: bool = False
    """An error was shown for this render."""
    is_noted: bool = False
    """The unstable orbit was mentioned in this render."""
    shown: "physics.WarpMapParameters | None" = None
    """What the current frame's map is made from, once it is there."""
    files: dict[Path, object] = field(default_factory=dict)
    """The maps that it shows, as they were when they were checked."""
    placed: object = None
    """How hole and camera stood then."""
    moment: float = 0.0
    """The frame at which they stood there, with its part."""
    name: str = ""
    """The scene's name when the render began."""
    step_in: Callable[[], None] | None = None
    """Undoes what lets a frame without a black hole be Blender's own."""
    turns: int = 0
    """How often the handler has let others go first in this frame."""


# Other add-ons may insist on being the last as well; and what they move may move on with each evaluation.
MOST_TURNS, MOST_ROUNDS = 4, 4

_renders = SESSION.per_scene(_Render, Life.FILE)
# True while this module itself steps the scene to other frames.
_stepping = SESSION.value(bool, Life.FILE)


def _guarded(work: Callable[[bpy.types.Scene], None], scene: bpy.types.Scene) -> None:
    """Run a handler's work; what goes wrong must be seen, because Blender swallows exceptions here."""
    try:
        work(scene)
    except physics.BlackHoleError as error:
        frame = f"Frame {scene.frame_current}: "
        _fail(scene, error if str(error).startswith(frame) else SceneError(f"{frame}{error}", code=error.code))
    except Exception as error:  # noqa: BLE001  a fault of ours must not end as a wrong picture either
        _fail(scene, unexpected(error))


def _fail(scene: bpy.types.Scene, error: "physics.BlackHoleError") -> None:
    now = _renders.of(scene)
    now.is_waiting = False
    text = error.for_user()
    if messages.without_window():
        messages.end_process(text)
        return
    with contextlib.suppress(physics.BlackHoleError):  # that it cannot be shown is what `text` says
        registry.of(scene).take_away(scene)
    messages.warn(text)
    if not now.has_failed:
        now.has_failed = True
        messages.popup(text)


# --- rendering ------------------------------------------------------------------------------------


@persistent
def on_render_init(scene: bpy.types.Scene, _unused: object = None) -> None:
    """A render begins, of one frame or many."""
    now = _renders.of(scene)
    now.has_failed = now.is_noted = False
    _guarded(lambda _scene: _suspend_previews(), scene)
    _guarded(lambda _scene: saved_names.migrate(), scene)  # a script may have made keyframes by former names
    output = registry.of(scene)
    if not output.is_in_use(scene):
        return
    if len(frame_setup.holes(scene)) > 1:
        messages.warn(f'scene "{scene.name}" contains several black holes; only the active one is rendered.')
    now.is_running, now.name = True, scene.name
    _guarded(lambda each: star_sky.provide(each, may_write=each.umbra.auto_bake), scene)
    if frame_setup.holes(scene):
        _guarded(output.begin_render, scene)
    _guarded(refreshing.refresh_disk, scene)
    if output.uses_compositor(scene) and bpy.app.background:
        device = getattr(scene.render, "compositor_device", "CPU")
        if device != "CPU":
            # without a display there is usually no OpenGL, and then Blender's GPU compositor ends the process
            now.device = device
            scene.render.compositor_device = "CPU"


@persistent
def on_render_pre(scene: bpy.types.Scene, _unused: object = None) -> None:
    """A frame begins; what is changed now is still evaluated for it."""
    _guarded(lambda each: disk_light.follow(each, frame_setup.find_active_hole(each)), scene)
    output = registry.of(scene)
    if not output.is_in_use(scene):
        return
    if messages.is_ending():
        messages.end_process(SceneError("A frame before this one failed.", code="render.frame-failed").for_user())
    now = _renders.of(scene)
    now.is_waiting, now.shown, now.turns = True, None, 0
    if presence.is_absent(scene):
        now.is_waiting = False
        _guarded(_stand_aside, scene)
        return
    _step_in(now)
    _come_first("render_post", on_render_post)  # before others put back what they have moved for the frame
    _guarded(output.take_away, scene)


@persistent
def on_frame_change_post(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """The frame is evaluated."""
    if _stepping.now or depsgraph is None:
        return
    live_preview.on_update(scene, depsgraph)
    now = _renders.of(scene)
    if depsgraph.mode != "RENDER" and not now.is_running:
        disk_light.follow(scene, frame_setup.find_active_hole(scene))
        registry.of(scene).follow(scene, depsgraph)
        viewport.on_update(scene, depsgraph)
    if depsgraph.mode != "RENDER" or not (now.is_waiting or now.shown):
        return
    if now.shown and scene.frame_current_final != now.moment:  # Cycles looks at other moments for its motion blur
        return
    if _lets_others_go_first(now):
        return
    if now.is_waiting:
        _guarded(lambda each: _provide_maps(each, depsgraph), scene)
    else:
        _guarded(lambda each: _check_layer(each, depsgraph), scene)


@persistent
def on_depsgraph_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """Something has changed: the viewport's camera and the preview follow."""
    if _stepping.now or depsgraph is None:
        return
    live_preview.on_update(scene, depsgraph)
    if not _renders.of(scene).is_running:
        disk_light.remove_orphans(scene)
        registry.of(scene).follow(scene, depsgraph)
        viewport.on_update(scene, depsgraph)


@persistent
def on_render_post(scene: bpy.types.Scene, _unused: object = None) -> None:
    """The frame is done."""
    now = _renders.of(scene)
    if now.is_waiting:
        text = f"Frame {scene.frame_current} was rendered without its warp map or lens."
        _fail(scene, SceneError(text, code="render.no-map"))
    elif now.shown is not None:
        _guarded(_check_files, scene)
        if now.placed != _placed(scene):
            _guarded(_check_frame, scene)
    now.shown = None


@persistent
def on_render_end(scene: bpy.types.Scene, _unused: object = None) -> None:
    """The render is complete or canceled."""
    now = _renders.of(scene)
    if now.device is not None:
        scene.render.compositor_device, now.device = now.device, None
    _step_in(now)
    SESSION.end(Life.RENDER)
    live_preview.resume()
    if now.is_running:
        now.is_running = False
        canceled, now.is_waiting = now.is_waiting, False
        registry.of(scene).end_render(scene, canceled=canceled)
    if not now.has_failed:  # else the map stays away until something changes
        viewport.start_again()


def _suspend_previews() -> None:
    """Keep all previews away from the render."""
    live_preview.suspend()
    viewport.show_files()


def _stand_aside(scene: bpy.types.Scene) -> None:
    """Let a frame without a black hole be rendered as if the add-on were not there."""
    now = _renders.of(scene)
    step_in = registry.of(scene).stand_aside(scene)
    now.step_in = now.step_in or step_in


def _step_in(now: _Render) -> None:
    if now.step_in is not None:
        now.step_in()
        now.step_in = None


@contextlib.contextmanager
def _steps() -> Iterator[None]:
    _stepping.now = True
    try:
        yield
    finally:
        _stepping.now = False


def _provide_maps(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Make sure that the maps of the frame being rendered are right, and let its picture read them."""
    _check_name(scene)
    frame, depsgraph = _read(scene, depsgraph)
    frames.check_sky(scene)
    _note_unstable_orbit(scene, frame.parameters)
    files: dict[Path, object] = {}
    for wanted in frames.requests_of(scene, frame):
        files |= baking.provide(wanted, may_bake=scene.umbra.auto_bake)
    for warning in registry.of(scene).point_at(scene, depsgraph, frame):
        messages.warn(warning)
    now = _renders.of(scene)
    now.shown, now.placed, now.files, now.is_waiting = frame.parameters, _placed(scene), files, False
    now.moment = scene.frame_current_final


# --- beside other add-ons -------------------------------------------------------------------------


def _come_first(name: str, handler: Callable[..., None]) -> None:
    attached = getattr(bpy.app.handlers, name)
    if attached[0] is not handler:
        attached.remove(handler)
        attached.insert(0, handler)


def _lets_others_go_first(now: _Render) -> bool:
    """Whether handlers come after this one, which is then called once more after them."""
    attached = bpy.app.handlers.frame_change_post
    if attached[-1] is not on_frame_change_post:
        now.turns += 1
        if now.turns <= MOST_TURNS:
            attached.append(on_frame_change_post)
        return now.turns <= MOST_TURNS
    while attached.count(on_frame_change_post) > 1:  # only the last may do so: Blender goes through the list by number
        attached.remove(on_frame_change_post)
    return False


def _read(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> tuple[frame_setup.FrameSetup, bpy.types.Depsgraph]:
    """The frame as it will be rendered, and a graph in which it is evaluated.

    Raises
    ------
    physics.BlackHoleError
        If the frame is impossible, or another add-on moves hole or camera without end.
    """
    with _steps():
        if len(bpy.app.handlers.frame_change_post) == 1:  # nobody else has changed anything
            return frames.read(scene, depsgraph), depsgraph
        if scene.render.use_persistent_data:
            # an update would take from Cycles what has changed in this frame
            layer = scene.view_layers.get(depsgraph.view_layer.name) or scene.view_layers[0]
            return frames.read_at(scene, scene.frame_current, layer), layer.depsgraph
        depsgraph.update()
        frame = frames.read(scene, depsgraph)
        for _ in range(MOST_ROUNDS):
            depsgraph.update()
            before, frame = frame, frames.read(scene, depsgraph)
            if frame.parameters == before.parameters:
                return frame, depsgraph
    raise SceneError(
        "Another add-on or script moves the black hole or the camera with each evaluation, so that no map can fit: "
        "switch it off.",
        code="render.moved",
    )


def _placed(scene: bpy.types.Scene) -> object:
    objects = (frame_setup.find_active_hole(scene), scene.camera)
    return placement(each for each in objects if each is not None)


def _check_layer(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Refuse a further view layer in which hole or camera are elsewhere than in the one before."""
    try:
        frame, _ = _read(scene, depsgraph)
    except physics.BlackHoleError as error:
        if error.code == "hole.excluded":  # the layer does without it
            return
        raise
    _compare(scene, frame)


def _check_frame(scene: bpy.types.Scene) -> None:
    """Refuse a frame in which somebody has moved hole or camera while it was rendered."""
    with _steps():
        frame = frames.read_at(scene, scene.frame_current)
    _compare(scene, frame)


def _compare(scene: bpy.types.Scene, frame: frame_setup.FrameSetup) -> None:
    if frame.parameters != _renders.of(scene).shown:
        raise SceneError(
            "The black hole or the camera was moved after its warp map was made, by another add-on or a script: "
            "switch it off, and render this frame again.",
            code="render.moved",
        )


def _check_name(scene: bpy.types.Scene) -> None:
    """Refuse a scene that was renamed since its render began, where Blender knows renders by their scenes' names."""
    name = _renders.of(scene).name
    if SCENE_OWNS_COMPOSITOR and name not in ("", scene.name) and registry.of(scene).uses_compositor(scene):
        raise SceneError(
            f'Another add-on or script has renamed the scene "{name}" to "{scene.name}" while it is rendered, and this '
            "version of Blender's compositor does not find its picture any more: switch it off.",
            code="render.renamed",
        )


def _check_files(scene: bpy.types.Scene) -> None:
    """Refuse a frame whose maps were not the same files, all through the render, as those that were checked."""
    for path, stamp in _renders.of(scene).files.items():
        if check.stamp(path) != stamp:
            raise SceneError(
                f"The map {path} was changed or removed while the frame was rendered, and the picture may be wrong: "
                "render the frame again.",
                code="render.map-changed",
            )


def _note_unstable_orbit(scene: bpy.types.Scene, parameters: "physics.WarpMapParameters") -> None:
    """Say once per render that the orbit is unstable: the picture is right, and the artist may want to know."""
    note = physics.unstable_orbit_warning(parameters)
    now = _renders.of(scene)
    if note is not None and not now.is_noted:
        now.is_noted = True
        print(f"Umbra: {note}", flush=True)


# --- files ----------------------------------------------------------------------------------------


@persistent
def on_load_post(_path: str = "", _unused: object = None) -> None:
    """A file was opened: bring what older versions of this add-on have made up to date."""
    SESSION.end(Life.FILE)
    live_preview.forget()
    viewport.forget()
    viewport.drop()  # a file that Blender has saved by itself has what was shown
    saved_names.migrate()
    former_disks.bring_up_to_date()
    for scene in bpy.data.scenes:
        if scene.library is None:
            saving.on_load(scene)
            registry.of(scene).on_load(scene)
            refreshing.refresh_disk_or_warn(scene)  # a render refuses what this only tells
    live_preview.start_again()


@persistent
def on_import_post(_imported: object = None, _unused: object = None) -> None:
    """Data of another file was linked or appended."""
    saved_names.migrate()
    former_disks.bring_up_to_date()


@persistent
def on_save_pre(path: str = "", _unused: object = None) -> None:
    """A file is about to be saved: it should refer to the maps of the settings that are saved."""
    live_preview.drop_live()
    viewport.before_saving()
    saving.before(Path(path or bpy.data.filepath))


@persistent
def on_save_post(path: str = "", _unused: object = None) -> None:
    """The file is saved: the preview shows itself again."""
    saving.after(Path(path or bpy.data.filepath))
    live_preview.start_again()
    viewport.after_saving()


@persistent
def on_save_post_fail(_path: str = "", _unused: object = None) -> None:
    """The file could not be saved."""
    live_preview.start_again()
    viewport.after_saving()


@persistent
def on_undo_post(_scene: bpy.types.Scene, _unused: object = None) -> None:
    """Undo or redo has replaced what the preview had shown."""
    live_preview.start_again()
    viewport.show_files()
    viewport.start_again()


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
    "blend_import_post": on_import_post,
    "save_pre": on_save_pre,
    "save_post": on_save_post,
    "save_post_fail": on_save_post_fail,
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
        while handler in attached:
            attached.remove(handler)
    messages.forget()
