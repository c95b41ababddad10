# SPDX-License-Identifier: GPL-3.0-or-later
"""Build flyby.blend: past a black hole, with a station and a field of rocks behind it (Output: Cycles Lens).

PYTHONPATH=. .venv-py311/bin/python blend_files/build_flyby.py
"""

from __future__ import annotations

import math
import random

import build_station
import numpy as np
import scene_tools as tools
import skies
from scene_tools import Matrix, Vector, bpy

FRAMES = 72
SKY_HEIGHT, STAR_WIDTH, SKY_QUALITY = 1280, 0.7, 65

SHAPES = 4
ROCKS = 260
# Where the rocks are: beyond the hole, in a belt; units M.
NEAREST, FARTHEST = 12.0, 95.0
# Straight behind the hole when the camera passes.
STATION = (1.5, 34.0, 1.0)


def rock_material() -> bpy.types.Material:
    """Dark stone with pale, dusty patches; each rock has a shade of its own."""
    made = tools.material("Rock", (0.2, 0.18, 0.16), roughness=0.95)
    place = tools.add_node(made, "ShaderNodeTexCoord", {}).outputs["Object"]
    patches = tools.add_node(made, "ShaderNodeTexNoise", {"Vector": place, "Scale": 2.6, "Detail": 10.0})
    color = tools.color_ramp(
        made,
        patches.outputs["Fac"],
        [(0.3, (0.07, 0.06, 0.055)), (0.55, (0.24, 0.20, 0.17)), (0.75, (0.44, 0.38, 0.32))],
    )
    own = tools.add_node(made, "ShaderNodeObjectInfo", {}).outputs["Random"]
    shade = tools.color_ramp(made, own, [(0.0, (0.6, 0.62, 0.66)), (0.6, (1.0, 0.95, 0.9)), (1.0, (1.0, 0.75, 0.55))])
    mix = tools.add_node(made, "ShaderNodeMix", {0: 1.0}, data_type="RGBA", blend_type="MULTIPLY")
    for socket, source in ((mix.inputs[6], color), (mix.inputs[7], shade)):
        made.node_tree.links.new(source, socket)
    tools.feed(made, "Base Color", mix.outputs[2])
    fine = tools.add_node(made, "ShaderNodeTexNoise", {"Vector": place, "Scale": 9.0, "Detail": 8.0})
    bump = tools.add_node(made, "ShaderNodeBump", {"Height": fine.outputs["Fac"], "Strength": 0.7, "Distance": 0.15})
    tools.feed(made, "Normal", bump.outputs["Normal"])
    return made


def rock_mesh(number: int, stone: bpy.types.Material) -> bpy.types.Mesh:
    """A lump about 1 in radius: a ball, cut by planes, stretched and dented."""
    import bmesh
    from mathutils import noise

    draw = np.random.default_rng(number)
    mesh = bpy.data.meshes.new(f"Rock {number}")
    edit = bmesh.new()
    bmesh.ops.create_icosphere(edit, subdivisions=4, radius=1.0)
    stretch = draw.uniform(0.7, 1.25, 3)
    planes = draw.normal(size=(14, 3))
    planes /= np.linalg.norm(planes, axis=1, keepdims=True)
    depths = draw.uniform(0.72, 0.95, len(planes))
    for vertex in edit.verts:
        outward = np.array(vertex.co)
        depth = min(1.0, float(np.min(depths / np.maximum(planes @ outward, 1e-3))))
        place = Vector(outward * 1.7 + 10.0 * number)
        rough = 0.16 * noise.fractal(place, 0.9, 2.1, 5)
        vertex.co = Vector(outward * stretch * (depth + rough))
    edit.to_mesh(mesh)
    edit.free()
    mesh.shade_smooth()
    mesh.materials.append(stone)
    return mesh


def scatter_rocks(stone: bpy.types.Material) -> None:
    """A belt of rocks behind the hole, denser towards a plane that is tilted to the picture; they share meshes."""
    meshes = [rock_mesh(number, stone) for number in range(SHAPES)]
    draw = random.Random(11)
    plane = Matrix.Rotation(math.radians(-17.0), 3, "Y") @ Matrix.Rotation(math.radians(-9.0), 3, "X")
    made = 0
    while made < ROCKS:
        far = draw.uniform(NEAREST, FARTHEST)
        place = plane @ Vector((draw.uniform(-1.1, 1.1) * (18.0 + far), far, draw.gauss(0.0, 5.0 + 0.05 * far)))
        radius = min(0.35 * draw.paretovariate(1.5), 3.2)
        turn = [draw.uniform(0.0, 2.0 * math.pi) for _ in range(3)]
        shape = draw.choice(meshes)
        # Not in the lens sphere, nor nearer than the hole for any place of the camera, nor in the station.
        if place.length < 18.0 + radius or place.y < 9.0 or (place - Vector(STATION)).length < 10.0 + radius:
            continue
        rock = tools.add_object("Rock", shape, place)
        rock.scale = (radius, radius, radius)
        rock.rotation_euler = turn
        made += 1


def station() -> None:
    """The wheel of station.blend, large and straight behind the hole."""
    shades = build_station.materials()
    middle = tools.add_object("Station", None, STATION)
    middle.rotation_euler = (math.radians(66.0), math.radians(22.0), math.radians(15.0))
    middle.scale = (3.2, 3.2, 3.2)
    wheel = build_station.build_wheel(middle, shades)
    tools.spin_steadily(wheel, 2, math.radians(70.0), FRAMES)
    build_station.build_core(middle, shades)


def build() -> None:
    """Build and save the scene; units are M."""
    scene = tools.new_scene("Flyby", FRAMES)
    scene.view_settings.look = "AgX - Medium High Contrast"
    stars = skies.star_panorama(SKY_HEIGHT, STAR_WIDTH, SKY_QUALITY)
    skies.star_world(scene, stars, skies.sky_rotation(20.0, -8.0, 20.0), 2.2, (0.010, 0.014, 0.024))

    tools.moving_camera(
        scene,
        lens=20.0,
        path=[(1, (-13.0, -25.0, 4.5)), (FRAMES, (12.0, -22.0, -1.5))],
        aim=[(1, (-1.0, 0.0, 0.5)), (FRAMES, (2.5, 0.0, 0.0))],
    )
    tilt = (math.radians(14.0), math.radians(18.0), 0.0)
    tools.lensing_hole((0.0, 0.0, 0.0), tilt, spin=0.98, mass_scale=1.0, motion="FIDO")

    station()
    scatter_rocks(rock_material())
    tools.sun("Key", (0.9, -0.35, 0.35), 4.4, (1.0, 0.74, 0.47))
    tools.sun("Rim", (-0.8, 0.5, -0.2), 0.8, (0.45, 0.62, 1.0), size=0.3)
    tools.save(scene, "flyby")


if __name__ == "__main__":
    with tools.addon():
        build()
