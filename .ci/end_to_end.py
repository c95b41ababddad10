# SPDX-License-Identifier: GPL-3.0-or-later
"""End to end with a real Blender executable, named by UMBRA_REAL_BLENDER, as an artist would go about it.

Installs the built zip by Blender's own command line, builds a small scene with the extension, renders two
frames with nothing but `blender -b FILE -a`, and compares every pixel with numpy's reference rendering of the
maps that this baked. Then it renders again, which must reuse the maps, and spoils the scene: that must end in
exit status 1. Whatever is printed on the error stream, and is not expected, ends the test too.

    UMBRA_REAL_BLENDER=blender PYTHONPATH=. python .ci/end_to_end.py
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from build_extension import build, current_platform

from physics import read_exr, read_warp_map, render_reference, star_sky, write_exr

SCENE_SCRIPT = Path(__file__).with_name("end_to_end_scene.py")
SIZE = (160, 90)
ROTATION = (0.1, 0.2, 0.7)
STRENGTH = 0.8
BALL_COLOR = (0.1, 0.6, 0.2)
# Where the ball is in the picture, generously: rows and columns. The rest is sky and hole.
BALL_REGION = (slice(50, 90), slice(100, 160))
# Lines on the error stream that are known and harmless, as regular expressions, each with its reason: Blender 5.2 has
# none.
HARMLESS: tuple[str, ...] = ()
# How a render that is refused says so, by the extension; the rest of its sentence is checked where it is caused.
REFUSAL = r"Error: Umbra Black Hole: .+ \[[a-z]+\.[a-z-]+\]"
TOLERANCE = 2e-3
"""Largest difference allowed from the reference: twice what half floats, 2^-11, lose of levels up to 1.7."""
LOOKS = 8
"""Of the filter that a new scene has."""


class Blender:
    """A real Blender executable with user resources of its own, run in `folder`.

    Nothing outside of that folder is named to it, so an executable in a container needs to see no more than that.
    """

    def __init__(self, executable: str, folder: Path) -> None:
        self.executable = os.path.abspath(shutil.which(executable) or executable)
        self.folder = folder
        self.environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "resources")}

    def run(self, *arguments: str | Path, status: int = 0) -> str:
        """Run it and return what it printed; any other exit status than the expected one ends the test.

        So does any line on the error stream, but for harmless ones, and for a refusal where the status is 1.
        """
        command = [self.executable, *map(str, arguments)]
        print("$ blender", *map(str, arguments), flush=True)
        result = subprocess.run(
            command,
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=1800,
            check=False,
        )
        output = f"{result.stdout}\n{result.stderr}"
        if result.returncode != status:
            sys.exit(f"{output}\nExit status {result.returncode}, expected {status}.")
        expected = (*HARMLESS, *([REFUSAL] if status else []))
        for line in result.stderr.splitlines():
            if line.strip() and not any(re.fullmatch(each, line.strip()) for each in expected):
                sys.exit(f"{output}\nThe error stream has a line that is not expected: {line}")
        return output


def make_sky() -> np.ndarray:
    """A sky that is different in every direction, smooth but for some stars: float32, shape (256, 512, 3)."""
    rows, columns = np.mgrid[0:256, 0:512]
    u, v = 2.0 * np.pi * (columns + 0.5) / 512, np.pi * (rows + 0.5) / 256
    gradient = [0.3 + 0.25 * np.sin(u + channel) * np.sin(v) + 0.1 * np.cos(3.0 * v) for channel in range(3)]
    stars = np.minimum(star_sky(256, magnitude_limit=4.0, star_width=1.0, galactic_glow=False), 1.0)
    return (np.stack(gradient, axis=-1) + stars).astype(np.float32)


def compare(folder: Path, sky: np.ndarray) -> None:
    """Each picture against the reference; the ball against its own color."""
    beside = ("_footprint_", "umbra_sky_")  # by which the sky is filtered
    maps = sorted(each for each in folder.rglob("umbra_maps/*.exr") if not any(name in each.name for name in beside))
    pictures = sorted(folder.glob("picture_*.exr"))
    if len(maps) != 2 or len(pictures) != 2:
        sys.exit(f"Expected two maps and two pictures, found {maps} and {pictures}.")
    for number, (map_path, picture_path) in enumerate(zip(maps, pictures, strict=True), start=1):
        warp_map = read_warp_map(map_path)
        expected = render_reference(warp_map, sky, rotation=ROTATION, strength=STRENGTH, looks=LOOKS).image[..., :3]
        picture = read_exr(picture_path)[0][..., :3]
        difference = np.abs(picture - expected)
        difference[BALL_REGION] = 0.0
        ball = np.all(np.abs(picture[BALL_REGION] - BALL_COLOR) < 1e-3, axis=-1).sum()
        shadow = np.count_nonzero(warp_map.visibility == 0.0)
        print(f"frame {number}: largest difference {difference.max():.1e}, shadow {shadow} px, ball {ball} px")
        if picture.shape[:2] != SIZE[::-1] or difference.max() > TOLERANCE:
            sys.exit(f"Frame {number} differs from the reference by {difference.max():.3g}, allowed {TOLERANCE}.")
        if shadow < 100 or ball < 50:
            sys.exit("The scene does not show what it should: a shadow of 100 pixels and a ball of 50 at least.")
    if np.array_equal(read_warp_map(maps[0]).theta, read_warp_map(maps[1]).theta):
        sys.exit("The camera moves, but both frames have the same map.")


def check_lens(blender: Blender, scene: Path) -> None:
    """The same scene with the Cycles Lens: both frames, from exit maps, a black shadow and a bent sky."""
    lensed = scene.with_name("lens.blend")
    if "OSL: False" in blender.run("-b", "--python-expr", "import _cycles; print('OSL:', _cycles.with_osl)"):
        output = blender.run(
            *("-b", scene, "--python-exit-code", "1", "--python-expr"),
            "import bpy, sys\ntry:\n    bpy.ops.umbra.set_output(output='CYCLES_LENS')\n"
            "except RuntimeError as error:\n    print(error)\n    sys.exit(1)",
            status=1,
        )
        if "without Open Shading Language" not in output:
            sys.exit(f"{output}\nThis Blender has no OSL, and the lens was refused without saying so.")
        print("The lens could not be tried: this Blender was built without Open Shading Language. It says so.")
        return
    switch = (
        "import bpy; s = bpy.context.scene; assert bpy.ops.umbra.set_output(output='CYCLES_LENS') == {'FINISHED'}; "
        f"s.render.filepath = '//lens_'; bpy.ops.wm.save_as_mainfile(filepath={str(lensed)!r})"
    )
    blender.run("-b", scene, "--python-exit-code", "1", "--python-expr", switch)
    blender.run("-b", lensed, "-a")
    pictures = sorted(scene.parent.glob("lens_*.exr"))
    maps = sorted(scene.parent.rglob("umbra_maps/*_exit_*.exr"))
    if len(pictures) != 2 or len(maps) != 2:
        sys.exit(f"Expected two exit maps and two pictures with the lens, found {maps} and {pictures}.")
    for path in pictures:
        black = (read_exr(path)[0][..., :3].max(axis=-1) == 0.0).sum()
        print(f"{path.name}: {black} px of shadow")
        if not 100 < black < 0.5 * SIZE[0] * SIZE[1]:
            sys.exit(f"{path.name} does not show a shadow of its size: {black} pixels are black.")
    missing = "import bpy; s = bpy.context.scene; s.umbra.auto_bake = False; s.umbra.active_hole.umbra.spin = 0.1"
    output = blender.run("-b", lensed, "--python-expr", missing, "-f", "1", status=1)
    if "out of date" not in output:
        sys.exit(f"{output}\nThe render failed, as it should, but did not say that the exit map is out of date.")


def main() -> None:
    """Run the whole test in a temporary folder."""
    executable = os.environ.get("UMBRA_REAL_BLENDER")
    if not executable:
        sys.exit("Name a Blender executable: UMBRA_REAL_BLENDER=/path/to/blender")
    with tempfile.TemporaryDirectory(prefix="umbra-end-to-end-") as temporary:
        folder = Path(temporary)
        blender = Blender(executable, folder)
        print(blender.run("--version").splitlines()[0])
        (zip_file,) = build([current_platform()], folder)
        blender.run("--command", "extension", "install-file", "-r", "user_default", "-e", zip_file)

        sky = make_sky()
        write_exr(folder / "sky.exr", sky)
        scene = folder / "scene.blend"
        settings = {
            "sky": str(folder / "sky.exr"),
            "scene": str(scene),
            "size": SIZE,
            "rotation": ROTATION,
            "strength": STRENGTH,
            "ball_color": BALL_COLOR,
        }
        scene_script = shutil.copy(SCENE_SCRIPT, folder)
        (folder / "settings.json").write_text(json.dumps(settings), encoding="utf-8")
        blender.run("-b", "--python-exit-code", "1", "--python", scene_script, "--", folder / "settings.json")
        blender.run("-b", scene, "-a")
        compare(folder, sky)

        before = {path: path.stat().st_mtime_ns for path in folder.rglob("umbra_maps/*.exr")}
        blender.run("-b", scene, "-f", "2")
        if before != {path: path.stat().st_mtime_ns for path in folder.rglob("umbra_maps/*.exr")}:
            sys.exit("Rendering again baked a map anew although nothing had changed.")

        orthographic = "import bpy; bpy.context.scene.camera.data.type = 'ORTHO'"
        output = blender.run("-b", scene, "--python-expr", orthographic, "-f", "1", status=1)
        if "rthographic" not in output:
            sys.exit(f"{output}\nThe render failed, as it should, but did not say that the camera is orthographic.")
        check_lens(blender, scene)
    print("End to end: passed.")


if __name__ == "__main__":
    main()
