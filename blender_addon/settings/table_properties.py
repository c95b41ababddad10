# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties made from rows of the tables `physics.MATTER_SETTINGS` and `physics.SKY_SETTINGS`."""

from collections.abc import Callable
from typing import Any

import bpy

from ..core.physics_api import physics

Update = Callable[[Any, bpy.types.Context], None]


def property_of(setting: "physics.Setting", update: Update, default: Any = None) -> Any:
    """Return the property of a row, for the annotations of a property group.

    Parameters
    ----------
    setting : physics.Setting
        The row: a number, or several choices, which become an enum.
    update : callable
        The property's update function.
    default : float, str or int, optional
        The default value; without it, that of the row.
    """
    default = setting.default if default is None else default
    if setting.choices:
        return bpy.props.EnumProperty(
            name=setting.label,
            description=setting.description,
            items=tuple((each.identifier, each.label, each.description, each.number) for each in setting.choices),
            default=setting.identifier(default),
            update=update,
            options=set(),
        )
    if isinstance(setting.default, int):
        return bpy.props.IntProperty(
            name=setting.label,
            description=setting.sentence,
            default=default,
            min=round(setting.low),
            max=round(setting.high),
            update=update,
        )
    return bpy.props.FloatProperty(
        name=setting.label,
        description=setting.sentence,
        default=default,
        min=setting.low,
        max=setting.high,
        soft_min=setting.low if setting.soft_low is None else setting.soft_low,
        soft_max=setting.high if setting.soft_high is None else setting.soft_high,
        step=round(100.0 * setting.step),  # Blender counts hundredths
        subtype=setting.subtype,
        update=update,
    )
