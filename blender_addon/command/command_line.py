# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line inside Blender: ``blender -b FILE -c umbra bake|status|clean``. See docs/long_shots.md."""

import argparse
import contextlib
import json
import os
import sys
import traceback
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import TextIO, TypeVar

import bpy

from ..bake import baking, check, frame_list
from ..bake.folder import folder
from ..core import stopping
from ..core.errors import MapFolderError, SceneError, unexpected
from ..core.physics_api import physics
from ..core.session import SESSION, Life
from ..outputs import frames as frame_maps
from ..outputs import registry
from ..scene import frame_setup

NAME = "umbra"

DONE, FAILED, WRONG_USAGE = 0, 1, 2


def _no_handle() -> object:
    return None


_handle = SESSION.value(_no_handle, Life.REGISTRATION)


def run(arguments: Sequence[str]) -> int:
    """Run one command; return the exit status: 0 done, 1 failed or not all well, 2 wrong usage.

    A failure is one sentence on standard error, and an event where JSON is asked for.
    """
    try:
        options = _parser().parse_args(list(arguments))
    except SystemExit as end:  # argparse has printed the help, or what is wrong
        return int(end.code or 0)
    with contextlib.ExitStack() as stack:
        try:
            stream = _json_stream(options.json, stack)
        except MapFolderError as error:
            return Output(None, quiet=True).fail(error)
        out = Output(stream, quiet=stream is sys.stdout)
        try:
            with stopping.stoppable() as out.stop:
                scene = _scene_of(options)
                status: int
                status, summary = options.work(options, scene, _frames_of(options, scene), out)
        except KeyboardInterrupt:
            return out.fail(SceneError("Stopped; the maps that are finished stay.", code="command.stopped"))
        except physics.BlackHoleError as error:
            hint = "" if bpy.data.filepath else " No .blend file is open: is it there, and named before -c?"
            return out.fail(SceneError(f"{error}{hint}", code=error.code))
        except Exception as error:  # noqa: BLE001  (Blender would print it and go on)
            traceback.print_exc()
            return out.fail(unexpected(error))
        try:
            out.event("end", status=status, **summary)
        except SceneError as error:
            return out.fail(error)
    return status


class Output:
    """Lines for people, and JSON lines for programs."""

    def __init__(self, json_stream: TextIO | None, *, quiet: bool) -> None:
        self._json = json_stream
        self._people = sys.stderr if quiet else sys.stdout
        self.stop = stopping.Stop()

    def line(self, text: str) -> None:
        """Print a line for people; where standard output is for JSON, on standard error."""
        self._print(f"Umbra: {text}", self._people)

    def event(self, event: str, **values: object) -> None:
        """Print a JSON object on a line of its own."""
        if self._json is not None:
            self._print(json.dumps({"event": event, **values}), self._json)

    def fail(self, error: "physics.BlackHoleError") -> int:
        """Say why the command has failed; return the exit status."""
        with contextlib.suppress(SceneError):  # nobody listens any more
            self._print(f"error: {error.for_user()}", sys.stderr)
            self.event("end", status=FAILED, error=str(error), code=error.code)
        return FAILED

    @staticmethod
    def _print(text: str, stream: TextIO) -> None:
        """Print a line at once, with escapes for what the stream cannot encode.

        Raises
        ------
        SceneError
            If it is closed, or its device is full.
        """
        encoding = getattr(stream, "encoding", None) or "utf-8"
        try:
            print(text.encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)
        except (OSError, ValueError) as error:
            if stream is sys.stdout:
                _lead_nowhere(stream)
            reason = (getattr(error, "strerror", None) or str(error)).lower()
            raise SceneError(
                f"The command's output cannot be written: {reason}; let it lead to a file or a program that takes it.",
                code="command.standard-output",
            ) from error


def _lead_nowhere(stream: TextIO) -> None:
    """Have the end of the process not fail to write once more what could not be written."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


# A command's exit status, and what its last line of JSON says.
Outcome = tuple[int, dict[str, object]]

Result = TypeVar("Result")


def _bake(options: argparse.Namespace, scene: bpy.types.Scene, frames: list[int], out: Output) -> Outcome:
    frame_setup.active_hole(scene)
    if not registry.of(scene).needs_maps(scene):
        out.line("The lens traces its rays itself (Rays: No Bake): there is nothing to bake.")
        return DONE, {"command": "bake", "baked": 0, "kept": 0, "unresolved": 0}
    words = {baking.BAKED: "baked", baking.KEPT: "still valid", baking.IMPOSSIBLE: "impossible"}

    def tell(progress: baking.Progress) -> None:
        if progress.outcome is not None:
            out.line(f"{progress.fraction:4.0%}  {progress.text}: {words[progress.outcome]}")
            out.event("frame", frame=progress.frame, outcome=progress.outcome, progress=round(progress.fraction, 4))

    summary = _drain(frame_maps.bake(scene, frames, options.view_layer), tell, out)
    out.line(summary.sentence())
    if summary.unresolved:
        out.line(f"{summary.unresolved} rays could not be resolved; choose another Method under Warp Maps.")
    return DONE, {
        "command": "bake",
        "baked": len(summary.baked),
        "kept": len(summary.reused),
        "unresolved": summary.unresolved,
        "folder": str(folder(scene).path),
    }


def _status(options: argparse.Namespace, scene: bpy.types.Scene, frames: list[int], out: Output) -> Outcome:
    steps = frame_maps.examine(scene, frames, options.view_layer, thorough=not options.quick)
    listing = _drain(steps, _tenths(out, "checking"), out)
    for each in listing.frames:
        note = f"  {each.fault}" if each.state in (*check.FAULTY, baking.IMPOSSIBLE) else ""
        note += f"  {each.baker} is baking it" if each.baker else ""
        out.line(f"{each.frame:7d}  {each.state:<10}{each.size / 1e6:9.1f} MB{note}")
        out.event(
            "frame",
            frame=each.frame,
            state=str(each.state),
            bytes=each.size,
            path=None if each.path is None else str(each.path),
            fault=each.fault or None,
            baker=each.baker,
        )
    out.line(listing.sentence())
    return DONE if listing.complete else FAILED, {
        "command": "status",
        "counts": listing.counts,
        "bytes": listing.size,
        "leftovers": [str(each) for each in listing.leftovers],
        "folder": str(listing.folder),
    }


def _clean(options: argparse.Namespace, scene: bpy.types.Scene, frames: list[int], out: Output) -> Outcome:
    steps = frame_maps.clean(scene, frames, options.view_layer, everything=options.all, dry_run=options.dry_run)
    cleaning = _drain(steps, _tenths(out, "checking"), out)
    for each in cleaning.removed:
        out.line(f"{'would remove' if options.dry_run else 'removed'} {each.path.name} ({each.reason})")
        out.event("file", path=str(each.path), reason=each.reason, bytes=each.size)
    out.line(cleaning.sentence())
    return DONE, {
        "command": "clean",
        "dry_run": options.dry_run,
        "files": len(cleaning.removed),
        "bytes": cleaning.size,
        "impossible": cleaning.impossible,
        "in_use": [str(each) for each in cleaning.in_use],
        "folder": str(folder(scene).path),
    }


def _drain(
    steps: Generator[baking.Progress, None, Result], tell: Callable[[baking.Progress], None], out: Output
) -> Result:
    """Run work to its end, unless the process is asked to end; `tell` hears of each step."""
    with contextlib.closing(steps):
        while True:
            try:
                progress = next(steps)
            except StopIteration as end:
                result: Result = end.value
                return result
            if out.stop.asked:
                raise KeyboardInterrupt
            tell(progress)


def _tenths(out: Output, verb: str) -> Callable[[baking.Progress], None]:
    """What tells people of each tenth of the work."""
    told = -1

    def tell(progress: baking.Progress) -> None:
        nonlocal told
        tenth = int(progress.fraction * 10)
        if tenth != told:
            told = tenth
            out.line(f"{progress.fraction:4.0%}  {verb}: {progress.text}")

    return tell


def scene_named(name: str) -> bpy.types.Scene:
    """The scene of a name.

    Raises
    ------
    SceneError
        There is none; the sentence says which there are.
    """
    scene = bpy.data.scenes.get(name)
    if scene is None:
        names = ", ".join(f'"{each.name}"' for each in bpy.data.scenes)
        raise SceneError(f'There is no scene "{name}" in this file: its scenes are {names}.', code="command.no-scene")
    return scene


def _scene_of(options: argparse.Namespace) -> bpy.types.Scene:
    return bpy.context.scene if options.scene is None else scene_named(options.scene)


def _frames_of(options: argparse.Namespace, scene: bpy.types.Scene) -> list[int]:
    if options.view_layer is not None and options.view_layer not in scene.view_layers:
        raise SceneError(
            f'Scene "{scene.name}" has no view layer "{options.view_layer}": it has '
            f"{', '.join(each.name for each in scene.view_layers)}.",
            code="command.no-view-layer",
        )
    return list(frame_setup.frames_of(scene)) if options.frames is None else options.frames


def _json_stream(target: str | None, stack: contextlib.ExitStack) -> TextIO | None:
    if target is None:
        return None
    if target == "-":
        return sys.stdout
    try:
        return stack.enter_context(Path(target).open("w", encoding="utf-8"))
    except OSError as error:
        raise MapFolderError(
            f"The JSON file {target} cannot be written ({(error.strerror or str(error)).lower()}): name another one.",
            code="command.json-file",
        ) from error


def _frames(text: str) -> list[int]:
    try:
        return frame_list.parse_frames(text)
    except frame_list.FrameListError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"blender -b FILE -c {NAME}",
        description="The black hole's maps of a file: bake them, see how they are, clean them up.",
        epilog="Exit status: 0 done, 1 failed (one sentence on standard error) or, for status, not every map is "
        "valid, 2 wrong usage.",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument(
        "--frames",
        type=_frames,
        metavar="LIST",
        help="as in 1-250, or 1,5,9-12, or 1-250x2 for every second; --frames=-5-9 where the first is negative "
        "(default: the frames that rendering the animation renders)",
    )
    common.add_argument("--scene", metavar="NAME", help="the scene (default: the file's active one)")
    common.add_argument("--view-layer", metavar="NAME", help="whose objects count (default: the first one rendered)")
    common.add_argument(
        "--json",
        nargs="?",
        const="-",
        metavar="FILE",
        help="write one JSON object a line, the last with event end, to a file, or without FILE to standard output; "
        "what people read then goes to standard error",
    )

    bake = commands.add_parser(
        "bake",
        parents=[common],
        help="bake the maps that are missing, stale, foreign or damaged; valid ones are kept",
        description="Bake what the scene's output needs (warp maps with a disk's passes, or exit maps) for frames "
        "whose map is missing, stale, foreign or damaged. It may be stopped or killed at any time and run again.",
    )
    bake.set_defaults(work=_bake)

    status = commands.add_parser(
        "status",
        parents=[common],
        help="list each frame's map: valid, missing, stale, foreign or damaged",
        description="List each frame's map: valid, missing, stale (made from other settings), foreign (not a map) or "
        "damaged. Each file is read whole and checked. Exit status 0 if all are valid.",
    )
    status.add_argument("--quick", action="store_true", help="read headers only: damaged pixels are not found")
    status.set_defaults(work=_status)

    clean = commands.add_parser(
        "clean",
        parents=[common],
        help="remove maps that are stale, foreign or damaged, and half files of bakes that were killed",
        description="Remove the frames' maps that are stale, foreign or damaged, and half files of bakes that were "
        "killed. Files whose names are not those of the scene's maps are left alone.",
    )
    clean.add_argument(
        "--all", action="store_true", help="remove every map of the scene's hole: all frames, sizes and outputs"
    )
    clean.add_argument("--dry-run", action="store_true", help="only say what would be removed")
    clean.set_defaults(work=_clean)
    return parser


def register() -> None:
    """Give Blender the command."""
    _handle.now = bpy.utils.register_cli_command(NAME, run)


def unregister() -> None:
    """Take it back."""
    bpy.utils.unregister_cli_command(_handle.now)
    _handle.clear()
