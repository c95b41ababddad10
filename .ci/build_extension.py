# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension for Blender: `blender_addon/` with `physics/` beside it and the OpenEXR wheels.

The wheels are fetched with pip and kept in build/wheels, so that a second build needs no network. Packing and
validation are done by Blender's own packer, which the bpy module contains.

    python .ci/build_extension.py                      one zip for every platform
    python .ci/build_extension.py --split-platforms    one zip for each platform
    python .ci/build_extension.py --platform current   one zip for this machine only
"""

import argparse
import importlib.util
import platform
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "blender_addon"
PHYSICS = ROOT / "physics"
BUILD = ROOT / "build"
WHEEL_CACHE = BUILD / "wheels"

# Blender 4.5 and 5.0 carry Python 3.11, 5.1 and 5.2 carry 3.13; Linux distributions build it with 3.14 too.
PYTHON_TAGS = ("cp311", "cp313", "cp314")

# Blender's name of a platform: the platform tag asked of pip, and the pattern of tags on what it fetches (a
# wheel for an older system serves as well).
WHEEL_TAGS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux*_x86_64"),
    "linux-arm64": ("manylinux_2_28_aarch64", "manylinux*_aarch64"),
    "macos-x64": ("macosx_11_0_x86_64", "macosx_*_x86_64"),
    "macos-arm64": ("macosx_11_0_arm64", "macosx_*_arm64"),
    "windows-x64": ("win_amd64", "win_amd64"),
    "windows-arm64": ("win_arm64", "win_arm64"),
}

WHEELS_MARK = "# wheels:"


def pyproject() -> dict:
    """The project's pyproject.toml."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def manifest() -> dict:
    """The extension's manifest as it stands in the repository, without wheels."""
    return tomllib.loads((ADDON / "blender_manifest.toml").read_text(encoding="utf-8"))


def bundled_wheel() -> tuple[str, str]:
    """Name and version of the one package that the extension carries as wheels."""
    (requirement,) = pyproject()["dependency-groups"]["bundled"]
    name, version = requirement.split("==")
    return name, version


def current_platform() -> str:
    """This machine's platform, by Blender's name for it."""
    system = {"Darwin": "macos"}.get(platform.system(), platform.system().lower())
    machine = platform.machine().lower()
    name = f"{system}-{ {'x86_64': 'x64', 'amd64': 'x64', 'aarch64': 'arm64'}.get(machine, machine) }"
    if name not in WHEEL_TAGS:
        sys.exit(f"There are no OpenEXR wheels for this machine ({name}); choose from: {', '.join(WHEEL_TAGS)}.")
    return name


def find_packer() -> Path:
    """Blender's own extension packer, inside the bpy module; the module is not imported."""
    spec = importlib.util.find_spec("bpy")
    if spec is None or spec.origin is None:
        sys.exit("Blender's packer comes with the bpy module, which this Python lacks: run `make extension`.")
    found = sorted(Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    if not found:
        sys.exit(f"The bpy module in {Path(spec.origin).parent} contains no extension packer.")
    return found[-1]


def run_packer(*arguments: str) -> None:
    """Run Blender's packer; its own words and a failure end the build."""
    result = subprocess.run(
        [sys.executable, str(find_packer()), *arguments], capture_output=True, text=True, check=False
    )
    if result.returncode != 0:
        sys.exit(f"Blender's packer refused ({arguments[0]}):\n{result.stdout}{result.stderr}")


def wheel(python_tag: str, platform_name: str) -> Path:
    """The wheel for one Python and one platform: from the cache, else fetched by pip."""
    name, version = bundled_wheel()
    asked, accepted = WHEEL_TAGS[platform_name]
    pattern = f"{name.lower()}-{version}-{python_tag}-{python_tag}-{accepted}.whl"
    if not list(WHEEL_CACHE.glob(pattern)):
        WHEEL_CACHE.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
        command += ["--no-deps", "--only-binary=:all:", "--implementation", "cp"]
        command += ["--platform", asked, "--python-version", python_tag.removeprefix("cp")]
        # pip itself leaves no half-written file there: it downloads elsewhere and copies a whole file.
        command += ["--dest", str(WHEEL_CACHE), f"{name}=={version}"]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        if result.returncode != 0 or not list(WHEEL_CACHE.glob(pattern)):
            sys.exit(
                f"{result.stderr.strip()}\nThe wheel {pattern} is missing and pip could not fetch it. "
                f"Check the network, or put the file into {WHEEL_CACHE}."
            )
    return min(WHEEL_CACHE.glob(pattern))


def toml_list(key: str, values: Iterable[str]) -> str:
    """A list of strings as lines of TOML."""
    return "\n".join([f"{key} = [", *(f'    "{value}",' for value in values), "]"])


def ignore(_folder: str, names: list[str]) -> set[str]:
    """What is never shipped: caches, tests, and files that editors and systems hide."""
    return {name for name in names if name in ("__pycache__", "tests") or name.startswith(".") or name.endswith(".pyc")}


def stage(folder: Path, platforms: Iterable[str]) -> None:
    """Lay out in an empty folder what goes into the zip for these platforms."""
    if manifest()["version"] != pyproject()["project"]["version"]:
        sys.exit("blender_addon/blender_manifest.toml and pyproject.toml give different versions; make them equal.")
    shutil.copytree(ADDON, folder, ignore=ignore, dirs_exist_ok=True)
    shutil.copytree(PHYSICS, folder / "physics", ignore=ignore)
    shutil.copy(ROOT / "LICENSE", folder)
    (folder / "wheels").mkdir()
    names = []
    for platform_name in platforms:
        for python_tag in PYTHON_TAGS:
            source = wheel(python_tag, platform_name)
            shutil.copy(source, folder / "wheels")
            names.append(f"./wheels/{source.name}")
    target = folder / "blender_manifest.toml"
    lines = target.read_text(encoding="utf-8").splitlines()
    (mark,) = (number for number, line in enumerate(lines) if line.startswith(WHEELS_MARK))
    lines[mark : mark + 1] = [toml_list("platforms", platforms), "", toml_list("wheels", names)]
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")


def build(platforms: list[str], output: Path, *, split: bool = False) -> list[Path]:
    """Build and validate the zip for these platforms, or one for each of them; returns the files made."""
    output.mkdir(parents=True, exist_ok=True)
    about = manifest()
    stem = f"{about['id']}-{about['version']}"
    with tempfile.TemporaryDirectory() as temporary:
        staged = Path(temporary, "staged")
        packed = Path(temporary, "packed")
        packed.mkdir()
        stage(staged, platforms)
        if split:
            run_packer("build", f"--source-dir={staged}", f"--output-dir={packed}", "--split-platforms")
        else:
            suffix = f"-{platforms[0].replace('-', '_')}" if len(platforms) == 1 else ""
            run_packer("build", f"--source-dir={staged}", f"--output-filepath={packed / (stem + suffix)}.zip")
        results = []
        for made in sorted(packed.glob("*.zip")):
            run_packer("validate", str(made))
            results.append(Path(shutil.move(made, output / made.name)))
    return results


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Build the extension for Blender.")
    parser.add_argument(
        "--platform",
        action="append",
        choices=["all", "current", *WHEEL_TAGS],
        help="the platforms to build for (may be given more than once; default: all)",
    )
    parser.add_argument("--split-platforms", action="store_true", help="one zip for each platform")
    parser.add_argument("--output", type=Path, default=BUILD, help="the folder for the zip (default: build)")
    arguments = parser.parse_args()
    asked = arguments.platform or ["all"]
    platforms = {current_platform() if name == "current" else name for name in asked}
    chosen = [name for name in WHEEL_TAGS if name in platforms or "all" in platforms]
    for path in build(chosen, arguments.output, split=arguments.split_platforms):
        print(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")


if __name__ == "__main__":
    main()
