# SPDX-License-Identifier: GPL-3.0-or-later
"""Build station.blend: a wheel-shaped space station in orbit of a black hole, under the real stars.

PYTHONPATH=. .venv-py311/bin/python blend_files/build_station.py
"""

from __future__ import annotations

import math
import random

import numpy as np
import scene_tools as tools
import skies
from scene_tools import Matrix, MeshParts, Vector, bpy

FRAMES = 72
SKY_HEIGHT = 2048
# Wider than the default spot, so that a star is not smaller than a pixel of a 1080p picture.
STAR_WIDTH = 0.8

WHEEL = 1.9  # radius of the middle of the rim
HALF_WIDTH, HALF_DEPTH = 0.17, 0.24  # of the rim: along the radius, along the axis


# --- materials ------------------------------------------------------------------------------------


def painted_hull() -> bpy.types.Material:
    """White paint on metal plates: plates of slightly different shades, and worn patches."""
    hull = tools.material("Hull", (0.62, 0.63, 0.65), metallic=0.25, roughness=0.42)
    coordinates = tools.add_node(hull, "ShaderNodeTexCoord", {})
    plates = tools.add_node(
        hull,
        "ShaderNodeTexVoronoi",
        {"Vector": coordinates.outputs["Object"], "Scale": 5.0, "Randomness": 0.9},
        distance="CHEBYCHEV",
    )
    shade = tools.add_node(hull, "ShaderNodeSeparateColor", {"Color": plates.outputs["Color"]})
    wear = tools.add_node(
        hull, "ShaderNodeTexNoise", {"Vector": coordinates.outputs["Object"], "Scale": 9.0, "Detail": 6.0}
    )
    color = tools.color_ramp(
        hull, shade.outputs["Red"], [(0.0, (0.40, 0.41, 0.43)), (0.5, (0.60, 0.61, 0.62)), (1.0, (0.72, 0.71, 0.69))]
    )
    dirt = tools.color_ramp(hull, wear.outputs["Fac"], [(0.35, (0.62, 0.60, 0.57)), (0.6, (1.0, 1.0, 1.0))])
    mix = tools.add_node(hull, "ShaderNodeMix", {}, data_type="RGBA", blend_type="MULTIPLY")
    mix.inputs[0].default_value = 1.0
    for socket, source in ((mix.inputs[6], color), (mix.inputs[7], dirt)):
        hull.node_tree.links.new(source, socket)
    tools.feed(hull, "Base Color", mix.outputs[2])
    bump = tools.add_node(
        hull, "ShaderNodeBump", {"Height": shade.outputs["Green"], "Strength": 0.25, "Distance": 0.01}
    )
    tools.feed(hull, "Normal", bump.outputs["Normal"])
    return hull


def materials() -> dict[str, bpy.types.Material]:
    """All materials of the station and the shuttle, by name."""
    foil = tools.material("Foil", (0.95, 0.62, 0.22), metallic=1.0, roughness=0.28)
    coordinates = tools.add_node(foil, "ShaderNodeTexCoord", {})
    creases = tools.add_node(
        foil, "ShaderNodeTexVoronoi", {"Vector": coordinates.outputs["Object"], "Scale": 22.0}, feature="F1"
    )
    bump = tools.add_node(
        foil, "ShaderNodeBump", {"Height": creases.outputs["Distance"], "Strength": 0.7, "Distance": 0.02}
    )
    tools.feed(foil, "Normal", bump.outputs["Normal"])
    return {
        "hull": painted_hull(),
        "dark": tools.material("Dark Metal", (0.10, 0.105, 0.115), metallic=0.8, roughness=0.45),
        "foil": foil,
        "cells": tools.material("Solar Cells", (0.012, 0.022, 0.075), metallic=0.3, roughness=0.16, coat_weight=0.6),
        "lit": tools.material(
            "Lit Window", (0.05, 0.04, 0.03), emission_color=(1.0, 0.66, 0.32), emission_strength=5.0
        ),
        "glass": tools.material("Dark Window", (0.01, 0.012, 0.016), roughness=0.08),
        "red": tools.material("Red Light", (0.1, 0.0, 0.0), emission_color=(1.0, 0.06, 0.03), emission_strength=14.0),
        "engine": tools.material("Engine", (0.02, 0.03, 0.05), emission_color=(0.28, 0.6, 1.0), emission_strength=4.0),
    }


# --- station --------------------------------------------------------------------------------------


def around(angle: float, radius: float, height: float) -> Matrix:
    """Axes of a place on the wheel: x outwards, y along the rim, z the wheel's axis."""
    return Matrix.Rotation(angle, 4, "Z") @ Matrix.Translation((radius, 0.0, height))


def build_wheel(parent: bpy.types.Object, shades: dict[str, bpy.types.Material]) -> bpy.types.Object:
    """The turning part: rim with ribs and windows, four spokes."""
    parts = MeshParts()
    hull, dark, lit, glass, foil = range(5)
    cut = 0.075  # chamfer of the rim's edges
    w, d = HALF_WIDTH, HALF_DEPTH
    profile = [(w, -d + cut), (w, d - cut), (w - cut, d), (cut - w, d)]
    profile += [(-w, d - cut), (-w, cut - d), (cut - w, -d), (w - cut, -d)]
    parts.lathe([(WHEEL + x, z) for x, z in profile], 192, hull, closed=True)
    # Two rails that run along the outside, and one dark gutter between them.
    for height in (-0.09, 0.09):
        rail = [(WHEEL + w + x, height + z) for x, z in ((-0.01, -0.03), (0.025, -0.03), (0.025, 0.03), (-0.01, 0.03))]
        parts.lathe(rail, 192, dark, closed=True)
    draw = random.Random(7)
    ribs = 32
    for rib in range(ribs):
        turn = 2.0 * math.pi * rib / ribs
        axes = around(turn, WHEEL, 0.0)
        wide = rib % 8 == 0
        parts.box((0.0, 0.0, 0.0), (2 * w + 0.05, 0.12 if wide else 0.045, 2 * d + 0.04), dark if wide else hull, axes)
        for _ in range(5):  # boxes of equipment on both flat sides
            side = draw.choice((-1, 1))
            size = (draw.uniform(0.04, 0.12), draw.uniform(0.04, 0.16), draw.uniform(0.015, 0.05))
            place = around(turn + draw.uniform(0.05, 0.15), WHEEL + draw.uniform(-0.05, 0.05), side * d)
            parts.box((0.0, 0.0, 0.0), size, draw.choice((hull, hull, dark, foil)), place)
    # Windows: on the inner wall, and on the four chamfers.
    slope = math.atan2(1.0, 1.0)
    rows = [(-w, 0.05, 0.0), (-w, -0.05, 0.0)]
    rows += [(cut / 2 - w, side * (d - cut / 2), side * slope) for side in (-1, 1)]
    rows += [(w - cut / 2, side * (d - cut / 2), -side * slope) for side in (-1, 1)]
    for inward, height, lean in rows:
        for step in range(ribs * 6):
            if step % 6 == 0:  # where the rib is
                continue
            place = around(2.0 * math.pi * step / (ribs * 6), WHEEL + inward, height)
            place = place @ Matrix.Rotation(-lean, 4, "Y")
            parts.box((0.0, 0.0, 0.0), (0.012, 0.034, 0.042), lit if draw.random() < 0.62 else glass, place)
    for spoke in range(4):
        turn = Matrix.Rotation(math.pi / 2.0 * spoke, 3, "Z")
        inner, outer = 0.34, WHEEL - w
        parts.tube(turn @ Vector((inner, 0, 0)), turn @ Vector((outer, 0, 0)), 0.075, 24, hull)
        for radius in (0.62, 0.95, 1.28, 1.6):  # collars
            parts.tube(turn @ Vector((radius, 0, 0)), turn @ Vector((radius + 0.05, 0, 0)), 0.1, 24, dark)
        bays = 6
        for side in (-1, 1):  # braces above and below
            rail_end = [Vector((inner + (outer - inner) * bay / bays, 0, side * 0.17)) for bay in range(bays + 1)]
            parts.tube(turn @ rail_end[0], turn @ rail_end[-1], 0.016, 8, dark)
            for bay in range(bays):
                middle = Vector(((rail_end[bay].x + rail_end[bay + 1].x) / 2, 0, 0))
                parts.tube(turn @ rail_end[bay], turn @ middle, 0.009, 6, dark)
                parts.tube(turn @ rail_end[bay + 1], turn @ middle, 0.009, 6, dark)
    order = [shades[name] for name in ("hull", "dark", "lit", "glass", "foil")]
    return parts.build("Wheel", order, parent=parent)


def build_core(parent: bpy.types.Object, shades: dict[str, bpy.types.Material]) -> None:
    """The part at rest: hub, docking port, mast with solar wings, dish."""
    parts = MeshParts()
    hull, dark, foil, lit = range(4)
    body = [(0.0, -0.62), (0.2, -0.62), (0.24, -0.58), (0.24, -0.42), (0.3, -0.36), (0.36, -0.28), (0.36, 0.28)]
    body += [(0.3, 0.36), (0.22, 0.44), (0.22, 0.66), (0.17, 0.7), (0.0, 0.7)]
    parts.lathe(body, 64, hull)
    for height, radius in ((-0.2, 0.375), (0.2, 0.375), (-0.5, 0.252), (0.56, 0.232)):
        ring = [(radius - 0.04, height - 0.03), (radius, height - 0.03), (radius, height + 0.03)]
        parts.lathe([*ring, (radius - 0.04, height + 0.03)], 64, dark, closed=True)
    parts.lathe([(0.0, 0.7), (0.1, 0.7), (0.1, 0.86), (0.075, 0.88), (0.0, 0.88)], 32, foil)
    for step in range(20):  # portholes round the hub
        axes = around(2.0 * math.pi * step / 20, 0.362, 0.0)
        parts.box((0.0, 0.0, 0.08), (0.01, 0.04, 0.05), lit, axes)
        parts.box((0.0, 0.0, -0.08), (0.01, 0.04, 0.05), lit, axes)
    mast = [Vector((x, y, 0)) for x, y in ((0.06, 0.06), (-0.06, 0.06), (-0.06, -0.06), (0.06, -0.06))]
    low, high, bays = 0.86, 2.3, 9
    for corner, foot in enumerate(mast):
        following = mast[(corner + 1) % 4]
        parts.tube(foot + Vector((0, 0, low)), foot + Vector((0, 0, high)), 0.011, 8, dark)
        for bay in range(bays):
            z0, z1 = (low + (high - low) * step / bays for step in (bay, bay + 1))
            parts.tube(foot + Vector((0, 0, z0)), following + Vector((0, 0, z1)), 0.006, 6, dark)
            parts.tube(foot + Vector((0, 0, z1)), following + Vector((0, 0, z1)), 0.006, 6, dark)
    # The dish on the other side, and its feed on three struts.
    bowl = [(0.42 * t, -1.0 + 0.2 * t * t - 0.2) for t in np.linspace(0.0, 1.0, 14)]
    rim = [(0.43, -1.0), *[(r, z + 0.015) for r, z in reversed(bowl)]]
    flip = Matrix.Translation((0, 0, -2.1)) @ Matrix.Diagonal((1, 1, -1, 1))
    parts.lathe(bowl + rim, 64, hull, axes=flip)
    parts.tube(Vector((0, 0, -0.6)), Vector((0, 0, -0.92)), 0.05, 16, dark)
    for step in range(3):
        angle = 2.0 * math.pi * step / 3
        parts.tube(Vector((0.4 * math.cos(angle), 0.4 * math.sin(angle), -1.1)), Vector((0, 0, -1.42)), 0.008, 6, dark)
    order = [shades[name] for name in ("hull", "dark", "foil", "lit")]
    parts.build("Core", order, parent=parent)

    wings = MeshParts()
    cells, frame = range(2)
    for side in (-1, 1):
        for panel in range(2):
            x0 = side * (0.2 + 0.98 * panel)
            x1 = x0 + side * 0.92
            wings.box(((x0 + x1) / 2, 0, 0), (0.92, 0.62, 0.012), frame)
            for column in range(9):
                for row in range(6):
                    center = (x0 + side * (0.06 + 0.1 * column), -0.25 + 0.1 * row, 0.0)
                    wings.box(center, (0.09, 0.09, 0.02), cells)
        wings.tube(Vector((0, 0, 0)), Vector((side * 2.15, 0, 0)), 0.02, 12, frame)
    wing = wings.build("Solar Wings", [shades["cells"], shades["dark"]], location=(0, 0, 2.1), parent=parent)
    wing.rotation_euler = (math.radians(-38.0), 0.0, math.radians(58.0))
    for place in ((0.0, 0.0, 2.34), (0.0, 0.0, -1.44)):
        tools.ball("Beacon", 0.028, place, shades["red"], parent)


def build_shuttle(shades: dict[str, bpy.types.Material]) -> bpy.types.Object:
    """A small craft; its nose points along +x."""
    parts = MeshParts()
    hull, dark, glass, engine, foil = range(5)
    along_x = Matrix.Rotation(math.radians(90.0), 4, "Y")
    body = [(0.0, -0.42), (0.09, -0.42), (0.12, -0.38), (0.13, -0.1), (0.12, 0.25)]
    tip = [(0.105, 0.36), (0.085, 0.45), (0.055, 0.53), (0.02, 0.58), (0.0, 0.585)]
    parts.lathe(body + tip, 48, hull, axes=along_x)
    for z, radius in ((-0.3, 0.135), (-0.02, 0.136), (0.2, 0.128)):
        band = [(radius - 0.02, z - 0.012), (radius, z - 0.012), (radius, z + 0.012), (radius - 0.02, z + 0.012)]
        parts.lathe(band, 48, dark, closed=True, axes=along_x)
    for side in (-1, 1):
        lean = Matrix.Rotation(side * math.radians(24.0), 4, "X")
        parts.box((-0.18, side * 0.26, 0.0), (0.3, 0.34, 0.018), hull, lean)
        parts.box((-0.18, side * 0.43, 0.0), (0.36, 0.03, 0.05), dark, lean)
        tank = Matrix.Translation((-0.32, side * 0.15, 0.0)) @ along_x
        pod = [(0.0, -0.12), (0.05, -0.12), (0.062, -0.08), (0.062, 0.12), (0.03, 0.2), (0.0, 0.21)]
        parts.lathe(pod, 32, foil, axes=tank)
        nozzle = [(0.0, -0.135), (0.035, -0.15), (0.05, -0.2), (0.045, -0.2), (0.03, -0.15), (0.0, -0.14)]
        parts.lathe(nozzle, 32, engine, axes=tank)
    parts.lathe([(0.0, -0.43), (0.06, -0.43), (0.075, -0.5), (0.065, -0.5), (0.0, -0.435)], 32, engine, axes=along_x)
    for side in (-1, 1):
        parts.box((0.43, side * 0.045, 0.062), (0.07, 0.05, 0.03), glass, Matrix.Rotation(side * -0.35, 4, "X"))
    order = [shades[name] for name in ("hull", "dark", "glass", "engine", "foil")]
    return parts.build("Shuttle", order)


# --- all together ---------------------------------------------------------------------------------


def build() -> None:
    """Build and save the scene."""
    scene = tools.new_scene("Station", FRAMES)
    scene.view_settings.look = "AgX - High Contrast"
    scene.umbra.environment_image = skies.star_panorama(SKY_HEIGHT, STAR_WIDTH, quality=95)
    scene.umbra.environment_source = "IMAGE"
    tools.world_background(scene, (0.10, 0.14, 0.22), 0.12)

    tilt = (math.radians(10.0), math.radians(-16.0), 0.0)
    tools.black_hole((0.0, 0.0, 0.0), tilt, spin=0.95, mass_scale=1.0, motion="CIRCULAR")
    look = tools.group_node(scene).inputs
    look["Environment Rotation"].default_value = skies.sky_rotation(14.0, 14.0, 28.0)
    look["Exposure"].default_value = 2.2
    look["Sky Temperature"].default_value = 4500.0
    look["Redshift Color"].default_value = 1.0
    look["Redshift Brightness"].default_value = 1.0

    tools.moving_camera(
        scene,
        lens=20.0,
        path=[(1, (-1.1, -22.4, 1.4)), (FRAMES, (0.9, -21.0, 0.7))],
        aim=[(1, (1.0, 0.0, 0.0)), (FRAMES, (2.2, 0.0, 0.0))],
    )

    shades = materials()
    station = tools.add_object("Station", None, (-1.75, -14.2, -0.75))
    station.rotation_euler = (math.radians(62.0), math.radians(24.0), math.radians(20.0))
    wheel = build_wheel(station, shades)
    tools.spin_steadily(wheel, 2, math.radians(50.0), FRAMES)
    build_core(station, shades)
    shuttle = build_shuttle(shades)
    shuttle.rotation_euler = (math.radians(18.0), math.radians(-12.0), math.radians(155.0))
    for frame, place in ((1, (2.2, -15.6, -0.75)), (FRAMES, (1.1, -14.6, -0.5))):
        shuttle.location = place
        shuttle.keyframe_insert("location", frame=frame)

    tools.sun("Key", (-0.75, -0.45, 0.55), 4.2, (1.0, 0.93, 0.84))
    tools.sun("Rim", (0.8, 0.75, 0.25), 0.9, (0.55, 0.7, 1.0), size=0.3)
    tools.save(scene, "station")


if __name__ == "__main__":
    with tools.addon():
        build()
