# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scripts that build the demo scenes share: an empty scene, meshes, materials, a camera move, saving."""

from __future__ import annotations

import atexit
import math
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

# Blender reads this when bpy is first imported: what is registered here never touches the user's own Blender.
os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="umbra-demo-")

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

atexit.register(shutil.rmtree, os.environ["BLENDER_USER_RESOURCES"], ignore_errors=True)

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parent
FIRST_VERSION_WITH_OTHER_FILES = (5, 0)

__all__ = ["Euler", "Matrix", "MeshParts", "Vector", "bpy"]  # for scripts, which must not import these before bpy

Point = tuple[float, float, float]
Color = tuple[float, float, float]


# --- the scene ------------------------------------------------------------------------------------


@contextmanager
def addon() -> Iterator[None]:
    """Register the add-on of this checkout, and unregister it at the end, without which Blender 4.5 never exits.

    Not the built extension: packing that fetches wheels for Blender's Python, while the environment which this
    runs in has everything already, so the demo works offline. That the packed extension does the same is what
    the tests are for, which open these scenes with it installed.
    """
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    import blender_addon

    blender_addon.register()
    try:
        yield
    finally:
        blender_addon.unregister()


def new_scene(name: str, frames: int) -> bpy.types.Scene:
    """An empty scene, rendered by Cycles on the CPU at 1920 x 1080 with few samples and a denoiser."""
    if bpy.app.version >= FIRST_VERSION_WITH_OTHER_FILES:
        sys.exit(
            f"Blender {bpy.app.version_string} saves files that Blender 4.5 renders wrong: build the scenes "
            "with Blender 4.5 (Python 3.11)."
        )
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    scene.name = name
    scene.frame_start, scene.frame_end = 1, frames
    scene.render.fps = 24
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
    scene.render.filepath = f"//render/{name.lower().replace(' ', '_')}_"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 64
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.use_denoising = True
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    # Without these two, bright glints on metal and through glass become specks that the denoiser smears.
    scene.cycles.sample_clamp_indirect = 6.0
    scene.cycles.blur_glossy = 1.0
    scene.view_settings.view_transform = "AgX"
    return scene


def pack_image(path: Path, name: str) -> bpy.types.Image:
    """Load a picture and keep it inside the .blend, without any path of this computer."""
    image = bpy.data.images.load(str(path))
    image.name = name
    image.pack()
    for packed in image.packed_files:  # they remember where they came from on their own
        packed.filepath = f"//{path.name}"
    image.filepath_raw = f"//{path.name}"
    return image


def black_hole(location: Point, tilt: Point, spin: float, mass_scale: float, motion: str) -> bpy.types.Object:
    """Add a black hole the way the Add menu does."""
    scene = bpy.context.scene
    scene.cursor.location = location
    bpy.ops.umbra.add_black_hole(spin=spin, mass_scale=mass_scale)
    scene.cursor.location = (0.0, 0.0, 0.0)
    hole = scene.umbra.active_hole
    hole.rotation_euler = tilt
    hole.umbra.motion = motion
    scene.umbra.supersampling = "2"
    return hole


def lensing_hole(location: Point, tilt: Point, spin: float, mass_scale: float, motion: str) -> bpy.types.Object:
    """Add a black hole that bends the rays of the scene's camera (Output: Cycles Lens)."""
    scene = bpy.context.scene
    if bpy.ops.umbra.set_output(output="CYCLES_LENS") != {"FINISHED"}:
        sys.exit("The Cycles Lens could not be set up; the reason is above.")
    hole = black_hole(location, tilt, spin, mass_scale, motion)
    scene.umbra.supersampling = "1"  # Cycles takes its samples anyway
    return hole


def group_node(scene: bpy.types.Scene) -> bpy.types.Node:
    """The black hole's node in the scene's compositor."""
    return next(node for node in scene.node_tree.nodes if node.name == "Umbra Black Hole")


def moving_camera(
    scene: bpy.types.Scene, lens: float, path: Sequence[tuple[int, Point]], aim: Sequence[tuple[int, Point]]
) -> bpy.types.Object:
    """A camera that moves along (frame, place) keys and keeps looking at an Empty with keys of its own."""
    camera = add_object("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens = lens
    camera.data.clip_end = 1000.0
    target = add_object("Camera Aim", None)
    target.empty_display_size = 0.5
    for thing, keys in ((camera, path), (target, aim)):
        for frame, place in keys:
            thing.location = place
            thing.keyframe_insert("location", frame=frame)
    constraint = camera.constraints.new("TRACK_TO")
    constraint.target = target
    constraint.track_axis, constraint.up_axis = "TRACK_NEGATIVE_Z", "UP_Y"
    scene.camera = camera
    return camera


def spin_steadily(thing: bpy.types.Object, axis: int, turn: float, frames: int) -> None:
    """Turn an object about one of its axes by an angle (radians) over the frames 1 to `frames`."""
    start = thing.rotation_euler[axis]
    for frame, angle in ((1, start), (frames, start + turn)):
        thing.rotation_euler[axis] = angle
        thing.keyframe_insert("rotation_euler", index=axis, frame=frame)
    for curve in thing.animation_data.action.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def save(scene: bpy.types.Scene, name: str) -> None:
    """Save the scene compressed in this folder, with nothing in it that names a place on this computer."""
    scene.frame_set(scene.frame_start)
    for space in (space for screen in bpy.data.screens for area in screen.areas for space in area.spaces):
        if space.type == "FILE_BROWSER" and space.params is not None:
            space.params.directory = b"//"
    bpy.data.orphans_purge(do_recursive=True)
    path = FOLDER / f"{name}.blend"
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, relative_remap=True)
    print(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB")


# --- objects --------------------------------------------------------------------------------------


def add_object(
    name: str, data: bpy.types.ID | None, location: Point = (0.0, 0.0, 0.0), parent: bpy.types.Object | None = None
) -> bpy.types.Object:
    """A new object in the scene."""
    thing = bpy.data.objects.new(name, data)
    thing.location = location
    thing.parent = parent
    bpy.context.scene.collection.objects.link(thing)
    return thing


class MeshParts:
    """Collects faces of several materials into one mesh; smooth where the parts are."""

    def __init__(self) -> None:
        self.vertices: list[Vector] = []
        self.faces: list[tuple[int, ...]] = []
        self.materials: list[int] = []

    def add(self, vertices: Sequence[Vector], faces: Sequence[tuple[int, ...]], material: int = 0) -> None:
        """Add a part as it is."""
        start = len(self.vertices)
        self.vertices.extend(vertices)
        self.faces.extend(tuple(start + corner for corner in face) for face in faces)
        self.materials.extend([material] * len(faces))

    def box(self, center: Point, size: Point, material: int = 0, axes: Matrix | None = None) -> None:
        """A box; `axes` turns it about its center's frame (4 x 4, applied last)."""
        corners = [
            Vector((center[0] + x * size[0] / 2, center[1] + y * size[1] / 2, center[2] + z * size[2] / 2))
            for x in (-1, 1)
            for y in (-1, 1)
            for z in (-1, 1)
        ]
        if axes is not None:
            corners = [axes @ corner for corner in corners]
        self.add(
            corners,
            [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)],
            material,
        )

    def lathe(
        self,
        profile: Sequence[tuple[float, float]],
        segments: int,
        material: int = 0,
        *,
        closed: bool = False,
        axes: Matrix | None = None,
    ) -> None:
        """A body of revolution about z from (radius, height) points, counter-clockwise seen with +z up.

        With `closed`, the last point joins the first (a torus); otherwise ends on the axis should have radius 0.
        """
        vertices = []
        for step in range(segments):
            turn = 2.0 * math.pi * step / segments
            for radius, height in profile:
                vertices.append(Vector((radius * math.cos(turn), radius * math.sin(turn), height)))
        if axes is not None:
            vertices = [axes @ each for each in vertices]
        count = len(profile)
        faces = []
        for step in range(segments):
            here, there = step * count, (step + 1) % segments * count
            for index in range(count if closed else count - 1):
                following = (index + 1) % count
                faces.append((here + index, there + index, there + following, here + following))
        self.add(vertices, faces, material)

    def tube(self, start: Vector, end: Vector, radius: float, segments: int = 12, material: int = 0) -> None:
        """A straight closed cylinder between two points."""
        along = end - start
        axes = Matrix.Translation(start) @ along.to_track_quat("Z", "Y").to_matrix().to_4x4()
        profile = [(0.0, 0.0), (radius, 0.0), (radius, along.length), (0.0, along.length)]
        self.lathe(profile, segments, material, axes=axes)

    def build(
        self,
        name: str,
        materials: Sequence[bpy.types.Material],
        *,
        smooth: float = math.radians(35.0),
        bevel: float = 0.0,
        location: Point = (0.0, 0.0, 0.0),
        parent: bpy.types.Object | None = None,
    ) -> bpy.types.Object:
        """Make the object. Edges blunter than `smooth` (radians) are smooth; `bevel` rounds the sharp ones."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata([tuple(each) for each in self.vertices], [], self.faces)
        for material in materials:
            mesh.materials.append(material)
        mesh.polygons.foreach_set("material_index", self.materials)
        tidy(mesh)
        mesh.shade_smooth()
        mesh.set_sharp_from_angle(angle=smooth)
        thing = add_object(name, mesh, location, parent)
        if bevel > 0.0:
            modifier = thing.modifiers.new("Bevel", "BEVEL")
            modifier.width, modifier.segments = bevel, 2
            modifier.angle_limit = smooth
            modifier.harden_normals = True
        return thing


def tidy(mesh: bpy.types.Mesh) -> None:
    """Join the doubled vertices on axes and seams and let all faces look outwards."""
    import bmesh

    edit = bmesh.new()
    edit.from_mesh(mesh)
    bmesh.ops.remove_doubles(edit, verts=edit.verts, dist=1e-5)
    bmesh.ops.recalc_face_normals(edit, faces=edit.faces)
    edit.to_mesh(mesh)
    edit.free()


def ball(
    name: str, radius: float, location: Point, material: bpy.types.Material, parent: bpy.types.Object | None = None
) -> bpy.types.Object:
    """A smooth sphere."""
    import bmesh

    mesh = bpy.data.meshes.new(name)
    edit = bmesh.new()
    bmesh.ops.create_uvsphere(edit, u_segments=96, v_segments=48, radius=radius)
    edit.to_mesh(mesh)
    edit.free()
    mesh.shade_smooth()
    mesh.materials.append(material)
    return add_object(name, mesh, location, parent)


def arc(center: tuple[float, float], radius: float, start: float, end: float, steps: int) -> list[tuple[float, float]]:
    """Points of a circular arc in a lathe's profile; angles in degrees."""
    angles = np.radians(np.linspace(start, end, steps))
    return [(center[0] + radius * math.cos(a), center[1] + radius * math.sin(a)) for a in angles]


# --- light and materials --------------------------------------------------------------------------


def sun(name: str, direction_from: Point, strength: float, color: Color, size: float = 0.01) -> bpy.types.Object:
    """A sun that shines from a direction."""
    data = bpy.data.lights.new(name, "SUN")
    data.energy, data.color, data.angle = strength, color, size
    light = add_object(name, data)
    light.rotation_euler = Vector(direction_from).to_track_quat("Z", "Y").to_euler()
    return light


def area_light(name: str, location: Point, aim: Point, size: float, power: float, color: Color) -> bpy.types.Object:
    """A square soft light that is itself invisible."""
    data = bpy.data.lights.new(name, "AREA")
    data.energy, data.color, data.size = power, color, size
    light = add_object(name, data, location)
    light.rotation_euler = (Vector(location) - Vector(aim)).to_track_quat("Z", "Y").to_euler()
    light.visible_camera = False
    return light


def material(name: str, color: Color, **settings: float | Color) -> bpy.types.Material:
    """A Principled material; settings by socket name with underscores, e.g. `emission_strength=4`."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    sockets = {each.name.lower().replace(" ", "_"): each for each in shader.inputs}
    for key, value in settings.items():
        sockets[key].default_value = (*value, 1.0) if isinstance(value, tuple) else value
    return made


def add_node(made: bpy.types.Material, kind: str, inputs: dict[str, object], **settings: object) -> bpy.types.Node:
    """A node in a material's tree; inputs are values or sockets to link."""
    node = made.node_tree.nodes.new(kind)
    for key, value in settings.items():
        setattr(node, key, value)
    for key, value in inputs.items():
        if isinstance(value, bpy.types.NodeSocket):
            made.node_tree.links.new(value, node.inputs[key])
        else:
            node.inputs[key].default_value = value
    return node


def feed(made: bpy.types.Material, socket_name: str, output: bpy.types.NodeSocket) -> None:
    """Link an output into the material's Principled shader."""
    made.node_tree.links.new(output, made.node_tree.nodes["Principled BSDF"].inputs[socket_name])


def color_ramp(
    made: bpy.types.Material, factor: bpy.types.NodeSocket, stops: Sequence[tuple[float, Color]]
) -> bpy.types.NodeSocket:
    """A color ramp's output."""
    node = add_node(made, "ShaderNodeValToRGB", {"Fac": factor})
    ramp = node.color_ramp
    while len(ramp.elements) < len(stops):
        ramp.elements.new(1.0)
    for element, (position, color) in zip(ramp.elements, stops, strict=True):
        element.position, element.color = position, (*color, 1.0)
    return node.outputs["Color"]


def world_background(scene: bpy.types.Scene, color: Color, strength: float) -> bpy.types.Node:
    """A World of one color; returns its Background node."""
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = strength
    return background
