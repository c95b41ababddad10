# SPDX-License-Identifier: GPL-3.0-or-later
"""Render three views of the disk of disk.blend to PNG files: face-on, 10 degrees above it, and extreme spin close up.

PYTHONPATH=. python blend_files/render_disk_views.py OUT [WIDTHxHEIGHT]
"""

from __future__ import annotations

import math
import os
import sys
from dataclasses import dataclass
from pathlib import Path

from render_demo import choose_denoiser, make_folder, size
from scene_tools import FOLDER, Vector, addon, bpy


@dataclass(frozen=True)
class View:
    """A place of the camera, and a disk."""

    spin: float
    distance: float
    """Units of M."""
    height: float
    """Of the camera over the disk's plane, degrees."""
    lens: float
    outer: float
    preset: str
    exposure: float = 0.0
    """Stops added to the preset's."""


VIEWS = {
    "disk_face_on": View(spin=0.7, distance=50.0, height=78.0, lens=31.0, outer=18.0, preset="PHYSICAL", exposure=0.4),
    "disk_ten_degrees": View(spin=0.6, distance=46.0, height=9.0, lens=38.0, outer=18.0, preset="GARGANTUA"),
    "disk_close_up": View(
        spin=0.998, distance=13.0, height=8.0, lens=19.0, outer=12.0, preset="BLUE_HOT", exposure=0.5
    ),
}


def render_view(name: str, view: View, out: Path) -> None:
    """Render one view; raises RuntimeError with a sentence when that fails."""
    scene = bpy.context.scene
    hole, camera = scene.umbra.active_hole, scene.camera
    hole.umbra.spin = view.spin
    hole.umbra.disk.outer_radius = view.outer
    bpy.ops.umbra.disk_preset(preset=view.preset)
    hole.umbra.disk.exposure += view.exposure
    reach, height = view.distance * hole.umbra.mass_scale, math.radians(view.height)
    camera.location = (0.0, -reach * math.cos(height), reach * math.sin(height))
    camera.rotation_euler = (-Vector(camera.location)).to_track_quat("-Z", "Y").to_euler()
    camera.data.lens = view.lens
    picture = out / f"{name}.png"
    picture.unlink(missing_ok=True)
    scene.render.filepath = str(picture)
    if bpy.ops.render.render(write_still=True) != {"FINISHED"} or not picture.is_file():
        raise RuntimeError(f"Blender did not render {name}; its reason is above.")
    print(picture, flush=True)


def main() -> None:
    """Run from the command line."""
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    out = Path(sys.argv[1]).resolve()
    try:
        make_folder(out)
        with addon():
            bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "disk.blend"))
            scene = bpy.context.scene
            scene.umbra.map_folder = str(out / "warp_maps") + os.sep
            render = scene.render
            render.resolution_x, render.resolution_y = size(sys.argv[2] if len(sys.argv) > 2 else "1600x900")
            render.resolution_percentage = 100
            render.image_settings.file_format = "PNG"
            scene.cycles.samples = 1
            choose_denoiser(scene)
            for name, view in VIEWS.items():
                render_view(name, view, out)
    except (RuntimeError, OSError, ImportError) as error:
        sys.exit(f"The views could not be rendered: {error}")


if __name__ == "__main__":
    main()
