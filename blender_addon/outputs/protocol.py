# SPDX-License-Identifier: GPL-3.0-or-later
"""The protocol of outputs: what the rest of the add-on may ask of a way to show the black hole.

An output is one object for all scenes; what it knows of a scene lies in the scene. A new output is a subclass of
`Output` with a line in `registration`, and one in the contracts of pyproject.toml. The abstract
methods must be written; the others do what suits an output that shows baked maps and nothing else.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Protocol

import bpy

from ..bake.request import MapRequest
from ..core.errors import SceneError
from ..core.physics_api import physics
from ..scene.cameras import PLAIN, Traits
from ..scene.frame_setup import FrameSetup

# Values by the names of the group "Umbra Black Hole"'s sockets: how the artist has set the sky, whatever shows it.
Look = dict[str, Any]

# What a frame's value is written to: a datablock, a path in it, and an index.
Track = tuple[bpy.types.ID, str, int]


@dataclass(frozen=True)
class Notice:
    """A sentence for the panel."""

    text: str
    icon: str = "INFO"
    operator: str = ""
    """The operator that helps, as a button below."""


def refusals(scene: bpy.types.Scene, *checks: Callable[[bpy.types.Scene], None]) -> list[Notice]:
    """Return what checks of a render refuse in a scene, for the panel."""
    found = []
    for check in checks:
        try:
            check(scene)
        except SceneError as error:
            found.append(Notice(error.for_user(), "ERROR"))
    return found


class LiveMap(Protocol):
    """A map that an output shows in the viewport, kept in memory while the scene changes."""

    def parameters(self, draft: "physics.WarpMapParameters") -> "physics.WarpMapParameters":
        """Return what the map is made from, for a frame's draft parameters."""

    def steps(self, parameters: "physics.WarpMapParameters") -> Generator[float, None, Any]:
        """Make the map step by step."""

    def light_parameters(self, light: "physics.LightParameters") -> "physics.LightParameters":
        """Return what the layer of the disk's light is made from, for a frame's draft."""

    def show_light(self, scene: bpy.types.Scene, layer: "physics.LightLayer") -> bool:
        """Show a layer of the disk's light; return whether it must be shown again a little later."""

    def can_show(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene has something that can show the map."""

    def is_shown(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene shows it now."""

    def show(self, scene: bpy.types.Scene, made: Any) -> bool:
        """Show a map; return whether it must be shown again a little later."""

    def show_again(self, scene: bpy.types.Scene) -> None:
        """Show the map once more."""

    def drop(self, scene: bpy.types.Scene) -> None:
        """Let the scene read its files again."""


class ViewportMaps(Protocol):
    """Maps in memory that an output's picture reads in the viewport, in place of its files, while the scene changes."""

    def can_show(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene has something that can show a map."""

    def is_shown(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene reads a map in memory now."""

    def show(self, scene: bpy.types.Scene, made: "physics.WarpMap") -> None:
        """Show a map; the disk's light stays as it is."""

    def show_light(self, scene: bpy.types.Scene, layer: "physics.LightLayer") -> None:
        """Show a layer of light of the disk, if the scene has one."""

    def has_light(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene's disk, if it has one, is read from memory, of whatever frame it is."""

    def show_again(self, scene: bpy.types.Scene) -> bool:
        """Show the map in memory once more, after the scene was given its files; return False if there is none."""

    def show_files(self, scene: bpy.types.Scene) -> None:
        """Let the scene read its files; the map in memory stays."""

    def show_nothing(self, scene: bpy.types.Scene) -> None:
        """Let the scene read no map: the picture is magenta."""

    def drop(self, scene: bpy.types.Scene) -> None:
        """Let the scene read its files, and free the map in memory."""


class FrameCarrier(Protocol):
    """What an output carries into each frame by itself, and what a file must hold as keyframes without the add-on."""

    def read(self, frame: FrameSetup) -> dict[Track, Any]:
        """Return the values of the frame at which the scene stands."""

    def held(self) -> AbstractContextManager[None]:
        """Keep the scene, for as long as the block lasts, as a file needs it that renders without the add-on."""


class Output(ABC):
    """One way in which the black hole comes into the picture."""

    identifier: str
    number: int
    """Blender saves this number: it never changes."""
    label: str
    description: str
    traits: Traits = PLAIN
    engine: str | None = None
    """The only render engine that it works in, if there is one."""

    # --- setting a scene up -----------------------------------------------------------------------

    def check(self, scene: bpy.types.Scene) -> None:
        """Refuse a scene that cannot be rendered this way. Changes nothing.

        Raises
        ------
        SceneError
            If `install` or a render would fail.
        """

    @abstractmethod
    def install(self, scene: bpy.types.Scene, look: Look) -> list[str]:
        """Set a checked scene up; return what the artist should know."""

    @abstractmethod
    def remove(self, scene: bpy.types.Scene) -> None:
        """Put back all that `install` has changed."""

    def look(self, scene: bpy.types.Scene) -> Look:
        """Return how the artist has set the sky, to be carried to another output."""
        return {}

    def refresh(self, scene: bpy.types.Scene) -> None:
        """Carry changed settings into a scene that is set up. Failures are left to the render and the panel."""

    def prepare(self, scene: bpy.types.Scene) -> None:
        """Make what the settings need and a render could not make, before `refresh`. May take seconds."""

    def refresh_disk(self, scene: bpy.types.Scene) -> None:
        """Carry changed settings of the disk into the scene.

        Raises
        ------
        SceneError
            If the scene cannot show the disk.
        """

    def on_hole_added(self, scene: bpy.types.Scene) -> list[str]:
        """Show a hole that was just added; return what the artist should know."""
        self.refresh(scene)
        return []

    def on_load(self, scene: bpy.types.Scene) -> None:
        """Bring the scene of a file that was opened up to date."""
        self.refresh(scene)

    # --- rendering --------------------------------------------------------------------------------

    @abstractmethod
    def is_in_use(self, scene: bpy.types.Scene) -> bool:
        """Return whether rendering the scene shows its black hole."""

    def uses_compositor(self, scene: bpy.types.Scene) -> bool:
        """Return whether a render runs nodes of this output in the compositor."""
        return False

    def needs_maps(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene's frames need any maps."""
        return True

    @abstractmethod
    def map_requests(self, scene: bpy.types.Scene, frame: FrameSetup) -> list[MapRequest]:
        """Return all maps that a frame needs."""

    def complete(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> FrameSetup:
        """Return a frame's setup with what only the output knows, as the dependency graph has evaluated it."""
        return frame

    def request_to_check(self, scene: bpy.types.Scene, frame: FrameSetup) -> MapRequest:
        """Return the map whose accuracy can be checked.

        Raises
        ------
        SceneError
            If there is none.
        """
        return self.map_requests(scene, frame)[0]

    def begin_render(self, scene: bpy.types.Scene) -> None:
        """Prepare the scene for a render of one frame or many."""

    def prepare_files(self, scene: bpy.types.Scene, *, may_bake: bool) -> None:
        """Make the files that all frames share, unless they are there.

        Raises
        ------
        physics.BlackHoleError
            If they are not there and cannot, or may not, be made.
        """

    @abstractmethod
    def take_away(self, scene: bpy.types.Scene) -> None:
        """Show no map: the picture is magenta or black until `point_at` has seen to the frame."""

    @abstractmethod
    def point_at(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> list[str]:
        """Let a frame's picture read its maps, which are valid; return warnings.

        Raises
        ------
        SceneError
            If the picture would be wrong.
        """

    def stand_aside(self, scene: bpy.types.Scene) -> Callable[[], None]:
        """Let the frame, which has no black hole, be rendered as if the output were not there; return what undoes that.

        What is returned for the first of several such frames undoes it for all.
        """
        return lambda: None

    def end_render(self, scene: bpy.types.Scene, *, canceled: bool) -> None:
        """Bring the scene back after a render; canceled if a frame was begun and not finished."""
        if canceled:
            self.refresh(scene)

    def follow(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        """Let the viewport follow a change, outside of renders."""

    # --- files ------------------------------------------------------------------------------------

    def marks(self, scene: bpy.types.Scene) -> bool:
        """Return whether a file of version 0.1.0, which does not say so, is set up for this output."""
        return False

    def is_set_up(self, scene: bpy.types.Scene) -> bool:
        """Return whether the scene refers to maps of this output."""
        return True

    def point_at_files(self, scene: bpy.types.Scene) -> None:
        """Let the scene refer to the maps of its settings, as a file that is saved should."""
        self.refresh(scene)

    def forget_loaded_maps(self, scene: bpy.types.Scene) -> None:
        """Let Blender read the maps from their files again."""

    def carrier(self, scene: bpy.types.Scene) -> FrameCarrier | None:
        """Return what this output carries into each frame by itself, if anything."""
        return None

    # --- the viewport and the panel ---------------------------------------------------------------

    live: LiveMap | None = None
    viewport: ViewportMaps | None = None
    """The maps that the 3D viewport's compositor shows, if the picture is made there."""
    follows_preview = False
    """Whether the live preview is switched on together with this output."""
    settings_label = ""
    """Heading of the output's own settings; none if it has none to draw."""

    def look_node(self, scene: bpy.types.Scene) -> bpy.types.Node | None:
        """Return the node whose inputs are the artist's controls of the sky."""
        return None

    def notices(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: FrameSetup) -> list[Notice]:
        """Return what the panel should say about the current frame, maps excepted.

        Raises
        ------
        SceneError
            If the scene cannot be rendered this way.
        """
        return []

    def sky_problem(self, scene: bpy.types.Scene) -> str | None:
        """Return why the sky cannot be read, if so."""
        return None

    def draw_settings(self, layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
        """Draw the output's own settings."""

    def brighten_stars(self, scene: bpy.types.Scene) -> None:
        """Brighten the star sky, unless the artist has set an exposure."""
