# SPDX-License-Identifier: GPL-3.0-or-later
"""Tell the artist what went wrong while rendering, where no operator can report it."""

import atexit
import os
import signal
import sys
import textwrap

import bpy

from .session import SESSION, Life

POPUP_WIDTH = 80  # characters a line

_pending = SESSION.value(list[str], Life.REGISTRATION)
_is_ending = False  # the process ends, whatever is registered


def without_window() -> bool:
    """Return whether nobody is there to read a message: a failure then has to end the process."""
    return bpy.app.background


def warn(text: str) -> None:
    """Say something worth knowing on the console."""
    print(f"Umbra: {text}", file=sys.stderr, flush=True)


def tell(text: str) -> None:
    """Say what was done, on the console: no fault, and so not among the errors."""
    print(f"Umbra: {text}", flush=True)


def popup(text: str) -> None:
    """Show a sentence in the window as soon as Blender's main thread is free; safe from a render's thread."""
    if text in _pending.now:
        return
    _pending.now.append(text)
    if not bpy.app.timers.is_registered(_show_pending):
        bpy.app.timers.register(_show_pending)


def _show_pending() -> None:
    texts = _pending.now
    _pending.clear()
    if not texts or not bpy.context.window_manager.windows:
        return
    lines = [line for text in texts for line in textwrap.wrap(text, POPUP_WIDTH)]

    def draw(menu: bpy.types.UIPopupMenu, _context: bpy.types.Context) -> None:
        for line in lines:
            menu.layout.label(text=line)

    # a timer runs outside any window, and a popup needs one
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.context.window_manager.popup_menu(draw, title="Umbra Black Hole", icon="ERROR")


def forget() -> None:
    """Drop what has not been shown yet."""
    _pending.clear()
    if bpy.app.timers.is_registered(_show_pending):
        bpy.app.timers.unregister(_show_pending)


def end_process(text: str) -> None:
    """Make a process without a window end with exit status 1, before a wrong picture is written.

    Blender swallows exceptions of handlers and goes on rendering, so the exit status is the only way for a render
    farm or a script to learn of the failure. Frames that are already written stay.

    Blender's executable is asked to break the render off as by Ctrl-C: it writes no more frames, but finishes a
    movie that it has begun. In Python's own process (the bpy module) Ctrl-C is Python's, or nobody's where a shell
    started it in the background, and the process is ended at once.
    """
    global _is_ending
    if not _is_ending:
        print(f"Error: Umbra Black Hole: {text}", file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    if _is_ending or bpy.app.module or signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        os._exit(1)
    _is_ending = True
    atexit.register(os._exit, 1)  # Blender itself would end with 0
    signal.raise_signal(signal.SIGINT)


def is_ending() -> bool:
    """Whether the process has been told to end."""
    return _is_ending
