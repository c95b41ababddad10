# SPDX-License-Identifier: GPL-3.0-or-later
"""Templates for render farms, written to a folder: a job for Open Job Description, a job type for Flamenco, a script.

The script is `farm/umbra_farm.py` with the source of what it imports. Both templates contain it, so that each is a file
that works alone.
"""

import json
import textwrap
from pathlib import Path

import bpy

from ..bake.folder import folder
from ..core.errors import SceneError
from ..core.physics_api import physics
from . import farm_copy

SOURCES = Path(__file__).parent
SCRIPT = "umbra_farm.py"
OPENJD, FLAMENCO, PARAMETERS = "umbra_openjd.yaml", "umbra_black_hole.js", "umbra_openjd_parameters.json"

_MARK = f"@{SCRIPT}@"
# What the script imports from this package, and where that is.
_IMPORT = "from ..bake.frame_list import FrameListError, frames_text, parse_frames, ranges\n"
_IMPORTED = "../bake/frame_list.py"


def script() -> str:
    """Return the script for farms, which needs nothing but Blender."""
    return _read(SCRIPT).replace(_IMPORT, _read(_IMPORTED))


def openjd_template() -> str:
    """The job template, with the script as blocks of text in it."""
    lines = []
    for line in _read("openjd_template.yaml").splitlines():
        block = textwrap.indent(script(), line.removesuffix(_MARK)).rstrip() if line.endswith(_MARK) else line
        lines.append(block)
    return "\n".join(lines) + "\n"


def flamenco_job_type() -> str:
    """The job type, with the script as a string in it."""
    return _read("flamenco_job_type.js").replace(_MARK, json.dumps(script()))


def parameters_of(scene: bpy.types.Scene) -> dict[str, object]:
    """The values of the job template's parameters for a scene; the file is its farm copy where it needs one.

    Raises
    ------
    SceneError
        The file is not saved yet.
    """
    if not bpy.data.filepath:
        raise SceneError(
            "This file is not saved yet: save it, so that the farm's machines can open it.", code="farm.not-saved"
        )
    blend = Path(bpy.data.filepath)
    picture = Path(bpy.path.abspath(scene.render.filepath))
    is_folder = scene.render.filepath.endswith(("/", "\\"))
    name = "" if is_folder else picture.name
    return {
        "JobName": blend.stem,
        "BlendFile": str(farm_copy.path_beside(blend) if farm_copy.needs_copy(scene) else blend),
        "MapFolder": str(folder(scene).path),
        "FirstFrame": scene.frame_start,
        "LastFrame": scene.frame_end,
        "OutputFolder": str(picture if is_folder else picture.parent),
        "OutputName": name if "#" in name else f"{name}####",
    }


def save(scene: bpy.types.Scene, folder: Path) -> list[Path]:
    """Write the templates into a folder; what an earlier version wrote there is replaced.

    Raises
    ------
    physics.BlackHoleError
        The file is not saved yet, or the folder cannot be written to.
    """
    texts = {
        OPENJD: openjd_template(),
        PARAMETERS: json.dumps(parameters_of(scene), indent=2) + "\n",
        FLAMENCO: flamenco_job_type(),
        SCRIPT: script(),
    }
    for name, text in texts.items():
        with physics.replacing_file(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


def _read(name: str) -> str:
    return (SOURCES / name).read_text(encoding="utf-8")
