# SPDX-License-Identifier: GPL-3.0-or-later
"""A glowing mesh in the place of the disk that lights the scene's objects, and that no camera sees.

It gives off the light of the disk at rest, averaged over its turbulence: to be as bright as what is seen is all that
"matched" can mean, for the picture's brightness is the artist's to choose. A thick disk is a closed surface.
"""

import math

import bpy
import numpy as np

from ...core import color_spaces
from ...core.blender_version import NODES_ARE_OPTIONAL
from ...core.physics_api import physics
from ...scene import disk_animation, disk_picture, frame_setup

NAME = "Umbra Disk Light"
MARK = "umbra_disk_light"
_MADE_FROM = "umbra_made_from"
_ATTRIBUTE = "Light"
_STRENGTH = "Strength"

RINGS, SEGMENTS = 48, 96


def find(hole: bpy.types.Object | None) -> bpy.types.Object | None:
    """The light of a hole's disk."""
    return None if hole is None else next((each for each in hole.children if MARK in each), None)


def refresh(scene: bpy.types.Scene, hole: bpy.types.Object | None) -> None:
    """Add the light where the settings ask for it, bring it up to date, or remove it."""
    for light in [each for each in scene.objects if MARK in each and (hole is None or each.parent != hole)]:
        _remove(light)  # its hole is gone, or is not the one that is rendered
    if hole is None or hole.library is not None:
        return
    settings = hole.umbra.disk
    present = find(hole)
    if not (settings.enabled and settings.light):
        if present is not None:
            _remove(present)
        return
    frame = scene.frame_current
    spin, disk = disk_animation.disk_at(hole, frame)
    look = disk_animation.look_at(hole, frame)
    try:
        disk.validate(spin, physics.DEFAULT_METHOD)
        look.validate()
    except physics.BlackHoleError:
        return  # whoever reads the shot says so
    light = present or _add(scene, hole)
    if light.animation_data is None:  # made by version 0.1.0
        _hide_with(hole, light)
    picture = disk_picture.picture_of(settings)
    tint = tuple(settings.tint)
    made_from = repr((spin, disk, look, tint, "" if picture is None else picture.digest))
    if light.data.get(_MADE_FROM) != made_from:
        _fill(light.data, disk, look, spin, tint, picture)
        light.data[_MADE_FROM] = made_from
    scale = disk_animation.value_at(hole, "umbra.mass_scale", frame)
    if not all(math.isclose(each, scale, rel_tol=1e-6) for each in light.scale):
        light.scale = (scale,) * 3
    material = light.active_material
    if material is None:
        return
    strength = material.node_tree.nodes[_STRENGTH].inputs["Strength"]
    wanted, exposure, opacity = (
        disk_animation.value_at(hole, f"umbra.disk.{name}", frame) for name in ("light_strength", "exposure", "opacity")
    )
    wanted *= 2.0**exposure * opacity
    if not math.isclose(strength.default_value, wanted, rel_tol=1e-6, abs_tol=1e-9):
        strength.default_value = wanted


def follow(scene: bpy.types.Scene, hole: bpy.types.Object | None) -> None:
    """Bring the light to the scene's frame, where settings of the hole have keyframes."""
    if hole is not None and find(hole) is not None and disk_animation.keyframes(hole):
        refresh(scene, hole)


def _fill(
    mesh: bpy.types.Mesh,
    disk: "physics.Disk",
    look: "physics.MatterLook",
    spin: float,
    tint: tuple[float, ...],
    picture: "physics.Picture | None",
) -> None:
    """Make the surface, in units of M, its light at each vertex."""
    radii = np.geomspace(*disk.radii(spin), RINGS)
    heights = np.zeros(RINGS)
    if look.thickness > 0.0:  # up along the inner rim, out over the top, and back along the bottom
        tall = radii * look.thickness * (radii / radii[0]) ** look.flare
        radii = np.concatenate([radii, radii[::-1], radii[:1]])
        heights = np.concatenate([tall, -tall[::-1], tall[:1]])
    rings = len(radii)
    angles = np.arange(SEGMENTS) * (2.0 * math.pi / SEGMENTS)
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(SEGMENTS)], axis=-1)
    places = radii[:, None, None] * around
    places[..., 2] = heights[:, None]
    ring, segment = np.divmod(np.arange((rings - 1) * SEGMENTS), SEGMENTS)
    after = (segment + 1) % SEGMENTS
    corners = np.stack([ring * SEGMENTS + segment, (ring + 1) * SEGMENTS + segment], axis=-1)
    others = np.stack([(ring + 1) * SEGMENTS + after, ring * SEGMENTS + after], axis=-1)
    mesh.clear_geometry()
    mesh.from_pydata(places.reshape(-1, 3).tolist(), [], np.concatenate([corners, others], axis=-1).tolist())
    colors = np.ones((rings, SEGMENTS, 4), np.float32)
    light = color_spaces.to_scene_linear(physics.disk_radiance(look, disk, spin, radii, picture))
    colors[..., :3] = (light * np.array(tint))[:, None, :]
    attribute = mesh.attributes.new(_ATTRIBUTE, "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", colors.ravel())
    mesh.update()


def _add(scene: bpy.types.Scene, hole: bpy.types.Object) -> bpy.types.Object:
    light = bpy.data.objects.new(NAME, bpy.data.meshes.new(NAME))
    light[MARK] = True
    light.data.materials.append(_material())
    light.parent = hole
    light.hide_select = True
    light.display_type = "WIRE"
    light.visible_camera = False
    light.visible_shadow = False
    _hide_with(hole, light)
    homes = [each for each in hole.users_collection if each in (scene.collection, *scene.collection.children_recursive)]
    (homes[0] if homes else scene.collection).objects.link(light)
    return light


def _hide_with(hole: bpy.types.Object, light: bpy.types.Object) -> None:
    """Have the light hidden where its hole is, by drivers, which need no add-on."""
    for name in ("hide_render", "hide_viewport"):
        driver = light.driver_add(name).driver
        driver.type = "SUM"
        variable = driver.variables.new()
        variable.targets[0].id = hole
        variable.targets[0].data_path = name


def remove_orphans(scene: bpy.types.Scene) -> None:
    """Remove the light of a hole that was deleted; nothing is looked through where there is no light."""
    if bpy.data.objects.get(NAME) is not None and frame_setup.find_active_hole(scene) is None:
        for light in [each for each in scene.objects if MARK in each]:
            _remove(light)


def _material() -> bpy.types.Material:
    """Emission by the vertices' light; camera rays pass, in engines that know no ray visibility too."""
    material = bpy.data.materials.new(NAME)
    if NODES_ARE_OPTIONAL:
        material.use_nodes = True  # always so from 5.0 on, where setting it is deprecated
    tree = material.node_tree
    tree.nodes.clear()
    kinds = ("Attribute", "Emission", "BsdfTransparent", "LightPath", "MixShader", "OutputMaterial")
    nodes = {}
    for index, kind in enumerate(kinds):
        nodes[kind] = tree.nodes.new(f"ShaderNode{kind}")
        nodes[kind].location = (220.0 * index, 0.0)
    nodes["Attribute"].attribute_name = _ATTRIBUTE
    nodes["Emission"].name = _STRENGTH
    for origin, target in (
        (nodes["Attribute"].outputs["Color"], nodes["Emission"].inputs["Color"]),
        (nodes["LightPath"].outputs["Is Camera Ray"], nodes["MixShader"].inputs[0]),
        (nodes["Emission"].outputs[0], nodes["MixShader"].inputs[1]),
        (nodes["BsdfTransparent"].outputs[0], nodes["MixShader"].inputs[2]),
        (nodes["MixShader"].outputs[0], nodes["OutputMaterial"].inputs["Surface"]),
    ):
        tree.links.new(origin, target)
    return material


def _remove(light: bpy.types.Object) -> None:
    mesh, material = light.data, light.active_material
    bpy.data.objects.remove(light)
    if mesh.users == 0:
        bpy.data.meshes.remove(mesh)
    if material is not None and material.users == 0:
        bpy.data.materials.remove(material)
