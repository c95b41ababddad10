# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of what an artist decides about matter that numpy renders (`physics.matter`), and the presets.

One row for each setting: the checks here, the options of ``python -m physics bake --light``, the properties of
`object.umbra.disk` and the table in the manual (`docs/settings_tables.py`) are made from it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from ..numerics.checks import finite
from ..numerics.errors import BlackHoleError
from .settings import Choice, Setting

VISIBLE, BOLOMETRIC, MONOCHROMATIC = "visible", "bolometric", "monochromatic"

COLDEST, HOTTEST = 300.0, 100_000.0
"""Temperatures between which matter's light is tabulated, kelvin."""


def _row(setting: Setting) -> Any:
    return field(default=setting.default, metadata={"setting": setting})


def _number(default: float, label: str, description: str, low: float, high: float, **more: Any) -> Any:
    return _row(Setting(label, description, default, low, high, **more))


def _amount(default: float, label: str, description: str) -> Any:
    return _number(default, label, description, 0.0, 1.0, subtype="FACTOR")


def _count(default: int, label: str, description: str, low: int, high: int) -> Any:
    return _row(Setting(label, description, default, low, high))


def _choice(label: str, description: str, *choices: Choice) -> Any:
    return _row(Setting(label, description, choices[0].value, choices=choices))


@dataclass(frozen=True)
class MatterLook:
    """How matter looks: numbers of any type become floats, or whole numbers."""

    profile: str = _choice(
        "Profile",
        "How the temperature changes with the radius",
        Choice(
            "novikov_thorne",
            "novikov_thorne",
            0,
            "Page-Thorne",
            "Physically accurate: dark at the innermost stable orbit, hottest outside of it",
        ),
        Choice("power_law", "power_law", 1, "Power Law", "Hottest at the inner edge, cooler outward"),
    )
    exponent: float = _number(3.0, "Falloff Power", "Power of the radius by which a Power Law's flux falls", 0.0, 20.0)
    temperature: float = _number(
        6500.0,
        "Temperature",
        "Temperature where the disk is hottest: it decides the color",
        500.0,
        60_000.0,
        soft_low=1500.0,
        soft_high=30_000.0,
        step=100.0,
        unit="K",
        subtype="COLOR_TEMPERATURE",
    )
    band: str = _choice(
        "Light",
        "Which light the brightness counts",
        Choice(VISIBLE, "VISIBLE", 0, "Visible", "The light that an eye sees, as the sky's"),
        Choice(BOLOMETRIC, "BOLOMETRIC", 1, "All Light", "The light of all wavelengths"),
        Choice(MONOCHROMATIC, "MONOCHROMATIC", 2, "One Color", "The light of a narrow band"),
    )
    doppler_color: float = _amount(
        1.0, "Doppler Color", "How much motion and gravity change the color: 0 is not at all, 1 is physically accurate"
    )
    doppler_brightness: float = _amount(
        1.0,
        "Doppler Brightness",
        "How much motion and gravity change the brightness: 0 is not at all, 1 is physically accurate",
    )
    color_variation: float = _amount(
        1.0, "Color Variation", "How much redder the cool parts are: at 0 the disk has one color"
    )
    falloff: float = _amount(1.0, "Falloff", "How far the brightness follows the profile: at 0 it is even")
    limb_darkening: float = _amount(
        0.0, "Limb Darkening", "How much dimmer a surface is that is seen at a slant: 1 is that of scattering gas"
    )
    light_travel: float = _amount(
        0.0, "Light Travel", "How much later what is farther away is seen: 0 is the film's picture, 1 is physics"
    )
    exposure: float = _number(
        0.0,
        "Exposure",
        "Brightens the disk by this many stops",
        -32.0,
        32.0,
        soft_low=-8.0,
        soft_high=8.0,
        unit="stops",
        is_added=True,
    )
    depth: float = _number(
        2.0, "Optical Depth", "How opaque the disk is, seen face-on: 1 lets 37 % of the light behind it pass", 0.0, 1e4
    )
    depth_power: float = _number(
        0.0, "Depth Power", "Power of the radius by which the optical depth grows outward", -5.0, 5.0
    )
    inner_softness: float = _amount(0.06, "Inner Softness", "Share of the disk over which its inner edge fades in")
    outer_softness: float = _amount(0.6, "Outer Softness", "Share of the disk over which its outer edge fades out")
    thickness: float = _number(0.0, "Thickness", "Height of the disk over its radius: 0 is a thin sheet", 0.0, 0.5)
    flare: float = _number(0.0, "Flare", "Power of the radius by which the thickness grows outward", -1.0, 1.0)
    puff: float = _number(0.35, "Puff", "How much higher the dense parts of a thick disk are", 0.0, 1.0)
    strands: float = _number(0.12, "Strands", "How much hotter and cooler strands of gas are", 0.0, 1.0)
    smoke: float = _number(1.0, "Smoke", "How much denser and thinner clouds of gas are", 0.0, 3.0)
    large_scale: float = _amount(0.6, "Large Scale", "How much of that there is in large clouds as well")
    waves: float = _number(4.0, "Waves", "Strands around the disk: more are shorter ones", 1.0, 32.0)
    stretch: float = _number(9.0, "Stretch", "How many times longer than wide strands are", 1.0, 40.0)
    pitch: float = _number(10.0, "Pitch", "Angle of strands against circles, trailing", -60.0, 60.0, unit="degrees")
    ridges: float = _amount(0.6, "Ridges", "How much of the detail is in thin bright threads")
    warp: float = _number(0.6, "Warp", "How much strands are bent", 0.0, 3.0)
    seed: int = _count(1, "Seed", "Another number is another pattern", 0, 1_000_000)
    infall: float = _amount(
        0.0,
        "Infalling Gas",
        "How much gas shines that falls from the innermost stable orbit",
    )
    gap_radius: float = _number(10.0, "Gap Radius", "Where an empty ring is, in M", 0.0, 1e6)
    gap_width: float = _number(0.1, "Gap Width", "Width of the empty ring over its radius", 1e-3, 2.0)
    gap_depth: float = _amount(0.0, "Gap", "How empty the ring is")
    spots: int = _count(0, "Hot Spots", "Number of hot spots on orbits", 0, 8)
    spot_radius: float = _number(8.0, "Spot Radius", "Radius of the innermost hot spot's orbit, in M", 1.0, 1e6)
    spot_size: float = _number(0.08, "Spot Size", "Radius of hot spots over that of their orbits", 1e-2, 1.0)
    spot_heat: float = _number(0.5, "Spot Heat", "How much hotter hot spots are", 0.0, 3.0)

    def __post_init__(self) -> None:
        for name, setting in MATTER_SETTINGS.items():
            if not setting.choices:
                value = finite(getattr(self, name), f"the disk's {name.replace('_', ' ')}")
                is_whole = isinstance(setting.default, int) and value.is_integer()
                object.__setattr__(self, name, int(value) if is_whole else value)

    def validate(self) -> None:
        """Check all settings.

        Raises
        ------
        BlackHoleError
            If one is out of its range, or not one of its choices.
        """
        for name, setting in MATTER_SETTINGS.items():
            value, words = getattr(self, name), name.replace("_", " ")
            problem = setting.problem(value)
            if problem is None and isinstance(setting.default, int) and not isinstance(value, int):
                problem = f"is {value:g}; give a whole number"
            if problem is not None:
                raise BlackHoleError(f"The disk's {words} {problem}.", code="disk.setting")


MATTER_SETTINGS: dict[str, Setting] = {
    each.name: dataclasses.replace(each.metadata["setting"], option=f"--light-{each.name.replace('_', '-')}")
    for each in dataclasses.fields(MatterLook)
}
"""Field of `MatterLook` -> its row."""


@dataclass(frozen=True)
class MatterPreset:
    """A look with a name."""

    number: int
    """Of the item of Blender's enum: it never changes."""
    label: str
    description: str
    look: MatterLook


MATTER_PRESET_TABLE: dict[str, MatterPreset] = {
    "gargantua": MatterPreset(
        0,
        "Gargantua",
        "Warm and even: nearly the same brightness on both sides, as in the film",
        MatterLook(
            profile="power_law",
            exponent=1.5,
            temperature=4500.0,
            doppler_color=0.15,
            doppler_brightness=0.15,
            color_variation=0.75,
            falloff=0.75,
            depth=1.5,
        ),
    ),
    "physical": MatterPreset(
        1,
        "Physical",
        "Physically accurate, with the side that moves toward the camera far brighter",
        MatterLook(light_travel=1.0, strands=0.06, smoke=0.6, depth=4.0, exposure=-0.3),
    ),
    "blue hot": MatterPreset(
        2,
        "Blue Hot",
        "Young and hot, with a part of the Doppler effect",
        MatterLook(
            temperature=16_000.0,
            doppler_color=0.7,
            doppler_brightness=0.5,
            falloff=0.8,
            strands=0.18,
            smoke=1.1,
            depth=1.5,
            pitch=16.0,
            exposure=-0.9,
        ),
    ),
    "ember": MatterPreset(
        3,
        "Ember",
        "Cool, clumpy and red",
        MatterLook(
            profile="power_law",
            exponent=2.0,
            temperature=2600.0,
            doppler_color=0.25,
            doppler_brightness=0.25,
            color_variation=0.5,
            falloff=0.4,
            strands=0.07,
            smoke=1.3,
            depth=1.5,
            waves=6.0,
            stretch=5.0,
            pitch=14.0,
            warp=1.2,
        ),
    ),
    "quasar": MatterPreset(
        4,
        "Quasar",
        "Bright and dense, white at the center and amber outside",
        MatterLook(
            temperature=9000.0,
            doppler_color=0.5,
            doppler_brightness=0.6,
            falloff=0.6,
            limb_darkening=1.0,
            depth=6.0,
            depth_power=0.5,
            strands=0.08,
            smoke=0.6,
            waves=3.0,
            pitch=20.0,
            exposure=-0.3,
        ),
    ),
    "torus": MatterPreset(
        5,
        "Torus",
        "Thick, dim and dusty",
        MatterLook(
            profile="power_law",
            exponent=1.0,
            temperature=4000.0,
            doppler_color=0.6,
            doppler_brightness=0.5,
            color_variation=0.8,
            falloff=0.6,
            strands=0.1,
            smoke=1.0,
            depth=8.0,
            inner_softness=0.2,
            outer_softness=0.7,
            thickness=0.12,
            puff=0.2,
            waves=5.0,
            stretch=4.0,
            ridges=0.3,
            warp=1.0,
            exposure=-0.8,
        ),
    ),
}
"""Presets by name."""

MATTER_PRESETS: dict[str, MatterLook] = {name: preset.look for name, preset in MATTER_PRESET_TABLE.items()}
"""Looks by name."""
