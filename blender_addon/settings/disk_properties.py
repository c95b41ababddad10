# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a hole's accretion disk: `object.umbra.disk`.

Those of its look are the rows of the table `physics.MATTER_SETTINGS`.
"""

from typing import Any

import bpy

from ..core import changes
from ..core.changes import Change
from ..core.physics_api import physics
from . import saved_names
from .former_disks import CURRENT
from .table_properties import property_of
from .typed import DiskSettings

# As many as the physics follows.
MOST_IMAGES = physics.MOST_CROSSINGS

# Items of the enum `texture_use`: how the artist's picture is used.
DENSITY, COLOR, RAMP = "DENSITY", "COLOR", "RAMP"

# With a new disk, the inner edge turns round in some four seconds.
DEFAULT_SPEED = 12.0
DEFAULT_LOOK = "gargantua"

# Settings that the compositor follows live; all others are in the layer of light.
LIVE = ("exposure", "tint", "opacity")


def _changed(settings: "UmbraDiskProperties", _context: object) -> None:
    """Announce a change.

    Every property has this as its update function: without one, Blender does not carry a script's new value into
    evaluated data.
    """
    if settings.look_version != CURRENT:
        settings.look_version = CURRENT
    changes.notify(Change.DISK, settings.id_data)


class UmbraDiskProperties(saved_names.AcceptsFormerChoices, bpy.types.PropertyGroup):
    """A disk of matter around the hole. The first six are its geometry, `LIVE` what the compositor does."""

    FORMER_CHOICES = saved_names.DISK_CHOICES

    enabled: bpy.props.BoolProperty(
        name="Disk",
        description="Surround the black hole with a glowing disk of matter, in the plane of its rotation",
        default=False,
        update=_changed,
        options=set(),
    )
    inner_at_isco: bpy.props.BoolProperty(
        name="Innermost Orbit",
        description="The disk begins at the innermost stable circular orbit, where matter starts to fall",
        default=True,
        update=_changed,
        options=set(),
    )
    inner_radius: bpy.props.FloatProperty(
        name="Inner Edge",
        description="Radius at which the disk begins, in units of M. Inside the innermost stable orbit matter falls",
        default=6.0,
        min=0.0,
        soft_min=1.0,
        soft_max=50.0,
        update=_changed,
    )
    outer_radius: bpy.props.FloatProperty(
        name="Outer Edge",
        description="Radius at which the disk ends, in units of M",
        default=18.0,
        min=0.0,
        soft_min=2.0,
        soft_max=100.0,
        update=_changed,
    )
    retrograde: bpy.props.BoolProperty(
        name="Retrograde",
        description="The disk turns against the hole's rotation; its innermost stable orbit is farther out",
        default=False,
        update=_changed,
        options=set(),
    )
    crossings: bpy.props.IntProperty(
        name="Images",
        description="How many images of the disk are drawn: the direct one, the one of its far side that is bent "
        "over and under the shadow, and the thin ring at the shadow's edge",
        default=physics.DEFAULT_CROSSINGS,
        min=1,
        max=MOST_IMAGES,
        update=_changed,
        options=set(),
    )
    turning_speed: bpy.props.FloatProperty(
        name="Turning Speed",
        description="How much time passes at the hole in a second of the animation, in units of M (G M / c^3); every "
        "radius turns with its own orbital speed",
        default=DEFAULT_SPEED,
        soft_min=-200.0,
        soft_max=200.0,
        update=_changed,
        options=set(),  # time would jump: it is the frame times this
    )
    texture: bpy.props.PointerProperty(
        name="Texture",
        description="A picture in place of the built-in turbulence: azimuth across, so that it should repeat, and the "
        "logarithm of the radius from the inner edge at the top",
        type=bpy.types.Image,
        update=_changed,
    )
    texture_use: bpy.props.EnumProperty(
        name="Used As",
        description="What the picture says about the disk",
        items=(
            (DENSITY, "Density", "Where it is dense, by its brightness: where it is black there is nothing", 0),
            (COLOR, "Color", "Its colors are the disk's own, not those of hot matter; its alpha is the density", 1),
            (RAMP, "Ramp", "Its colors, from the top down, are those of the disk from its inner edge outward", 2),
        ),
        default=DENSITY,
        update=_changed,
        options=set(),
    )
    opacity: bpy.props.FloatProperty(
        name="Opacity",
        description="Share of the whole disk that is shown, its light and what it hides",
        default=1.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_changed,
    )
    tint: bpy.props.FloatVectorProperty(
        name="Tint",
        description="Color by which the disk's light is multiplied",
        default=(1.0, 1.0, 1.0),
        size=3,
        min=0.0,
        soft_max=1.0,
        subtype="COLOR",
        update=_changed,
    )
    light: bpy.props.BoolProperty(
        name="Light the Scene",
        description="Add a glowing disk that lights the scene's objects in Cycles; the camera does not see it",
        default=False,
        update=_changed,
        options=set(),
    )
    light_strength: bpy.props.FloatProperty(
        name="Light Strength",
        description="Factor of the light that the disk sheds on objects: 1 is that of the disk that is seen",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        update=_changed,
    )
    look_version: bpy.props.IntProperty(
        name="Version of the Look",
        description="Which version of the add-on the settings are of; see `former_disks`",
        default=0,
        options={"HIDDEN"},
    )
    innermost_orbit: bpy.props.FloatProperty(
        name="Innermost Stable Orbit",
        description="Radius of the innermost stable orbit of the disk's matter, units of M",
        get=lambda settings: physics.isco_radius(settings.id_data.umbra.spin, prograde=not settings.retrograde),
    )


# The rows of the look; a new disk has the default look.
for _name, _setting in physics.MATTER_SETTINGS.items():
    _default = getattr(physics.MATTER_PRESETS[DEFAULT_LOOK], _name)
    UmbraDiskProperties.__annotations__[_name] = property_of(_setting, _changed, _default)
saved_names.accept(UmbraDiskProperties, saved_names.DISK)


def disk_of(settings: DiskSettings) -> "physics.Disk | None":
    """The disk, or None where it is switched off."""
    if not settings.enabled:
        return None
    return physics.Disk(
        crossings=int(settings.crossings),
        inner_radius=None if settings.inner_at_isco else float(settings.inner_radius),
        outer_radius=float(settings.outer_radius),
        retrograde=bool(settings.retrograde),
    )


def value_of(settings: DiskSettings, name: str) -> Any:
    """Return a setting of the look as the value of the field of `MatterLook`: a str, an int or a float."""
    value = getattr(settings, name)
    choices = physics.MATTER_SETTINGS[name].choices
    return next(each.value for each in choices if each.identifier == value) if choices else value


def look_of(settings: DiskSettings) -> "physics.MatterLook":
    """Return how the disk looks that is baked: the compositor adds the exposure."""
    values = {name: value_of(settings, name) for name in physics.MATTER_SETTINGS}
    return physics.MatterLook(**{**values, "exposure": 0.0})


def use_look(settings: DiskSettings, look: "physics.MatterLook") -> None:
    """Set all properties of the look."""
    for name, setting in physics.MATTER_SETTINGS.items():
        value = getattr(look, name)
        if value_of(settings, name) != value:
            setattr(settings, name, setting.identifier(value) if setting.choices else value)


CLASSES = (UmbraDiskProperties,)
