# SPDX-License-Identifier: GPL-3.0-or-later
"""Umbra Black Hole on a render farm: bake a chunk of frames, render one, or only look whether its maps are there.

Blender runs this file. Rendering and looking need no add-on; baking starts a second Blender, which needs it.

    blender -b FILE -s 1 -e 10 --python-exit-code 1 --python umbra_farm.py -a
        renders as ever, unless a map of the scene's frames is missing
    blender -b FILE --python-exit-code 1 --python umbra_farm.py -- check --frames=1-3,7
    blender -b FILE --python-exit-code 1 --python umbra_farm.py -- render --frames=1-10 --output /renders/shot_####
    blender -b --factory-startup --python-exit-code 1 --python umbra_farm.py -- bake --frames=1-10 --file FILE

In the add-on this file is a part of what `farm_templates.script` writes, which stands alone.

Progress and failures are printed as Open Job Description understands them (openjd_progress, openjd_status,
openjd_fail); elsewhere they are lines of the log like any other.
"""

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

import bpy

from ..bake.frame_list import FrameListError, frames_text, parse_frames, ranges

# As the add-on marks its nodes and numbers its files.
ROLE = "umbra_role"
SETTINGS = "umbra."
LENS = "umbra_lens_before"
WORLD_MAP = "umbra_world_map"
LIGHT = "umbra_disk_light"
COPIED_FRAMES = "umbra_farm_frames"
READ_BY_FRAME = re.compile(r"map|disk_layer|disk_pass_\d+|stars")
SEQUENCE_LENGTH = 1_000_000
EXR_MAGIC = b"\x76\x2f\x31\x01"

# How the add-on's failures begin while it renders.
FAILURE = "Error: Umbra Black Hole: "
# A failure of its command: the sentence and the code, which add-ons of version 0.1.0 lack.
COMMAND_FAILURE = re.compile(r"error: (.*?)(?: \[([a-z.-]+)\])?")
# A line of that command for each frame that is done.
FRAME_DONE = re.compile(r"Umbra: .*(Frame -?\d+).*: (baked|still valid)")


class Fault(Exception):
    """One sentence that says what is wrong and what to do, and its code from the manual's troubleshooting page."""

    def __init__(self, sentence: str, *, code: str) -> None:
        super().__init__(f"{sentence} [{code}]")


def tell(kind: str, text: object) -> None:
    """Say something to the scheduler."""
    print(f"openjd_{kind}: {text}", flush=True)


def arguments() -> argparse.Namespace:
    """What stands behind `--` on Blender's command line; nothing means check."""
    parser = argparse.ArgumentParser(prog="umbra_farm.py", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("task", choices=("bake", "render", "check"), help="what to do")
    parser.add_argument("--frames", help="as in 1-250, or 1,5,9-12, or 1-250x2; the scene's own without")
    parser.add_argument("--count", type=int, help="no more than so many frames, from the first")
    parser.add_argument("--last", type=int, help="no frame after this one")
    parser.add_argument("--output", default="", help="where pictures go, # for digits; the scene's own without")
    parser.add_argument("--file", help="bake: the .blend file")
    parser.add_argument("--blender", default=bpy.app.binary_path, help="bake: the Blender that has the add-on")
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    return parser.parse_args(given or ["check"])


def frames_of(options: argparse.Namespace) -> list[int]:
    """The frames of this task: a chunk may be given as its first frame, a number of frames and the shot's last one."""
    scene = bpy.context.scene
    if options.frames is None:
        return list(range(scene.frame_start, scene.frame_end + 1, max(scene.frame_step, 1)))
    frames = parse_frames(options.frames)
    if options.count is not None:
        if options.count < 1:
            raise Fault(f"Frames per task is {options.count}: it must be 1 or more.", code="command.frames")
        last = frames[0] + options.count - 1
        if options.last is not None:
            last = max(frames[0], min(last, options.last))
        frames = parse_frames(f"{frames[0]}-{last}")
    if options.last is not None:
        frames = [frame for frame in frames if frame <= options.last]
    if not frames:
        raise Fault("There is no frame to work on: the last frame is before the first.", code="command.frames")
    return frames


# --- maps -----------------------------------------------------------------------------------------


def compositor_of(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """The scene's compositor, where it is used; Blender 5 keeps it elsewhere than Blender 4."""
    if not scene.render.use_compositing:
        return None
    if bpy.app.version >= (5, 0):
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def map_images(scene: bpy.types.Scene) -> Iterator[bpy.types.Image]:
    """The images that the compositor, or the lensed World, reads frame by frame."""
    tree = compositor_of(scene)
    for node in [] if tree is None else tree.nodes:
        if READ_BY_FRAME.fullmatch(node.get(ROLE, "")) and node.image is not None and is_used(node):
            yield node.image
    tree = None if scene.world is None else scene.world.node_tree
    groups = {node.node_tree for node in ([] if tree is None else tree.nodes) if node.type == "GROUP" and not node.mute}
    nodes = [node for group in groups if group is not None for node in group.nodes if WORLD_MAP in node]
    if any(node.image is None or node.image.source != "SEQUENCE" for node in nodes):
        raise Fault(
            "The lensed World reads no maps: open the file with the add-on and save it again.",
            code="farm.world-without-maps",
        )
    yield from {node.image for node in nodes if node.image is not None}


def map_files(scene: bpy.types.Scene, frame: int) -> Iterator[Path]:
    """The files that are read for a frame: a warp map, the layers of light and of stars, or a world map."""
    for image in map_images(scene):
        path = Path(bpy.path.abspath(image.filepath, library=image.library))
        beginning = path.stem.rstrip("0123456789")
        number = path.stem[len(beginning) :]
        yield path.with_name(f"{beginning}{frame % SEQUENCE_LENGTH:0{len(number)}d}{path.suffix}")


def is_used(node: bpy.types.Node) -> bool:
    """Whether one of the add-on's groups reads the node, and is not muted."""
    readers = [link.to_node for output in node.outputs for link in output.links]
    return any(not each.mute and (each.get(ROLE) != "disk" or is_used(each)) for each in readers)


def check_light(scene: bpy.types.Scene) -> None:
    """Refuse a disk that lights the scene while its settings are animated: only the add-on makes its mesh follow."""
    for each in scene.objects:
        hole = each.parent if LIGHT in each else None
        animation = hole.animation_data if hole is not None else None
        if hole is None or animation is None:
            continue
        layers = list(animation.action.layers) if animation.action is not None else []
        bags = [bag for layer in layers for strip in layer.strips for bag in strip.channelbags]
        curves = [*animation.drivers, *(curve for bag in bags for curve in bag.fcurves)]
        if any(curve.data_path.startswith(SETTINGS) for curve in curves):
            raise Fault(
                f'The disk of "{hole.name}" lights the scene, and its settings are animated: render with the '
                "add-on, or switch Light the Scene off.",
                code="farm.lighting-disk",
            )


def check_alone(scene: bpy.types.Scene, frames: list[int]) -> None:
    """Refuse frames that only the add-on, or its farm copy of the file, renders right."""
    check_light(scene)
    known = scene.get(COPIED_FRAMES)
    if known is not None:
        outside = [frame for frame in frames if not known[0] <= frame <= known[1]]
        if outside:
            raise Fault(
                f"Frame {outside[0]} is not in this farm copy, which has {known[0]} to {known[1]}: save it anew.",
                code="farm.frame-not-copied",
            )
        return
    cameras = [scene.camera, *(marker.camera for marker in scene.timeline_markers)]
    lensed = any(each is not None and each.type == "CAMERA" and LENS in each.data for each in cameras)
    tree = compositor_of(scene)
    drivers = list(tree.animation_data.drivers) if tree is not None and tree.animation_data is not None else []
    targets = [
        target
        for curve in drivers
        if not curve.mute
        for variable in curve.driver.variables
        for target in variable.targets
    ]
    if lensed or any(target.data_path.startswith(SETTINGS) for target in targets):
        raise Fault(
            "This file needs the add-on in each frame (for the Cycles Lens, or a disk whose settings are animated): "
            "render its farm copy, which Save Farm Copy in the Umbra panel writes.",
            code="farm.needs-add-on",
        )


def check(frames: list[int]) -> None:
    """Refuse to render without a map: Blender itself would render magenta and call it a success.

    An add-on that is there is left to look itself, and to bake what is missing.
    """
    scene = bpy.context.scene
    if hasattr(bpy.types.Scene, "umbra"):
        return
    check_alone(scene, frames)
    for frame in frames:
        for path in map_files(scene, frame):
            if not path.is_file():
                raise Fault(
                    f"Frame {frame}: the map {path} is missing: bake it, or bring the maps' folder along.",
                    code="farm.map-missing",
                )
            with path.open("rb") as file:
                if file.read(len(EXR_MAGIC)) != EXR_MAGIC:
                    raise Fault(f"Frame {frame}: the map {path} is damaged: bake it again.", code="farm.map-missing")


# --- tasks ----------------------------------------------------------------------------------------


class Failures:
    """Passes on what is written to it, and tells the scheduler of the first failure among it."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.told = False

    def write(self, text: str) -> int:
        if text.startswith(FAILURE) and not self.told:
            self.told = True
            tell("fail", text.removeprefix(FAILURE).strip())
        return self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def render(frames: list[int], output: str) -> None:
    """Render frames one run after another, each a stretch without a gap."""
    check(frames)
    scene = bpy.context.scene
    if scene.render.is_movie_format:
        raise Fault(
            "The scene's format is a movie, which cannot be rendered in chunks: choose an image format.",
            code="farm.movie",
        )
    if output:
        scene.render.filepath = output
    written: list[int] = []

    def on_write(*_unused: object) -> None:
        written.append(scene.frame_current)
        tell("progress", f"{100.0 * len(written) / len(frames):.1f}")
        tell("status", f"Rendered frame {scene.frame_current}")

    bpy.app.handlers.render_write.append(on_write)
    scene.frame_step = 1
    for scene.frame_start, scene.frame_end in ranges(frames):
        bpy.ops.render.render(animation=True, scene=scene.name)
    bpy.app.handlers.render_write.remove(on_write)
    left = sorted(set(frames) - set(written))
    if left:
        raise Fault(f"Frame {left[0]} was not written: the lines above say why.", code="farm.frame-not-written")


def bake(frames: list[int], blender: str, file: str) -> None:
    """Bake by the add-on's own command, and pass its progress and its failure on."""
    command = [blender, "-b", file, "-c", "umbra", "bake", f"--frames={frames_text(frames)}"]
    try:
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", errors="replace"
        )
    except OSError as error:
        raise Fault(
            f"Blender could not be started as {blender} ({error.strerror}): name its executable.",
            code="farm.no-blender",
        ) from error
    failure, done = None, 0
    for line in process.stdout or ():
        print(line, end="", flush=True)
        text = line.strip()
        match = FRAME_DONE.fullmatch(text)
        if match is not None:
            done += 1
            tell("progress", f"{100.0 * done / len(frames):.1f}")
            tell("status", f"{match[1]}: {match[2]}")
        else:
            failure = COMMAND_FAILURE.fullmatch(text) or failure
    if process.wait() == 0:
        return
    if failure is not None:
        raise Fault(failure[1], code=failure[2] or "farm.bake-failed")
    raise Fault(
        f"Baking ended with exit status {process.returncode}: the lines above say why.", code="farm.bake-failed"
    )


def main() -> None:
    """Do the task; a fault ends the process with exit status 1."""
    options = arguments()
    sys.stderr = Failures(sys.stderr)  # the add-on, where it is there, ends the process with a sentence
    try:
        frames = frames_of(options)
        if options.task == "bake":
            if not options.file:
                raise Fault("Baking needs the .blend file: name it by --file.", code="farm.no-file")
            bake(frames, options.blender, options.file)
        elif options.task == "render":
            render(frames, options.output)
        else:
            check(frames)
    except (Fault, FrameListError) as fault:
        print(f"{FAILURE}{fault}", file=sys.stderr, flush=True)
        sys.exit(1)


if __name__ == "__main__":
    main()
