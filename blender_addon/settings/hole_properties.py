# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a black hole: `object.umbra`."""

import bpy

from ..core import changes
from ..core.changes import Change
from . import disk_properties

# physics accepts spins up to this; a hole spinning the other way is the object turned over.
LARGEST_SPIN = 0.9999

# With Blender's default camera, the shadow then fills most of the picture's height.
DEFAULT_MASS_SCALE = 0.35

CAMERA_ANIMATION = "CAMERA_ANIMATION"

# Identifier of the enum `motion` -> name of the same motion in physics.
MOTIONS = {
    "FIDO": "fido",
    "STATIC": "static",
    "CIRCULAR": "circular",
    "CIRCULAR_RETROGRADE": "circular_retrograde",
    "FREE_FALL": "free_fall",
    CAMERA_ANIMATION: "velocity",
}


def _changed(settings: "UmbraHoleProperties", _context: object) -> None:
    """Announce a change.

    Every property has this as its update function: without one, Blender does not carry a script's new value into
    evaluated data.
    """
    changes.notify(Change.HOLE, settings.id_data)


class UmbraHoleProperties(bpy.types.PropertyGroup):
    """A black hole. Its place, axis (local Z) and size are those of the object."""

    is_black_hole: bpy.props.BoolProperty(
        name="Black Hole",
        description="This object is a black hole: its origin is the center, its local Z the axis of rotation",
        default=False,
        update=_changed,
        options=set(),
    )
    spin: bpy.props.FloatProperty(
        name="Spin",
        description="How fast the hole rotates: 0 does not rotate, 1 would be the fastest possible. "
        "The shadow is flattened on the side that turns towards the camera",
        default=0.9,
        min=0.0,
        max=LARGEST_SPIN,
        precision=4,
        step=1,
        update=_changed,
    )
    mass_scale: bpy.props.FloatProperty(
        name="Size of 1 M",
        description="Length of one gravitational radius (G M / c^2) in scene units, before the object's own "
        "scale. The shadow is about ten of these across",
        default=DEFAULT_MASS_SCALE,
        min=1e-9,
        soft_min=0.001,
        soft_max=100.0,
        precision=4,
        unit="LENGTH",
        update=_changed,
    )
    motion: bpy.props.EnumProperty(
        name="Camera Motion",
        description="How the camera moves: this shifts directions (aberration) and colors (Doppler effect)",
        items=(
            (
                "FIDO",
                "Carried by Space",
                "Held in place, and carried round by the hole's rotation (the local fiducial observer)",
                0,
            ),
            ("STATIC", "At Rest", "At rest against the stars; impossible inside the ergosphere", 1),
            (
                "CIRCULAR",
                "Circular Orbit",
                "Abreast of the circular orbit of the same radius that runs with the hole's rotation",
                2,
            ),
            (
                "CIRCULAR_RETROGRADE",
                "Circular Orbit, Retrograde",
                "Abreast of the circular orbit of the same radius that runs against the hole's rotation",
                3,
            ),
            ("FREE_FALL", "Free Fall", "Falling in, from rest at infinity", 4),
            (
                CAMERA_ANIMATION,
                "Camera Animation",
                "As the camera's own animation moves it in the scene, "
                "measured at each frame against the speed of light set below",
                5,
            ),
        ),
        default="FIDO",
        update=_changed,
    )
    speed_of_light: bpy.props.FloatProperty(
        name="Speed of Light",
        description="Scene units that light covers in a second; the camera's speed is measured against it",
        default=100.0,
        min=1e-6,
        soft_min=0.1,
        soft_max=1e5,
        precision=3,
        update=_changed,
    )
    disk: bpy.props.PointerProperty(type=disk_properties.UmbraDiskProperties)


CLASSES = (UmbraHoleProperties,)


def register() -> None:
    """Attach the properties to objects."""
    bpy.types.Object.umbra = bpy.props.PointerProperty(type=UmbraHoleProperties)


def unregister() -> None:
    """Detach the properties; their values stay in the file."""
    del bpy.types.Object.umbra
