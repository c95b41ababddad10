# SPDX-License-Identifier: GPL-3.0-or-later
"""Panoramas of Worlds that are no plain image: rendered once by Cycles, kept in the file, and known by a digest.

A panorama is exact as far as the World's light depends on its direction alone. What moves, or depends on where the
picture's frame is, has none. A panorama is made where an artist acts, never inside a render, which cannot run another
one.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ...core.errors import SceneError
from ...core.physics_api import physics
from ...core.session import SESSION, Life
from . import followed, image_world, sky_frames, world_digest
from .followed import Followed
from .node_paths import reachable

is_rendering = SESSION.value(bool, Life.RENDER)
"""Whether a render of a scene with a sky runs, in which no other one can."""

KEY = "umbra_panorama"
"""Custom property of the image: the digest of what it shows."""
_STAMP = "umbra_panorama_files"

# Width of the panorama of a World without images, and the limits of others: pixels.
PROCEDURAL_WIDTH = 4096
LEAST_WIDTH, LARGEST_WIDTH = 16, 8192

# Rays go through the centers of pixels: a wider filter would blur an image that has as many pixels.
_FILTER_WIDTH = 0.01
_LARGEST_HALF = float(np.finfo(np.float16).max)

# Texture Coordinate's outputs that depend on the camera.
_OF_THE_CAMERA = frozenset({"Camera", "Window"})


def problem(world: bpy.types.World, output: bpy.types.Node, parts: Followed) -> SceneError | None:
    """Return why a World can have no panorama, if so; what is followed beside it may be animated."""
    nodes = list(reachable(output.inputs["Surface"]))
    owners: list[Any] = [world, *{node.id_data.as_pointer(): node.id_data for node in nodes}.values()]
    apart = {each.path for each in parts.places}
    moving = next((each for each in owners if followed.animated(each) - apart), None)
    if moving is not None:
        return _moves(world, f'"{moving.name}" is animated')
    for node in nodes:
        image = getattr(node, "image", None)
        if image is not None and image.source == "TILED":
            return sky_frames.tiled(image)
        if image is not None and sky_frames.moves(image):
            return _moves(world, f'the image "{image.name}" is a sequence or a movie')
        if image is not None and image.source == "FILE" and not sky_frames.is_packed(image):
            path = sky_frames.path_of(image)
            if not path.is_file():
                return sky_frames.image_missing(image)
        thing = getattr(node, "object", None)
        if thing is not None and (thing.animation_data is not None or thing.parent is not None or thing.constraints):
            return _moves(world, f'the object "{thing.name}", which it takes coordinates from, may move')
        of_camera = node.type == "TEX_COORD" and any(
            each.is_linked for each in node.outputs if each.name in _OF_THE_CAMERA
        )
        if of_camera or node.type == "CAMERA":
            return SceneError(
                f'World "{world.name}" looks otherwise from each camera, by its node "{node.name}", and a sky is one '
                "picture for all: use Texture Coordinate > Generated, or choose Sky: Image in the Umbra panel.",
                code="sky.coordinates",
            )
    return None


def _moves(world: bpy.types.World, reason: str) -> SceneError:
    return SceneError(
        f'World "{world.name}" is no plain image, so that it needs a panorama, and it has none because {reason}: '
        "choose Sky: Image in the Umbra panel, or Output: World, which follows it.",
        code="sky.animated",
    )


def find(digest: str) -> bpy.types.Image | None:
    """Return the panorama of a digest, if the file has it."""
    return next((each for each in bpy.data.images if each.get(KEY) == digest), None)


def of_world(world: bpy.types.World, output: bpy.types.Node, parts: Followed) -> bpy.types.Image:
    """Return the panorama of a World without what is followed, rendered unless there is one of it as it is.

    Raises
    ------
    SceneError
        It cannot be rendered.
    """
    images = _images(output)
    digest = world_digest.of_world(output, parts)
    present = _present(digest, images)
    if present is not None:
        return present
    copy = world.copy()
    try:
        _keep_surface(copy, output.name)
        parts.make_neutral(copy)
        return _render(copy, _width(images), world.name, digest, _stamp(images))
    finally:
        bpy.data.worlds.remove(copy)


def of_image(image: bpy.types.Image) -> bpy.types.Image:
    """Return what Cycles shows where a World shows an image, as an image without alpha.

    Raises
    ------
    SceneError
        It cannot be rendered.
    """
    digest = world_digest.of_image(image)
    present = _present(digest, [image])
    if present is not None:
        return present
    world = image_world.make("Umbra Panorama", image)
    try:
        return _render(world, _width([image]), image.name, digest, _stamp([image]))
    finally:
        bpy.data.worlds.remove(world)


def _images(output: bpy.types.Node) -> list[bpy.types.Image]:
    found = (getattr(node, "image", None) for node in reachable(output.inputs["Surface"]))
    return [image for image in found if image is not None]


def _width(images: list[bpy.types.Image]) -> int:
    widths = [image.size[0] for image in images if image.size[0] > 0]
    return min(max(*widths, LEAST_WIDTH), LARGEST_WIDTH) if widths else PROCEDURAL_WIDTH


def _stamp(images: list[bpy.types.Image]) -> str:
    """Sizes and times of the files that are read, as far as they are there: what tells that one was written anew."""
    parts = []
    for image in images:
        with contextlib.suppress(OSError):
            found = sky_frames.path_of(image).stat()
            parts.append(f"{image.name} {found.st_size} {found.st_mtime_ns}")
    return "\n".join(parts)


def _present(digest: str, images: list[bpy.types.Image]) -> bpy.types.Image | None:
    found = find(digest)
    if found is None or (_stamp(images) and found.get(_STAMP) != _stamp(images)):
        return None
    return found


def _keep_surface(world: bpy.types.World, output_name: str) -> None:
    """Take out of a World's copy its volume, and the outputs of other engines."""
    tree = world.node_tree
    for node in [each for each in tree.nodes if each.type == "OUTPUT_WORLD" and each.name != output_name]:
        tree.nodes.remove(node)
    output: Any = tree.nodes[output_name]
    output.target, output.is_active_output = "ALL", True
    for link in list(output.inputs["Volume"].links):
        tree.links.remove(link)


def _render(world: bpy.types.World, width: int, name: str, digest: str, stamp: str) -> bpy.types.Image:
    path = Path(bpy.app.tempdir) / f"umbra_panorama_{digest}.exr"
    try:
        _render_to(path, world, width)
        with contextlib.suppress(physics.BlackHoleError):  # then it stays in single precision
            _make_small(path)
        return _keep(path, f"{name} Panorama", digest, stamp)
    except (RuntimeError, OSError) as error:
        raise SceneError(
            f'The panorama of "{name}" could not be rendered ({error}): render it by hand and choose it as Sky: Image.',
            code="sky.panorama-failed",
        ) from error
    finally:
        path.unlink(missing_ok=True)


def _make_small(path: Path) -> None:
    """Write a picture in half precision, which is as exact as a sky needs, unless the sun in it is too bright."""
    pixels, _header = physics.read_exr(path)
    if np.abs(pixels).max() < _LARGEST_HALF:
        physics.write_exr(path, pixels[..., :3].astype(np.float16))


def _render_to(path: Path, world: bpy.types.World, width: int) -> None:
    if is_rendering.now or bpy.app.is_job_running("RENDER"):
        raise RuntimeError("a render is running")
    scene = bpy.data.scenes.new("Umbra Panorama")
    camera = bpy.data.cameras.new("Umbra Panorama")
    thing = bpy.data.objects.new("Umbra Panorama", camera)
    try:
        _set_up(scene, world, width)
        _aim(scene, thing, camera)
        scene.render.filepath = str(path)
        with _own_slot():
            bpy.ops.render.render(write_still=True, scene=scene.name)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(thing)
        bpy.data.cameras.remove(camera)


def _set_up(scene: bpy.types.Scene, world: bpy.types.World, width: int) -> None:
    render = scene.render
    render.engine = "CYCLES"
    scene.world = world
    cycles = scene.cycles
    of_world: Any = world.cycles
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = 1, False, False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", _FILTER_WIDTH
    of_world.sampling_method = "NONE"  # nothing is lit, and the table of the light takes long
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, max(width // 2, 1), 100
    render.use_compositing = render.use_sequencer = False
    render.use_file_extension = False
    settings = render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"


def _aim(scene: bpy.types.Scene, thing: bpy.types.Object, camera: bpy.types.Camera) -> None:
    """Look along x, so that the picture is laid out as Environment Textures are."""
    camera.type = "PANO"
    (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
    thing.rotation_euler = (math.pi / 2.0, 0.0, -math.pi / 2.0)
    scene.collection.objects.link(thing)
    scene.camera = thing


@contextlib.contextmanager
def _own_slot() -> Iterator[None]:
    """Render into the last slot of the render's result, and leave the artist's own."""
    result = next((each for each in bpy.data.images if each.type == "RENDER_RESULT"), None)
    slots = None if result is None else result.render_slots
    if slots is None or len(slots) < 2:
        yield
        return
    before = slots.active_index
    slots.active_index = len(slots) - 1 if before != len(slots) - 1 else len(slots) - 2
    try:
        yield
    finally:
        slots.active_index = before


def _keep(path: Path, name: str, digest: str, stamp: str) -> bpy.types.Image:
    """Pack a panorama into the file, in place of one that nobody uses any more."""
    for old in [each for each in bpy.data.images if each.get(KEY) is not None and each.users == 0]:
        bpy.data.images.remove(old)
    former = find(digest)
    if former is not None:  # its files were written anew
        del former[KEY]
    image = bpy.data.images.load(str(path))
    image.name = name
    image.pack()
    # no path of this computer in a file that may be passed on
    image.filepath_raw = f"//{path.name}"
    for packed in image.packed_files:
        packed.filepath = image.filepath_raw
    image[KEY], image[_STAMP] = digest, stamp
    return image
