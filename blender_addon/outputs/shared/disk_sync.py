# SPDX-License-Identifier: GPL-3.0-or-later
"""Keep the group "Umbra Disk" in a scene's compositor while its hole has a disk, and in step with the settings.

Time is followed by drivers that need no add-on, so that a .blend and its maps render the same without it. So are
settings that are animated; but their drivers read this add-on's properties.
"""

import math

import bpy

from ...core.errors import SceneError
from ...core.physics_api import physics
from ...nodes import disk_group, disk_images
from ...scene import disk_animation, frame_setup
from ...settings import disk_properties
from .compositor_tree import ROLE, find_node, find_tree
from .map_images import drop_live, keep_as_data, read_sequence

DISK = "disk"
PICTURE_ROLES = {picture.socket: picture.role for picture in disk_images.PICTURES.values()}
# Nodes that only files have whose group was of version 1.
FORMER_ROLES = ("disk_profile",)


def pass_role(number: int) -> str:
    """Role of the node that reads the pass of an image, counted from 1."""
    return f"disk_pass_{number}"


def wanted_hole(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the scene's hole if its disk is switched on."""
    hole = frame_setup.find_active_hole(scene)
    return hole if hole is not None and hole.umbra.disk.enabled else None


def update(scene: bpy.types.Scene, hole: bpy.types.Object, node: bpy.types.Node) -> None:
    """Carry the disk's settings into its node: values, and drivers where they are animated."""
    tree = node.id_data
    disk = disk_properties.disk_of(hole.umbra.disk)
    if disk is None:
        return
    try:
        disk.validate(hole.umbra.spin, scene.umbra.method)
    except physics.BlackHoleError:
        pass  # whoever reads the frame reports it
    else:
        _follow_geometry(tree, node, hole, disk)
        _follow_time(tree, node, hole, scene)
    _follow_settings(tree, node, hole)


def check_shot(scene: bpy.types.Scene, parameters: "physics.WarpMapParameters") -> None:
    """Refuse a frame whose disk is not the one that the compositor draws.

    Blender takes the compositor's values from before the frame; what is written while it renders comes too late. Values
    with keyframes or drivers have drivers of their own, which are evaluated in time; strips have none.

    Raises
    ------
    SceneError
        The spin or an edge is animated in a way that is not followed.
    """
    tree = find_tree(scene)
    node = None if tree is None else find_node(tree, DISK)
    if parameters.disk is None or node is None:
        return
    hole = frame_setup.active_hole(scene)
    for name, (value, path) in _geometry(hole, parameters.spin, parameters.disk).items():
        socket = node.inputs[name]
        if path is None and not _is_close(socket.default_value, value):
            raise SceneError(
                f'The spin or the edges of "{hole.name}" are animated in a way that its disk cannot follow: give them '
                "keyframes of their own in place of strips of the Nonlinear Animation.",
                code="disk.strips",
            )
    if disk_animation.in_strips(hole) & {f"umbra.disk.{field}" for field in disk_group.LOOK_SOCKETS}:
        raise SceneError(
            f'Settings of the disk of "{hole.name}" are moved by strips of the Nonlinear Animation, which its picture '
            "cannot follow: give them keyframes of their own (Object > Animation > Bake Action).",
            code="disk.strips",
        )
    driven = sorted(disk_animation.driven(hole) & {disk_animation.SPIN, disk_animation.INNER, disk_animation.OUTER})
    if driven:
        raise SceneError(
            f'{driven[0].rpartition(".")[2].replace("_", " ").capitalize()} of "{hole.name}" has a driver, of which '
            "the disk's streaks cannot know other frames: give it keyframes (Object > Animation > Bake Action).",
            code="disk.driver",
        )


# --- nodes ----------------------------------------------------------------------------------------


def ensure_node(scene: bpy.types.Scene, tree: bpy.types.NodeTree) -> bpy.types.Node:
    """The node of the disk's group in a tree, with the nodes of its pictures; not linked to anything else."""
    settings = frame_setup.active_hole(scene).umbra.disk
    images = int(settings.crossings)
    group = disk_group.ensure(images, disk_properties.shows_picture(settings))
    node = find_node(tree, DISK)
    if node is None:
        node = tree.nodes.new("CompositorNodeGroup")
        node[ROLE] = DISK
        node.width = 220.0
    former = node.node_tree
    if former != group:
        targets = {each.name: [link.to_socket for link in each.links] for each in node.outputs}
        behind = node.inputs.get(disk_group.BEHIND)
        picture = behind.links[0].from_socket if behind is not None and behind.is_linked else None
        _remove_drivers(tree, node.path_from_id() + ".")
        for link in [link for socket in node.inputs for link in socket.links]:
            tree.links.remove(link)  # kept, they would go by the order of the sockets
        for role in (*(pass_role(number) for number in range(images + 1, physics.MOST_CROSSINGS + 1)), *FORMER_ROLES):
            _remove_node(tree, role)
        node.node_tree = group
        for name, sockets in targets.items():
            for socket in sockets:
                tree.links.new(node.outputs[name], socket)
        if picture is not None:
            tree.links.new(picture, node.inputs[disk_group.BEHIND])
        disk_group.remove_unused()
    node.name = node.label = disk_group.GROUP_NAME
    roles = (*(pass_role(number) for number in range(1, images + 1)), *PICTURE_ROLES.values())
    for role, name in zip(roles, (*disk_group.pass_names(images), *PICTURE_ROLES), strict=True):
        image = find_node(tree, role)
        if image is None:
            image = tree.nodes.new("CompositorNodeImage")
            image[ROLE] = role
            image.name, image.label = f"Umbra Disk {name}", f"Disk {name}"
        if not any(link.from_node == image for link in node.inputs[name].links):
            tree.links.new(image.outputs["Image"], node.inputs[name])
    arrange(tree, node)
    return node


def arrange(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Lay the disk's pictures out beside its node."""
    roles = (*(pass_role(number) for number in range(1, physics.MOST_CROSSINGS + 1)), *PICTURE_ROLES.values())
    images = [image for image in (find_node(tree, role) for role in roles) if image is not None]
    for index, image in enumerate(images):
        image.location = (node.location.x - 300, node.location.y - 340 * (index + 1))


def remove(tree: bpy.types.NodeTree) -> None:
    """Take the disk's nodes out of a compositor."""
    node = find_node(tree, DISK)
    if node is not None:
        _remove_drivers(tree, node.path_from_id() + ".")
        tree.nodes.remove(node)
        disk_group.remove_unused()
    passes = (pass_role(number) for number in range(1, physics.MOST_CROSSINGS + 1))
    for role in (*passes, *PICTURE_ROLES.values(), *FORMER_ROLES):
        _remove_node(tree, role)
    disk_images.remove_unused()


def _remove_node(tree: bpy.types.NodeTree, role: str) -> None:
    node = find_node(tree, role)
    if node is None:
        return
    drop_live(node)
    image = node.image
    tree.nodes.remove(node)
    if image is not None and image.users == 0 and role.startswith("disk_pass_"):
        bpy.data.images.remove(image)
    disk_images.remove_unused()


def _remove_drivers(tree: bpy.types.NodeTree, prefix: str) -> None:
    if tree.animation_data is not None:
        for curve in [each for each in tree.animation_data.drivers if each.data_path.startswith(prefix)]:
            tree.animation_data.drivers.remove(curve)


# --- settings -------------------------------------------------------------------------------------


def _geometry(hole: bpy.types.Object, spin: float, disk: "physics.Disk") -> dict[str, tuple[float, str | None]]:
    """Values of the sockets that say what the disk is, and the paths that they follow where those are animated."""
    animated = animated_paths(hole)
    turning = disk_animation.SPIN in animated
    inner, outer = disk.radii(spin)
    orbit, factor = "umbra.disk.innermost_orbit", "umbra.disk.flux_factor"
    inner_path = orbit if disk.inner_radius is None else disk_animation.INNER
    inner_moves = turning if disk.inner_radius is None else disk_animation.INNER in animated
    return {
        disk_group.SPIN: (spin, disk_animation.SPIN if turning else None),
        disk_group.DIRECTION: (physics.matter_direction(spin, disk.retrograde), None),
        disk_group.INNER: (inner, inner_path if inner_moves else None),
        disk_group.OUTER: (outer, disk_animation.OUTER if disk_animation.OUTER in animated else None),
        disk_group.INNERMOST: (physics.isco_radius(spin, not disk.retrograde), orbit if turning else None),
        disk_group.FLUX_FACTOR: (1.0 / physics.peak_disk_flux(spin, disk.retrograde), factor if turning else None),
    }


def _follow_geometry(
    tree: bpy.types.NodeTree, node: bpy.types.Node, hole: bpy.types.Object, disk: "physics.Disk"
) -> None:
    for name, (value, path) in _geometry(hole, float(hole.umbra.spin), disk).items():
        _follow(tree, node.inputs[name], value, hole, path)


def _follow_settings(tree: bpy.types.NodeTree, node: bpy.types.Node, hole: bpy.types.Object) -> None:
    settings = hole.umbra.disk
    animated = animated_paths(hole)
    for name, setting in physics.DISK_SETTINGS.items():
        path = f"umbra.disk.{name}"
        value = setting.socket_value(disk_properties.value_of(settings, name))
        _follow(tree, node.inputs[setting.socket], value, hole, path if path in animated else None)
    for picture in disk_images.PICTURES.values():
        reader, image = find_node(tree, picture.role), picture.image(settings)
        if reader is not None and reader.image != image:
            reader.image = image
        if image != settings.texture:
            keep_as_data(image)


def _follow_time(
    tree: bpy.types.NodeTree, node: bpy.types.Node, hole: bpy.types.Object, scene: bpy.types.Scene
) -> None:
    """Let phase and turns of the patterns follow the frame; see `physics.disk_pattern_shares`."""
    settings = hole.umbra.disk
    period = disk_animation.pattern_period(scene, hole)
    _set(tree, node.inputs[disk_group.PERIOD], period)
    time_of_a_frame = settings.turning_speed * scene.render.fps_base / scene.render.fps
    lives = f"(frame*{time_of_a_frame / period!r})"
    (age, _, first), (_, _, second) = physics.disk_pattern_shares(scene.frame_current * time_of_a_frame, period)
    for name, value, expression in (
        (disk_group.PHASE, age / period, f"{lives}-floor{lives}"),
        (disk_group.FIRST_TURN, first, _turn(f"2*floor{lives}")),
        (disk_group.SECOND_TURN, second, _turn(f"(2*floor({lives}+0.5)+1)")),
    ):
        _set(tree, node.inputs[name], value, expression)


def _turn(number: str) -> str:
    """2 pi times the fraction of the number of a pattern times the golden section."""
    turns = f"{number}*{physics.DISK_PATTERN_TURN!r}"
    return f"{2.0 * math.pi!r}*({turns}-floor({turns}))"


def animated_paths(hole: bpy.types.Object) -> set[str]:
    """The hole's properties that have keyframes or drivers; strips of other actions are left out."""
    return disk_animation.driven(hole) | disk_animation.keyframes(hole).keys()


def _follow(
    tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, value: float, hole: bpy.types.Object, path: str | None
) -> None:
    """Give a socket a value, or let it follow a property of the hole."""
    _set(tree, socket, value, None if path is None else "a", None if path is None else (hole, path))


def _is_close(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-9)


def _set(
    tree: bpy.types.NodeTree,
    socket: bpy.types.NodeSocket,
    value: float,
    expression: str | None = None,
    source: tuple[bpy.types.ID, str] | None = None,
) -> None:
    """Give a socket a value and, with an expression, a driver; the expression may use a property as `a`."""
    path = socket.path_from_id("default_value")
    animation = tree.animation_data
    present = animation.drivers.find(path) if animation is not None else None
    if (
        animation is not None
        and present is not None
        and not (expression is not None and _drives(present, expression, source))
    ):
        animation.drivers.remove(present)
        present = None
    if present is None and expression is not None:
        driver = socket.driver_add("default_value").driver
        driver.type = "SCRIPTED"
        if source is not None:
            variable = driver.variables.new()
            variable.name = "a"
            variable.targets[0].id, variable.targets[0].data_path = source
        driver.expression = expression
    if not _is_close(socket.default_value, value):
        socket.default_value = value


def _drives(curve: bpy.types.FCurve, expression: str, source: tuple[bpy.types.ID, str] | None) -> bool:
    driver = curve.driver
    found = [(each.targets[0].id, each.targets[0].data_path) for each in driver.variables]
    return driver.is_valid and driver.expression == expression and found == ([] if source is None else [source])


# --- passes ---------------------------------------------------------------------------------------


def point_passes(tree: bpy.types.NodeTree, path: str) -> None:
    """Let the disk's passes be read from beside a map."""
    for node, crossing in passes_of(tree):
        read_sequence(node, f"Umbra Disk Pass {crossing}", physics.pass_path(path, crossing))


def passes_of(tree: bpy.types.NodeTree) -> list[tuple[bpy.types.Node, int]]:
    """The image nodes of the passes that there are, and the numbers of their crossings."""
    numbers = range(1, physics.MOST_CROSSINGS + 1)
    nodes = [(find_node(tree, pass_role(number)), number) for number in numbers]
    return [(node, number) for node, number in nodes if node is not None]
