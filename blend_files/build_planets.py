# SPDX-License-Identifier: GPL-3.0-or-later
"""Build planets.blend: worlds behind and beside a black hole that bends the camera's rays (Output: Cycles Lens).

PYTHONPATH=. .venv-py311/bin/python blend_files/build_planets.py
"""

from __future__ import annotations

import math

import scene_tools as tools
import skies
from scene_tools import Color, MeshParts, bpy

FRAMES = 72
SKY_HEIGHT, STAR_WIDTH, SKY_QUALITY = 1280, 0.7, 72


# --- materials ------------------------------------------------------------------------------------


def object_coordinates(made: bpy.types.Material) -> bpy.types.NodeSocket:
    """Coordinates of the object itself."""
    return tools.add_node(made, "ShaderNodeTexCoord", {}).outputs["Object"]


def noise(
    made: bpy.types.Material, place: bpy.types.NodeSocket, scale: float, detail: float = 6.0, distortion: float = 0.0
) -> bpy.types.NodeSocket:
    """Fractal noise from 0 to 1."""
    inputs = {"Vector": place, "Scale": scale, "Detail": detail, "Distortion": distortion}
    return tools.add_node(made, "ShaderNodeTexNoise", inputs).outputs["Fac"]


def calculate(made: bpy.types.Material, operation: str, *values: float | bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """One of the Math node's operations."""
    return tools.add_node(made, "ShaderNodeMath", dict(enumerate(values)), operation=operation).outputs[0]


def mixed(
    made: bpy.types.Material, share: bpy.types.NodeSocket, one: bpy.types.NodeSocket | Color, other: Color
) -> bpy.types.NodeSocket:
    """A color between two."""
    node = tools.add_node(made, "ShaderNodeMix", {0: share}, data_type="RGBA")
    made.node_tree.links.new(one, node.inputs[6])
    node.inputs[7].default_value = (*other, 1.0)
    return node.outputs[2]


def raised(made: bpy.types.Material, height: bpy.types.NodeSocket, strength: float, distance: float) -> None:
    """Let a height bend the light on the surface."""
    bump = tools.add_node(made, "ShaderNodeBump", {"Height": height, "Strength": strength, "Distance": distance})
    tools.feed(made, "Normal", bump.outputs["Normal"])


def gas_giant(radius: float) -> bpy.types.Material:
    """Bands of cream, rust and white that the winds have drawn out."""
    made = tools.material("Gas Giant", (0.8, 0.6, 0.4), roughness=0.85)
    place = object_coordinates(made)
    axes = tools.add_node(made, "ShaderNodeSeparateXYZ", {"Vector": place})
    flat = tools.add_node(made, "ShaderNodeMapping", {"Vector": place, "Scale": (1.0, 1.0, 5.0)})
    swirl = noise(made, flat.outputs["Vector"], 2.2 / radius, 8.0, 0.8)
    height = calculate(made, "DIVIDE", axes.outputs["Z"], 2.0 * radius)
    height = calculate(made, "ADD", height, 0.5)
    height = calculate(made, "MULTIPLY_ADD", calculate(made, "SUBTRACT", swirl, 0.5), 0.10, height)
    cream, rust, white = (0.83, 0.62, 0.38), (0.50, 0.20, 0.07), (0.92, 0.84, 0.70)
    brown, slate = (0.30, 0.12, 0.05), (0.34, 0.36, 0.42)
    stops = [(0.0, slate), (0.12, brown), (0.20, cream), (0.28, rust), (0.35, white), (0.42, cream), (0.47, brown)]
    stops += [(0.52, white), (0.58, white), (0.63, rust), (0.68, brown), (0.74, cream), (0.83, rust), (0.90, cream)]
    tools.feed(made, "Base Color", tools.color_ramp(made, height, [*stops, (1.0, slate)]))
    return made


def planetary_rings(inner: float, outer: float) -> bpy.types.Material:
    """Ringlets of ice and dust with gaps; what is thin lets light through."""
    made = tools.material("Rings", (0.8, 0.7, 0.6), roughness=1.0)
    place = object_coordinates(made)
    distance = tools.add_node(made, "ShaderNodeVectorMath", {0: place}, operation="LENGTH").outputs["Value"]
    share = calculate(made, "DIVIDE", calculate(made, "SUBTRACT", distance, inner), outer - inner)
    grooves = tools.add_node(
        made, "ShaderNodeTexNoise", {"W": share, "Scale": 16.0, "Detail": 5.0}, noise_dimensions="1D"
    ).outputs["Fac"]
    tint = tools.color_ramp(
        made, grooves, [(0.3, (0.42, 0.30, 0.20)), (0.5, (0.80, 0.66, 0.48)), (0.7, (1, 0.94, 0.84))]
    )
    tools.feed(made, "Base Color", tint)
    thick = tools.color_ramp(made, grooves, [(0.32, (0.1, 0.1, 0.1)), (0.5, (0.75, 0.75, 0.75)), (0.7, (1, 1, 1))])
    one, none = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
    stops = [(0.0, none), (0.06, one), (0.58, one), (0.60, (0.04, 0.04, 0.04)), (0.66, (0.04, 0.04, 0.04))]
    gaps = tools.color_ramp(made, share, [*stops, (0.68, one), (0.95, one), (1.0, none)])
    tools.feed(made, "Alpha", calculate(made, "MULTIPLY", thick, gaps))
    return made


def ocean_world(radius: float) -> bpy.types.Material:
    """Seas, green and brown land, ice at the poles, clouds."""
    made = tools.material("Ocean World", (0.1, 0.2, 0.5), roughness=0.6)
    place = object_coordinates(made)
    land = noise(made, place, 1.3 / radius, 10.0)
    sea, shore = (0.006, 0.035, 0.14), (0.02, 0.16, 0.30)
    stops = [(0.0, sea), (0.49, sea), (0.52, shore), (0.53, (0.10, 0.20, 0.05)), (0.60, (0.26, 0.20, 0.09))]
    ground = tools.color_ramp(made, land, [*stops, (0.72, (0.42, 0.36, 0.30))])
    axes = tools.add_node(made, "ShaderNodeSeparateXYZ", {"Vector": place})
    north = calculate(made, "DIVIDE", calculate(made, "ABSOLUTE", axes.outputs["Z"]), radius)
    ice = calculate(made, "MULTIPLY_ADD", calculate(made, "SUBTRACT", land, 0.5), 0.6, north)
    ice = tools.color_ramp(made, ice, [(0.80, (0, 0, 0)), (0.86, (1, 1, 1))])
    ground = mixed(made, ice, ground, (0.85, 0.90, 0.95))
    flat = tools.add_node(made, "ShaderNodeMapping", {"Vector": place, "Scale": (1.0, 1.0, 1.9)})
    clouds = noise(made, flat.outputs["Vector"], 2.4 / radius, 12.0, 1.1)
    clouds = tools.color_ramp(made, clouds, [(0.50, (0, 0, 0)), (0.68, (0.95, 0.95, 0.95))])
    tools.feed(made, "Base Color", mixed(made, clouds, ground, (0.92, 0.94, 0.97)))
    return made


def lava_world(radius: float) -> bpy.types.Material:
    """Black crust, and glowing cracks."""
    made = tools.material("Lava World", (0.03, 0.025, 0.025), roughness=0.8, emission_strength=5.0)
    place = object_coordinates(made)
    warped = noise(made, place, 2.5 / radius, 4.0)
    crust = tools.add_node(
        made, "ShaderNodeTexVoronoi", {"Vector": place, "Scale": 3.6 / radius}, feature="DISTANCE_TO_EDGE"
    ).outputs["Distance"]
    crust = calculate(made, "MULTIPLY_ADD", calculate(made, "SUBTRACT", warped, 0.42), 0.5, crust)
    stops = [(0.0, (1.0, 0.42, 0.08)), (0.05, (1.0, 0.16, 0.01)), (0.12, (0.15, 0.01, 0.0)), (0.2, (0.0, 0.0, 0.0))]
    tools.feed(made, "Emission Color", tools.color_ramp(made, crust, stops))
    raised(made, warped, 0.8, 0.3 * radius)
    return made


def barren_moon(name: str, radius: float, dark: Color, light: Color) -> bpy.types.Material:
    """Rock or ice with craters."""
    made = tools.material(name, light, roughness=0.95)
    place = object_coordinates(made)
    plains = noise(made, place, 2.0 / radius, 10.0)
    tools.feed(made, "Base Color", tools.color_ramp(made, plains, [(0.38, dark), (0.62, light)]))
    craters = tools.add_node(
        made, "ShaderNodeTexVoronoi", {"Vector": place, "Scale": 4.5 / radius}, feature="F1"
    ).outputs["Distance"]
    craters = calculate(made, "MULTIPLY_ADD", plains, 0.5, calculate(made, "MINIMUM", craters, 0.35))
    raised(made, craters, 0.9, 0.25 * radius)
    return made


# --- all together ---------------------------------------------------------------------------------


def ringed_planet(radius: float, location: tools.Point) -> None:
    """The gas giant, its axis and rings tilted."""
    giant = tools.ball("Giant", radius, location, gas_giant(radius))
    giant.rotation_euler = (math.radians(24.0), math.radians(-18.0), 0.0)
    inner, outer = 1.35 * radius, 2.25 * radius
    parts = MeshParts()
    parts.lathe([(inner, 0.0), (outer, 0.0)], 256)
    parts.build("Giant's Rings", [planetary_rings(inner, outer)], parent=giant)


def build() -> None:
    """Build and save the scene; units are M."""
    scene = tools.new_scene("Planets", FRAMES)
    scene.view_settings.look = "AgX - Medium High Contrast"
    stars = skies.star_panorama(SKY_HEIGHT, STAR_WIDTH, SKY_QUALITY)
    skies.star_world(scene, stars, skies.sky_rotation(8.0, 16.0, -30.0), 2.0, (0.006, 0.008, 0.014))

    tools.moving_camera(
        scene,
        lens=25.0,
        path=[(1, (-5.5, -45.0, 3.0)), (FRAMES, (5.5, -45.0, 5.0))],
        aim=[(1, (2.0, 0.0, 0.6)), (FRAMES, (2.0, 0.0, 0.6))],
    )
    tilt = (math.radians(12.0), math.radians(-20.0), 0.0)
    tools.lensing_hole((0.0, 0.0, 0.0), tilt, spin=0.95, mass_scale=1.0, motion="STATIC")

    ringed_planet(7.0, (7.0, 52.0, -3.0))
    tools.ball("Ocean World", 4.4, (-18.0, 30.0, -8.5), ocean_world(4.4))
    tools.ball("Lava World", 2.6, (22.5, 14.0, -8.0), lava_world(2.6))
    gray, pale = ((0.10, 0.095, 0.09), (0.42, 0.40, 0.37)), ((0.42, 0.50, 0.58), (0.86, 0.90, 0.94))
    tools.ball("Gray Moon", 2.0, (-22.0, 8.0, 9.5), barren_moon("Gray Rock", 2.0, *gray))
    tools.ball("Ice Moon", 1.4, (15.5, 10.0, 12.0), barren_moon("Ice", 1.4, *pale))

    tools.sun("Sun", (-0.95, -0.55, 0.5), 5.5, (1.0, 0.93, 0.84))
    tools.save(scene, "planets")


if __name__ == "__main__":
    with tools.addon():
        build()
