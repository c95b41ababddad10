# SPDX-License-Identifier: GPL-3.0-or-later
"""Templates for render farms, written to a folder: a job for Open Job Description, a job type for Flamenco, a script.

Both templates carry the script `farm/umbra_farm.py` in them, so that each is a file that works alone.
"""

import json
import textwrap
from pathlib import Path

import bpy

from ..bake.folder import folder
from ..core.errors import SceneError
from ..core.physics_api import exr
from ..ui.reporting import reporting
from ..ui.sidebar import HolePanel
from . import farm_copy

SOURCES = Path(__file__).parent
SCRIPT = "umbra_farm.py"
OPENJD, FLAMENCO, PARAMETERS = "umbra_openjd.yaml", "umbra_black_hole.js", "umbra_openjd_parameters.json"

_MARK = f"@{SCRIPT}@"


def openjd_template() -> str:
    """The job template, with the script as blocks of text in it."""
    script = _read(SCRIPT)
    lines = []
    for line in _read("openjd_template.yaml").splitlines():
        block = textwrap.indent(script, line.removesuffix(_MARK)).rstrip() if line.endswith(_MARK) else line
        lines.append(block)
    return "\n".join(lines) + "\n"


def flamenco_job_type() -> str:
    """The job type, with the script as a string in it."""
    return _read("flamenco_job_type.js").replace(_MARK, json.dumps(_read(SCRIPT)))


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
        SCRIPT: _read(SCRIPT),
    }
    for name, text in texts.items():
        with exr.replacing(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


def _read(name: str) -> str:
    return (SOURCES / name).read_text(encoding="utf-8")


class UMBRA_OT_save_farm_templates(bpy.types.Operator):
    bl_idname = "umbra.save_farm_templates"
    bl_label = "Save Farm Templates..."
    bl_description = (
        "Write job templates for render farms (Open Job Description, Flamenco) and their script to a folder; and a "
        "farm copy of this file where it needs one"
    )
    bl_options = {"REGISTER"}

    directory: bpy.props.StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reporting
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        written = save(scene, Path(bpy.path.abspath(self.directory)))
        self.report({"INFO"}, f"Wrote {', '.join(path.name for path in written)}.")
        if farm_copy.needs_copy(scene):
            try:
                bpy.ops.umbra.save_farm_copy("EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT")
            except RuntimeError as error:  # what the other operator has reported, with its code
                self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
                return {"CANCELLED"}
        return {"FINISHED"}


class VIEW3D_PT_umbra_farm(HolePanel, bpy.types.Panel):
    bl_label = "Render Farm"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column()
        column.enabled = bool(bpy.data.filepath)
        column.operator("umbra.save_farm_templates", icon="FILE_FOLDER")
        column.operator("umbra.save_farm_copy", icon="DUPLICATE")
        if not bpy.data.filepath:
            self.layout.label(text="Save this file first.", icon="INFO")


CLASSES = (UMBRA_OT_save_farm_templates, VIEW3D_PT_umbra_farm)
