# SPDX-License-Identifier: GPL-3.0-or-later
"""Build plinth.blend: a black hole that hovers over a marble plinth with glass and metal, at sunset in Venice.

PYTHONPATH=. .venv-py311/bin/python blend_files/build_plinth.py
"""

from __future__ import annotations

import math
from pathlib import Path

import scene_tools as tools
from scene_tools import MeshParts, Vector, bpy

FRAMES = 72
HDRI = "sunset.exr"

DISTANCE = 6.0  # of the camera from the hole
DISTANCE_IN_M = 30.0
TOP = -1.62  # height of the plinth's upper face; the hole's center is at 0


def sunset_world(scene: bpy.types.Scene, turn: float, strength: float) -> None:
    """One of the HDRIs that come with Blender, packed, turned about the vertical by degrees."""
    path = Path(bpy.utils.system_resource("DATAFILES"), "studiolights", "world", HDRI)
    background = tools.world_background(scene, (1.0, 1.0, 1.0), strength)
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = tools.pack_image(path, "Sunset")
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0.0, 0.0, math.radians(turn))
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    for index, node in enumerate((coordinates, mapping, texture)):
        node.location = (-900 + 220 * index, 300)


# --- materials ------------------------------------------------------------------------------------


def marble() -> bpy.types.Material:
    """Black marble with pale and golden veins, polished."""
    stone = tools.material("Marble", (0.02, 0.02, 0.022), roughness=0.12, coat_weight=0.5, coat_roughness=0.04)
    coordinates = tools.add_node(stone, "ShaderNodeTexCoord", {})
    warp = tools.add_node(
        stone,
        "ShaderNodeTexNoise",
        {"Vector": coordinates.outputs["Object"], "Scale": 1.6, "Detail": 8.0, "Roughness": 0.62},
    )
    spread = tools.add_node(
        stone,
        "ShaderNodeVectorMath",
        {0: warp.outputs["Color"], 1: (1.4, 1.4, 1.4), 2: coordinates.outputs["Object"]},
        operation="MULTIPLY_ADD",
    )
    veins = tools.add_node(
        stone,
        "ShaderNodeTexVoronoi",
        {"Vector": spread.outputs["Vector"], "Scale": 1.1},
        feature="DISTANCE_TO_EDGE",
    )
    color = tools.color_ramp(
        stone,
        veins.outputs["Distance"],
        [(0.0, (0.75, 0.66, 0.52)), (0.012, (0.30, 0.27, 0.24)), (0.05, (0.035, 0.035, 0.04)), (0.3, (0.012,) * 3)],
    )
    tools.feed(stone, "Base Color", color)
    return stone


def brushed(name: str, color: tools.Color, roughness: float) -> bpy.types.Material:
    """Metal with fine uneven polish."""
    metal = tools.material(name, color, metallic=1.0, roughness=roughness)
    coordinates = tools.add_node(metal, "ShaderNodeTexCoord", {})
    noise = tools.add_node(
        metal, "ShaderNodeTexNoise", {"Vector": coordinates.outputs["Object"], "Scale": 6.0, "Detail": 5.0}
    )
    polish = tools.add_node(
        metal,
        "ShaderNodeMapRange",
        {"Value": noise.outputs["Fac"], "From Min": 0.3, "From Max": 0.7}
        | {"To Min": roughness * 0.6, "To Max": roughness * 1.6},
    )
    tools.feed(metal, "Roughness", polish.outputs["Result"])
    return metal


def materials() -> dict[str, bpy.types.Material]:
    """All materials, by name."""
    clear = {"roughness": 0.0, "transmission_weight": 1.0, "ior": 1.47}
    return {
        "marble": marble(),
        "brass": brushed("Brass", (0.86, 0.60, 0.24), 0.16),
        "gold": brushed("Gold", (1.0, 0.72, 0.30), 0.09),
        "copper": brushed("Copper", (0.93, 0.48, 0.33), 0.2),
        "chrome": tools.material("Chrome", (0.86, 0.87, 0.89), metallic=1.0, roughness=0.02),
        "steel": brushed("Steel", (0.42, 0.44, 0.48), 0.24),
        "glass": tools.material("Glass", (1.0, 1.0, 1.0), **clear),
        "ruby": tools.material("Ruby Glass", (1.0, 0.12, 0.10), **clear),
        "sea": tools.material("Sea Glass", (0.35, 0.85, 0.80), **clear),
        "lacquer": tools.material("Lacquer", (0.008,) * 3, roughness=0.25, coat_weight=1.0, coat_roughness=0.02),
        "pearl": tools.material("Pearl", (0.86, 0.80, 0.74), roughness=0.22, coat_weight=0.7, sheen_weight=0.3),
    }


# --- objects --------------------------------------------------------------------------------------


def build_plinth(shades: dict[str, bpy.types.Material]) -> None:
    """A drum of marble with a moulded edge and rings of brass, and a shallow dish under the hole."""
    parts = MeshParts()
    stone, brass = range(2)
    edge = [(1.34, -0.42), (1.40, -0.38), *tools.arc((1.40, -0.30), 0.05, -90.0, 90.0, 9), (1.43, -0.22)]
    edge += [(1.50, -0.16), *tools.arc((1.50, -0.06), 0.06, -60.0, 90.0, 12)]
    profile = [(0.0, -4.0), (1.26, -4.0), (1.26, -0.46), *edge, (0.0, 0.0)]
    parts.lathe(profile, 192, stone)
    for radius, height, thickness in ((1.27, -0.52, 0.028), (1.27, -0.62, 0.014), (1.44, -0.19, 0.02)):
        parts.lathe(
            [(radius + x, height + z) for x, z in tools.arc((0.0, 0.0), thickness, 0.0, 342.0, 20)],
            192,
            brass,
            closed=True,
        )
    # Two rings let into the upper face, a little proud of it.
    for radius, width in ((1.40, 0.018), (0.80, 0.012)):
        strip = [(radius, -0.01), (radius + width, -0.01), (radius + width, 0.004), (radius, 0.004)]
        parts.lathe(strip, 192, brass, closed=True)
    parts.build("Plinth", [shades["marble"], shades["brass"]], location=(0.0, 0.0, TOP))

    dish = MeshParts()
    inner = tools.arc((0.0, 0.86), 0.80, -90.0, -46.0, 24)
    lip = tools.arc((inner[-1][0] + 0.012, inner[-1][1]), 0.018, 160.0, -20.0, 9)
    outer = [(0.5, 0.24), (0.36, 0.12), (0.2, 0.045), (0.17, 0.03), (0.26, 0.012), (0.28, 0.0), (0.0, 0.0)]
    dish.lathe([*inner, *lip, *outer], 128)
    dish.build("Dish", [shades["copper"]], location=(0.0, 0.0, TOP), smooth=math.radians(50.0))


def build_stand(name: str, place: tuple[float, float], height: float, shades: dict[str, bpy.types.Material]) -> None:
    """A turned brass stand whose little cup ends at a height over the plinth."""
    parts = MeshParts()
    foot = [(0.0, 0.0), (0.15, 0.0), (0.155, 0.012), (0.145, 0.028), (0.07, 0.05), (0.035, 0.09)]
    knop = [(0.022, 0.13), (0.02, 0.22), *tools.arc((0.018, 0.26), 0.028, -70.0, 70.0, 8), (0.018, 0.30)]
    stem = [(0.014, 0.42), (0.014, height - 0.14), (0.026, height - 0.12), (0.016, height - 0.09)]
    cup = [(0.04, -0.05), (0.085, 0.0), (0.092, 0.01), (0.08, 0.006), (0.0, -0.035)]
    parts.lathe([*foot, *knop, *stem, *((x, height + z) for x, z in cup)], 64)
    parts.build(name, [shades["brass"]], location=(*place, TOP), smooth=math.radians(50.0))


def build_spheres(shades: dict[str, bpy.types.Material]) -> None:
    """Spheres that lie on the plinth, and three on stands."""
    lying = [  # angle about the axis (degrees, 0 to the right, -90 to the camera), distance, radius, material
        (-172.0, 1.08, 0.24, "chrome"),
        (-143.0, 1.16, 0.13, "copper"),
        (-104.0, 1.13, 0.21, "sea"),
        (-84.0, 1.2, 0.09, "gold"),
        (-74.0, 1.05, 0.12, "lacquer"),
        (-58.0, 1.16, 0.17, "chrome"),
        (-18.0, 1.16, 0.20, "pearl"),
        (6.0, 1.1, 0.12, "ruby"),
        (35.0, 1.1, 0.26, "steel"),
        (88.0, 1.14, 0.16, "gold"),
        (140.0, 1.1, 0.22, "lacquer"),
    ]
    for index, (angle, distance, radius, name) in enumerate(lying):
        turn = math.radians(angle)
        place = (distance * math.cos(turn), distance * math.sin(turn), TOP + radius)
        tools.ball(f"Sphere {index + 1}", radius, place, shades[name])
    stands = [  # place on the plinth, height, radius, material
        ((-0.72, -0.88), 0.58, 0.27, "glass"),
        ((0.90, -0.72), 0.70, 0.20, "ruby"),
        ((-1.10, 0.35), 0.86, 0.15, "gold"),
    ]
    for index, (place, height, radius, name) in enumerate(stands):
        build_stand(f"Stand {index + 1}", place, height, shades)
        # It rests on the cup's rim, 0.085 from the axis.
        rest = math.sqrt(radius**2 - 0.085**2)
        tools.ball(f"Sphere on Stand {index + 1}", radius, (*place, TOP + height + 0.008 + rest), shades[name])


def camera_path(start: float, end: float, keys: int) -> list[tuple[int, tools.Point]]:
    """An arc about the hole, from one azimuth (degrees from -y) to another, that closes in and sinks a little."""
    path = []
    for key in range(keys):
        share = key / (keys - 1)
        turn = math.radians(start + (end - start) * share)
        reach = DISTANCE * (1.0 - 0.06 * share)
        height = 0.42 - 0.16 * share
        across = math.sqrt(reach**2 - height**2)
        place = Vector((across * math.sin(turn), -across * math.cos(turn), height))
        path.append((1 + round((FRAMES - 1) * share), tuple(place)))
    return path


# --- all together ---------------------------------------------------------------------------------


def build() -> None:
    """Build and save the scene."""
    scene = tools.new_scene("Plinth", FRAMES)
    scene.view_settings.look = "AgX - High Contrast"
    scene.cycles.max_bounces = 12
    scene.cycles.transmission_bounces = 12
    sunset_world(scene, turn=-139.0, strength=0.42)

    tilt = (math.radians(-14.0), math.radians(20.0), 0.0)
    tools.black_hole((0.0, 0.0, 0.0), tilt, spin=0.9, mass_scale=DISTANCE / DISTANCE_IN_M, motion="STATIC")
    scene.umbra.environment_source = "WORLD"
    scene.umbra.hide_behind = False  # the hole stands over the plinth: nothing on it is covered
    bpy.ops.umbra.setup_compositor()

    tools.moving_camera(
        scene, lens=22.0, path=camera_path(-13.0, 13.0, 7), aim=[(1, (0.0, 0.0, -0.36)), (FRAMES, (0.0, 0.0, -0.3))]
    )
    shades = materials()
    build_plinth(shades)
    build_spheres(shades)
    tools.area_light("Key", (-3.2, -4.2, 3.6), (0.0, 0.0, -1.4), 1.6, 190.0, (1.0, 0.86, 0.7))
    tools.save(scene, "plinth")


if __name__ == "__main__":
    with tools.addon():
        build()
