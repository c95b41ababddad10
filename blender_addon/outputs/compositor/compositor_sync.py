# SPDX-License-Identifier: GPL-3.0-or-later
"""Carry a scene's settings into its compositor set-up: which maps are read, and which sky."""

from typing import Any

import bpy

from ...bake.folder import folder
from ...bake.kinds import LIGHT_LAYER, STAR_LAYER, WARP_MAP
from ...bake.names import sequence_path
from ...core.errors import SceneError
from ...core.physics_api import physics
from ...nodes import black_hole_group
from ...scene import cameras, frame_setup
from ...scene.sky import environment, sky_frames
from ...scene.sky.node_paths import Place
from ...settings.scene_properties import glare_of, looks_of
from ..shared import disk_light, disk_sync
from ..shared.compositor_tree import FOOTPRINT, STARS, Setup, find_node, find_setup, find_tree, takes_sky_from_settings
from ..shared.map_images import NO_MAP, file_image, plain_layer, plain_map, read_sequence
from . import depth, disk, sky_filter, stars

MAP_IMAGE_NAME = "Umbra Warp Map"

ROTATION_SOCKET, STRENGTH_SOCKET = "Environment Rotation", "Environment Strength"


def repair(scene: bpy.types.Scene, *, thorough: bool = True) -> bool:
    """Make the node group of an existing set-up whole and of this version; whether there was something to do.

    Thorough: the group's inside is looked through as well, which takes up to a tenth of a second; else its sockets.
    """
    setup = find_setup(scene)
    if setup is None or setup.tree.library is not None:
        return False
    tree = setup.group.node_tree
    inputs, outputs = setup.group.inputs, setup.group.outputs
    whole = all(spec.name in inputs for spec in black_hole_group.INPUTS)
    whole = whole and all(spec.name in outputs for spec in black_hole_group.OUTPUTS)
    looks, glare = looks_of(scene.umbra), glare_of(scene.umbra)
    if black_hole_group.kind_of(tree) != black_hole_group.group_of(looks, glare):
        whole = False
    elif whole and thorough and tree is not None:
        whole = black_hole_group.is_current(tree)
    if whole:
        return False
    black_hole_group.use(setup.group, looks, glare)
    return True


def refresh(scene: bpy.types.Scene, notes: list[str] | None = None) -> None:
    """Carry the scene's settings into an existing set-up: which maps, which sky. Failures become notes."""
    setup = find_setup(scene)
    if setup is None:
        return
    repair(scene, thorough=False)
    if setup.tree.library is None:
        sky_filter.refresh_nodes(scene, setup)
    refresh_stars(scene)
    disk_light.refresh(scene, frame_setup.find_active_hole(scene))
    disk.refresh(scene)
    depth.refresh(scene)
    try:
        point_at_maps(scene)
    except SceneError as error:
        if notes is not None:
            notes.append(error.for_user())
    try:
        sync_sky(scene)
    except physics.BlackHoleError as error:
        if notes is not None:
            notes.append(error.for_user())


def refresh_stars(scene: bpy.types.Scene) -> None:
    """Put the node that reads stars into an existing set-up, or take it out, as the settings say."""
    setup = find_setup(scene)
    if setup is not None and setup.tree.library is None:
        stars.refresh_node(scene, setup)


def point_at_maps(scene: bpy.types.Scene) -> None:
    """Let the nodes read the scene's maps, and layers of light, of the current resolution.

    Raises
    ------
    SceneError
        There is no hole.
    """
    hole = frame_setup.active_hole(scene)
    samples = int(scene.umbra.supersampling)
    width, height = cameras.render_size(scene.render)
    size = (width * samples, height * samples)
    light = sequence_path(scene, hole.name, (width, height), LIGHT_LAYER)
    points = sequence_path(scene, hole.name, (width, height), STAR_LAYER)
    _set_paths(scene, sequence_path(scene, hole.name, size, WARP_MAP), light, points)


def point_at_nothing(scene: bpy.types.Scene) -> None:
    """Let the nodes read no map at all: the picture is magenta until a valid map is in place."""
    nothing = folder(scene).blender_path + NO_MAP
    _set_paths(scene, nothing, nothing, nothing)


def point_at_plain_map(scene: bpy.types.Scene) -> None:
    """Let the nodes read, at this frame, a map that bends nothing, no disk and no stars."""
    plain = plain_layer(scene.frame_current)
    _set_paths(scene, plain_map(scene.frame_current), plain, plain)


def _set_paths(scene: bpy.types.Scene, path: str, light_path: str, stars_path: str) -> None:
    setup = find_setup(scene)
    if setup is None or setup.map is None:
        return
    read_sequence(setup.map, MAP_IMAGE_NAME, path)
    disk_sync.point_at(setup.tree, light_path)
    stars.point_at(setup.tree, stars_path)
    sky_filter.point_at_footprints(setup.tree, path)


def forget_loaded_map(scene: bpy.types.Scene) -> None:
    """Let Blender read the maps anew from their files."""
    for node in map_nodes(scene):
        image = file_image(node)
        if image is not None:
            image.reload()
            image.update_tag()  # else the viewport's compositor keeps what it has


def map_nodes(scene: bpy.types.Scene) -> list[bpy.types.Node]:
    """Return the nodes that read maps: the warp map's first, if it is there, then those of what lies beside it."""
    setup, tree = find_setup(scene), find_tree(scene)
    if tree is None:
        return []
    beside = [find_node(tree, role) for role in (FOOTPRINT, disk_sync.LAYER, STARS)]
    found = [None if setup is None else setup.map, *beside]
    return [node for node in found if node is not None]


def sync_sky(scene: bpy.types.Scene) -> None:
    """Bring image, rotation and strength of the sky into the set-up.

    A World's rotation and strength are followed by drivers, so that they stay in step when they are animated,
    and in a Blender that lacks this add-on.

    Raises
    ------
    SceneError
        There is no sky, or it cannot be read.
    """
    setup = find_setup(scene)
    if setup is None or setup.sky is None or not takes_sky_from_settings(setup):
        return
    sky = environment.read(scene)
    node: Any = setup.sky
    image = stars.texture(scene, setup, sky.image)
    is_new = node.image != image
    if is_new:
        node.image = image
    _link_picture(setup, node)
    if sky_frames.moves(sky.image):
        if sky.texture is not None:
            sky_frames.copy_settings(sky.texture.image_user, node)
        elif is_new or node.frame_duration <= 1:  # else they are the artist's own
            sky_frames.set_defaults(sky.image, node)
    environment.check_image(image)
    sky_filter.sync(scene, setup, image)
    from_world = scene.umbra.environment_source == "WORLD"
    _follow(scene, setup, ROTATION_SOCKET, sky.rotation_at, sky.rotation, fixed=from_world)
    _follow(scene, setup, STRENGTH_SOCKET, sky.strength_at, sky.strength, fixed=from_world)


def _link_picture(setup: Setup, node: bpy.types.Node) -> None:
    """Let the group take the picture of the sky's node: of a file of layers that is another output."""
    pictures = [each for each in node.outputs if each.enabled and each.type == "RGBA"]
    combined = [each for each in pictures if each.name == "Combined"]
    picture = next(iter(combined or pictures), None)
    socket = setup.group.inputs["Environment"]
    if picture is not None and not any(link.from_socket == picture for link in socket.links):
        setup.tree.links.new(picture, socket)


def check_frame(scene: bpy.types.Scene) -> None:
    """Refuse a frame whose sky has no file.

    Raises
    ------
    SceneError
        The file is missing.
    """
    setup = find_setup(scene)
    if setup is not None and setup.sky is not None and setup.sky.image is not None and takes_sky_from_settings(setup):
        sky_frames.check_frame(setup.sky.image, scene.frame_current, setup.sky)
        if sky_frames.moves(setup.sky.image):
            sky_filter.ensure_files(scene, setup, may_bake=scene.umbra.auto_bake)


def _follow(
    scene: bpy.types.Scene,
    setup: Setup,
    socket_name: str,
    place: Place | None,
    value: "float | tuple[float, float, float]",
    *,
    fixed: bool,
) -> None:
    """Drive a socket of the group by a World's value; without a place of that, write a `fixed` value once."""
    socket = setup.group.inputs.get(socket_name)
    if socket is None:
        return
    is_vector = not isinstance(value, float)
    socket_path = socket.path_from_id("default_value")
    animation = setup.tree.animation_data
    drivers = animation.drivers if animation is not None else ()
    present = [each for each in drivers if each.data_path == socket_path]
    if place is None:
        _remove(setup.tree, present)
        if fixed:
            socket.default_value = value
        elif present:  # the World's values are not those of a picture chosen by hand
            socket.default_value = (0.0, 0.0, 0.0) if is_vector else 1.0
        return
    owner, path = _target(scene, place)
    wanted = [f"{path}[{index}]" for index in range(3)] if is_vector else [path]
    if [_driven_by(each, owner) for each in sorted(present, key=lambda each: each.array_index)] == wanted:
        return
    _remove(setup.tree, present)
    for index, data_path in enumerate(wanted):
        driver = socket.driver_add("default_value", *([index] if is_vector else [])).driver
        driver.type = "SUM"
        variable = driver.variables.new()
        target = variable.targets[0]
        target.id_type = "NODETREE" if isinstance(owner, bpy.types.NodeTree) else "WORLD"
        target.id = owner
        target.data_path = data_path
    socket.default_value = value


def _target(scene: bpy.types.Scene, place: Place) -> tuple[bpy.types.ID, str]:
    """Whose value a driver reads, and its path: a World's own nodes are not a datablock by themselves."""
    world = scene.world
    if world is not None and place.owner == world.node_tree:
        return world, f"node_tree.{place.path}"
    return place.owner, place.path


def _remove(tree: bpy.types.NodeTree, drivers: list[bpy.types.FCurve]) -> None:
    for each in drivers:
        if tree.animation_data is not None:
            tree.animation_data.drivers.remove(each)


def _driven_by(curve: bpy.types.FCurve, owner: bpy.types.ID) -> str | None:
    variables = curve.driver.variables
    if len(variables) != 1 or variables[0].targets[0].id != owner or not curve.driver.is_valid:
        return None
    return variables[0].targets[0].data_path
