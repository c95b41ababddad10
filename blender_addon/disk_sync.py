# SPDX-License-Identifier: GPL-3.0-or-later
"""Keep the group "Umbra Disk" in a scene's compositor while its hole has a disk, and in step with the settings.

Settings that may be animated are followed by drivers, and so is time: a .blend and its maps render the same without
this add-on. Only what follows from the disk's edges and the hole's spin is written into the sockets, by whoever
knows the frame's shot.
"""

import math

import bpy

from . import disk_group, disk_images, disk_light, disk_properties, shot
from ._physics import disk_texture, orbiting_matter, physics
from .compositor_tree import ROLE, Setup, find_node, find_setup

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


def write_shot(scene: bpy.types.Scene, parameters: "physics.WarpMapParameters") -> None:
    """Write what follows from a frame's spin and disk, both of which may be animated."""
    if parameters.disk is not None:
        write_geometry(scene, shot.active_hole(scene), parameters.spin, parameters.disk)


def write_geometry(scene: bpy.types.Scene, hole: bpy.types.Object, spin: float, disk: "physics.Disk") -> None:
    """Write edges, spin and the pattern's period into the sockets, and the profile into its table."""
    setup = find_setup(scene)
    node = None if setup is None else find_node(setup.tree, DISK)
    if node is None:
        return
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
    settings = hole.umbra.disk
    table = find_node(setup.tree, TABLE_ROLES[disk_group.PROFILE])
    image = disk_images.ensure_profile(settings.profile, settings.exponent, spin, inner, outer, disk.retrograde)
    if table.image != image:
        table.image = image


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
    for field, name in disk_group.LOOK_SOCKETS.items():
        _drive(setup.tree, node.inputs[name], "a", {"a": (hole, f"umbra.disk.{field}")}, getattr(settings, field))
    node.inputs[disk_group.BEAMING].default_value = disk_properties.BEAMINGS[settings.beaming]
    images = {
        disk_group.COLOURS: disk_images.ensure_colours(),
        disk_group.TEXTURE: settings.texture or disk_images.ensure_texture(),
    }
    for name, image in images.items():
        table = find_node(setup.tree, TABLE_ROLES[name])
        if table.image != image:
            table.image = image
    # Time in patterns' lives, c; see `physics.disk_texture.pattern_shares`.
    variables = {
        "s": (hole, "umbra.disk.turning_speed"),
        "f": (scene, "render.fps"),
        "b": (scene, "render.fps_base"),
    }
    period = node.inputs[disk_group.PERIOD].default_value
    lives = f"(frame*s*b/f/{period:.9g})"
    golden = repr(disk_texture.TURN_BETWEEN)
    expressions = {
        disk_group.PHASE: f"{lives}-floor{lives}",
        disk_group.FIRST_TURN: _turn(f"2*floor{lives}", golden),
        disk_group.SECOND_TURN: _turn(f"(2*floor({lives}+0.5)+1)", golden),
    }
    now = scene.frame_current * settings.turning_speed * scene.render.fps_base / scene.render.fps
    (age, _, first), (_, _, second) = disk_texture.pattern_shares(now, period)
    values = {disk_group.PHASE: age / period, disk_group.FIRST_TURN: first, disk_group.SECOND_TURN: second}
    for name, expression in expressions.items():
        _drive(setup.tree, node.inputs[name], expression, variables, values[name])


def _turn(number: str, golden: str) -> str:
    """2 pi times the fraction of the number of a pattern times the golden section."""
    return f"6.283185307179586*({number}*{golden}-floor({number}*{golden}))"


def _drive(
    tree: bpy.types.NodeTree,
    socket: bpy.types.NodeSocket,
    expression: str,
    variables: dict[str, tuple[bpy.types.ID, str]],
    value: float,
) -> None:
    """Let a socket follow an expression of properties, and give it the value of now."""
    path = socket.path_from_id("default_value")
    present = tree.animation_data.drivers.find(path) if tree.animation_data is not None else None
    if present is None or not _drives(present, expression, variables):
        if present is not None:
            tree.animation_data.drivers.remove(present)
        driver = socket.driver_add("default_value").driver
        driver.type = "SCRIPTED"
        for name, (owner, data_path) in variables.items():
            variable = driver.variables.new()
            variable.name = name
            variable.targets[0].id_type = "SCENE" if isinstance(owner, bpy.types.Scene) else "OBJECT"
            variable.targets[0].id = owner
            variable.targets[0].data_path = data_path
        driver.expression = expression
    if not math.isclose(socket.default_value, value, rel_tol=1e-6, abs_tol=1e-9):
        socket.default_value = value


def _drives(curve: bpy.types.FCurve, expression: str, variables: dict[str, tuple[bpy.types.ID, str]]) -> bool:
    driver = curve.driver
    found = {each.name: (each.targets[0].id, each.targets[0].data_path) for each in driver.variables}
    return driver.is_valid and driver.expression == expression and found == variables


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
