# SPDX-License-Identifier: GPL-3.0-or-later
"""One signal for all changes of settings: settings announce, and whoever acts on a change subscribes.

So `settings` imports nobody. Subscribers are attached when the add-on is registered.
"""

import contextlib
import enum
from collections.abc import Callable, Iterator

import bpy


class Change(enum.Enum):
    """What has changed; the owner is the object or the scene that carries the settings."""

    HOLE = enum.auto()
    """A setting of a hole, its disk excepted."""
    DISK = enum.auto()
    """A setting of a hole's disk."""
    SCENE = enum.auto()
    """A setting of how a scene is rendered: the hole, the sky, the maps."""
    OUTPUT = enum.auto()
    """The setting of the scene's output."""
    SWITCHED = enum.auto()
    """The output that the scene is set up for."""
    PREVIEW = enum.auto()
    """The switch of the live preview."""


Subscriber = Callable[[bpy.types.ID], None]

_subscribers: dict[Change, list[Subscriber]] = {change: [] for change in Change}
_muted: set[Change] = set()


def subscribe(change: Change, subscriber: Subscriber) -> None:
    """Call `subscriber` with the owner of the settings after each change of that kind."""
    _subscribers[change].append(subscriber)


def unsubscribe(change: Change, subscriber: Subscriber) -> None:
    """Undo `subscribe`."""
    _subscribers[change].remove(subscriber)


def notify(change: Change, owner: bpy.types.ID) -> None:
    """Tell the subscribers of a change, in the order in which they subscribed."""
    if change not in _muted:
        for subscriber in list(_subscribers[change]):
            subscriber(owner)


@contextlib.contextmanager
def muted(*changes: Change) -> Iterator[None]:
    """Keep changes of these kinds from the subscribers for as long as the block lasts."""
    added = set(changes) - _muted
    _muted.update(added)
    try:
        yield
    finally:
        _muted.difference_update(added)
