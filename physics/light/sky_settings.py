# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of how the sky looks: one row for each setting.

The options of ``python -m physics render``, the properties of `scene.umbra`, the sockets of the node groups and the
table in the manual (`docs/settings_tables.py`) are made from it.
"""

from __future__ import annotations

from . import glare
from .color import DEFAULT_TEMPERATURE
from .settings import Choice, Setting

SKY_SETTINGS: dict[str, Setting] = {
    "exposure": Setting(
        "Exposure",
        "Brightens the sky by this many stops, without changing the rendered scene",
        0.0,
        -32.0,
        32.0,
        unit="stops",
        socket="Exposure",
        option="--exposure",
    ),
    "redshift_color": Setting(
        "Redshift Color",
        "How much the frequency shift changes the color of the sky: 0 is not at all, 1 is physically accurate",
        1.0,
        0.0,
        1.0,
        subtype="FACTOR",
        socket="Redshift Color",
        option="--redshift-color",
    ),
    "redshift_brightness": Setting(
        "Redshift Brightness",
        "How much the frequency shift changes the brightness of the sky: 0 is not at all, 1 is physically accurate, "
        "(1 + z) to the power of -4",
        1.0,
        0.0,
        1.0,
        subtype="FACTOR",
        socket="Redshift Brightness",
        option="--redshift-brightness",
    ),
    "sky_temperature": Setting(
        "Sky Temperature",
        "Color temperature of light that is not colored as a black body is; the lens takes it for all light",
        DEFAULT_TEMPERATURE,
        500.0,
        1e6,
        soft_high=40_000.0,
        step=100.0,
        unit="K",
        subtype="COLOR_TEMPERATURE",
        socket="Sky Temperature",
        option="--temperature",
    ),
}
"""Name -> row; all but the exposure are also properties of `scene.umbra`."""

RENDER_ARGUMENTS = {
    "exposure": "exposure",
    "redshift_color": "color_amount",
    "redshift_brightness": "brightness_amount",
    "sky_temperature": "temperature",
}
"""Name in `SKY_SETTINGS` -> argument of `reference_render.render`."""

SKY_FILTER = Setting(
    "Filter",
    "How the sky is averaged over the part of it that each pixel sees",
    8,
    option="--filter",
    choices=(
        Choice(0, "OFF", 0, "Off", "One look at the sky per pixel: beside the shadow it flickers"),
        Choice(8, "FAST", 1, "Fast", "Eight looks per pixel, along the ellipse that it sees of the sky"),
        Choice(16, "BEST", 2, "Best", "Sixteen looks per pixel: sharper beside the shadow"),
    ),
)
"""The values are numbers of looks; see `reference.filtered_sky`."""

GLARE = Setting(
    "Glare",
    "How the lens spreads a share of the light of sky and disk around it, without adding any",
    glare.OFF,
    option="--glare",
    choices=(
        Choice(glare.OFF, "OFF", 0, "Off", "Light stays where it is"),
        Choice(glare.SUBTLE, "SUBTLE", 1, "Subtle", "A clean lens: bright stars have a faint glow"),
        Choice(glare.FILM, "FILM", 2, "Film", "An old lens: a wide glow, and spikes to four sides"),
    ),
)
"""The values are kinds of `glare.GLARES`."""
