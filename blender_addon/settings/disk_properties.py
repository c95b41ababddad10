# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist sets of a hole's accretion disk: `object.umbra.disk`."""

from typing import Any

import bpy

from ..core import changes
from ..core.changes import Change
from ..core.physics_api import physics
from . import saved_names
from .typed import DiskSettings

# Blender saves an enum's number; identifiers are the physics' own names.
PROFILES = (
    ("novikov_thorne", "Page-Thorne", "As physics has it: dark at the innermost stable orbit, brightest outside of it"),
    ("power_law", "Power Law", "Brightest at the inner edge, and dimmer outwards by a power of the radius"),
)
BEAMINGS = {"BOLOMETRIC": physics.BOLOMETRIC_EXPONENT, "MONOCHROMATIC": physics.MONOCHROMATIC_EXPONENT}

# As many as the physics follows.
MOST_IMAGES = physics.MOST_CROSSINGS

# Items of the enum `texture_use`: how the artist's picture is used.
DENSITY, COLOR = "DENSITY", "COLOR"

# With a new disk, the inner edge turns round in some four seconds.
DEFAULT_SPEED = 12.0
DEFAULT_LOOK = "gargantua"
_LOOK = physics.DISK_PRESETS[DEFAULT_LOOK]

# Fields of `DiskLook` that are properties of the same name.
LOOK_FIELDS = (
    "profile",
    "exponent",
    "temperature",
    "doppler_color",
    "doppler_brightness",
    "color_variation",
    "falloff",
    "exposure",
    "opacity",
    "streaks",
    "clumps",
    "inner_softness",
    "outer_softness",
    "gain",
)


def _changed(settings: "UmbraDiskProperties", _context: object) -> None:
    """Announce a change.

    Every property has this as its update function: without one, Blender does not carry a script's new value into
    evaluated data.
    """
    changes.notify(Change.DISK, settings.id_data)


def _amount(name: str, field: str, description: str) -> Any:
    return bpy.props.FloatProperty(
        name=name,
        description=description,
        default=getattr(_LOOK, field),
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_changed,
    )


class UmbraDiskProperties(saved_names.AcceptsFormerChoices, bpy.types.PropertyGroup):
    """A thin disk of matter around the hole. The first six decide what is baked, the others how it looks."""

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
    profile: bpy.props.EnumProperty(
        name="Profile",
        description="How brightness and temperature change with the radius",
        items=tuple((*each, number) for number, each in enumerate(PROFILES)),
        default=_LOOK.profile,
        update=_changed,
        options=set(),
    )
    exponent: bpy.props.FloatProperty(
        name="Falloff Power",
        description="Power of the radius by which the brightness falls",
        default=_LOOK.exponent,
        min=0.0,
        max=20.0,
        update=_changed,
    )
    temperature: bpy.props.FloatProperty(
        name="Temperature",
        description="Where the disk is brightest, kelvin: it decides the color",
        default=_LOOK.temperature,
        min=physics.COLDEST_DISK,
        max=physics.HOTTEST_DISK,
        soft_min=1500.0,
        soft_max=30_000.0,
        subtype="COLOR_TEMPERATURE",
        update=_changed,
    )
    doppler_color: _amount(
        "Doppler Color",
        "doppler_color",
        "How much motion and gravity change the disk's color: 0 not at all, 1 as physics has it",
    )
    doppler_brightness: _amount(
        "Doppler Brightness",
        "doppler_brightness",
        "How much motion and gravity change the disk's brightness: 0 not at all, 1 as physics has it, which makes the "
        "side that comes towards the camera far brighter",
    )
    beaming: bpy.props.EnumProperty(
        name="Light",
        description="What the brightness counts",
        items=(
            ("BOLOMETRIC", "All Light", "The light of all wavelengths: the frequency ratio to the power of 4", 0),
            ("MONOCHROMATIC", "One Color", "The light of a narrow band: the frequency ratio to the power of 3", 1),
        ),
        default="BOLOMETRIC",
        update=_changed,
        options=set(),
    )
    color_variation: _amount(
        "Color Variation", "color_variation", "How much cooler the dim parts are: at 0 the disk has one temperature"
    )
    falloff: _amount("Falloff", "falloff", "How far the brightness follows the profile: at 0 it is the same throughout")
    exposure: bpy.props.FloatProperty(
        name="Exposure",
        description="Brightens the disk by this many stops",
        default=_LOOK.exposure,
        min=-32.0,
        max=32.0,
        soft_min=-8.0,
        soft_max=8.0,
        update=_changed,
    )
    opacity: _amount("Opacity", "opacity", "How much the densest parts hide what is behind")
    streaks: _amount("Streaks", "streaks", "How much the streaks thin the disk out")
    clumps: _amount("Clumps", "clumps", "How much the clumps thin the disk out")
    inner_softness: _amount("Inner Softness", "inner_softness", "Share of the disk over which its inner edge fades in")
    outer_softness: _amount("Outer Softness", "outer_softness", "Share of the disk over which its outer edge fades out")
    gain: bpy.props.FloatProperty(
        name="Contrast of Light",
        description="How much brighter dense streaks are than thin ones",
        default=_LOOK.gain,
        min=1.0,
        max=8.0,
        soft_max=3.0,
        update=_changed,
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
        description="A picture in place of the built-in streaks: azimuth across, so that it should repeat, and the "
        "logarithm of the radius from the inner edge at the top",
        type=bpy.types.Image,
        update=_changed,
    )
    texture_use: bpy.props.EnumProperty(
        name="Used As",
        description="What the picture says about the disk",
        items=(
            (DENSITY, "Streaks", "How dense it is: red thins it by Streaks, green by Clumps", 0),
            (COLOR, "Color", "Its colors are the disk's own, not those of hot matter; its alpha is the density", 1),
        ),
        default=DENSITY,
        update=_changed,
        options=set(),
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
    # What depends on the spin, for drivers.
    innermost_orbit: bpy.props.FloatProperty(
        name="Innermost Stable Orbit",
        description="Radius of the innermost stable orbit of the disk's matter, units of M",
        get=lambda settings: physics.isco_radius(settings.id_data.umbra.spin, prograde=not settings.retrograde),
    )
    flux_factor: bpy.props.FloatProperty(
        name="Flux Factor",
        description="By which Page and Thorne's flux becomes 1 where it is largest",
        # A driver takes what is below 1e-4 for 0, so it is not the flux itself.
        get=lambda settings: 1.0 / physics.peak_disk_flux(settings.id_data.umbra.spin, settings.retrograde),
    )


saved_names.accept(UmbraDiskProperties, saved_names.DISK)


def shows_picture(settings: DiskSettings) -> bool:
    """Whether the disk has the colors of the artist's picture."""
    return settings.texture is not None and settings.texture_use == COLOR


def disk_of(settings: DiskSettings) -> "physics.Disk | None":
    """The disk whose passes are baked, or None."""
    if not settings.enabled:
        return None
    return physics.Disk(
        crossings=int(settings.crossings),
        inner_radius=None if settings.inner_at_isco else float(settings.inner_radius),
        outer_radius=float(settings.outer_radius),
        retrograde=bool(settings.retrograde),
    )


def look_of(settings: DiskSettings) -> "physics.DiskLook":
    """How the disk looks."""
    values = {name: getattr(settings, name) for name in LOOK_FIELDS}
    return physics.DiskLook(**values, beaming=BEAMINGS[settings.beaming])


def use_look(settings: DiskSettings, look: "physics.DiskLook") -> None:
    """Set all properties of the look."""
    for name in LOOK_FIELDS:
        if getattr(settings, name) != getattr(look, name):
            setattr(settings, name, getattr(look, name))
    settings.beaming = next(name for name, power in BEAMINGS.items() if power == look.beaming)


CLASSES = (UmbraDiskProperties,)
