# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the manual's screenshots in a real Blender, on a display of its own.

    UMBRA_REAL_BLENDER=blender python docs/screenshots/take.py [NAME ...]

Builds the extension, installs it into resources of its own by Blender's command line, and has `stage.py` set up one
picture after the other in the window. Needs Xvfb and ImageMagick (Debian's packages xvfb and imagemagick); OpenGL may
be in software. Run it in the project's environment, because the extension's packer comes with the bpy module.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / ".ci"))

from build_extension import build, current_platform  # noqa: E402  found only now

WINDOW = (1400, 1200)
LARGEST = 150_000
"""Bytes that one picture may have."""
COLORS = (256, 128, 64, 32)
"""Numbers of colors tried until a picture is that small."""
TIMEOUT = 600  # seconds
POLL_INTERVAL = 0.1  # seconds


def start_display() -> tuple[subprocess.Popen, str]:
    """Start a virtual display on a free number; return its process and its name."""
    reading, writing = os.pipe()
    display = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writing), "-screen", "0", f"{WINDOW[0]}x{WINDOW[1]}x24", "-nolisten", "tcp"],
        pass_fds=[writing],
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    with os.fdopen(reading) as pipe:
        number = pipe.readline().strip()
    if not number:
        sys.exit("Xvfb did not start.")
    return display, f":{number}"


def take(request: Path, environment: dict[str, str]) -> None:
    """Take the picture that Blender asks for, cut to what matters, small."""
    wanted = json.loads(request.read_text())
    left, top, width, height = wanted["crop"]
    whole, cut = request.with_suffix(".whole.png"), request.with_suffix(".png")
    subprocess.run(["import", "-window", "root", str(whole)], env=environment, check=True)
    command = ["convert", str(whole), "-crop", f"{width}x{height}+{left}+{top}", "+repage"]
    if wanted["trim"]:
        command += ["-fuzz", "1%", "-trim", "+repage", "-bordercolor", "#303030", "-border", "4"]
    for colors in COLORS:
        written = [*command, "-strip", "+dither", "-colors", str(colors), "-define", "png:compression-level=9"]
        subprocess.run([*written, f"PNG8:{cut}"], check=True)
        if cut.stat().st_size <= LARGEST:
            break
    else:
        sys.exit(f"{cut.name} has more than {LARGEST} bytes: cut it smaller.")
    if wanted["unlike"] and cut.read_bytes() == request.with_name(f"{wanted['unlike']}.png").read_bytes():
        cut.unlink()
    elif wanted["keep"]:
        shutil.copy(cut, HERE)
        print(f"{cut.name}: {cut.stat().st_size / 1000:.0f} kB, {colors} colors", flush=True)
    request.unlink()  # Blender goes on


def run_blender(executable: str, folder: Path, names: list[str]) -> None:
    """Have Blender stage and take the pictures into the folder."""
    environment = {
        **os.environ,
        "BLENDER_USER_RESOURCES": str(folder / "resources"),
        "LIBGL_ALWAYS_SOFTWARE": "1",
    }
    (zip_file,) = build([current_platform()], folder)
    install = ["--command", "extension", "install-file", "-r", "user_default", "-e", str(zip_file)]
    subprocess.run([executable, *install], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    stage = shutil.copy(HERE / "stage.py", folder)
    display, environment["DISPLAY"] = start_display()
    window = ["--window-geometry", "0", "0", *map(str, WINDOW), "--enable-event-simulate"]
    command = [executable, *window, "--python-exit-code", "1", "--python", stage, "--", *names]
    try:
        with (folder / "blender.log").open("w") as log:
            blender = subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=log)
            deadline = time.monotonic() + TIMEOUT
            while blender.poll() is None and time.monotonic() < deadline:
                for request in folder.glob("*.request"):
                    take(request, environment)
                time.sleep(POLL_INTERVAL)
            if blender.poll() is None:
                blender.terminate()
    finally:
        display.terminate()
        display.wait()
    if not (folder / "done").exists():
        sys.exit((folder / "blender.log").read_text() + "\nBlender ended before all pictures were taken.")


def main() -> None:
    """Take the named pictures, or all."""
    executable = os.environ.get("UMBRA_REAL_BLENDER")
    if not executable:
        sys.exit("Name a Blender executable: UMBRA_REAL_BLENDER=/path/to/blender")
    missing = [program for program in ("Xvfb", "convert", "import") if shutil.which(program) is None]
    if missing:
        sys.exit(f"Not found: {', '.join(missing)}. On Debian: apt-get install xvfb imagemagick")
    with tempfile.TemporaryDirectory(prefix="umbra-screenshots-") as temporary:
        folder = Path(temporary)
        run_blender(os.path.abspath(shutil.which(executable) or executable), folder, sys.argv[1:])


if __name__ == "__main__":
    main()
