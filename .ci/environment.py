# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the virtual environment `.venv-py311` or `.venv-py313`, for the Python that runs this file.

Everything comes from pyproject.toml through pip. A stamp in the environment holds a digest of what was asked
for, so that nothing is installed again until pyproject.toml asks for something else. Prints the environment's
Python.

Needs the standard library only, because nothing else exists yet when it runs.
"""

import argparse
import hashlib
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STAMP = "umbra-stamp"
SUPPORTED = ((3, 11), (3, 13))
MISSING_LIBRARIES_STATUS = 3

# What the Blender module links to and a bare server lacks, by Debian's names.
SYSTEM_PACKAGES = (
    "libx11-6",
    "libxrender1",
    "libxfixes3",
    "libxi6",
    "libxkbcommon0",
    "libsm6",
    "libice6",
    "libxext6",
    "libgl1",
)


def requirements() -> list[str]:
    """What pyproject.toml asks for: to run, Blender's module, the bundled release, developers' tools, the manual's."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    groups = project["dependency-groups"]
    return [
        *project["project"]["dependencies"],
        *project["project"]["optional-dependencies"]["blender"],
        *groups["bundled"],
        *groups["dev"],
        *groups["docs"],
    ]


def environment_python(folder: Path) -> Path:
    """Where the interpreter of the environment in this folder is."""
    return folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def works(python: Path) -> bool:
    """Whether the environment's own interpreter and pip still start (not so after its folder was moved)."""
    if not python.exists():
        return False
    command = [str(python), "-m", "pip", "--version"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def digest(wanted: list[str]) -> str:
    """What the stamp holds: a digest of the requirements (the folder's name says for which Python)."""
    return hashlib.sha256("\n".join(wanted).encode()).hexdigest()


def make(folder: Path) -> None:
    """Create the environment or bring it up to date; does nothing when its stamp is right."""
    wanted = requirements()
    stamp = folder / STAMP
    python = environment_python(folder)
    usable = works(python)
    if usable and stamp.exists() and stamp.read_text(encoding="utf-8").strip() == digest(wanted):
        return
    print(f"Preparing {folder.name} (first time: about 400 MB to download) ...", file=sys.stderr, flush=True)
    stamp.unlink(missing_ok=True)
    if not usable:
        venv.create(folder, clear=folder.exists(), with_pip=True)
    command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *wanted]
    if subprocess.run(command, check=False, stdout=sys.stderr).returncode != 0:
        sys.exit(
            f"pip could not install what pyproject.toml asks for into {folder.name} (its reason is above). "
            "Check the network, the free disk space, and that Blender's module is published for this system."
        )
    stamp.write_text(digest(wanted) + "\n", encoding="utf-8")


def check_blender(folder: Path) -> None:
    """Import Blender's module once, and turn the loader's error into what to install."""
    command = [str(environment_python(folder)), "-c", "import bpy"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    if result.returncode == 0:
        return
    reason = (result.stderr.strip().splitlines() or [f"exit status {result.returncode}"])[-1]
    if "shared object" in reason:
        print(
            f"Blender's module cannot start because system libraries are missing ({reason}). On Debian or "
            f"Ubuntu install these as root, then try again: apt-get install {' '.join(SYSTEM_PACKAGES)}",
            file=sys.stderr,
        )
        sys.exit(MISSING_LIBRARIES_STATUS)
    sys.exit(f"Blender's module is installed in {folder.name} but does not start: {reason}")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Make the environment that the Makefile's commands run in.")
    parser.add_argument(
        "--system-packages", action="store_true", help="only print the Debian packages Blender's module needs"
    )
    arguments = parser.parse_args()
    if arguments.system_packages:
        print(*SYSTEM_PACKAGES)
        return
    if sys.version_info[:2] not in SUPPORTED:
        sys.exit(f"Blender's module needs Python 3.11 or 3.13; this is {sys.version.split()[0]}.")
    folder = ROOT / f".venv-py{sys.version_info.major}{sys.version_info.minor}"
    make(folder)
    check_blender(folder)
    print(environment_python(folder).relative_to(ROOT).as_posix())


if __name__ == "__main__":
    main()
