# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of the session: what the add-on remembers while Blender runs and no file saves.

All of it hangs on the one object `SESSION`. Each piece has a defined life, after which it is as if it had just been
made. State of a scene is kept under the scene's `session_uid`, which survives renaming, undo and redo; names do not.

Annotations are not evaluated here: `typing` would keep the generic classes, and with them `bpy`, for ever, and Blender
4.5 as a Python module hangs when the process ends before it is released.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator
from typing import Generic, Protocol, TypeVar

import bpy

T = TypeVar("T")


class Life(enum.IntEnum):
    """How long a piece of state lives; the longer lives have the larger numbers."""

    RENDER = 0
    """Until the scene's render ends."""
    FILE = 1
    """Until another file is opened."""
    REGISTRATION = 2
    """Until the add-on is disabled."""


class _State(Protocol):
    life: Life

    def clear(self) -> None: ...


class Value(Generic[T]):
    """One value for the whole session."""

    def __init__(self, make: Callable[[], T], life: Life) -> None:
        self.life = life
        self._make = make
        self.now = make()

    def clear(self) -> None:
        """Make the value anew."""
        self.now = self._make()


class PerScene(Generic[T]):
    """One value for each scene, made when it is first asked for."""

    def __init__(self, make: Callable[[], T], life: Life) -> None:
        self.life = life
        self._make = make
        self._values: dict[int, T] = {}

    def of(self, scene: bpy.types.Scene) -> T:
        """Return the scene's value."""
        return self._values.setdefault(scene.session_uid, self._make())

    def find(self, scene: bpy.types.Scene) -> T | None:
        """Return the scene's value, or None if it was never asked for."""
        return self._values.get(scene.session_uid)

    def put(self, scene: bpy.types.Scene, value: T) -> None:
        """Replace the scene's value."""
        self._values[scene.session_uid] = value

    def drop(self, scene: bpy.types.Scene) -> T | None:
        """Forget the scene's value, and return it."""
        return self._values.pop(scene.session_uid, None)

    def items(self) -> list[tuple[bpy.types.Scene, T]]:
        """Return the scenes that have a value, with it; values of scenes that are gone are dropped."""
        scenes = {scene.session_uid: scene for scene in bpy.data.scenes}
        self._values = {uid: value for uid, value in self._values.items() if uid in scenes}
        return [(scenes[uid], value) for uid, value in self._values.items()]

    def __iter__(self) -> Iterator[T]:
        return iter(list(self._values.values()))

    def clear(self) -> None:
        """Forget all values."""
        self._values.clear()


class Session:
    """Everything that the add-on remembers, in pieces that end together."""

    def __init__(self) -> None:
        self._pieces: list[_State] = []

    def value(self, make: Callable[[], T], life: Life) -> Value[T]:
        """Add a value for the whole session."""
        piece = Value(make, life)
        self._pieces.append(piece)
        return piece

    def per_scene(self, make: Callable[[], T], life: Life) -> PerScene[T]:
        """Add a value for each scene."""
        piece = PerScene(make, life)
        self._pieces.append(piece)
        return piece

    def end(self, life: Life) -> None:
        """Clear all state whose life is over: that of this life and of shorter ones."""
        for piece in self._pieces:
            if piece.life <= life:
                piece.clear()


SESSION = Session()


def scene_of(uid: int) -> bpy.types.Scene | None:
    """Return the scene of a `session_uid`, or None if it is gone."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == uid), None)
