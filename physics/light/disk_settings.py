# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of what an artist decides about a disk's look: one row for each setting, and the presets.

Everything else is made from it: the checks here, the options of ``python -m physics render``, the properties
`object.umbra.disk`, the sockets of the node groups, and the table in the manual (`docs/settings_tables.py`). What a
setting does to the light is in `disk_look`, and in float32 in the add-on's `nodes.disk_nodes`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from ..numerics.checks import finite
from ..numerics.errors import BlackHoleError
from .settings import Choice, Setting

BOLOMETRIC, MONOCHROMATIC = 4, 3

# Temperatures between which colors are tabulated, kelvin.
COLDEST, HOTTEST = 500.0, 60_000.0


def _row(setting: Setting) -> Any:
    return field(default=setting.default, metadata={"setting": setting})


def _number(default: float, label: str, description: str, low: float, high: float, **more: Any) -> Any:
    return _row(Setting(label, description, default, low, high, **{"socket": label, **more}))


def _amount(default: float, label: str, description: str) -> Any:
    return _number(default, label, description, 0.0, 1.0, subtype="FACTOR")


def _choice(label: str, socket: str, description: str, *choices: Choice) -> Any:
    return _row(Setting(label, description, choices[0].value, socket=socket, choices=choices))


@dataclass(frozen=True)
class DiskLook:
    """How a disk looks. The rows are in the order of the node groups' sockets."""

    profile: str = _choice(
        "Profile",
        "Page-Thorne",
        "How brightness and temperature change with the radius",
        Choice(
            "novikov_thorne",
            "novikov_thorne",
            0,
            "Page-Thorne",
            "Physically accurate: dark at the innermost stable orbit, brightest outside of it",
            1.0,
        ),
        Choice(
            "power_law",
            "power_law",
            1,
            "Power Law",
            "Brightest at the inner edge, and dimmer outward by a power of the radius",
            0.0,
        ),
    )
    exponent: float = _number(3.0, "Falloff Power", "Power of the radius by which a Power Law falls", 0.0, 20.0)
    temperature: float = _number(
        6500.0,
        "Temperature",
        "Temperature where the disk is brightest: it decides the color",
        COLDEST,
        HOTTEST,
        soft_low=1500.0,
        soft_high=30_000.0,
        step=100.0,
        unit="K",
        subtype="COLOR_TEMPERATURE",
    )
    doppler_color: float = _amount(
        1.0,
        "Doppler Color",
        "How much motion and gravity change the disk's color: 0 is not at all, 1 is physically accurate",
    )
    doppler_brightness: float = _amount(
        1.0,
        "Doppler Brightness",
        "How much motion and gravity change the disk's brightness: 0 is not at all, 1 is physically accurate and makes "
        "the side that moves toward the camera far brighter",
    )
    beaming: int = _choice(
        "Light",
        "Beaming",
        "Which light the brightness counts",
        Choice(
            BOLOMETRIC,
            "BOLOMETRIC",
            0,
            "All Light",
            "The light of all wavelengths: the frequency ratio to the power of 4",
            4.0,
        ),
        Choice(
            MONOCHROMATIC,
            "MONOCHROMATIC",
            1,
            "One Color",
            "The light of a narrow band: the frequency ratio to the power of 3",
            3.0,
        ),
    )
    color_variation: float = _amount(
        1.0, "Color Variation", "How much cooler the dim parts are: at 0 the disk has one temperature"
    )
    falloff: float = _amount(
        1.0, "Falloff", "How far the brightness follows the profile: at 0 it is the same at all radii"
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
        socket="Disk Exposure",
        is_added=True,
    )
    opacity: float = _amount(0.9, "Opacity", "How much the densest parts hide what is behind them")
    streaks: float = _amount(0.7, "Streaks", "How much the streaks thin the disk out")
    clumps: float = _amount(0.4, "Clumps", "How much the clumps thin the disk out")
    inner_softness: float = _amount(0.1, "Inner Softness", "Share of the disk over which its inner edge fades in")
    outer_softness: float = _amount(0.4, "Outer Softness", "Share of the disk over which its outer edge fades out")
    gain: float = _number(
        1.5, "Contrast of Light", "How much brighter dense streaks are than thin ones", 1.0, 8.0, soft_high=3.0
    )

    def validate(self) -> None:
        """Check all settings.

        Raises
        ------
        BlackHoleError
            If one is out of its range, or not one of its choices.
        """
        for name, setting in DISK_SETTINGS.items():
            value, words = getattr(self, name), name.replace("_", " ")
            if not setting.choices:
                finite(value, f"the disk's {words}")
            problem = setting.problem(value)
            if problem is not None:
                raise BlackHoleError(f"The disk's {words} {problem}.", code="disk.setting")


DISK_SETTINGS: dict[str, Setting] = {
    each.name: dataclasses.replace(each.metadata["setting"], option=f"--disk-{each.name.replace('_', '-')}")
    for each in dataclasses.fields(DiskLook)
}
"""Field of `DiskLook`, and property of `object.umbra.disk` -> its row."""


@dataclass(frozen=True)
class Preset:
    """A look with a name."""

    number: int
    """Of the item of Blender's enum: it never changes."""
    label: str
    description: str
    look: DiskLook


PRESET_TABLE: dict[str, Preset] = {
    "gargantua": Preset(
        0,
        "Gargantua",
        "Thin, warm and even: the same brightness on both sides, as in the film",
        DiskLook(
            profile="power_law",
            exponent=1.5,
            temperature=4300.0,
            doppler_color=0.0,
            doppler_brightness=0.0,
            color_variation=0.5,
            opacity=0.95,
            streaks=0.85,
            clumps=0.3,
            inner_softness=0.05,
            outer_softness=0.5,
            gain=1.7,
            exposure=2.4,
        ),
    ),
    "physical": Preset(
        1,
        "Physical",
        "Physically accurate, with the side that moves toward the camera far brighter",
        DiskLook(exposure=2.0),
    ),
    "blue hot": Preset(
        2,
        "Blue Hot",
        "Young and hot, with a part of the Doppler effect",
        DiskLook(
            temperature=18_000.0,
            doppler_color=0.7,
            doppler_brightness=0.5,
            streaks=0.8,
            clumps=0.5,
            exposure=1.8,
        ),
    ),
    "ember": Preset(
        3,
        "Ember",
        "Cool, clumpy and red",
        DiskLook(
            profile="power_law",
            exponent=2.4,
            temperature=2400.0,
            doppler_color=0.3,
            doppler_brightness=0.4,
            streaks=0.9,
            clumps=0.8,
            opacity=0.85,
            gain=2.2,
            exposure=3.0,
        ),
    ),
}
"""Presets by name."""

PRESETS: dict[str, DiskLook] = {name: preset.look for name, preset in PRESET_TABLE.items()}
"""Looks by name."""
