# SPDX-License-Identifier: GPL-3.0-or-later
"""The 3D viewports that show a scene through its compositor: find them, make one, and give it back as it was.

How a viewport was before is kept with its screen, so that it can be given back after the file was saved and opened.
"""

import json
from typing import Any

import bpy

# The screen's custom property: index of the area -> how its viewport was.
KEPT = "umbra_viewports"

SHADED = ("MATERIAL", "RENDERED")

_AXES = ("view_location", "view_rotation")


def shows_composite(space: bpy.types.Space | None) -> bool:
    """Return whether a space is a 3D viewport that shows the compositor's picture as the camera sees it."""
    if not isinstance(space, bpy.types.SpaceView3D) or space.shading.type not in SHADED:
        return False
    mode, region = space.shading.use_compositor, space.region_3d
    return mode == "ALWAYS" or (mode == "CAMERA" and region is not None and region.view_perspective == "CAMERA")


def spaces_of(scene: bpy.types.Scene) -> list[tuple[bpy.types.Window, bpy.types.SpaceView3D]]:
    """Return the 3D viewports that show the scene through its compositor, with their windows."""
    found = []
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas if window.scene == scene else ():
            space = area.spaces.active
            if isinstance(space, bpy.types.SpaceView3D) and shows_composite(space):
                found.append((window, space))
    return found


def is_through_another_camera(space: bpy.types.SpaceView3D, scene: bpy.types.Scene) -> bool:
    """Return whether a viewport looks through a camera of its own, for which there is no map."""
    return bool(space.use_local_camera) and space.camera != scene.camera


def show(area: bpy.types.Area) -> None:
    """Let a viewport look through the scene's camera, rendered, and with the compositor."""
    space: Any = area.spaces.active
    shading, region = space.shading, space.region_3d
    screen, index = _place(area)
    kept = _kept(screen)
    before = {
        "type": shading.type,
        "use_compositor": shading.use_compositor,
        "use_local_camera": space.use_local_camera,
        "view_perspective": region.view_perspective,
        "view_distance": region.view_distance,
        **{name: list(getattr(region, name)) for name in _AXES},
    }
    kept[index] = before
    screen[KEPT] = json.dumps(kept)
    space.use_local_camera = False
    if shading.type not in SHADED:
        shading.type = "RENDERED"
    region.view_perspective = "CAMERA"
    shading.use_compositor = "CAMERA"  # in a free view the camera's map would be stretched over the region


def give_back(area: bpy.types.Area) -> None:
    """Let a viewport be as it was before `show`; where that is not known, switch its compositor off."""
    space: Any = area.spaces.active
    shading, region = space.shading, space.region_3d
    screen, index = _place(area)
    kept = _kept(screen)
    before = kept.pop(index, None)
    if kept:
        screen[KEPT] = json.dumps(kept)
    elif KEPT in screen:
        del screen[KEPT]
    if before is None:
        shading.use_compositor = "DISABLED"
        return
    shading.type, shading.use_compositor = before["type"], before["use_compositor"]
    space.use_local_camera = before["use_local_camera"]
    region.view_perspective = before["view_perspective"]
    if before["view_perspective"] != "CAMERA":
        for name in ("view_distance", *_AXES):
            setattr(region, name, before[name])


def _place(area: bpy.types.Area) -> tuple[bpy.types.Screen, str]:
    """Return an area's screen, and its number there as text."""
    screen = area.id_data
    assert isinstance(screen, bpy.types.Screen)
    return screen, str(list(screen.areas).index(area))


def _kept(screen: bpy.types.Screen) -> dict[str, dict[str, Any]]:
    try:
        kept = json.loads(screen.get(KEPT, "{}"))
    except (TypeError, ValueError):  # somebody else's
        return {}
    return kept if isinstance(kept, dict) else {}
