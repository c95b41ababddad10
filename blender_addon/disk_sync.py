# SPDX-License-Identifier: GPL-3.0-or-later
"""Keep the group "Umbra Disk" in a scene's compositor while its hole has a disk, and in step with the settings.

Time is followed by drivers that need no add-on, so that a .blend and its maps render the same without it. So are
settings that are animated; but their drivers read this add-on's properties.
"""

import math

import bpy

from . import disk_group, disk_images, disk_light, disk_properties, shot
from ._physics import disk_texture, orbiting_matter, physics
from .compositor_tree import ROLE, Setup, find_node, find_setup
from .errors import SceneError

DISK = "disk"
PASS_ROLES = tuple(f"disk_pass_{number}" for number in range(1, len(disk_group.PASS_NAMES) + 1))
TABLE_ROLES = {
    disk_group.PROFILE: "disk_profile",
    disk_group.COLOURS: "disk_colours",
    disk_group.TEXTURE: "disk_texture",
}
SOCKET = "Disk"  # of the group "Umbra Black Hole"


def refresh_hole(hole: bpy.types.Object) -> None:
    """Carry a change of a hole's settings into all scenes that render it."""
    for scene in bpy.data.scenes:
        if isinstance(hole, bpy.types.Object) and shot.find_active_hole(scene) == hole:
            refresh(scene)


def refresh(scene: bpy.types.Scene) -> None:
    """Put the disk's nodes into the scene's compositor, bring them up to date, or take them out."""
    hole = shot.find_active_hole(scene)
    settings = None if hole is None else hole.umbra.disk
    disk_light.refresh(scene, hole)
    setup = find_setup(scene)
    if setup is None or setup.tree.library is not None:
        return
    if settings is None or not settings.enabled:
        remove(setup)
        return
    node = _ensure_nodes(setup)
    disk = disk_properties.disk_of(settings)
    try:
        disk.validate(hole.umbra.spin, scene.umbra.method)
    except physics.BlackHoleError:
        pass  # whoever reads the shot says so
    else:
        write_geometry(scene, hole, float(hole.umbra.spin), disk)
    _follow_settings(setup, node, hole, scene)
    _point_passes(scene, setup)


def check_shot(scene: bpy.types.Scene, parameters: "physics.WarpMapParameters") -> None:
    """Refuse a frame whose disk is not the one that the compositor draws.

    Blender takes the compositor's values from before the frame; what is written while it renders comes too late.

    Raises
    ------
    SceneError
        The spin, from which the disk's place and its pattern follow, is animated.
    """
    hole = shot.active_hole(scene)
    if parameters.disk is not None and write_geometry(scene, hole, parameters.spin, parameters.disk):
        raise SceneError(
            f'The spin of "{hole.name}" is animated, which its disk cannot follow within one render: remove the '
            "keyframes, or render these frames one by one."
        )


def write_geometry(scene: bpy.types.Scene, hole: bpy.types.Object, spin: float, disk: "physics.Disk") -> bool:
    """Write edges, spin and the pattern's period into the sockets, and the profile into its table.

    Returns whether anything was different before.
    """
    setup = find_setup(scene)
    node = None if setup is None else find_node(setup.tree, DISK)
    if node is None:
        return False
    changed = False
    inner, outer = disk.radii(spin)
    values = {
        disk_group.IMAGES: float(disk.crossings),
        disk_group.PERIOD: disk_texture.pattern_period(spin, inner, outer, disk.retrograde),
        disk_group.SPIN: spin,
        disk_group.DIRECTION: orbiting_matter.matter_direction(spin, disk.retrograde),
        disk_group.INNER: inner,
        disk_group.OUTER: outer,
    }
    for name, value in values.items():
        if not math.isclose(node.inputs[name].default_value, value, rel_tol=1e-6, abs_tol=1e-9):
            node.inputs[name].default_value = value
            changed = True
    settings = hole.umbra.disk
    table = find_node(setup.tree, TABLE_ROLES[disk_group.PROFILE])
    image = disk_images.ensure_profile(
        hole.name, settings.profile, settings.exponent, spin, inner, outer, disk.retrograde
    )
    if table.image != image:
        table.image = image
    _follow_time(setup, node, hole, scene)
    return changed


# --- nodes ----------------------------------------------------------------------------------------


def _ensure_nodes(setup: Setup) -> bpy.types.Node:
    tree = setup.tree
    node = find_node(tree, DISK)
    if node is None:
        node = disk_group.GROUP.add_node(tree)
        node[ROLE] = DISK
        x, y = setup.group.location
        node.location = (x - 300, y - 1100)
    group = disk_group.GROUP.ensure()
    if node.node_tree != group:
        node.node_tree = group
    roles = (*PASS_ROLES, *TABLE_ROLES.values())
    names = (*disk_group.PASS_NAMES, *TABLE_ROLES)
    for index, (role, name) in enumerate(zip(roles, names, strict=True)):
        image = find_node(tree, role)
        if image is None:
            image = tree.nodes.new("CompositorNodeImage")
            image[ROLE] = role
            image.name, image.label = f"Umbra Disk {name}", f"Disk {name}"
            image.location = (node.location.x - 300, node.location.y - 340 * index)
        if not node.inputs[name].is_linked:
            tree.links.new(image.outputs["Image"], node.inputs[name])
    if not setup.group.inputs[SOCKET].is_linked:
        tree.links.new(node.outputs[disk_group.OUTPUT], setup.group.inputs[SOCKET])
    return node


def remove(setup: Setup) -> None:
    """Take the disk's nodes out of a compositor."""
    tree = setup.tree
    node = find_node(tree, DISK)
    if node is not None:
        _remove_drivers(tree, node.path_from_id() + ".")
    for role in (DISK, *PASS_ROLES, *TABLE_ROLES.values()):
        node = find_node(tree, role)
        if node is None:
            continue
        used = node.node_tree if role == DISK else node.image
        tree.nodes.remove(node)
        if used is None or used.users > 0:
            continue
        if role == DISK:
            bpy.data.node_groups.remove(used)
        elif role in PASS_ROLES:
            bpy.data.images.remove(used)
    disk_images.remove_unused()


def _remove_drivers(tree: bpy.types.NodeTree, prefix: str) -> None:
    if tree.animation_data is not None:
        for curve in [each for each in tree.animation_data.drivers if each.data_path.startswith(prefix)]:
            tree.animation_data.drivers.remove(curve)


# --- settings -------------------------------------------------------------------------------------


def _follow_settings(setup: Setup, node: bpy.types.Node, hole: bpy.types.Object, scene: bpy.types.Scene) -> None:
    settings = hole.umbra.disk
    animated = _animated_paths(hole)
    for field, name in disk_group.LOOK_SOCKETS.items():
        path = f"umbra.disk.{field}"
        source = (hole, path) if path in animated else None
        _set(setup.tree, node.inputs[name], getattr(settings, field), "a" if source else None, source)
    node.inputs[disk_group.BEAMING].default_value = disk_properties.BEAMINGS[settings.beaming]
    images = {
        disk_group.COLOURS: disk_images.ensure_colours(),
        disk_group.TEXTURE: settings.texture or disk_images.ensure_texture(),
    }
    for name, image in images.items():
        table = find_node(setup.tree, TABLE_ROLES[name])
        if table.image != image:
            table.image = image


def _follow_time(setup: Setup, node: bpy.types.Node, hole: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Let phase and turns of the patterns follow the frame; see `physics.disk_texture.pattern_shares`."""
    settings = hole.umbra.disk
    period = node.inputs[disk_group.PERIOD].default_value
    time_of_a_frame = settings.turning_speed * scene.render.fps_base / scene.render.fps
    lives = f"(frame*{time_of_a_frame / period!r})"
    (age, _, first), (_, _, second) = disk_texture.pattern_shares(scene.frame_current * time_of_a_frame, period)
    for name, value, expression in (
        (disk_group.PHASE, age / period, f"{lives}-floor{lives}"),
        (disk_group.FIRST_TURN, first, _turn(f"2*floor{lives}")),
        (disk_group.SECOND_TURN, second, _turn(f"(2*floor({lives}+0.5)+1)")),
    ):
        _set(setup.tree, node.inputs[name], value, expression)


def _turn(number: str) -> str:
    """2 pi times the fraction of the number of a pattern times the golden section."""
    turns = f"{number}*{disk_texture.TURN_BETWEEN!r}"
    return f"{2.0 * math.pi!r}*({turns}-floor({turns}))"


def _animated_paths(hole: bpy.types.Object) -> set[str]:
    """The hole's properties that have keyframes or drivers; strips of other actions are left out."""
    animation = hole.animation_data
    if animation is None:
        return set()
    paths = {curve.data_path for curve in animation.drivers}
    if animation.action is not None:
        for layer in animation.action.layers:
            for strip in layer.strips:
                for bag in strip.channelbags:
                    paths.update(curve.data_path for curve in bag.fcurves)
    return paths


def _set(
    tree: bpy.types.NodeTree,
    socket: bpy.types.NodeSocket,
    value: float,
    expression: str | None = None,
    source: tuple[bpy.types.ID, str] | None = None,
) -> None:
    """Give a socket a value and, with an expression, a driver; the expression may use a property as `a`."""
    path = socket.path_from_id("default_value")
    present = tree.animation_data.drivers.find(path) if tree.animation_data is not None else None
    if present is not None and not (expression is not None and _drives(present, expression, source)):
        tree.animation_data.drivers.remove(present)
        present = None
    if present is None and expression is not None:
        driver = socket.driver_add("default_value").driver
        driver.type = "SCRIPTED"
        if source is not None:
            variable = driver.variables.new()
            variable.name = "a"
            variable.targets[0].id, variable.targets[0].data_path = source
        driver.expression = expression
    if not math.isclose(socket.default_value, value, rel_tol=1e-6, abs_tol=1e-9):
        socket.default_value = value


def _drives(curve: bpy.types.FCurve, expression: str, source: tuple[bpy.types.ID, str] | None) -> bool:
    driver = curve.driver
    found = [(each.targets[0].id, each.targets[0].data_path) for each in driver.variables]
    return driver.is_valid and driver.expression == expression and found == ([] if source is None else [source])


# --- passes ---------------------------------------------------------------------------------------


def _point_passes(scene: bpy.types.Scene, setup: Setup) -> None:
    """Let the passes be read from beside the map that is read."""
    from . import sync  # it calls this module

    if setup.map is not None and setup.map.image is not None:
        sync.point_passes(setup, setup.map.image.filepath)


def passes_of(setup: Setup) -> list[tuple[bpy.types.Node, int]]:
    """The image nodes of the passes that there are, and the numbers of their crossings."""
    nodes = [(find_node(setup.tree, role), number) for number, role in enumerate(PASS_ROLES, start=1)]
    return [(node, number) for node, number in nodes if node is not None]
