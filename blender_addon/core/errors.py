# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's own errors: each carries one sentence for the artist and a stable code."""

from .physics_api import physics


class SceneError(physics.BlackHoleError):
    """The scene cannot be rendered with a black hole as it is set up."""


class MapFolderError(physics.BlackHoleError):
    """The folder of the warp maps cannot be used."""


def unexpected(error: Exception) -> SceneError:
    """Return the error that reports a fault of the add-on itself."""
    return SceneError(
        f"An unexpected fault ({type(error).__name__}: {error}); please report it.", code="render.unexpected"
    )
