# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's own errors: each carries one sentence for the artist, saying what is wrong and what to do."""

from .physics_api import physics


class SceneError(physics.BlackHoleError):
    """The scene cannot be rendered with a black hole as it is set up."""


class MapFolderError(physics.BlackHoleError):
    """The folder of the warp maps cannot be used."""
