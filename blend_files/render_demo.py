# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the demo scenes to PNG files, without a window and without a GPU.

    PYTHONPATH=. python blend_files/render_demo.py OUT
    PYTHONPATH=. python blend_files/render_demo.py OUT --scenes station --frames 1,36 --size 1920x1080
    PYTHONPATH=. python blend_files/render_demo.py OUT --animation

Opens each scene with the bpy module that is installed here, bakes its maps into OUT and renders. The
scenes themselves are not changed.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from scene_tools import addon, bpy

FOLDER = Path(__file__).resolve().parent
# The frames and the samples a pixel that are rendered unless others are asked for: few where Cycles renders the whole
# picture, sky and all.
DEFAULTS = {
    "station": ((1, 36, 72), 48),
    "plinth": ((1, 36, 72), 48),
    "disk": ((1, 36, 72), 48),
    "planets": ((40,), 16),
    "flyby": ((44,), 16),
}
SCENES = tuple(DEFAULTS)
DEFAULT_SIZE = (960, 540)


def numbers(text: str) -> tuple[int, ...]:
    """Frame numbers separated by commas."""
    try:
        return tuple(int(each) for each in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f'"{text}" is not a list of frames; write them like 1,24,48') from None


def size(text: str) -> tuple[int, int]:
    """Width x height."""
    try:
        width, height = (int(each) for each in text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f'"{text}" is not a size; write it like 960x540') from None
    if width < 16 or height < 16:
        raise argparse.ArgumentTypeError(f"{width}x{height} is too small; give at least 16x16")
    return width, height


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description="Render the demo scenes to PNG files.")
    parser.add_argument("out", type=Path, metavar="OUT", help="the folder for the pictures, and for their warp maps")
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=SCENES, help="which scenes (default: all)")
    frames = parser.add_mutually_exclusive_group()
    frames.add_argument("--frames", type=numbers, help="default: one to three of each scene")
    frames.add_argument("--animation", action="store_true", help="all frames of each scene")
    parser.add_argument("--size", type=size, default=DEFAULT_SIZE, help="default: 960x540")
    parser.add_argument("--samples", type=int, help="Cycles' samples a pixel (default: 48, with the Cycles Lens 16)")
    return parser.parse_args()


def render_scene(name: str, arguments: argparse.Namespace) -> None:
    """Render frames of one scene; raises RuntimeError with a sentence when that fails."""
    source = FOLDER / f"{name}.blend"
    if not source.is_file():
        raise RuntimeError(f"{source} is missing: build it with blend_files/build_{name}.py in Blender 4.5.")
    bpy.ops.wm.open_mainfile(filepath=str(source))
    scene = bpy.context.scene
    scene.umbra.map_folder = str(arguments.out / "warp_maps") + os.sep
    render = scene.render
    render.resolution_x, render.resolution_y = arguments.size
    render.resolution_percentage = 100
    render.image_settings.file_format = "PNG"
    usual_frames, usual_samples = DEFAULTS[name]
    scene.cycles.samples = usual_samples if arguments.samples is None else arguments.samples
    scene.cycles.device = "CPU"
    choose_denoiser(scene)
    frames = range(scene.frame_start, scene.frame_end + 1) if arguments.animation else arguments.frames or usual_frames
    for frame in frames:
        picture = arguments.out / f"{name}_{frame:04d}.png"
        picture.unlink(missing_ok=True)  # an old picture must not pass for this one
        start = time.perf_counter()
        scene.frame_set(frame)
        render.filepath = str(picture)
        if bpy.ops.render.render(write_still=True) != {"FINISHED"} or not picture.is_file():
            raise RuntimeError(f"Blender did not render frame {frame} of {source.name}; its reason is above.")
        print(f"{picture}  ({time.perf_counter() - start:.0f} s)", flush=True)


def choose_denoiser(scene: bpy.types.Scene) -> None:
    """Denoise where this Blender can; else take more samples."""
    import _cycles

    if not _cycles.with_openimagedenoise:
        scene.cycles.use_denoising = False
        scene.cycles.samples *= 4


def make_folder(folder: Path) -> None:
    """Make the output folder; raises RuntimeError with a sentence when that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RuntimeError(f"the folder {folder} cannot be made ({error.strerror}); choose another one.") from error


def main() -> None:
    """Run from the command line."""
    arguments = parse()
    arguments.out = arguments.out.resolve()
    try:
        make_folder(arguments.out)
        with addon():
            for name in arguments.scenes:
                render_scene(name, arguments)
    except (RuntimeError, OSError, ImportError) as error:
        sys.exit(f"The demo could not be rendered: {error}")


if __name__ == "__main__":
    main()
