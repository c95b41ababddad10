# SPDX-License-Identifier: GPL-3.0-or-later
"""Set up each screenshot inside Blender for `take.py`, which starts this and takes them off the display.

Each picture is a generator: what it yields are seconds for Blender to draw, what it returns says where to cut. Nothing
is drawn that an artist would not see; panels that are not meant are only left out.
"""

import json
import sys
import traceback
from collections.abc import Callable, Generator
from pathlib import Path

import bpy

FOLDER = Path.cwd()
SETTLE = 1.0  # seconds for the window to be drawn, in software
WAIT = 0.1
ATTEMPTS = 5
BAKED = 0.25
"""Share of an animation's frames that are baked when the picture of it is taken."""
PERCENTAGE = 40
"""Of the renders' full HD."""
WIDER = 170
"""Pixels that the sidebar is drawn wider, so that its words fit."""
BORDER = 4
TABS = 26
"""Pixels of the sidebar's tabs, which run down its whole height."""
PACKAGE = "bl_ext.user_default.umbra_black_hole"

Rectangle = tuple[int, int, int, int]
Steps = Generator[float, None, tuple[Rectangle, bool]]
Shooting = Generator[float, None, bool]


def window() -> bpy.types.Window:
    """Blender's first window."""
    return bpy.context.window_manager.windows[0]


def area(kind: str = "VIEW_3D") -> bpy.types.Area:
    """The largest area of a kind."""
    return max((each for each in window().screen.areas if each.type == kind), key=lambda each: each.width * each.height)


def region(kind: str, of: bpy.types.Area) -> bpy.types.Region:
    """A region of an area."""
    return next(each for each in of.regions if each.type == kind)


def at(kind: str = "VIEW_3D", part: str = "WINDOW") -> object:
    """Where an operator is called, as `with at():`."""
    here = area(kind)
    return bpy.context.temp_override(window=window(), area=here, region=region(part, here))


def rectangle(thing: bpy.types.Area | bpy.types.Region, header: int = 0) -> Rectangle:
    """Left, top, width and height of a part of the window, from its upper left corner."""
    return thing.x, window().height - thing.y - thing.height - header, thing.width, thing.height + header


def point(x: int, y: int) -> None:
    """Move the pointer."""
    window().event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)


def scene_with_hole(samples: int = 8) -> bpy.types.Object:
    """The factory scene with a black hole where the cube was, as the tutorial has it."""
    scene = bpy.context.scene
    cube = bpy.data.objects.get("Cube")
    if cube is not None:
        bpy.data.objects.remove(cube)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.render.resolution_percentage = PERCENTAGE
    if scene.umbra.active_hole is None:
        with at():
            bpy.ops.umbra.add_black_hole()
    return scene.umbra.active_hole


def all_panels() -> list[type]:
    """The add-on's panels in the sidebar, parents before children."""
    found = [
        each
        for each in bpy.types.Panel.__subclasses__()
        if each.__module__.startswith(PACKAGE) and getattr(each, "bl_category", "") == "Umbra"
    ]
    parents = {getattr(each, "bl_idname", each.__name__): getattr(each, "bl_parent_id", "") for each in found}

    def depth(panel: type) -> int:
        parent, levels = getattr(panel, "bl_parent_id", ""), 0
        while parent:
            parent, levels = parents[parent], levels + 1
        return levels

    return sorted(found, key=depth)


PANELS: list[type] = []
CLOSED = "DEFAULT_CLOSED"


def show_panels(*names: str) -> None:
    """Leave only these panels under the main one, all of them open."""
    for each in reversed(PANELS):
        if each.is_registered:
            bpy.utils.unregister_class(each)
    for each in PANELS:
        options = set(getattr(each, "bl_options", set()))
        if CLOSED in options:  # a new name, because Blender remembers the old one as closed
            before = getattr(each, "bl_idname", each.__name__)
            each.bl_idname, each.bl_options = f"{each.__name__}_open", options - {CLOSED}
            for child in PANELS:
                if getattr(child, "bl_parent_id", "") == before:
                    child.bl_parent_id = each.bl_idname
        if each.__name__ == "VIEW3D_PT_umbra" or each.__name__.removeprefix("VIEW3D_PT_umbra_") in names:
            bpy.utils.register_class(each)
    area().spaces[0].show_region_ui = True


def sidebar(*names: str) -> Steps:
    """The sidebar with these panels."""
    show_panels(*names)
    yield from choose_tab()
    return sidebar_rectangle(), True


def sidebar_rectangle() -> Rectangle:
    """The sidebar without its tabs."""
    left, top, width, height = rectangle(region("UI", area()))
    return left + BORDER, top + BORDER, width - TABS - 2 * BORDER, height - 2 * BORDER


def choose_tab() -> Generator[float, None, None]:
    """Show the sidebar's tab Umbra, which can be chosen once the tabs have been drawn."""
    yield SETTLE
    region("UI", area()).active_panel_category = "Umbra"
    yield SETTLE


def add_menu() -> Steps:
    """The Add menu with the black hole's entry under the pointer."""
    here = region("WINDOW", area())
    point(here.x + 400, here.y + here.height - 150)
    yield SETTLE
    with at():
        bpy.ops.wm.call_menu(name="VIEW3D_MT_add")
    yield SETTLE
    for value in ("PRESS", "RELEASE"):  # the last entry
        window().event_simulate("END", value)
    yield SETTLE
    left, top, _width, _height = rectangle(here)
    return (left + 240, top + 30, 420, 640), False


def panel() -> Steps:
    """The sidebar just after a hole was added."""
    scene_with_hole()
    return (yield from sidebar("hole", "sky"))


def viewport() -> Steps:
    """The camera's view of the hole, with the sidebar."""
    scene_with_hole()
    show_panels("hole", "sky")
    area().spaces[0].region_3d.view_perspective = "CAMERA"
    yield from choose_tab()
    with at():
        bpy.ops.view3d.view_center_camera()
    yield SETTLE
    left, top, width, _height = rectangle(area())
    return (left, top, width, 820), False


def disk() -> Steps:
    """The disk's settings."""
    scene_with_hole().umbra.disk.enabled = True
    return (yield from sidebar("disk", "disk_detail"))


def quality() -> Steps:
    """Samples, accuracy and the maps' folder."""
    scene_with_hole()
    return (yield from sidebar("maps"))


def baking() -> Steps:
    """An animation being baked."""
    scene = bpy.context.scene
    scene_with_hole()
    scene.render.resolution_percentage = 60
    scene.frame_end = 24
    show_panels()
    yield from choose_tab()
    with at():
        bpy.ops.umbra.bake_animation("INVOKE_DEFAULT")
    operators = sys.modules[f"{PACKAGE}.ui.bake_operators"]
    while operators.running().fraction < BAKED:
        yield WAIT
    return sidebar_rectangle(), True


def stop_baking() -> Generator[float, None, None]:
    """End what `baking` began."""
    with at():
        bpy.ops.umbra.stop_baking()
    yield SETTLE
    bpy.context.scene.render.resolution_percentage = PERCENTAGE
    bpy.context.scene.frame_end = 250


def error() -> Steps:
    """What the panel says of a camera that cannot show a hole."""
    scene_with_hole()
    bpy.context.scene.camera.data.type = "ORTHO"
    picture = yield from sidebar("hole")
    return picture


def popup() -> Steps:
    """What a render says in the window when a frame's map cannot be baked."""
    scene_with_hole()
    bpy.context.scene.camera.data.type = "ORTHO"
    here = region("WINDOW", area())
    left, top, _width, height = rectangle(here)
    crop = (left + 90, top + height // 2 - 60, 540, 120)
    yield SETTLE
    yield from shoot("before", crop, keep=False)
    for _ in range(ATTEMPTS):  # on a slow machine a message is closed by events that come late
        point(here.x + 500, here.y + here.height // 2)
        yield SETTLE
        with at():
            bpy.ops.render.render()
        yield 3.0 * SETTLE  # the message comes when Blender is free again
        if (yield from shoot("tried", crop, unlike="before", keep=False)):
            break
    return crop, False


def perspective() -> Generator[float, None, None]:
    """Undo what the pictures of errors need, and close the message."""
    window().event_simulate("ESC", "PRESS")
    window().event_simulate("ESC", "RELEASE")
    bpy.context.scene.camera.data.type = "PERSP"
    yield SETTLE


def result() -> Steps:
    """The rendered picture in the image editor."""
    scene_with_hole()
    with at():
        bpy.ops.render.render()
    yield SETTLE
    here = area()
    here.type = "IMAGE_EDITOR"
    here.spaces[0].image = bpy.data.images["Render Result"]
    here.spaces[0].show_region_ui = False
    yield SETTLE
    with at("IMAGE_EDITOR"):
        bpy.ops.image.view_all(fit_view=False)
    yield SETTLE
    left, top, width, height = rectangle(region("WINDOW", area("IMAGE_EDITOR")))
    wide, high = (each * PERCENTAGE // 100 for each in (1920, 1080))
    return (left + (width - wide) // 2, top + (height - high) // 2, wide, high), False


def result_with_disk() -> Steps:
    """The same with a disk."""
    scene_with_hole().umbra.disk.enabled = True
    return (yield from result())


def compositor() -> Steps:
    """The compositor with the node group behind the render."""
    scene_with_hole()
    here = area("VIEW_3D") if any(each.type == "VIEW_3D" for each in window().screen.areas) else area("IMAGE_EDITOR")
    here.ui_type = "CompositorNodeTree"
    yield SETTLE
    with at("NODE_EDITOR"):
        bpy.ops.node.select_all(action="SELECT")
        for node in here.spaces[0].edit_tree.nodes:  # the output is far off
            node.select = node.bl_idname != "NodeGroupOutput"
        bpy.ops.node.view_selected()
        bpy.ops.node.select_all(action="DESELECT")
    yield 2.0 * SETTLE
    return rectangle(region("WINDOW", area("NODE_EDITOR"))), True


def back() -> Generator[float, None, None]:
    """Show the 3D viewport again."""
    for kind in ("IMAGE_EDITOR", "NODE_EDITOR"):
        for each in window().screen.areas:
            if each.type == kind:
                each.type = "VIEW_3D"
    yield SETTLE


# Each picture, and what puts the window back afterwards.
PICTURES: dict[str, tuple[Callable[[], Steps], Callable[[], Generator[float, None, None]] | None]] = {
    "panel": (panel, None),
    "viewport": (viewport, None),
    "quality": (quality, None),
    "baking": (baking, stop_baking),
    "compositor": (compositor, back),
    "result": (result, back),
    "disk": (disk, None),
    "result_with_disk": (result_with_disk, back),
    "error": (error, perspective),
    "popup": (popup, perspective),
    "add_menu": (add_menu, None),  # the last: a menu stays open
}


def prepare() -> Generator[float, None, None]:
    """A window without anything in the way."""
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "scene.blend"))
    PANELS[:] = all_panels()
    area().spaces[0].show_region_ui = True
    yield SETTLE
    edge = region("UI", area())
    x, y = edge.x, edge.y + edge.height // 2
    for event, value, to in (
        ("MOUSEMOVE", "NOTHING", x), ("LEFTMOUSE", "PRESS", x), ("MOUSEMOVE", "NOTHING", x - WIDER // 2),
        ("MOUSEMOVE", "NOTHING", x - WIDER), ("LEFTMOUSE", "RELEASE", x - WIDER),
    ):  # fmt: skip
        window().event_simulate(event, value, x=to, y=y)
        yield WAIT
    yield SETTLE


def shoot(name: str, crop: Rectangle, trim: bool = False, *, unlike: str = "", keep: bool = True) -> Shooting:
    """Have the window taken off the display; return whether the picture is unlike an earlier one."""
    with bpy.context.temp_override(window=window()):
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
    request = FOLDER / f"{name}.request"
    request.with_suffix(".part").write_text(json.dumps({"crop": crop, "trim": trim, "unlike": unlike, "keep": keep}))
    request.with_suffix(".part").rename(request)
    while request.exists():
        yield WAIT
    return request.with_suffix(".png").exists()


def take_all(names: list[str]) -> Generator[float, None, None]:
    """Take one picture after the other."""
    yield from prepare()
    for name in names:
        picture, afterwards = PICTURES[name]
        crop, trim = yield from picture()
        yield from shoot(name, crop, trim)
        if afterwards is not None:
            yield from afterwards()
    show_panels(*(each.__name__.removeprefix("VIEW3D_PT_umbra_") for each in PANELS))  # as the add-on registered them
    (FOLDER / "done").touch()


def main() -> None:
    """Go through the pictures by a timer, between which Blender draws; then end Blender."""
    preferences = bpy.context.preferences
    preferences.view.show_splash = False  # before the window is drawn
    preferences.system.use_region_overlap = False
    names = sys.argv[sys.argv.index("--") + 1 :] or list(PICTURES)
    steps = take_all(names)

    def go_on() -> float | None:
        try:
            return next(steps)
        except StopIteration:
            pass
        except Exception:  # noqa: BLE001  whatever it is: Blender has to end, and its output shows it
            traceback.print_exc()
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(go_on, first_interval=2.0)


main()
