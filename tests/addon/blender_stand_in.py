# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of Blender's command line that farms use, with the bpy module in the place of the executable.

Options take effect in their order, as Blender's do. The extension is enabled where it is installed, unless the options
ask for factory settings.
"""

import importlib
import runpy
import sys
from pathlib import Path

import bpy

EXTENSION = "bl_ext.user_default.umbra_black_hole"


def run(arguments: list[str]) -> int:
    """Do what the options say; returns the exit status."""
    commands = {}
    bpy.utils.register_cli_command = commands.setdefault
    bpy.utils.unregister_cli_command = lambda _handle: None
    if (
        "--factory-startup" not in arguments
        and (Path(bpy.utils.user_resource("EXTENSIONS")) / "user_default" / "umbra_black_hole").is_dir()
    ):
        importlib.import_module("addon_utils").enable(EXTENSION, default_set=True)
    python_status = 0
    rest = list(arguments)
    while rest and rest[0] != "--":
        option = rest.pop(0)
        scene = bpy.context.scene
        if not option.startswith("-"):
            try:
                bpy.ops.wm.open_mainfile(filepath=option)
            except RuntimeError as error:
                print(error, file=sys.stderr)
                return 1
        elif option == "--python-exit-code":
            python_status = int(rest.pop(0))
        elif option in ("--python", "--python-expr"):
            source = rest.pop(0)
            try:
                if option == "--python":
                    runpy.run_path(source, run_name="__main__")
                else:
                    exec(compile(source, "<expression>", "exec"), {"__name__": "__main__"})
            except Exception as error:  # noqa: BLE001  whatever a script raises
                print(error, file=sys.stderr)
                if python_status:
                    return python_status
        elif option in ("-s", "-e"):
            setattr(scene, {"-s": "frame_start", "-e": "frame_end"}[option], int(rest.pop(0)))
        elif option in ("-o", "--render-output"):
            scene.render.filepath = rest.pop(0)
        elif option in ("-F", "--render-format"):
            scene.render.image_settings.file_format = rest.pop(0)
        elif option in ("-f", "--render-frame"):
            for part in rest.pop(0).split(","):
                first, _, last = part.partition("..")
                scene.frame_start, scene.frame_end = int(first), int(last or first)
                bpy.ops.render.render(animation=True)
        elif option in ("-a", "--render-anim"):
            bpy.ops.render.render(animation=True)
        elif option in ("-c", "--command"):
            name = rest.pop(0)
            if name not in commands:
                print(f"Unrecognized command: {name!r}", file=sys.stderr)
                return 1
            return commands[name](rest)
        elif option not in ("-b", "--background", "--factory-startup", "-y"):
            print(f"{option} is unknown to this stand-in", file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
