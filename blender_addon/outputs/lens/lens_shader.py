# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's shader: compiled by Cycles, put into a camera, and given its parameters.

Blender's own way to a custom camera needs the module oslquery to find the parameters; it is missing in the bpy module.
The parameters are known here, so the bytecode and they are written into the camera directly.
"""

import hashlib
import re
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import bpy

from ...core.errors import SceneError

SOURCE = Path(__file__).parent / "shaders" / "umbra_lens.osl"
# Defined for the variant that looks rays up.
MAP_DEFINE = "UMBRA_EXIT_MAP"

# Devices of Cycles that run camera shaders; "NONE" is the CPU.
DEVICES_WITH_SHADERS = ("OPTIX", "NONE")


@cache
def bytecode(*, uses_map: bool) -> tuple[str, str]:
    """The compiled shader, and the hash by which Blender knows it.

    Raises
    ------
    SceneError
        This Blender has no Cycles with Open Shading Language, or cannot compile the shader.
    """
    try:
        import _cycles
    except ImportError:
        raise SceneError(
            "Cycles is not available: enable it in Preferences > Add-ons.", code="lens.no-cycles"
        ) from None
    if not _cycles.with_osl:
        raise SceneError(
            "This Blender was built without Open Shading Language, which the Cycles Lens needs: use an official build, "
            "or choose Output: Compositor.",
            code="lens.no-osl",
        )
    text = SOURCE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        source, compiled = Path(folder, "umbra_lens.osl"), Path(folder, "umbra_lens.oso")
        source.write_text(f"#define {MAP_DEFINE}\n{text}" if uses_map else text, encoding="utf-8")
        if not _cycles.osl_compile(str(source), str(compiled)) or not compiled.is_file():
            raise SceneError(
                "Cycles could not compile the lens camera's shader; please report it.", code="lens.not-compiled"
            )
        code = without_origin(compiled.read_text(encoding="utf-8"))
    return code, hashlib.md5(code.encode(), usedforsecurity=False).hexdigest()


def without_origin(code: str) -> str:
    """Take out of bytecode what says where it comes from: comments, and the files and lines of instructions.

    They name folders of this computer, and would make every session's code another one.
    """
    lines = (line for line in code.splitlines(keepends=True) if not line.startswith("#"))
    return re.sub(r'%(filename\{"[^"]*"\}|line\{\d+\}) ?', "", "".join(lines))


def write(camera: bpy.types.Camera, values: Mapping[str, object]) -> None:
    """Let a converted camera run the shader with these parameters; nothing is touched that is so already.

    With `exit_map` among them, it is the variant that looks rays up.
    """
    code, identity = bytecode(uses_map="exit_map" in values)
    changed = False
    if camera.custom_bytecode_hash != identity or camera.custom_mode != "INTERNAL":
        camera.custom_mode = "INTERNAL"
        camera.custom_bytecode = code
        camera.custom_bytecode_hash = identity
        changed = True
    present = camera.cycles_custom
    for name in [each for each in present.keys() if each not in values]:  # noqa: SIM118  it has no iterator of its own
        del present[name]
        changed = True
    for name, value in values.items():
        if name not in present or not _same(present[name], value):
            present[name] = value
            changed = True
    if changed:
        camera.update_tag()


def _same(present: Any, value: object) -> bool:
    return bool(tuple(present) == value if isinstance(value, tuple) else present == value)


def device_problem(scene: bpy.types.Scene) -> SceneError | None:
    """Return the error for a device that cannot run a camera's shader; None if the scene's device can."""
    if scene.cycles.device != "GPU":
        return None
    addon = bpy.context.preferences.addons.get("cycles")
    kind = addon.preferences.compute_device_type if addon is not None and addon.preferences is not None else "NONE"
    if kind in DEVICES_WITH_SHADERS:
        return None
    return SceneError(
        f"The GPU is used through {kind}, which cannot run camera shaders: only OptiX can. Choose CPU as Device in "
        "Render Properties, or OptiX in Preferences > System.",
        code="lens.device",
    )
